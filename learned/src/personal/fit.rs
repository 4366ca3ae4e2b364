//! From registrations to a personal body (METHOD-BODY 6): poses, template and joints, then the posterior of the correctives.

use glam::{DMat3, DVec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use xavatar_body::{Anatomy, BlendShapes, BodyModel, Correctives};
use xavatar_formats::{ArrayMap, Error, Result};
use xavatar_register::linear::FramePose;

use super::file::in_layout_of;
use super::{Posterior, Scales, Support};
use crate::core::{
    Fitted, FittedBody, Identity, IdentityMoments, Mirror, Person, PoseFit, SkinningRows, features, shaped, undriven,
    unposed, weight_rows, with_identity,
};
use crate::registrations::Registrations;

/// How often poses and identity are found in turn.
const TURNS: usize = 3;
/// What a joint costs a metre from where the body's shapes have it, metres^2.
const JOINT_PRICE: f64 = 1.0;
/// How symmetric joints are.
const SYMMETRY: f64 = 4.0;

/// A body of one person.
#[derive(Clone, Debug)]
pub struct Personal {
    /// The body, with the shapes of the one that it was made from: zero is the person.
    pub model: BodyModel,
    /// At rest.
    pub identity: Identity,
    /// The pose of each registration.
    pub poses: Vec<FramePose>,
    /// The scales that were found.
    pub scales: Scales,
    /// The mean distance of a vertex of the registrations, metres: with the body's own shapes, with a personal template, with personal correctives.
    pub distances: [f64; 3],
    /// What is believed of the correctives.
    beliefs: Beliefs,
}

/// The posterior's ingredients: enough to say how sure any pose is.
#[derive(Clone, Debug)]
struct Beliefs {
    support: Support,
    /// Of the registrations (n, F).
    seen: Vec<Vec<f64>>,
    vertices: usize,
}

/// A body like `model` of the person of these registrations, all of one subject.
///
/// # Errors
/// [`Error::Value`] if they are several people's; those of reading registrations.
pub fn personal(model: &BodyModel, registrations: &Registrations) -> Result<Personal> {
    let paths: Vec<_> = registrations.subjects.iter().flat_map(|subject| &subject.frames).collect();
    let frames: Vec<Vec<DVec3>> = paths.par_iter().map(|path| registrations.read(path)).collect::<Result<_>>()?;
    if frames.is_empty() {
        let expected = "at least one".into();
        return Err(Error::Value { name: "a person's registrations".into(), found: "none".into(), expected });
    }
    let expression = model.expression_coefficients() > 0;
    let generic = FittedBody::of(model);
    let fitted: Vec<Fitted> =
        frames.par_iter().map(|frame| PoseFit { shape: true, expression }.nearest(&generic, frame, None)).collect();
    let mut shape = vec![0.0; model.shape_coefficients()];
    for of_frame in &fitted {
        shape.iter_mut().zip(&of_frame.shape).for_each(|(sum, value)| *sum += value / frames.len() as f64);
    }
    let mut identity = shaped(model, &shape);
    let believed = identity.joints.clone();
    let rest = Identity::of(model);
    let mirror = Mirror::of(&rest.template, &rest.joints);
    let symmetry = vec![SYMMETRY; rest.joints.len()];
    let rows = SkinningRows::new(&weight_rows(model), &model.skeleton().parents);
    let mut poses: Vec<FramePose> = fitted.into_iter().map(|of_frame| of_frame.pose).collect();
    let mut distances = [0.0; 3];
    let mut person = Person::new(model, identity.clone())?;
    for turn in 0..=TURNS {
        poses = posed_again(&person.body, &frames, &poses, expression);
        match turn {
            0 => distances[0] = distance(&person.body, &frames, &poses),
            TURNS => break,
            _ => {}
        }
        let mut moments = IdentityMoments::new(&rows);
        for (frame, pose) in frames.iter().zip(&poses) {
            let (posed, chain) = person.body.posed(pose, &[]);
            moments.add(&chain.turns, &rows.targets(&identity, &posed.positions, &chain.turns, frame));
        }
        let start = Identity { joints: believed.clone(), ..identity };
        identity = moments.solve(&start, mirror.as_ref().map(|mirror| (mirror, symmetry.as_slice())), JOINT_PRICE);
        person = Person::new(model, identity.clone())?;
    }
    distances[1] = distance(&person.body, &frames, &poses);
    let support = Support::of(model);
    let seen: Vec<Vec<f64>> = poses.iter().map(|pose| features_of(pose, support.per_joint)).collect();
    // What is seen beyond the body's own correctives.
    let residual = |(frame, pose): (&Vec<DVec3>, &FramePose)| -> Vec<f64> {
        let (posed, _) = person.body.posed(pose, &[]);
        let own = vec![DVec3::ZERO; frame.len()];
        unposed(&posed.positions, &posed.turns, frame, &own).iter().flat_map(|offset| offset.to_array()).collect()
    };
    let residuals: Vec<Vec<f64>> = frames.par_iter().zip(&poses).map(residual).collect();
    let scales = Scales::most_probable(&support, &seen, &residuals);
    let correctives = moved(model, &support, scales, &seen, &residuals);
    let with = BodyModel::assemble(
        model.path(),
        Anatomy { correctives: undriven(&correctives), ..with_identity(model, &identity)?.anatomy().clone() },
    )?;
    distances[2] = distance(&FittedBody::of(&with), &frames, &poses);
    let beliefs = Beliefs { support, seen, vertices: model.vertex_count() };
    Ok(Personal { model: recentred(model, &with, correctives)?, identity, poses, scales, distances, beliefs })
}

impl Personal {
    /// The arrays of its file: in the layout of `file`, that of the body that it was made from, if it can be, else in the one that holds any body.
    pub fn arrays(&self, file: &ArrayMap) -> ArrayMap {
        in_layout_of(file, &self.model).unwrap_or_else(|| self.model.to_arrays())
    }

    /// The standard deviation of each vertex (V) in a pose that was not seen, along any axis, metres; the noise of a registration in it.
    pub fn deviations(&self, pose: &FramePose) -> Vec<f64> {
        let Beliefs { support, seen, vertices } = &self.beliefs;
        let all = features_of(pose, support.per_joint);
        let mut deviations = vec![self.scales.noise; *vertices];
        for (joints, of_pattern) in &support.patterns {
            let mut posterior = prior(support, joints, self.scales, 0);
            for x in seen {
                let x = DVector::from_vec(support.features(joints, x));
                posterior.observe(&x, &DVector::zeros(0));
            }
            let deviation = posterior.variance(&DVector::from_vec(support.features(joints, &all))).sqrt();
            of_pattern.iter().for_each(|vertex| deviations[*vertex] = deviation);
        }
        deviations
    }
}

/// Nothing seen: zero beyond the body's own, by these scales.
fn prior(support: &Support, joints: &[usize], scales: Scales, outputs: usize) -> Posterior {
    let count = support.per_joint * joints.len();
    Posterior {
        mean: DMatrix::zeros(count, outputs),
        covariance: DMatrix::identity(count, count) * scales.variance(support.per_joint),
        noise: scales.noise.powi(2),
    }
}

/// The body's correctives, moved by what was seen.
fn moved(
    model: &BodyModel,
    support: &Support,
    scales: Scales,
    seen: &[Vec<f64>],
    residuals: &[Vec<f64>],
) -> Correctives {
    let joints = model.skeleton().joints.len();
    let (width, numbers) = (support.per_joint * (joints - 1), 3 * model.vertex_count());
    let of_pattern = |(own, vertices): &(Vec<usize>, Vec<usize>)| {
        let outputs: Vec<usize> = vertices.iter().flat_map(|vertex| 3 * vertex..3 * vertex + 3).collect();
        let mut posterior = prior(support, own, scales, outputs.len());
        for (x, y) in seen.iter().zip(residuals) {
            let y = DVector::from_iterator(outputs.len(), outputs.iter().map(|output| y[*output]));
            posterior.observe(&DVector::from_vec(support.features(own, x)), &y);
        }
        (own.clone(), outputs, posterior.mean)
    };
    let found: Vec<_> = support.patterns.par_iter().map(of_pattern).collect();
    let skipped = match model.correctives() {
        Correctives::Quaternions { first_joint: 0, .. } => support.per_joint,
        _ => 0,
    };
    let mut directions: Vec<Vec<f32>> = match model.correctives() {
        Correctives::None => vec![Vec::new(); width],
        Correctives::RotationEntries(shapes) | Correctives::Quaternions { shapes, .. } => {
            shapes.directions().map(<[f32]>::to_vec).collect()
        }
    };
    for (own, outputs, mean) in found {
        for (place, group) in own.iter().enumerate() {
            for feature in 0..support.per_joint {
                let row = &mut directions[skipped + support.per_joint * group + feature];
                row.resize(numbers, 0.0);
                for (at, output) in outputs.iter().enumerate() {
                    row[*output] += mean[(support.per_joint * place + feature, at)] as f32;
                }
            }
        }
    }
    let shapes = BlendShapes::from_directions(directions);
    match model.correctives() {
        Correctives::Quaternions { first_joint, coefficient, .. } => {
            Correctives::Quaternions { first_joint: *first_joint, coefficient: *coefficient, shapes }
        }
        Correctives::None | Correctives::RotationEntries(_) => Correctives::RotationEntries(shapes),
    }
}

/// The personal body with the shapes of the body that it was made from: zero is the person.
fn recentred(model: &BodyModel, personal: &BodyModel, correctives: Correctives) -> Result<BodyModel> {
    let (own, anatomy) = (personal.anatomy(), model.anatomy());
    let joints = xavatar_body::JointBasis { template: own.joints.template.clone(), ..anatomy.joints.clone() };
    BodyModel::assemble(model.path(), Anatomy { shapes: anatomy.shapes.clone(), joints, correctives, ..own.clone() })
}

/// Features as the body's correctives have them: of rotations' entries, row by row, or of quaternions.
fn features_of(pose: &FramePose, per_joint: usize) -> Vec<f64> {
    if per_joint == 4 {
        return features(pose);
    }
    pose.rotations[1..].iter().flat_map(|rotation| (*rotation - DMat3::IDENTITY).transpose().to_cols_array()).collect()
}

fn posed_again(body: &FittedBody, frames: &[Vec<DVec3>], poses: &[FramePose], expression: bool) -> Vec<FramePose> {
    let fit = PoseFit { shape: false, expression };
    let again = |(frame, pose): (&Vec<DVec3>, &FramePose)| {
        fit.nearest(body, frame, Some(Fitted { pose: pose.clone(), shape: Vec::new() })).pose
    };
    frames.par_iter().zip(poses).map(again).collect()
}

/// The mean distance of a vertex.
fn distance(body: &FittedBody, frames: &[Vec<DVec3>], poses: &[FramePose]) -> f64 {
    let of_frame = |(frame, pose): (&Vec<DVec3>, &FramePose)| {
        let (posed, _) = body.posed(pose, &[]);
        posed.positions.iter().zip(frame).map(|(own, target)| own.distance(*target)).sum::<f64>() / frame.len() as f64
    };
    let distances: Vec<f64> = frames.par_iter().zip(poses).map(of_frame).collect();
    distances.iter().sum::<f64>() / frames.len() as f64
}
