//! The same movement of skeletons that rest in other poses is the same motion.
//!
//! The fixtures' movement: from standing, the person turns, bends forward, moves the head, lowers and bends the right arm, swings the
//! left leg and bends the right knee. Rest poses made here keep it: with Q_b the turn of bone b at rest, its offset is turned
//! by Q_parent^-1 and its rotation R becomes Q_parent^-1 R Q_b.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use xavatar_data::{Clip, MotionOptions, Warning};

use crate::kinematics::{name, of_file, of_parameters};
use crate::t_pose::{BONES, CLOSE, direction};
use crate::{clip, fixture};

fn assert_same_motion(found: &Clip, expected: &Clip, what: &str) {
    let warnings = found.warnings.clone();
    assert_eq!(found.frames.len(), expected.frames.len(), "{what}");
    for (index, (found, expected)) in found.frames.iter().zip(&expected.frames).enumerate() {
        let (turns, wanted) = (of_parameters(found), of_parameters(expected));
        for joint in 0..turns.len() {
            let off = turns[joint].angle_between(wanted[joint]).to_degrees();
            let doubts = &warnings;
            assert!(off < CLOSE, "{what}, frame {index}, {}: {off:.1} degrees off; {doubts:?}", name(joint));
        }
        let off = found.transl.distance(expected.transl);
        assert!(off < 0.01, "{what}, frame {index}: {off} m off");
    }
}

#[test]
fn recorded_rest_poses_are_the_same_motion() {
    let expected = clip("t_pose.bvh");
    for name in ["every_bone_along_x.bvh", "feet_raised.bvh", "facing_45.bvh"] {
        let found = clip(name);
        assert_same_motion(&found, &expected, name);
        assert!(found.report.iter().any(|line| line.starts_with("up axis: Y ")), "{:?}", found.report);
    }
}

/// The T-pose's file with its bones turned at rest.
fn at_rest_with(turn: impl Fn(&str) -> DQuat) -> String {
    rewritten(&std::fs::read_to_string(fixture("t_pose.bvh")).unwrap(), turn)
}

/// A BVH file, one word of its hierarchy a blank, its channels ZXY, with its bones turned at rest.
fn rewritten(text: &str, turn: impl Fn(&str) -> DQuat) -> String {
    let (hierarchy, motion) = text.split_once("MOTION").unwrap();
    let mut out = String::new();
    let (mut open, mut names): (Vec<String>, Vec<(String, Option<String>)>) = (Vec::new(), Vec::new());
    for line in hierarchy.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["ROOT" | "JOINT", name] => {
                names.push((name.to_owned(), open.last().cloned()));
                open.push(name.to_owned());
            }
            ["End", ..] => open.push(String::new()),
            ["}"] => drop(open.pop()),
            _ => {}
        }
        match words[..] {
            ["OFFSET", x, y, z] if open.len() > 1 => {
                let parent = turn(&open[open.len() - 2]);
                let offset = parent.inverse() * DVec3::new(x.parse().unwrap(), y.parse().unwrap(), z.parse().unwrap());
                out += &format!("OFFSET {} {} {}\n", offset.x, offset.y, offset.z);
            }
            _ => out += &format!("{line}\n"),
        }
    }
    let mut lines = motion.lines();
    let heading: Vec<&str> = lines.by_ref().take(3).collect();
    out += &format!("MOTION{}\n", heading.join("\n"));
    for line in lines.filter(|line| !line.trim().is_empty()) {
        let values: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        out += &format!("{} {} {}", values[0], values[1], values[2]);
        for ((name, parent), turns) in names.iter().zip(values[3..].as_chunks::<3>().0) {
            let [z, x, y] = turns.map(f64::to_radians);
            let rotation = DQuat::from_rotation_z(z) * DQuat::from_rotation_x(x) * DQuat::from_rotation_y(y);
            let above = parent.as_ref().map_or(DQuat::IDENTITY, |parent| turn(parent));
            let (z, x, y) = (above.inverse() * rotation * turn(name)).to_euler(glam::EulerRot::ZXY);
            out += &format!(" {} {} {}", z.to_degrees(), x.to_degrees(), y.to_degrees());
        }
        out.push('\n');
    }
    out
}

fn loaded(text: &str) -> xavatar_formats::Result<Clip> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.bvh");
    std::fs::write(&path, text).unwrap();
    Clip::load(&path, &MotionOptions::default())
}

fn is_left(bone: &str) -> bool {
    bone.starts_with("Left")
}

fn is_leg(bone: &str) -> bool {
    ["UpLeg", "Leg"].iter().any(|part| bone.trim_start_matches("Left").trim_start_matches("Right") == *part)
}

fn is_foot(bone: &str) -> bool {
    bone.ends_with("Foot") || bone.ends_with("ToeBase")
}

