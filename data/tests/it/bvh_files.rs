//! BVH files of other tools: their bones' names, helper bones, and what they make of the text.

use glam::DQuat;
use xavatar_data::{Clip, MotionOptions};

use crate::kinematics::{name, of_file, of_parameters};
use crate::{clip, fixture};

fn text(name: &str) -> String {
    std::fs::read_to_string(fixture(name)).unwrap()
}

fn loaded(text: &str, options: &MotionOptions) -> xavatar_formats::Result<Clip> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.bvh");
    std::fs::write(&path, text).unwrap();
    Clip::load(&path, options)
}

#[test]
fn names_of_other_tools_need_no_map() {
    let expected = clip("t_pose.bvh");
    for tool in ["daz", "makehuman", "prefix", "lower_case", "vrm", "armature"] {
        let found = clip(&format!("names_{tool}.bvh"));
        assert!(found.frames == expected.frames, "{tool}");
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    }
}

#[test]
fn bones_of_unknown_names_need_a_map_and_the_error_begins_one() {
    let unknown = text("t_pose.bvh").replace("LeftUpLeg", "Bone7").replace("RightForeArm", "Bone12");
    let message = loaded(&unknown, &MotionOptions::default()).unwrap_err().to_string();
    for line in [
        "left_hip, right_elbow",
        "save it as map.toml",
        "\"Hips\" = \"pelvis\"",
        "# \"Bone7\" = \"\"",
        "# \"Bone12\" = \"\"",
    ] {
        assert!(message.contains(line), "{message}");
    }
    let (_, draft) = message.split_once(":\n").unwrap();
    let filled = draft
        .replace("# \"Bone7\" = \"\"", "\"Bone7\" = \"left_hip\"")
        .replace("# \"Bone12\" = \"\"", "\"Bone12\" = \"right_elbow\"");
    let map = toml::from_str(&filled).unwrap();
    let found = loaded(&unknown, &MotionOptions { bone_map: Some(map), ..MotionOptions::default() }).unwrap();
    assert!(found.frames == clip("t_pose.bvh").frames);
}

// `__jaw` stands above `jaw`: the jaw has the turns of both, which are the head's at first and 25 degrees more at last.
#[test]
fn a_helper_of_the_same_name_leaves_the_joint_its_turn() {
    let (found, expected) = (clip("helper_jaw.bvh"), clip("jaw.bvh"));
    assert!(found.frames == expected.frames);
    let opened = found.frames[4].jaw_pose.0.length().to_degrees();
    assert!((opened - 25.0).abs() < 1e-3, "{opened}");
    assert!(found.report[2].contains("jaw -> jaw"), "{:?}", found.report);
}

/// The T-pose's file with each of some bones' turns shared with a helper in its place, above or below it.
fn with_helpers(helped: &[(&str, &str, bool)]) -> String {
    let base = text("t_pose.bvh");
    let (hierarchy, motion) = base.split_once("MOTION").unwrap();
    // Columns of the file's bones, in order; the helper's follow or go before.
    let mut order: Vec<(String, Option<f64>)> = Vec::new();
    let (mut out, mut closing): (String, Vec<usize>) = (String::new(), Vec::new());
    let mut pending: Option<(String, bool)> = None;
    for line in hierarchy.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["ROOT" | "JOINT", name] => {
                let helper = helped.iter().find(|(bone, ..)| *bone == name);
                match helper {
                    Some((_, helper, true)) => {
                        out += &format!("JOINT {helper}\n");
                        pending = Some((name.to_owned(), true));
                        order.extend([(name.to_owned(), Some(0.25)), (name.to_owned(), Some(0.75))]);
                    }
                    Some((_, helper, false)) => {
                        out += &format!("{line}\n");
                        pending = Some(((*helper).to_owned(), false));
                        order.extend([(name.to_owned(), Some(0.25)), (name.to_owned(), Some(0.75))]);
                    }
                    None => {
                        out += &format!("{line}\n");
                        order.push((name.to_owned(), None));
                    }
                }
                closing.push(0);
            }
            ["CHANNELS", ..] => {
                out += &format!("{line}\n");
                if let Some((inner, _)) = pending.take() {
                    out += &format!("JOINT {inner}\n{{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n");
                    *closing.last_mut().unwrap() = 1;
                }
            }
            ["End", ..] => {
                closing.push(0);
                out += &format!("{line}\n");
            }
            ["}"] => {
                out += &"}\n".repeat(1 + closing.pop().unwrap());
            }
            _ => out += &format!("{line}\n"),
        }
    }
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in &order {
        if names.last() != Some(&name.as_str()) {
            names.push(name);
        }
    }
    let mut lines = motion.lines();
    out += &format!("MOTION{}\n", lines.by_ref().take(3).collect::<Vec<_>>().join("\n"));
    for line in lines.filter(|line| !line.trim().is_empty()) {
        let values: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        let mut row: Vec<f64> = values[..3].to_vec();
        for (name, share) in &order {
            let place = names.iter().position(|other| other == name).unwrap();
            let [z, x, y] = [0, 1, 2].map(|axis| values[3 + 3 * place + axis].to_radians());
            let whole = DQuat::from_rotation_z(z) * DQuat::from_rotation_x(x) * DQuat::from_rotation_y(y);
            // Not of one axis: what a joint of three axes and its helper share in any way.
            let first = DQuat::from_rotation_x(0.3) * DQuat::IDENTITY.slerp(whole, 0.25);
            let turn = match share {
                None => whole,
                Some(share) if *share < 0.5 => first,
                Some(_) => first.inverse() * whole,
            };
            let (z, x, y) = turn.to_euler(glam::EulerRot::ZXY);
            row.extend([z.to_degrees(), x.to_degrees(), y.to_degrees()]);
        }
        out += &format!("{}\n", row.iter().map(f64::to_string).collect::<Vec<_>>().join(" "));
    }
    out
}

