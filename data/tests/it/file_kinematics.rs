//! The joints of motions against the forward kinematics of their files, composed here from the files' own numbers.

use glam::DVec3;
use xavatar_data::RestPose;

use crate::kinematics::{of_file, of_parameters};
use crate::t_pose::{CLOSE, direction, joint, joint_of};
use crate::{clip, fixture};

/// Bones with a direction, and where they end.
const LIMBS: [(&str, &str); 8] = [
    ("LeftArm", "LeftForeArm"),
    ("LeftForeArm", "LeftHand"),
    ("RightArm", "RightForeArm"),
    ("RightForeArm", "RightHand"),
    ("LeftUpLeg", "LeftLeg"),
    ("LeftLeg", "LeftFoot"),
    ("RightUpLeg", "RightLeg"),
    ("RightLeg", "RightFoot"),
];

// The T-pose's bones are SMPL-X's in axes of their own: back, neck, head, collar bones and feet turn as the file's; limbs point
// as the file's.
#[test]
fn joints_turn_as_the_files_bones_and_limbs_point_as_they() {
    let frames = of_file(&std::fs::read_to_string(fixture("t_pose.bvh")).unwrap());
    let rest: Vec<DVec3> = RestPose::default().joints().iter().map(|place| place.as_dvec3()).collect();
    let clip = clip("t_pose.bvh");
    assert_eq!((frames.len(), clip.frames.len()), (5, 5));
    assert!(clip.warnings.is_empty(), "{:?}", clip.warnings);
    for (index, (bones, frame)) in frames.iter().zip(&clip.frames).enumerate() {
        let turns = of_parameters(frame);
        for (bone, end) in LIMBS {
            let (from, to) = (joint_of(bone), joint_of(end));
            let expected = (bones[end].place - bones[bone].place).normalize();
            let off = (turns[from] * (rest[to] - rest[from])).angle_between(expected).to_degrees();
            assert!(off < CLOSE, "frame {index}, {bone}: {off:.1} degrees off");
        }
        for bone in ["Hips", "Spine", "Spine1", "Spine2", "Neck", "Head", "LeftShoulder", "RightShoulder"] {
            let off = turns[joint_of(bone)].angle_between(bones[bone].turn).to_degrees();
            assert!(off < CLOSE, "frame {index}, {bone}: {off:.1} degrees off");
        }
        for (ankle, toe) in [("LeftFoot", "LeftToeBase"), ("RightFoot", "RightToeBase")] {
            // Level feet stay level, and point where the file's toes are.
            let (from, to) = (joint_of(ankle), joint_of(toe));
            let level = turns[from] * DVec3::Y;
            assert!(level.angle_between(bones[ankle].turn * DVec3::Y).to_degrees() < CLOSE, "frame {index}, {ankle}");
            let toes = bones[toe].place - bones[ankle].place;
            let ahead = |direction: DVec3| direction - level * direction.dot(level);
            let off = ahead(turns[from] * (rest[to] - rest[from])).angle_between(ahead(toes)).to_degrees();
            assert!(off < CLOSE, "frame {index}, {ankle}: {off:.1} degrees off");
        }
    }
}

// Where the files' own numbers put their joints, whatever their rest pose, is where SMPL-X's axes have them: hips and collar bones
// along x, the back along y; limbs point as SMPL-X's; its toes are ahead of its ankle where the file's are, as far below as in the T-pose, which stands.
#[test]
fn joints_turn_as_the_files_bones_lie_in_every_recorded_rest_pose() {
    let rest: Vec<DVec3> = RestPose::default().joints().iter().map(|place| place.as_dvec3()).collect();
    let own = |side: &str, from: &str, to: &str| {
        let [from, to] = [from, to].map(|bone| rest[joint_of(&format!("{side}{bone}"))]);
        to - from
    };
    let foot = |ankle: &str, foot: &str| {
        let own = rest[joint(foot)] - rest[joint(ankle)];
        DVec3::new(own.x, own.x.hypot(own.z) * direction("LeftFoot").y / direction("LeftFoot").z, own.z).normalize()
    };
    let mut bones: Vec<(String, String, DVec3)> = [("Spine", "Spine1"), ("Spine1", "Spine2"), ("Spine2", "Neck")]
        .map(|(from, to)| (from.to_owned(), to.to_owned(), DVec3::Y))
        .into();
    for (side, across, foot) in [
        ("Left", DVec3::X, foot("left_ankle", "left_foot")),
        ("Right", DVec3::NEG_X, foot("right_ankle", "right_foot")),
    ] {
        for (from, to, along) in [
            ("Shoulder", "Arm", across),
            ("Foot", "ToeBase", foot),
            ("UpLeg", "Leg", own(side, "UpLeg", "Leg")),
            ("Leg", "Foot", own(side, "Leg", "Foot")),
            ("Arm", "ForeArm", own(side, "Arm", "ForeArm")),
            ("ForeArm", "Hand", own(side, "ForeArm", "Hand")),
        ] {
            bones.push((format!("{side}{from}"), format!("{side}{to}"), along));
        }
    }
    for name in ["t_pose.bvh", "every_bone_along_x.bvh", "feet_raised.bvh", "facing_45.bvh", "prone.bvh"] {
        let frames = of_file(&std::fs::read_to_string(fixture(name)).unwrap());
        for (index, (places, frame)) in frames.iter().zip(&clip(name).frames).enumerate() {
            let turns = of_parameters(frame);
            let hips = places["LeftUpLeg"].place - places["RightUpLeg"].place;
            assert!((turns[0] * DVec3::X).angle_between(hips).to_degrees() < CLOSE, "{name}, frame {index}");
            for (from, to, along) in &bones {
                let lies = places[to].place - places[from].place;
                let off = (turns[joint_of(from)] * along).angle_between(lies).to_degrees();
                assert!(off < CLOSE, "{name}, frame {index}, {from}: {off:.1} degrees off");
            }
        }
    }
}