fn is_arm(bone: &str) -> bool {
    bone.ends_with("Arm") || bone.ends_with("Hand")
}

fn assert_is_the_t_poses(what: &str, turn: impl Fn(&str) -> DQuat) {
    let expected = clip("t_pose.bvh");
    let found = loaded(&at_rest_with(turn)).unwrap_or_else(|error| panic!("{what}: {error}"));
    assert_same_motion(&found, &expected, what);
}

#[test]
fn a_body_may_face_any_way_at_rest() {
    for degrees in (0..360).step_by(15) {
        assert_is_the_t_poses(&format!("facing {degrees}"), |_| {
            DQuat::from_rotation_y(f64::from(degrees).to_radians())
        });
    }
}

#[test]
fn arms_and_legs_may_rest_anywhere() {
    for (arms, legs) in [(0, 30), (45, 0), (70, 10), (85, 45), (-30, 20)] {
        let (arms, legs) = (f64::from(arms).to_radians(), f64::from(legs).to_radians());
        for with_feet in [false, true] {
            assert_is_the_t_poses(&format!("arms {arms}, legs {legs}, feet {with_feet}"), |bone| {
                let side = if is_left(bone) { 1.0 } else { -1.0 };
                match bone {
                    bone if is_arm(bone) => DQuat::from_rotation_z(side * arms),
                    bone if is_leg(bone) || (with_feet && is_foot(bone)) => DQuat::from_rotation_z(-side * legs),
                    _ => DQuat::IDENTITY,
                }
            });
        }
    }
}

// Nothing in the rest pose shows it: knees that bend aside, an elbow that bends up do.
#[test]
fn limbs_may_be_rolled_about_themselves() {
    for degrees in [-120, -90, 50, 90, 180] {
        let angle = f64::from(degrees).to_radians();
        for with_feet in [false, true] {
            assert_is_the_t_poses(&format!("rolled by {degrees}, feet {with_feet}"), |bone| {
                let rolls = is_arm(bone) || is_leg(bone) || (with_feet && is_foot(bone));
                if rolls { DQuat::from_axis_angle(direction(bone), angle) } else { DQuat::IDENTITY }
            });
        }
    }
}

// Game rigs: every bone lies along one axis of its own, rolled about it in one way or another, those on the right against it.
#[test]
fn bones_may_all_lie_along_one_axis_of_their_own() {
    for axis in [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::Z, DVec3::NEG_Z] {
        for degrees in [0, 37, 90, 200] {
            for is_mirrored in [false, true] {
                assert_is_the_t_poses(&format!("along {axis}, rolled by {degrees}, mirrored {is_mirrored}"), |bone| {
                    let roll = DQuat::from_axis_angle(axis, f64::from(degrees).to_radians());
                    let opposite = is_mirrored && bone.starts_with("Right");
                    let axis = if opposite { -axis } else { axis };
                    DQuat::from_rotation_arc(axis, direction(bone)) * roll
                });
            }
        }
    }
}

// Each rolled about it in a way of its own: where bones lie along each other, the back's are not to be believed either.
#[test]
fn bones_along_one_axis_may_each_be_rolled_in_another_way() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for axis in [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z] {
        for _ in 0..4 {
            let rolls: BTreeMap<&str, f64> =
                BONES.iter().map(|(bone, _)| (*bone, random.random_range(-3.1..3.1))).collect();
            assert_is_the_t_poses(&format!("along {axis}, rolled by {rolls:?}"), |bone| {
                DQuat::from_rotation_arc(axis, direction(bone)) * DQuat::from_axis_angle(axis, rolls[bone])
            });
        }
    }
}

#[test]
fn a_body_may_sit_at_rest() {
    assert_is_the_t_poses("thighs ahead, shins down", |bone| match bone {
        "LeftUpLeg" | "RightUpLeg" => DQuat::from_rotation_x(-1.57),
        _ => DQuat::IDENTITY,
    });
}

// The world of the rest pose has other axes than that of the frames, or both have.
#[test]
fn axes_may_be_crossed_at_rest() {
    let third = DQuat::from_axis_angle(DVec3::ONE.normalize(), 120f64.to_radians());
    for (what, turn) in [("x, y, z -> y, z, x", third), ("x, y, z -> z, x, y", third.inverse())] {
        assert_is_the_t_poses(what, |_| turn);
    }
}

