//! What keeping bones and flesh apart is measured against: a SMPL body of the same registrations, skeleton and weights (Wang 5.5, "SMPL-reimpl").
//!
//! Each person's T-pose is the mean of the un-posed registrations, joints are the mean of the vertices on their ring; poses and T-poses are found in
//! turn. Shapes are principal components of T-poses, the ring is the regressor; there are no pose correctives. Metres.

use glam::DVec3;
use rayon::prelude::*;
use xavatar_body::{Anatomy, BlendShapes, BodyModel, Correctives, JointBasis};
use xavatar_formats::Result;

use crate::core::{Fitted, Identity, Person, PoseFit, WeightRow, shapes_of, unposed, weight_rows};
use crate::registrations::Registrations;

/// How often poses and a T-pose are found in turn.
const TURNS: usize = 4;
/// A vertex is on the ring of a joint if it follows it and its parent by more than this.
const RING: f64 = 0.2;

/// A body with the skeleton and weights of `start`, and at most so many shapes.
///
/// # Errors
/// Those of reading registrations and of [`BodyModel::assemble`].
pub fn whole_bodies(start: &BodyModel, registrations: &Registrations, shapes: usize) -> Result<BodyModel> {
    let bare = Anatomy {
        shapes: BlendShapes::from_directions(Vec::new()),
        expressions: 0,
        joints: JointBasis { template: start.anatomy().joints.template.clone(), directions: Vec::new() },
        correctives: Correctives::None,
        ..start.anatomy().clone()
    };
    let plain = BodyModel::assemble(start.path(), bare)?;
    let rings = rings(&weight_rows(start), &start.skeleton().parents);
    let fit = PoseFit { shape: false, expression: false };
    let mut people = Vec::new();
    for subject in &registrations.subjects {
        let frames: Vec<Vec<DVec3>> =
            subject.frames.par_iter().map(|path| registrations.read(path)).collect::<Result<_>>()?;
        let mut identity = Identity::of(start);
        identity.joints = joints_of(&rings, &identity.template, &identity.joints);
        let mut poses: Vec<Option<Fitted>> = vec![None; frames.len()];
        for _ in 0..TURNS {
            let person = Person::new(&plain, identity.clone())?;
            let of_frame = |(frame, before): (&Vec<DVec3>, &Option<Fitted>)| {
                let found = fit.nearest(&person.body, frame, before.clone());
                let (posed, _) = person.body.posed(&found.pose, &[]);
                let left = unposed(&posed.positions, &posed.turns, frame, &vec![DVec3::ZERO; frame.len()]);
                (Some(found), left)
            };
            let (found, left): (Vec<_>, Vec<Vec<DVec3>>) = frames.par_iter().zip(&poses).map(of_frame).unzip();
            poses = found;
            for (vertex, place) in identity.template.iter_mut().enumerate() {
                *place += left.iter().map(|of| of[vertex]).sum::<DVec3>() / left.len() as f64;
            }
            identity.joints = joints_of(&rings, &identity.template, &identity.joints);
        }
        people.push(identity);
    }
    let space = shapes_of(&people, shapes);
    let none = vec![DVec3::ZERO; rings.len()];
    let flat = |points: &Vec<DVec3>| points.iter().flat_map(|point| point.as_vec3().to_array()).collect();
    let joints = JointBasis {
        template: joints_of(&rings, &space.mean, &plain.anatomy().joints.template),
        directions: space.directions.iter().map(|direction| joints_of(&rings, direction, &none)).collect(),
    };
    let whole = Anatomy {
        template: space.mean.iter().map(|place| place.as_vec3()).collect(),
        shapes: BlendShapes::from_directions(space.directions.iter().map(flat).collect()),
        joints,
        ..plain.anatomy().clone()
    };
    BodyModel::assemble(start.path(), whole)
}

/// The vertices on each joint's ring (J).
fn rings(weights: &[WeightRow], parents: &[Option<usize>]) -> Vec<Vec<usize>> {
    let follows =
        |vertex: usize, joint: usize| weights[vertex].iter().any(|(of, weight)| *of == joint && *weight > RING);
    let ring = |(joint, parent): (usize, &Option<usize>)| {
        let Some(parent) = parent else { return Vec::new() };
        (0..weights.len()).filter(|vertex| follows(*vertex, joint) && follows(*vertex, *parent)).collect()
    };
    parents.iter().enumerate().map(ring).collect()
}

/// The means of rings (J), or where a joint without one was.
fn joints_of(rings: &[Vec<usize>], points: &[DVec3], before: &[DVec3]) -> Vec<DVec3> {
    let mean = |(ring, before): (&Vec<usize>, &DVec3)| match ring.len() {
        0 => *before,
        count => ring.iter().map(|vertex| points[*vertex]).sum::<DVec3>() / count as f64,
    };
    rings.iter().zip(before).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_are_the_means_of_the_vertices_between_them_and_their_parents() {
        let weights =
            vec![vec![(0, 1.0)], vec![(0, 0.5), (1, 0.5)], vec![(0, 0.3), (1, 0.7)], vec![(1, 0.9), (2, 0.1)]];
        let rings = rings(&weights, &[None, Some(0), Some(1)]);
        assert_eq!(rings, [vec![], vec![1, 2], vec![]]);
        let points: Vec<DVec3> = (0..4).map(|vertex| DVec3::splat(f64::from(vertex))).collect();
        let before = [DVec3::X, DVec3::ZERO, DVec3::Y];
        assert_eq!(joints_of(&rings, &points, &before), [DVec3::X, DVec3::splat(1.5), DVec3::Y]);
    }
}
