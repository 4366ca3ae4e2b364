//! MHR's body (Meta; Apache-2.0) as a file of SMPL-X's layout, from its TorchScript file, without PyTorch.
//!
//! The file has a mesh in centimetres, Y up, in a pose of its own; a skeleton of 127 joints whose parameters are poses and scales (`rig`);
//! coefficients of identity and of expression; a network of pose correctives. From these:
//!
//! mesh + a person's identity and scales -> turned to SMPL-X's T-pose (`t_pose`) -> 55 joints (`joints`) -> the ten strongest shapes and
//! expressions (`directions`) -> linear correctives (`correctives`) -> what all imported bodies get.
//!
//! Names and shapes are from public descriptions of the file. V = 18,439 vertices; metres.

mod correctives;
mod directions;
mod file;
mod joints;
mod person;
mod rig;
mod t_pose;
#[cfg(test)]
mod tests;

use std::path::Path;

use glam::{DMat3, DQuat, DVec3};

use self::correctives::LinearCorrectives;
use self::file::Body;
use self::person::Person;
use self::rig::Similarity;
use self::t_pose::{METRES, TPose};
use crate::anny::Measures;
use crate::imported::{Assembled, Directions, PELVIS, POSE_FEATURES, TPosedBody, collapsed_weights};
use crate::{Pose, PoseAxisAngle, smplx};
use xavatar_formats::{ArrayMap, Result};
use xavatar_mesh::TriangleMesh;

/// An imported body.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The arrays of a model's file in SMPL-X's layout.
    pub model: ArrayMap,
    /// Which vertices are which part, as [`PartLabels`](crate::PartLabels) reads them beside a model.
    pub labels: ArrayMap,
    /// Of the body at rest.
    pub measures: Measures,
    /// How much of what MHR's identities and expressions move the ten shapes and ten expressions have, from 0 to 1.
    pub kept: [f64; 2],
    /// The largest distance of a regressed joint from the rig's, metres.
    pub joint_error: f64,
    /// What pose correctives do over random poses, and what the linear ones leave of that, root mean squares, millimetres.
    pub correctives: [f64; 2],
    /// The pose of the person, for the model, in MHR's frame.
    pub pose: Option<Pose>,
}

/// Imports the body from `mhr_model.pt` or the folder that it is in; of a person that SAM 3D Body found, if a result of its is given.
///
/// # Errors
/// [`Error::Missing`](xavatar_formats::Error::Missing) or [`Error::Mismatch`](xavatar_formats::Error::Mismatch) naming the file, and what in it is
/// not there or not what it should be.
pub fn import(path: &Path, person: Option<&Path>) -> Result<Imported> {
    let body = Body::read(path)?;
    let person = person.map(|path| Person::read(path, body.identity.len(), body.rig.parameters)).transpose()?;
    Ok(imported(&body, person.as_ref()))
}

fn imported(body: &Body, person: Option<&Person>) -> Imported {
    let Body { rig, .. } = body;
    let mut shaped = body.vertices.clone();
    for (share, offsets) in person.iter().flat_map(|person| &person.identity).zip(&body.identity) {
        shaped.iter_mut().zip(offsets).for_each(|(vertex, offset)| *vertex += *offset * *share);
    }
    let made = rig.posed(&person.map_or(Vec::new(), |person| rig.scales_of(&person.parameters)));
    let pose = TPose::of(&made.iter().map(|joint| joint.shift).collect::<Vec<_>>());
    let LinearCorrectives { at_rest, mut directions, rms, left } = body.correctives.linear(rig, &made, &pose);
    shaped.iter_mut().zip(&at_rest).for_each(|(vertex, offset)| *vertex += *offset);

    let becomes = &joints::map().becomes;
    let weights: Vec<Vec<f64>> = rig.weights.iter().map(|row| collapsed_weights(row, becomes)).collect();
    // In the person's proportions first, then to the T-pose.
    let skinned = rig.skinned(&made, &shaped);
    let template: Vec<DVec3> =
        skinned.iter().zip(&weights).map(|((vertex, _), row)| pose.place(*vertex, row)).collect();
    let linear: Vec<DMat3> =
        skinned.iter().zip(&weights).map(|((_, linear), row)| pose.linear(row) * *linear).collect();
    turn_rows(&mut directions, &linear);
    let turned = |all: &[Vec<DVec3>]| -> Vec<Vec<DVec3>> {
        let of_vertices =
            |offsets: &Vec<DVec3>| offsets.iter().zip(&linear).map(|(offset, turn)| *turn * *offset).collect();
        all.iter().map(of_vertices).collect()
    };
    let (shapes, shapes_kept) = directions::strongest(&turned(&body.identity), smplx::SHAPES, "identity");
    let (expressions, expressions_kept) =
        directions::strongest(&turned(&body.expressions), smplx::EXPRESSIONS, "expression");

    let mesh = TriangleMesh {
        vertices: template.iter().map(|vertex| vertex.as_vec3()).collect(),
        faces: body.faces.clone(),
        ..TriangleMesh::default()
    };
    let measures = Measures::of_mesh(&mesh);
    let posed = person.map(|person| posed(&rig.posed(&person.parameters), &made, &pose));
    let of_smplx = TPosedBody {
        template,
        faces: mesh.faces,
        weights,
        joints: pose.joints(),
        directions: Directions { shapes, expressions },
        correctives: Some(directions),
    };
    let Assembled { model, labels, joint_error } = of_smplx.assembled(|_| false);
    Imported {
        model,
        labels,
        measures,
        kept: [shapes_kept, expressions_kept],
        joint_error,
        correctives: [rms, left],
        pose: posed,
    }
}

/// Turns each vertex's rows of directions (V, 3, 486) by its matrix, centimetres to metres.
fn turn_rows(directions: &mut [f32], turns: &[DMat3]) {
    for (rows, turn) in directions.chunks_exact_mut(3 * POSE_FEATURES).zip(turns) {
        for feature in 0..POSE_FEATURES {
            let at = |axis: usize| axis * POSE_FEATURES + feature;
            let turned = *turn * DVec3::from_array(std::array::from_fn(|axis| f64::from(rows[at(axis)])));
            (0..3).for_each(|axis| rows[at(axis)] = turned[axis] as f32);
        }
    }
}

/// A pose of SMPL-X's joints from MHR's joints in the world, in a pose and as they were `made`.
fn posed(joints: &[Similarity], made: &[Similarity], pose: &TPose) -> Pose {
    let at = &joints::map().at;
    let world: Vec<DQuat> = at
        .iter()
        .zip(pose.turns())
        .map(|(joint, turn)| joints[*joint].turn * (*turn * made[*joint].turn).inverse())
        .collect();
    let parents = &smplx::skeleton().parents;
    let local =
        world.iter().zip(parents).map(|(own, parent)| parent.map_or(*own, |parent| world[parent].inverse() * *own));
    let place = joints[at[smplx::joint::PELVIS]].shift * METRES;
    Pose {
        rotations: local.map(|turn| PoseAxisAngle(turn.to_scaled_axis().as_vec3())).collect(),
        translation: (place - PELVIS).as_vec3(),
        ..Pose::default()
    }
}
