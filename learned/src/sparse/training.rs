//! The training of a STAR or SUPR body (Osman 3.3, 4.5; METHOD-BODY 3): one subject after the other, round after round.
//!
//! A round: of every subject the poses of its registrations, then its template and joints, twice; the registrations un-posed into sums over frames. Then
//! correctives, then skinning weights. A subject's frames are read, used and forgotten: memory is that of one subject and of the sums. One frame of ten is
//! held out of training: by these sparsity is chosen and rounds are judged. What was found is [`kept`](crate::kept) after every subject and round.

use glam::DVec3;
use rayon::prelude::*;
use xavatar_body::BodyModel;
use xavatar_formats::{ArrayMap, Error, Result};
use xavatar_register::linear::{FramePose, PosedChain};

use super::acceleration::Acceleration;
use super::correctives::{PER_JOINT, SparseCorrectives};
use super::geodesic::distances_to_joints;
use super::heaviness::heaviest_second;
use super::moments::{Moments, SubjectFrames};
use super::selection::{Chosen, Kind, chosen};
use super::state::Alternation;
use crate::core::{
    Family, Fitted, FittedBody, Grown, Identity, IdentityMoments, Mirror, Person, PoseFit, SkinningRows, WeightMoments,
    features, joint_rows, mean_identity, shaped, shapes_of, trained_arrays, unposed, weight_rows, with_skin,
};
use crate::kept::Kept;
use crate::registrations::{Registrations, Subject};

/// Rounds at most.
const ROUNDS: usize = 12;
/// Training ends when the held-out distance falls by a smaller share.
const CONVERGED: f64 = 0.005;
/// Of so many frames of a subject one is held out.
const HELD_OUT: usize = 10;
/// How many times dearer sparse correctives are in the first round, and how much of that is left after each: none from the fifth on.
const STRICTEST: f64 = 4.0;
const EASED: f64 = 0.7;
/// Shapes that are kept.
const SHAPES: usize = 300;
/// How often poses and identity are found in turn, in the first round and in others.
const FIRST_TURNS: usize = 3;
const TURNS: usize = 2;
/// What a joint costs a metre and a frame from where the body that training began with has it, metres^2: where it is and linear correctives of it do much
/// the same, so that registrations alone say little of it.
const JOINT_PRICE: f64 = 30.0;
/// How symmetric joints are, in the head, in the body, in hands.
const SYMMETRY: [f64; 3] = [10.0, 4.0, 0.0];

/// What is trained.
#[derive(Clone, Copy, Debug)]
pub struct Training {
    /// What the body is a file of.
    pub family: Family,
    /// Its correctives.
    pub kind: Kind,
    /// Whether skinning weights are trained, too.
    pub weights: bool,
}

/// What is going on.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Of the rounds that there are at most, from 0.
    pub round: usize,
    /// All of them.
    pub rounds: usize,
    /// Subjects of the round that are done.
    pub done: usize,
    /// All of them.
    pub subjects: usize,
}

/// A subject as training sees it.
#[derive(Clone, Debug)]
pub struct TrainedSubject {
    /// The folder's name.
    pub name: String,
    /// At rest.
    pub identity: Identity,
    /// The pose of each frame.
    pub poses: Vec<FramePose>,
    /// Where the body that training began with has its joints (J).
    pub(super) believed: Vec<DVec3>,
}

/// A body that was trained.
#[derive(Clone, Debug)]
pub struct TrainedBody {
    /// Its file.
    pub arrays: ArrayMap,
    /// What it was trained on.
    pub subjects: Vec<TrainedSubject>,
    /// The mean distance of a vertex of held-out frames after each round, metres: of plain skinning first.
    pub held_out: Vec<f64>,
    /// The correctives.
    pub correctives: SparseCorrectives,
    /// The correlation of the second coefficient with volume over height cubed, of a STAR body.
    pub heaviness: Option<f64>,
    /// Whether the template is its own mirror image, so that symmetry is asked for.
    pub is_symmetric: bool,
}