/// The mirror image of a file along x.
fn mirrored(text: &str) -> String {
    let (hierarchy, motion) = text.split_once("MOTION").unwrap();
    let mut out = String::new();
    for line in hierarchy.lines() {
        match line.split_whitespace().collect::<Vec<_>>()[..] {
            ["OFFSET", x, y, z] => out += &format!("OFFSET {} {y} {z}\n", -x.parse::<f64>().unwrap()),
            _ => out += &format!("{line}\n"),
        }
    }
    let mut lines = motion.lines();
    out += &format!("MOTION{}\n", lines.by_ref().take(3).collect::<Vec<_>>().join("\n"));
    for line in lines.filter(|line| !line.trim().is_empty()) {
        // Xposition, then Z, X and Y of each joint.
        let values = line.split_whitespace().enumerate().map(|(place, word)| {
            let value: f64 = word.parse().unwrap();
            let changes = place == 0 || (place >= 3 && place % 3 != 1);
            (if changes { -value } else { value }).to_string()
        });
        out += &format!("{}\n", values.collect::<Vec<_>>().join(" "));
    }
    out
}

// A tool whose world is left-handed writes the mirror image: what is called left is then on the right.
#[test]
fn a_mirror_image_is_seen_by_its_toes_and_said() {
    let expected = clip("t_pose.bvh");
    for name in ["t_pose.bvh", "every_bone_along_x.bvh", "facing_45.bvh"] {
        let text = std::fs::read_to_string(fixture(name)).unwrap();
        let found = loaded(&mirrored(&text)).unwrap();
        assert_same_motion(&found, &expected, name);
        assert!(found.warnings.iter().any(|line| line.message.contains("mirror image")), "{:?}", found.warnings);
    }
}

// The skeleton at rest stands along Y: who lies along Z lies.
#[test]
fn who_lies_prone_stays_lying() {
    let text = std::fs::read_to_string(fixture("prone.bvh")).unwrap();
    for text in [text.clone(), rewritten(&text, |bone| DQuat::from_rotation_arc(DVec3::X, direction(bone)))] {
        let clip = loaded(&text).unwrap();
        assert!(clip.report.iter().any(|line| line.starts_with("up axis: Y ")), "{:?}", clip.report);
        let bones = of_file(&text);
        for (frame, bones) in clip.frames.iter().zip(bones) {
            let turns = of_parameters(frame);
            let trunk = (bones["Neck"].place - bones["Hips"].place).normalize();
            assert!(trunk.y.asin().to_degrees().abs() < 20.0, "the file's person lies");
            for joint in [0, 3, 6, 9] {
                assert!((turns[joint] * DVec3::Y).angle_between(trunk).to_degrees() < 10.0, "{joint}");
            }
        }
    }
}

// Where on the floor, and which way up, changes nothing: least of all where the feet are over the origin.
#[test]
fn who_lies_anywhere_stays_lying() {
    let text = std::fs::read_to_string(fixture("prone.bvh")).unwrap();
    let (hierarchy, motion) = text.split_once("MOTION").unwrap();
    let mut lines = motion.lines();
    let heading = lines.by_ref().take(3).collect::<Vec<_>>().join("\n");
    let rows: Vec<Vec<&str>> =
        lines.filter(|line| !line.is_empty()).map(|line| line.split_whitespace().collect()).collect();
    for (place, [z, x, y]) in [
        ("0 12 90", ["0", "90", "0"]),
        ("0 12 -85", ["0", "-90", "0"]),
        ("85 30 0", ["-90", "0", "0"]),
        ("-90 8 3", ["90", "0", "0"]),
        ("40 12 40", ["0", "90", "45"]),
    ] {
        let mut moved = format!("{hierarchy}MOTION{heading}\n");
        for row in &rows {
            moved += &format!("{place} {z} {x} {y} {}\n", row[6..].join(" "));
        }
        let clip = loaded(&moved).unwrap();
        assert!(clip.report.iter().any(|line| line.starts_with("up axis: Y (")), "{place}: {:?}", clip.report);
        let bones = of_file(&moved);
        for (frame, bones) in clip.frames.iter().zip(bones) {
            let off = of_parameters(frame)[0].angle_between(bones["Hips"].turn).to_degrees();
            assert!(off < CLOSE, "{place}: {off:.1} degrees off");
        }
    }
}

fn text_of(warnings: &[Warning]) -> String {
    warnings.iter().map(Warning::to_string).collect::<Vec<_>>().join("\n")
}

#[test]
fn what_is_assumed_of_a_rest_pose_is_said_with_the_figure() {
    for (name, words) in [
        ("every_bone_along_x.bvh", ["left_hip 180 degrees", "the legs in frame 1"]),
        ("feet_raised.bvh", ["left_ankle 37 degrees", "the left foot in frame 1"]),
    ] {
        let warnings = text_of(&clip(name).warnings);
        assert!(words.iter().all(|word| warnings.contains(word)), "{warnings}");
    }
    let along_x = |bone: &str| DQuat::from_rotation_arc(DVec3::X, direction(bone));
    let prone = rewritten(&std::fs::read_to_string(fixture("prone.bvh")).unwrap(), along_x);
    let report = text_of(&loaded(&prone).unwrap().warnings);
    assert!(report.contains("lies"), "{report}");
}
