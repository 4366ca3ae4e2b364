//! BVH motions: another skeleton's movement, turned onto SMPL-X's (docs/motion.md).
//!
//! file -> joints and rows ([`parse`]) -> which bone is which joint ([`bones`]) -> how SMPL-X's joints lie in the bones
//! ([`rest_pose`], [`alignment`]) -> SMPL-X rotations ([`retarget`]).

mod alignment;
mod bones;
mod handedness;
mod hinges;
mod parse;
mod rest_pose;
mod retarget;
mod rows;
mod skeleton;
mod stance;
mod text;
mod upright;

use std::collections::BTreeMap;
use std::path::Path;

use super::{Motion, RestPose, Warning};
use retarget::{Retargeting, Unusable};
use skeleton::Bvh;
use xavatar_formats::{Choice, Error, Remedy, Result, decode_text};

const FORMAT: &str = "BVH motion";
const PERSON: &str = "the bones of a person, by names of a common skeleton";

/// Whether a file that starts like this is a BVH file.
pub(super) fn is_bvh(start: &[u8]) -> bool {
    let start = decode_text(start);
    let first = start.lines().map(|line| text::without_comment(line).trim()).find(|line| !line.is_empty());
    first.and_then(|line| line.get(..9)).is_some_and(|word| word.eq_ignore_ascii_case("HIERARCHY"))
}

/// Reads the motion in the file at `path` onto the skeleton `rest`; `map`, where there is one, says which bone is which joint.
pub(super) fn parse(
    path: &Path,
    bytes: &[u8],
    rest: &RestPose,
    map: Option<&BTreeMap<String, String>>,
) -> Result<Motion> {
    // Only names can be in yet another encoding, and they only have to stay apart.
    let mut bvh = parse::parse(&decode_text(bytes)).map_err(|fault| fault.in_file(path, FORMAT))?;
    let mut warnings: Vec<Warning> = bvh.oddities.iter().map(Warning::plain).collect();
    if bvh.frame_time.is_none() {
        warnings.push(Warning::choosing(Choice::FrameRate, "the file says that no time passes between frames"));
    }
    warnings.extend(keep_person(&mut bvh, map).map(Warning::plain));
    let bones = match map {
        Some(map) => bones::declared(&bvh.joints, map)?,
        None => bones::recognised(&bvh.joints),
    };
    let frames_per_second = bvh.frame_time.map(rate);
    let draft = bones::draft(&bvh.joints, &bones);
    let retargeting = Retargeting::new(bvh, bones, rest).map_err(|unusable| match unusable {
        Unusable::Missing(joints) => Error::UnknownBones {
            path: path.into(),
            missing: joints.join(", "),
            map: draft,
            remedy: Remedy::choosing(Choice::BoneMap, "complete this map, save it as map.toml and give it"),
        },
        Unusable::NoBody(without) => Error::Mismatch {
            path: path.into(),
            found: format!("a skeleton without {without}"),
            expected: PERSON.into(),
            remedy: Remedy::choosing(
                Choice::BoneMap,
                "if bones were taken for others, say which is which joint (docs/motion.md)",
            ),
        },
    })?;
    warnings.extend_from_slice(retargeting.doubts());
    let (up, up_reason) = retargeting.up();
    Ok(Motion {
        frames: retargeting.frames(),
        frames_per_second,
        up,
        up_reason: up_reason.into(),
        up_is_certain: true,
        source: format!("{} ({FORMAT})", path.display()),
        zeroed: ["betas", "expression"].map(str::to_owned).to_vec(),
        notes: retargeting.report().to_vec(),
        warnings,
        ..Motion::default()
    })
}

/// Of several trees of joints, keeps the one with most bones of a person; says what was left out.
fn keep_person(bvh: &mut Bvh, map: Option<&BTreeMap<String, String>>) -> Option<String> {
    let trees = bvh.trees();
    if trees.len() < 2 {
        return None;
    }
    let known = |tree: &std::ops::Range<usize>| match map {
        Some(map) => bvh.joints[tree.clone()].iter().filter(|joint| map.contains_key(&joint.name)).count(),
        None => {
            let mut alone = Bvh { values: Vec::new(), ..bvh.clone() };
            alone.keep(tree.clone());
            bones::recognised(&alone.joints).iter().flatten().count()
        }
    };
    // The first of those with the most.
    let person = trees.iter().rev().max_by_key(|tree| known(tree))?.clone();
    let others: Vec<String> =
        trees.iter().filter(|tree| **tree != person).map(|tree| bvh.joints[tree.start].name.clone()).collect();
    bvh.keep(person);
    Some(format!("the file has {} skeletons: left out are {}", others.len() + 1, others.join(", ")))
}

/// Frames a second from the time between them, of which files have few digits: 0.0083333 s are meant to be 120.
fn rate(frame_time: f64) -> f32 {
    let rate = 1.0 / frame_time;
    (if (rate - rate.round()).abs() < 2e-5 * rate { rate.round() } else { rate }) as f32
}