/// What a round starts from.
pub(super) struct State {
    pub model: BodyModel,
    pub correctives: SparseCorrectives,
    pub subjects: Vec<TrainedSubject>,
}

/// What all frames of a round say.
struct Sums<'a> {
    trained: Moments,
    held: Moments,
    weights: WeightMoments<'a>,
    /// Sum of distances, and how many.
    distance: (f64, usize),
}

impl Training {
    /// Trains a body that begins as `start` on registrations in its topology; none if that was stopped, and what is kept is gone on with.
    ///
    /// # Errors
    /// [`Error::Value`] if the family is not for the body's joints; those of reading registrations and what is kept; what `progress` returns.
    pub fn train(
        self,
        start: &BodyModel,
        registrations: &Registrations,
        kept: &mut Kept<'_>,
        mut progress: impl FnMut(Progress) -> Result<()>,
    ) -> Result<Option<TrainedBody>> {
        self.check(start)?;
        let (rest, parents) = (Identity::of(start), start.skeleton().parents.clone());
        let mirror = Mirror::of(&rest.template, &rest.joints);
        let symmetry: Vec<f64> = start.skeleton().joints.iter().map(|name| SYMMETRY[region(name)]).collect();
        let mirrored = mirror.as_ref().map(|mirror| (mirror, symmetry.as_slice()));
        let first_weights = weight_rows(start);
        let grown = Grown::of(&first_weights, start.faces());
        let subjects = registrations.subjects.len();
        let mut alternation = Alternation::begun(start, subjects, kept)?;
        while alternation.round < ROUNDS {
            let round = alternation.round;
            let width = PER_JOINT * (parents.len() - 1);
            let mut sums = Sums {
                trained: Moments::new(width, start.vertex_count()),
                held: Moments::new(width, start.vertex_count()),
                weights: WeightMoments::new(&grown),
                distance: (0.0, 0),
            };
            let rows = SkinningRows::new(&weight_rows(&alternation.state.model), &parents);
            for (done, subject) in registrations.subjects.iter().enumerate() {
                if kept.is_stopped() {
                    return Ok(None);
                }
                progress(Progress { round, rounds: ROUNDS, done, subjects })?;
                let frames = registrations.read_all(subject)?;
                let state = &mut alternation.state;
                let person = if alternation.fitted.get(done) == Some(&round) {
                    Person::new(&state.model, state.subjects[done].identity.clone())?
                } else {
                    let before = state.subjects.get(done).cloned();
                    let (fitted, person) = state.fitted(subject, &frames, before, &rows, mirrored)?;
                    if done < state.subjects.len() {
                        state.subjects[done] = fitted
                    } else {
                        state.subjects.push(fitted)
                    }
                    alternation.keep_subject(done, kept)?;
                    person
                };
                alternation.state.add(&person, &alternation.state.subjects[done].poses, &frames, &mut sums);
            }
            let Alternation { state, held_out, acceleration, .. } = &mut alternation;
            let distance = sums.distance.0 / sums.distance.1.max(1) as f64;
            let settled = held_out.last().is_some_and(|before: &f64| distance > before * (1.0 - CONVERGED));
            held_out.push(distance);
            if settled && round > 1 && self.strictness(round - 1) == 1.0 {
                break;
            }
            let weights = weight_rows(&state.model);
            let distances = distances_to_joints(
                &mean_identity(state.subjects.iter().map(|subject| &subject.identity)),
                &weights,
                &parents,
                start.faces(),
            );
            let Chosen { correctives, .. } =
                chosen(self.kind, &sums.trained, &sums.held, &distances, self.strictness(round));
            let weights = if self.weights && round > 0 { sums.weights.solve() } else { weights };
            let from = std::mem::take(&mut state.correctives);
            if self.strictness(round) > 1.0 {
                *acceleration = Acceleration::default();
            }
            state.correctives = acceleration.next(from, correctives);
            state.model = with_skin(&state.model, &weights, state.correctives.to_body(parents.len()))?;
            alternation.round += 1;
            alternation.keep(kept)?;
        }
        let Alternation { mut state, acceleration, held_out, .. } = alternation;
        if let Some((_, found)) = acceleration.rounds.last() {
            state.model = with_skin(&state.model, &weight_rows(&state.model), found.to_body(parents.len()))?;
            state.correctives = found.clone();
        }
        self.finished(state, held_out, mirror.is_some()).map(Some)
    }

