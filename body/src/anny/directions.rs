//! What the ten coefficients of shape and the ten of expression do to Anny's body, in the T-pose.
//!
//! A shape is a difference of phenotypes, or of the two targets of a measure, over both of which the body is turned to the T-pose anew, so
//! that joints and pose follow; coefficients within -2 to 2 are plausible. Expressions are the strongest of the facial actions, left and right
//! halves joined, half of each a unit. V vertices of the body; metres.

use glam::DVec3;

use super::Body;
use super::phenotype::Phenotype;
use super::t_pose::TPose;
use crate::imported::{Direction, Directions};
use xavatar_formats::Result;

/// Expressions of the format.
const EXPRESSIONS: usize = crate::smplx::EXPRESSIONS;
/// How far a body is changed to see what a shape does.
const STEP: f64 = 2.0;
/// What a unit of an expression is of the whole action.
const UNIT_OF_ACTION: f64 = 0.5;

/// A shape.
struct Shape {
    name: &'static str,
    /// An entry of the phenotype, and how much of the way from 0 to 1 a unit is.
    phenotype: Option<(&'static str, f64)>,
    /// Measures, whose targets are called `-incr` and `-decr`, and how much of the way from the middle to either a unit is.
    measures: &'static [(&'static str, f64)],
}

/// The ten shapes: named directions, the same for every phenotype.
const SHAPES: [Shape; 10] = [
    Shape { name: "height", phenotype: Some(("height", 0.1)), measures: &[] },
    Shape {
        name: "weight",
        phenotype: Some(("weight", 0.25)),
        measures: &[
            ("torso/measure-waist-circ", 0.25),
            ("torso/measure-hips-circ", 0.2),
            ("torso/measure-bust-circ", 0.2),
        ],
    },
    Shape { name: "male", phenotype: Some(("gender", -0.25)), measures: &[] },
    Shape { name: "muscle", phenotype: Some(("muscle", 0.25)), measures: &[] },
    Shape { name: "ideal proportions", phenotype: Some(("proportions", -0.25)), measures: &[] },
    Shape {
        name: "broad shoulders",
        phenotype: None,
        measures: &[("torso/torso-vshape", 0.4), ("torso/measure-shoulder-dist", 0.4)],
    },
    Shape {
        name: "long legs",
        phenotype: None,
        measures: &[("legs/upperlegs-height", 0.3), ("legs/lowerlegs-height", 0.3)],
    },
    Shape {
        name: "waist and hips",
        phenotype: None,
        measures: &[("torso/measure-hips-circ", 0.5), ("torso/measure-waist-circ", 0.5)],
    },
    Shape {
        name: "long arms",
        phenotype: None,
        measures: &[("arms/measure-upperarm-length", 0.35), ("arms/measure-lowerarm-length", 0.35)],
    },
    Shape {
        name: "large head and hands",
        phenotype: None,
        measures: &[
            ("head/head-scale-horiz", 0.3),
            ("head/head-scale-vert", 0.3),
            ("head/head-scale-depth", 0.3),
            ("hands/l-hand-scale", 0.3),
            ("hands/r-hand-scale", 0.3),
        ],
    },
];

/// The 52 facial actions, as ARKit names them: those of both sides are two files, ending in `Left` and `Right`.
const TWO_SIDED: [&str; 18] = [
    "browDown",
    "browOuterUp",
    "cheekSquint",
    "eyeBlink",
    "eyeLookDown",
    "eyeLookIn",
    "eyeLookOut",
    "eyeLookUp",
    "eyeSquint",
    "eyeWide",
    "mouthDimple",
    "mouthFrown",
    "mouthLowerDown",
    "mouthPress",
    "mouthSmile",
    "mouthStretch",
    "mouthUpperUp",
    "noseSneer",
];
const ONE_SIDED: [&str; 16] = [
    "browInnerUp",
    "cheekPuff",
    "jawForward",
    "jawLeft",
    "jawOpen",
    "jawRight",
    "mouthClose",
    "mouthFunnel",
    "mouthLeft",
    "mouthPucker",
    "mouthRight",
    "mouthRollLower",
    "mouthRollUpper",
    "mouthShrugLower",
    "mouthShrugUpper",
    "tongueOut",
];