// Whichever bones have one, above or below, and whatever its name.
#[test]
fn turns_of_helper_bones_are_the_joints() {
    let expected = clip("t_pose.bvh");
    for helped in [
        &[("LeftUpLeg", "LHipJoint", true), ("RightUpLeg", "RHipJoint", true), ("Spine", "LowerBack", true)][..],
        &[("Neck", "neck_01", true), ("Spine2", "Spine2_helper", false), ("Hips", "Pelvis_turn", false)],
        &[("RightArm", "RightArmRoll", false), ("RightForeArm", "RightForeArmRoll", true), ("Head", "skull", false)],
        &[("Hips", "Pelvis", false), ("RightLeg", "RightLeg1", false), ("LeftFoot", "LeftFootRoll", true)],
        &[("Spine", "Spine", true), ("LeftShoulder", "LeftShoulder", false)],
    ] {
        let found = loaded(&with_helpers(helped), &MotionOptions::default()).unwrap();
        for (index, (found, expected)) in found.frames.iter().zip(&expected.frames).enumerate() {
            let (turns, wanted) = (of_parameters(found), of_parameters(expected));
            for joint in 0..turns.len() {
                let off = turns[joint].angle_between(wanted[joint]).to_degrees();
                assert!(off < 0.1, "{helped:?}, frame {index}, {}: {off:.1} degrees off", name(joint));
            }
            assert!(found.transl.distance(expected.transl) < 1e-5);
        }
    }
}

#[test]
fn a_prop_beside_the_person_is_left_out_and_named() {
    let found = clip("second_root.bvh");
    assert!(found.frames == clip("t_pose.bvh").frames);
    assert!(
        found.warnings.iter().any(|line| line.message.contains("2 skeletons") && line.message.contains("Prop")),
        "{:?}",
        found.warnings
    );
    // The prop may come first.
    let (hierarchy, motion) =
        text("t_pose.bvh").split_once("MOTION").map(|(start, end)| (start.to_owned(), end.to_owned())).unwrap();
    let prop =
        "ROOT Prop\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\nEnd Site\n{\nOFFSET 0 0 1\n}\n}\n";
    let person = hierarchy.replace("HIERARCHY\n", "");
    let mut lines = motion.lines();
    let mut other =
        format!("HIERARCHY\n{prop}{person}MOTION{}\n", lines.by_ref().take(3).collect::<Vec<_>>().join("\n"));
    lines.for_each(|line| other += &format!("7 8 9 {line}\n"));
    assert!(loaded(&other, &MotionOptions::default()).unwrap().frames == found.frames);
}

#[test]
fn text_that_differs_from_the_letter_is_the_same_file() {
    let expected = clip("t_pose.bvh");
    for name in ["named_end_sites.bvh", "no_space.bvh", "comment.bvh"] {
        let found = clip(name);
        assert!(found.frames == expected.frames && found.frames_per_second == expected.frames_per_second, "{name}");
        assert!(found.warnings.is_empty(), "{name}: {:?}", found.warnings);
    }
    assert_eq!(of_file(&text("t_pose.bvh")).len(), expected.frames.len());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("utf_16.bvh");
    let units = [0xfeff].into_iter().chain(text("t_pose.bvh").encode_utf16().collect::<Vec<_>>());
    std::fs::write(&path, units.flat_map(u16::to_le_bytes).collect::<Vec<_>>()).unwrap();
    assert!(Clip::load(&path, &MotionOptions::default()).unwrap().frames == expected.frames);
}

#[test]
fn rows_that_are_miscounted_are_read_and_said() {
    let expected = clip("t_pose.bvh");
    for (name, rows, words) in
        [("more_rows.bvh", 6, "says 5 frames and has 6"), ("fewer_rows.bvh", 4, "says 5 frames and has 4")]
    {
        let found = clip(name);
        assert_eq!(found.frames.len(), rows, "{name}");
        let common = rows.min(5);
        assert!(found.frames[..common] == expected.frames[..common], "{name}");
        assert!(found.warnings[0].message.contains(words), "{:?}", found.warnings);
    }
}

#[test]
fn a_file_in_which_no_time_passes_needs_a_rate() {
    let timeless = text("t_pose.bvh").replace("0.033333", "0");
    let found = loaded(&timeless, &MotionOptions { source_rate: Some(60.0), ..MotionOptions::default() }).unwrap();
    assert!(found.frames == clip("t_pose.bvh").frames && found.frames_per_second == 60.0);
    let undeclared = loaded(&timeless, &MotionOptions::default()).unwrap();
    assert!(
        undeclared.warnings.iter().any(|line| line.message.contains("no time passes")),
        "{:?}",
        undeclared.warnings
    );
}