    /// What prices and thresholds are multiplied by in a round. The first poses are of a body without correctives and have taken up what correctives should;
    /// few blocks, those that matter most, bring them back before others are let in to explain what is left.
    fn strictness(self, round: usize) -> f64 {
        match self.kind {
            Kind::Sparse => (STRICTEST * EASED.powi(round as i32)).max(1.0),
            Kind::Plain | Kind::Dense => 1.0,
        }
    }

    fn check(self, start: &BodyModel) -> Result<()> {
        let smpl = xavatar_body::smpl::skeleton();
        if self.family == Family::Star
            && (start.skeleton().joints != smpl.joints || start.skeleton().parents != smpl.parents)
        {
            return Err(Error::Value {
                name: "a STAR body".into(),
                found: start.skeleton().description(),
                expected: smpl.description(),
            });
        }
        Ok(())
    }

    fn finished(self, state: State, held_out: Vec<f64>, is_symmetric: bool) -> Result<TrainedBody> {
        let identities: Vec<Identity> = state.subjects.iter().map(|subject| subject.identity.clone()).collect();
        let mut shapes = shapes_of(&identities, SHAPES);
        let heaviness = match self.family {
            Family::Supr => None,
            Family::Star => heaviest_second(&mut shapes, &identities, state.model.faces()),
        };
        let rows = joint_rows(&identities, &shapes);
        Ok(TrainedBody {
            arrays: trained_arrays(&state.model, &shapes, &rows, self.family)?,
            subjects: state.subjects,
            held_out,
            correctives: state.correctives,
            heaviness,
            is_symmetric,
        })
    }
}

impl State {
    /// The body as it begins: without correctives, which are another's.
    pub fn new(start: &BodyModel) -> Result<Self> {
        let correctives = SparseCorrectives::none(start.vertex_count());
        let model = with_skin(start, &weight_rows(start), correctives.to_body(start.skeleton().joints.len()))?;
        Ok(Self { model, correctives, subjects: Vec::new() })
    }

    /// A subject's poses and identity, and its body.
    fn fitted(
        &self,
        subject: &Subject,
        frames: &[Vec<DVec3>],
        before: Option<TrainedSubject>,
        rows: &SkinningRows,
        mirror: Option<(&Mirror, &[f64])>,
    ) -> Result<(TrainedSubject, Person)> {
        let turns = if before.is_some() { TURNS } else { FIRST_TURNS };
        let mut known = match before {
            Some(before) => before,
            None => self.first(subject, frames)?,
        };
        let mut person = Person::new(&self.model, known.identity.clone())?;
        known.poses = poses(&person, frames, Some(&known.poses));
        for _ in 0..turns {
            let mut moments = IdentityMoments::new(rows);
            for (_, (pose, frame)) in known.poses.iter().zip(frames).enumerate().filter(|(frame, _)| !is_held(*frame)) {
                let (posed, chain) = person.body.posed(pose, &[]);
                moments.add(&chain.turns, &rows.targets(&known.identity, &posed.positions, &chain.turns, frame));
            }
            let start = Identity { joints: known.believed.clone(), ..known.identity };
            known.identity = moments.solve(&start, mirror, JOINT_PRICE * frames.len() as f64);
            person = Person::new(&self.model, known.identity.clone())?;
            known.poses = poses(&person, frames, Some(&known.poses));
        }
        Ok((known, person))
    }

