//! BVH motions: another skeleton's movement, turned onto SMPL-X's (docs/motion.md).
//!
//! file -> joints and rows ([`parse`]) -> which bone is which joint ([`names`]) -> SMPL-X rotations ([`retarget`]).

mod names;
mod parse;
mod retarget;

use std::collections::BTreeMap;
use std::path::Path;

use super::{Motion, RestPose};
use xavatar_body::smplx;
use xavatar_formats::{Error, Result, read_bytes};

const FORMAT: &str = "BVH motion";

/// Whether a file that starts like this is a BVH file.
pub(super) fn is_bvh(start: &[u8]) -> bool {
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
    start.get(..9).is_some_and(|word| word.eq_ignore_ascii_case(b"HIERARCHY"))
}

/// Reads a motion onto the skeleton `rest`; `map`, where there is one, says which bone is which joint.
pub(super) fn read(path: &Path, rest: &RestPose, map: Option<&BTreeMap<String, String>>) -> Result<Motion> {
    let bytes = read_bytes(path)?;
    // Only names can be in another encoding, and they only have to stay apart.
    let bvh = parse::parse(&String::from_utf8_lossy(&bytes)).map_err(|fault| fault.in_file(path, FORMAT))?;
    let bones = match map {
        Some(map) => names::declared(&bvh.joints, map)?,
        None => names::recognised(&bvh.joints),
    };
    let retargeting = retarget::Retargeting::new(&bvh, bones, rest).map_err(|missing| Error::Mismatch {
        path: path.into(),
        found: format!("a skeleton in which no bone is known as {}", missing.join(", ")),
        expected: "the bones of a person, by names of a common skeleton".into(),
        remedy: format!("say which bone is which joint (--bone-map); the bones are {}", bone_names(&bvh.joints)).into(),
    })?;
    Ok(Motion {
        frames: retargeting.frames(),
        frames_per_second: Some(rate(bvh.frame_time)),
        up: retargeting.up(),
        source: format!("{} ({FORMAT})", path.display()),
        zeroed: ["betas", "expression"].map(str::to_owned).to_vec(),
        notes: retargeting.report(),
        ..Motion::default()
    })
}

/// Frames a second from the time between them, of which files have few digits: 0.0083333 s are meant to be 120.
fn rate(frame_time: f64) -> f32 {
    let rate = 1.0 / frame_time;
    (if (rate - rate.round()).abs() < 2e-5 * rate { rate.round() } else { rate }) as f32
}

fn bone_names(joints: &[parse::Joint]) -> String {
    joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", ")
}

/// The joints' names, joined, of some of SMPL-X's.
fn joint_names(joints: impl Iterator<Item = usize>) -> Vec<&'static str> {
    joints.map(|joint| smplx::skeleton().joints[joint].as_str()).collect()
}