/// The shapes of a phenotype, and the strongest expressions.
pub(super) fn directions_of(
    body: &mut Body,
    phenotype: &Phenotype,
    neutral: &[DVec3],
    pose: &TPose,
) -> Result<Directions> {
    let shapes = SHAPES.iter().map(|shape| shape_direction(body, shape, phenotype, neutral));
    Ok(Directions { shapes: shapes.collect::<Result<_>>()?, expressions: strongest_actions(body, pose)? })
}

fn shape_direction(body: &mut Body, shape: &Shape, phenotype: &Phenotype, neutral: &[DVec3]) -> Result<Direction> {
    let mut unit = vec![DVec3::ZERO; neutral.len()];
    if let Some((entry, share)) = shape.phenotype {
        let [least, most] = [0.0, 1.0].map(|value| phenotype.with(entry, value));
        let (least, most) = (body.shaped(&least)?, body.shaped(&most)?);
        unit.iter_mut()
            .zip(most.iter().zip(&least))
            .for_each(|(unit, (most, least))| *unit += (*most - *least) * share);
    }
    for (measure, share) in shape.measures {
        for (end, sign) in [("incr", 0.5), ("decr", -0.5)] {
            let target = body.source.target(&format!("mpfb2/targets/{measure}-{end}.target.gz"), neutral.len())?;
            target.add_to(&mut unit, sign * share);
        }
    }
    let used = body.base.used_vertices();
    let changed = |amount: f64| {
        let mesh: Vec<DVec3> = neutral.iter().zip(&unit).map(|(vertex, unit)| *vertex + *unit * amount).collect();
        let pose = TPose::of(&body.rig, &mesh);
        let skinned = pose.skinned(&body.rig, &mesh);
        let vertices: Vec<DVec3> = used.iter().map(|vertex| skinned[*vertex]).collect();
        (vertices, pose.joints)
    };
    let ((more, more_joints), (less, less_joints)) = (changed(STEP), changed(-STEP));
    let slope = |more: Vec<DVec3>, less: Vec<DVec3>| {
        more.iter().zip(&less).map(|(more, less)| (*more - *less) / (2.0 * STEP)).collect::<Vec<DVec3>>()
    };
    Ok(Direction { name: shape.name.into(), offsets: slope(more, less), joints: slope(more_joints, less_joints) })
}

/// The facial actions, and what their files' names end in.
fn actions_and_sides() -> impl Iterator<Item = (&'static str, &'static [&'static str])> {
    TWO_SIDED.map(|name| (name, &["Left", "Right"][..])).into_iter().chain(ONE_SIDED.map(|name| (name, &[""][..])))
}

/// The names of the files of all facial actions, ARKit's own.
pub(super) fn action_files() -> impl Iterator<Item = String> {
    actions_and_sides().flat_map(|(name, sides)| sides.iter().map(move |side| format!("{name}{side}")))
}

/// The facial actions that move the body most.
fn strongest_actions(body: &mut Body, pose: &TPose) -> Result<Vec<Direction>> {
    let (used, count) = (body.base.used_vertices(), body.base.vertices.len());
    let mut actions = Vec::new();
    for (name, sides) in actions_and_sides() {
        let mut offsets = vec![DVec3::ZERO; count];
        for side in sides {
            let file = format!("faceunits01/targets/faceunits/{name}{side}.target");
            body.source.target(&file, count)?.add_to(&mut offsets, UNIT_OF_ACTION);
        }
        let turned = pose.turned(&body.rig, &offsets);
        let offsets: Vec<DVec3> = used.iter().map(|vertex| turned[*vertex]).collect();
        let strength: f64 = offsets.iter().map(|offset| offset.length_squared()).sum();
        let joints = vec![DVec3::ZERO; super::joints::COUNT];
        actions.push((strength, Direction { name: name.into(), offsets, joints }));
    }
    actions.sort_by(|(one, _), (other, _)| other.total_cmp(one));
    Ok(actions.into_iter().take(EXPRESSIONS).map(|(_, action)| action).collect())
}
