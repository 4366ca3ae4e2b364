//! How well a body fits registrations that it was not trained on (METHOD-BODY section 7): the mean distance of a vertex after fitting.
//!
//! *Shapes*: every frame's pose and first k coefficients, for some k. *Poses*: the shape of a subject's first frame, frozen, and the pose of the
//! others. *Space*: compactness, generalisation, specificity of the shapes. *Pruning*: what correctives are worth that few vertices need. Expressions are fitted where the body has any. AUC is the area under the share of vertices nearer than d, d from 0 to 10 mm. Metres, but what
//! is named in millimetres.

mod pruning;
mod space;

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;
use xavatar_body::{Anatomy, BlendShapes, BodyModel, Correctives, JointBasis};
use xavatar_formats::Result;

use self::pruning::Pruning;
use self::space::{Space, at_rest};
use crate::core::{Fitted, FittedBody, PoseFit, shaped};
use crate::feet::{Feet, Stance, is_in_contact};
use crate::registrations::Registrations;
use crate::sparse::SparseCorrectives;
use crate::truth::KnownTruth;

pub use self::pruning::AtLevel;

/// Where the area under the curve ends, metres.
const AREA: f64 = 0.01;
/// Steps of that area.
const STEPS: usize = 100;

/// What was measured.
#[derive(Clone, Debug, Serialize)]
pub struct Evaluation {
    /// Registrations, and whose.
    pub frames: usize,
    /// People.
    pub subjects: usize,
    /// By number of coefficients.
    pub shapes: Vec<AtCoefficients>,
    /// Poses in a shape that was frozen, where a subject has more than one frame, millimetres.
    pub poses_mm: Option<f64>,
    /// With all coefficients, by subject.
    pub by_subject: Vec<OfSubject>,
    /// What pruning costs, of a body whose correctives are of joints but the root, by quaternions.
    pub pruning: Vec<AtLevel>,
    /// Of feet on the ground, of a body that knows what the ground does to them.
    pub feet: Option<OfFeet>,
    /// Where the truth is known.
    pub truth: Option<BesideTruth>,
}

/// Feet on the ground, with all coefficients.
#[derive(Clone, Debug, Serialize)]
pub struct OfFeet {
    /// Vertices that touch the ground.
    pub in_contact: Pressed,
    /// Other vertices of feet.
    pub others: Pressed,
}

/// What pressing feet is worth.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Pressed {
    /// Vertices in all frames.
    pub vertices: usize,
    /// Their mean distance from the body that knows of no ground, millimetres.
    pub without_mm: f64,
    /// From the body whose feet the ground presses, in the same poses.
    pub with_mm: f64,
}

/// A body's feet, and the height of the ground if it is known.
#[derive(Clone, Copy, Debug)]
pub struct OnGround<'a> {
    /// The feet.
    pub feet: &'a Feet,
    /// Metres; without it each frame's own, where its feet are flat.
    pub ground: Option<f64>,
}

/// Beside what is known of a made-up population.
#[derive(Clone, Debug, Serialize)]
pub struct BesideTruth {
    /// Of the joints but the root, posed, with all coefficients, millimetres; none if no subject's truth is known.
    pub joints_mm: Option<f64>,
    /// How well the corrective blocks are the planted ones, 0 to 1; none of a body that has no such blocks.
    pub support_f1: Option<f64>,
}

/// With some of the coefficients.
#[derive(Clone, Debug, Serialize)]
pub struct AtCoefficients {
    /// k.
    pub coefficients: usize,
    /// The mean distance of a vertex, millimetres.
    pub mean_mm: f64,
    /// The area under the cumulative curve, 0 to 1.
    pub auc: f64,
    /// The share of the variance of the body's shapes; none without shapes.
    pub compactness: Option<f64>,
    /// How far people at rest are from what these coefficients make of them, the mean distance of a vertex, millimetres.
    pub generalisation_mm: Option<f64>,
    /// How far people drawn from these coefficients are from the nearest of them, millimetres.
    pub specificity_mm: Option<f64>,
}

/// Of one subject.
#[derive(Clone, Debug, Serialize)]
pub struct OfSubject {
    /// The folder's name.
    pub name: String,
    /// The mean distance of a vertex, millimetres.
    pub mean_mm: f64,
}

/// The distances of a frame's vertices.
#[derive(Clone, Debug)]
struct Distances {
    mean: f64,
    area: f64,
}