    /// A subject as the body's own shapes have it, each frame for itself, and their mean.
    fn first(&self, subject: &Subject, frames: &[Vec<DVec3>]) -> Result<TrainedSubject> {
        let body = FittedBody::of(&self.model);
        let fit = PoseFit { shape: true, expression: has_expressions(&self.model) };
        let found: Vec<Fitted> = frames.par_iter().map(|frame| fit.nearest(&body, frame, None)).collect();
        let mut shape = vec![0.0; body.linkage.extents().shapes];
        for fitted in &found {
            shape.iter_mut().zip(&fitted.shape).for_each(|(sum, value)| *sum += value / found.len() as f64);
        }
        let identity = shaped(&self.model, &shape);
        Ok(TrainedSubject {
            name: subject.name.clone(),
            believed: identity.joints.clone(),
            identity,
            poses: found.into_iter().map(|fitted| fitted.pose).collect(),
        })
    }

    /// Adds what a subject's frames say to the sums.
    fn add(&self, person: &Person, poses: &[FramePose], frames: &[Vec<DVec3>], sums: &mut Sums<'_>) {
        let of_frame = |(pose, frame): (&FramePose, &Vec<DVec3>)| {
            let (posed, chain) = person.body.posed(pose, &[]);
            let features = features(pose);
            let corrections = self.correctives.offsets(&features);
            let residuals = unposed(&posed.positions, &posed.turns, frame, &corrections);
            let distance: f64 = posed.positions.iter().zip(frame).map(|(found, target)| found.distance(*target)).sum();
            (features, residuals, corrections, chain, distance)
        };
        let found: Vec<_> = poses.par_iter().zip(frames).map(of_frame).collect();
        let part = |held: bool| -> (Vec<Vec<f64>>, Vec<Vec<DVec3>>) {
            let wanted = found.iter().enumerate().filter(|(frame, _)| is_held(*frame) == held);
            wanted.map(|(_, (features, residuals, ..))| (features.clone(), residuals.clone())).unzip()
        };
        let (trained, held) = (part(false), part(true));
        let own = SubjectFrames { features: &trained.0, residuals: &trained.1 };
        if let Some(means) = own.means() {
            sums.trained.add(&own, &means);
            sums.held.add(&SubjectFrames { features: &held.0, residuals: &held.1 }, &means);
        }
        for (number, ((_, _, corrections, chain, distance), frame)) in found.iter().zip(frames).enumerate() {
            if is_held(number) || frames.len() < HELD_OUT {
                sums.distance.0 += distance;
                sums.distance.1 += frame.len();
            }
            if !is_held(number) {
                let moved = |vertex: usize, joint: usize| {
                    let rest = person.identity.template[vertex] + corrections[vertex];
                    moved_by(chain, &person.identity.joints, joint, rest)
                };
                sums.weights.add(frame, moved);
            }
        }
    }
}

/// Whether a frame is held out of training.
fn is_held(frame: usize) -> bool {
    frame % HELD_OUT == HELD_OUT - 1
}

/// Where a point at rest is when it follows a joint alone.
fn moved_by(chain: &PosedChain, rest: &[DVec3], joint: usize, point: DVec3) -> DVec3 {
    chain.turns[joint] * (point - rest[joint]) + chain.joint(joint)
}

/// The poses of registrations, each from what it was before.
fn poses(person: &Person, frames: &[Vec<DVec3>], before: Option<&[FramePose]>) -> Vec<FramePose> {
    let extents = person.body.linkage.extents();
    let fit = PoseFit { shape: false, expression: extents.expressions > 0 };
    let of_frame = |(index, frame): (usize, &Vec<DVec3>)| {
        let start = before.map(|poses| Fitted { pose: poses[index].clone(), shape: Vec::new() });
        fit.nearest(&person.body, frame, start).pose
    };
    frames.par_iter().enumerate().map(of_frame).collect()
}

fn has_expressions(model: &BodyModel) -> bool {
    model.expression_coefficients() > 0
}

/// Head, body or hands: the places of [`SYMMETRY`].
fn region(joint: &str) -> usize {
    let is = |words: &[&str]| words.iter().any(|word| joint.contains(word));
    if is(&["head", "jaw", "eye", "neck"]) {
        0
    } else if is(&["index", "middle", "pinky", "ring", "thumb"]) {
        2
    } else {
        1
    }
}