/// Measures a body, and its feet if it has any. Of `counts` those that the body has are tried, and all that it has. Of a made-up population `truth` is compared with. `progress` is told the
/// share that is done.
///
/// # Errors
/// Those of reading registrations; what `progress` returns.
pub fn evaluate(
    model: &BodyModel,
    registrations: &Registrations,
    counts: &[usize],
    on_ground: Option<OnGround<'_>>,
    truth: Option<&KnownTruth>,
    mut progress: impl FnMut(f64) -> Result<()>,
) -> Result<Evaluation> {
    let all = model.shape_coefficients();
    // STAR's second coefficient drives a corrective: it is not left out.
    let fewest = match model.correctives() {
        Correctives::Quaternions { coefficient: Some(index), .. } => index + 1,
        _ => 0,
    };
    let is_possible = |count: &usize| (fewest..all).contains(count);
    let mut counts: Vec<usize> = counts.iter().copied().filter(is_possible).chain([all]).collect();
    counts.sort_unstable();
    counts.dedup();
    let bodies: Vec<FittedBody> =
        counts.iter().map(|count| Ok(FittedBody::of(&with_first(model, *count)?))).collect::<Result<_>>()?;
    let expression = model.expression_coefficients() > 0;
    let fit = PoseFit { shape: true, expression };
    let mut of_counts: Vec<Vec<Distances>> = vec![Vec::new(); counts.len()];
    let (mut poses, mut by_subject, mut joints) = (Vec::new(), Vec::new(), Vec::new());
    let mut pruning = SparseCorrectives::of_body(model.correctives(), model.vertex_count())
        .filter(|correctives| correctives.blocks() > 0)
        .map(|correctives| Pruning::of(&correctives));
    let mut people = Vec::new();
    let mut of_feet = [Pressed::default(), Pressed::default()];
    for (done, subject) in registrations.subjects.iter().enumerate() {
        progress(done as f64 / registrations.subjects.len() as f64)?;
        let frames = registrations.read_all(subject)?;
        let mut found: Vec<Fitted> = Vec::new();
        for (body, distances) in bodies.iter().zip(&mut of_counts) {
            let start = |frame: usize| found.get(frame).map(|fitted: &Fitted| fitted.with_shapes(body));
            found = (0..frames.len())
                .into_par_iter()
                .map(|frame| fit.nearest(body, &frames[frame], start(frame)))
                .collect();
            distances.extend(
                frames.par_iter().zip(&found).map(|(frame, found)| of_frame(body, found, frame)).collect::<Vec<_>>(),
            );
        }
        let Some(body) = bodies.last() else { continue };
        people.push(at_rest(model, body, &frames, &found));
        if let Some(pruning) = &mut pruning {
            found.iter().for_each(|found| pruning.add(&found.pose));
        }
        if let Some(known) = truth.and_then(|truth| truth.joints.get(&subject.name)) {
            joints.extend(found.iter().zip(known).map(|(found, known)| joint_distance(body, found, known)));
        }
        if let Some(on_ground) = on_ground {
            let both =
                found.par_iter().zip(&frames).map(|(found, frame)| on_ground.measured(model, body, found, frame));
            for found in both.collect::<Result<Vec<[Pressed; 2]>>>()? {
                of_feet.iter_mut().zip(found).for_each(|(sum, found)| sum.add(&found));
            }
        }
        if let Some(last) = of_counts.last() {
            let own = &last[last.len() - frames.len()..];
            by_subject.push(OfSubject { name: subject.name.clone(), mean_mm: 1e3 * mean(own, |of| of.mean) });
        }
        let frozen = |frame: usize| {
            let start = Fitted { pose: found[frame].pose.clone(), shape: found[0].shape.clone() };
            let fitted = PoseFit { shape: false, expression }.nearest(body, &frames[frame], Some(start));
            of_frame(body, &fitted, &frames[frame])
        };
        poses.extend((1..frames.len()).into_par_iter().map(frozen).collect::<Vec<_>>());
    }
    let space = Space::of(model, &people);
    let at = |(coefficients, distances): (&usize, &Vec<Distances>)| {
        let of_space = space.measures(*coefficients);
        AtCoefficients {
            coefficients: *coefficients,
            mean_mm: 1e3 * mean(distances, |of| of.mean),
            auc: mean(distances, |of| of.area),
            compactness: of_space.as_ref().map(|of| of.compactness),
            generalisation_mm: of_space.as_ref().map(|of| 1e3 * of.generalisation),
            specificity_mm: of_space.as_ref().map(|of| 1e3 * of.specificity),
        }
    };
    Ok(Evaluation {
        frames: registrations.frames(),
        subjects: registrations.subjects.len(),
        shapes: counts.iter().zip(&of_counts).map(at).collect(),
        poses_mm: (!poses.is_empty()).then(|| 1e3 * mean(&poses, |of| of.mean)),
        by_subject,
        pruning: pruning.map_or_else(Vec::new, |pruning| pruning.levels()),
        feet: on_ground.map(|_| {
            let [in_contact, others] = of_feet.map(Pressed::mean);
            OfFeet { in_contact, others }
        }),
        truth: truth.map(|truth| BesideTruth {
            joints_mm: (!joints.is_empty()).then(|| 1e3 * joints.iter().sum::<f64>() / joints.len() as f64),
            support_f1: support_f1(model, &truth.model),
        }),
    })
}

impl OnGround<'_> {
    /// Sums of distances of a frame's feet, of what touches the ground in the registration and of the rest.
    fn measured(self, model: &BodyModel, body: &FittedBody, found: &Fitted, frame: &[DVec3]) -> Result<[Pressed; 2]> {
        let (posed, chain) = body.posed(&found.pose, &found.shape);
        let ground = self.feet.ground(frame, self.ground);
        let rest = shaped(model, &found.shape).template;
        let stance = Stance {
            rest: &rest,
            rotations: &found.pose.rotations,
            turns: &chain.turns,
            positions: &posed.positions,
            vertex_turns: &posed.turns,
        };
        let pressed = self.feet.pressed(stance, ground)?;
        let mut sums = [Pressed::default(), Pressed::default()];
        for vertex in self.feet.vertices() {
            let own = Pressed {
                vertices: 1,
                without_mm: 1e3 * posed.positions[vertex].distance(frame[vertex]),
                with_mm: 1e3 * pressed[vertex].distance(frame[vertex]),
            };
            sums[usize::from(!is_in_contact(frame[vertex], ground))].add(&own);
        }
        Ok(sums)
    }
}

impl Pressed {
    fn add(&mut self, other: &Self) {
        self.vertices += other.vertices;
        self.without_mm += other.without_mm;
        self.with_mm += other.with_mm;
    }

    /// Of sums.
    fn mean(self) -> Self {
        let count = self.vertices.max(1) as f64;
        Self { without_mm: self.without_mm / count, with_mm: self.with_mm / count, ..self }
    }
}

/// The mean distance of a frame's joints but the root from where they are known to be.
fn joint_distance(body: &FittedBody, found: &Fitted, known: &[DVec3]) -> f64 {
    let chain = body.linkage.posed(&found.pose, &found.shape);
    let distances = known.iter().enumerate().skip(1).map(|(joint, known)| chain.joint(joint).distance(*known));
    distances.sum::<f64>() / known.len().saturating_sub(1).max(1) as f64
}

fn support_f1(model: &BodyModel, truth: &BodyModel) -> Option<f64> {
    let own = SparseCorrectives::of_body(model.correctives(), model.vertex_count())?;
    Some(own.support_f1(&SparseCorrectives::of_body(truth.correctives(), truth.vertex_count())?))
}

impl Fitted {
    /// The same for a body with other coefficients: those that are missing are zero.
    fn with_shapes(&self, body: &FittedBody) -> Self {
        let mut shape = self.shape.clone();
        shape.resize(body.linkage.extents().shapes, 0.0);
        Self { pose: self.pose.clone(), shape }
    }
}

/// A body with its first coefficients of shape alone.
fn with_first(model: &BodyModel, count: usize) -> Result<BodyModel> {
    let anatomy = model.anatomy();
    let all = anatomy.shape_coefficients();
    let is_kept = |(place, _): &(usize, _)| *place < count || *place >= all;
    let shapes = anatomy.shapes.directions().enumerate().filter(|(place, _)| *place < count || *place >= all);
    let directions = anatomy.joints.directions.iter().enumerate().filter(is_kept);
    let kept = Anatomy {
        shapes: BlendShapes::from_directions(shapes.map(|(_, row)| row.to_vec()).collect()),
        joints: JointBasis {
            template: anatomy.joints.template.clone(),
            directions: directions.map(|(_, row)| row.clone()).collect(),
        },
        ..anatomy.clone()
    };
    BodyModel::assemble(model.path(), kept)
}

fn of_frame(body: &FittedBody, found: &Fitted, frame: &[DVec3]) -> Distances {
    let (posed, _) = body.posed(&found.pose, &found.shape);
    let distances: Vec<f64> = posed.positions.iter().zip(frame).map(|(own, target)| own.distance(*target)).collect();
    let count = distances.len() as f64;
    // The mean over d of the share of vertices that are nearer.
    let nearer = |step: usize| {
        let limit = AREA * (step as f64 + 0.5) / STEPS as f64;
        distances.iter().filter(|distance| **distance < limit).count() as f64 / count
    };
    Distances { mean: distances.iter().sum::<f64>() / count, area: (0..STEPS).map(nearer).sum::<f64>() / STEPS as f64 }
}

fn mean(distances: &[Distances], of: impl Fn(&Distances) -> f64) -> f64 {
    distances.iter().map(of).sum::<f64>() / distances.len().max(1) as f64
}
