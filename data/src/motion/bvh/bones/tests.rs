use glam::DVec3;

use super::*;

/// A skeleton from `Hips(Spine(Neck),LeftUpLeg)`; every bone is as long, but those whose name ends in `*` have no length.
fn skeleton(text: &str) -> Vec<Joint> {
    let (mut joints, mut open): (Vec<Joint>, Vec<usize>) = (Vec::new(), Vec::new());
    for word in text.split_inclusive(['(', ')', ',']) {
        let name = word.trim_matches(['(', ')', ',', ' ', '\n']);
        if !name.is_empty() {
            let offset = if name.ends_with('*') { DVec3::ZERO } else { DVec3::Y };
            let name = name.trim_end_matches('*').to_owned();
            joints.push(Joint { name, parent: open.last().copied(), offset, channels: Vec::new(), first_channel: 0 });
        }
        match word.chars().last() {
            Some('(') => open.push(joints.len() - 1),
            Some(')') => drop(open.pop()),
            _ => {}
        }
    }
    joints
}

/// The bones' names by joint.
fn mapped(text: &str) -> BTreeMap<&'static str, String> {
    let joints = skeleton(text);
    let bones = recognised(&joints);
    let names = smplx::skeleton().joints.iter().map(String::as_str);
    bones.iter().zip(names).filter_map(|(bone, joint)| Some((joint, joints[(*bone)?].name.clone()))).collect()
}

/// The joints must have these bones, and no others.
fn assert_maps(text: &str, expected: &[(&str, &str)]) {
    let found = mapped(text);
    let found: Vec<(&str, &str)> = found.iter().map(|(joint, bone)| (*joint, bone.as_str())).collect();
    let mut expected = expected.to_vec();
    expected.sort_unstable();
    assert_eq!(found, expected, "{text}");
}

/// The bones of a person: of the trunk from the pelvis to the head, then of a left arm and a left leg; those on the right are
/// named alike.
fn person(
    trunk: [&str; 6],
    arm: [&str; 4],
    leg: [&str; 4],
    right: impl Fn(&str) -> String,
) -> (String, Vec<(&'static str, String)>) {
    let limb = |bones: [&str; 4]| format!("{}({}({}({})))", bones[0], bones[1], bones[2], bones[3]);
    let both = |bones: [&str; 4]| {
        let other = bones.map(&right);
        format!("{},{}", limb(bones), limb(other.each_ref().map(String::as_str)))
    };
    let [pelvis, spine1, spine2, spine3, neck, head] = trunk;
    let text = format!("{pelvis}({spine1}({spine2}({spine3}({neck}({head}),{}))),{})", both(arm), both(leg));
    let mut expected: Vec<(&'static str, String)> =
        ["pelvis", "spine1", "spine2", "spine3", "neck", "head"].into_iter().zip(trunk.map(str::to_owned)).collect();
    let left = [
        ["left_collar", "left_shoulder", "left_elbow", "left_wrist"],
        ["left_hip", "left_knee", "left_ankle", "left_foot"],
    ];
    let others = [
        ["right_collar", "right_shoulder", "right_elbow", "right_wrist"],
        ["right_hip", "right_knee", "right_ankle", "right_foot"],
    ];
    for ((joints, others), bones) in left.into_iter().zip(others).zip([arm, leg]) {
        for ((joint, other), bone) in joints.into_iter().zip(others).zip(bones) {
            expected.push((joint, bone.to_owned()));
            expected.push((other, right(bone)));
        }
    }
    (text, expected)
}

#[test]
fn the_conventions_of_common_skeletons_are_known() {
    let mixamo = [
        ["Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"],
        ["LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", "", ""],
        ["LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase", "", ""],
    ];
    let prefixed = |prefix: &str| mixamo.map(|names| names.map(|name| format!("{prefix}{name}")));
    let mut conventions: Vec<[[String; 6]; 3]> =
        ["", "mixamorig:", "Character1_", "Armature|", "Take1:Actor01_"].map(prefixed).to_vec();
    conventions.push(mixamo.map(|names| names.map(str::to_lowercase)));
    conventions.push(mixamo.map(|names| names.map(str::to_uppercase)));
    let others = [
        // MakeHuman
        [
            ["root", "spine05", "spine03", "spine01", "neck01", "head"],
            ["clavicle.L", "upperarm01.L", "lowerarm01.L", "wrist.L", "", ""],
            ["upperleg01.L", "lowerleg01.L", "foot.L", "toe1-1.L", "", ""],
        ],
        // Poser and Daz, MocapNET
        [
            ["hip", "abdomen", "chest", "chest2", "neck", "head"],
            ["lCollar", "lShldr", "lForeArm", "lHand", "", ""],
            ["lThigh", "lShin", "lFoot", "lToe", "", ""],
        ],
        [
            ["hip", "abdomen", "chest", "chest2", "neck", "head"],
            ["lcollar", "lshoulder", "lelbow", "lhand", "", ""],
            ["lhip", "lknee", "lfoot", "ltoe", "", ""],
        ],
        [
            ["hip", "abdomenLower", "abdomenUpper", "chestLower", "neckLower", "head"],
            ["lCollar", "lShldrBend", "lForearmBend", "lHand", "", ""],
            ["lThighBend", "lShin", "lFoot", "lToe", "", ""],
        ],
        // VRM
        [
            ["J_Bip_C_Hips", "J_Bip_C_Spine", "J_Bip_C_Chest", "J_Bip_C_UpperChest", "J_Bip_C_Neck", "J_Bip_C_Head"],
            ["J_Bip_L_Shoulder", "J_Bip_L_UpperArm", "J_Bip_L_LowerArm", "J_Bip_L_Hand", "", ""],
            ["J_Bip_L_UpperLeg", "J_Bip_L_LowerLeg", "J_Bip_L_Foot", "J_Bip_L_ToeBase", "", ""],
        ],
        // Unity
        [
            ["Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"],
            ["LeftShoulder", "LeftUpperArm", "LeftLowerArm", "LeftHand", "", ""],
            ["LeftUpperLeg", "LeftLowerLeg", "LeftFoot", "LeftToes", "", ""],
        ],
        // Unreal
        [
            ["pelvis", "spine_01", "spine_02", "spine_03", "neck_01", "head"],
            ["clavicle_l", "upperarm_l", "lowerarm_l", "hand_l", "", ""],
            ["thigh_l", "calf_l", "foot_l", "ball_l", "", ""],
        ],
        // Biped
        [
            ["Bip01 Pelvis", "Bip01 Spine", "Bip01 Spine1", "Bip01 Spine2", "Bip01 Neck", "Bip01 Head"],
            ["Bip01 L Clavicle", "Bip01 L UpperArm", "Bip01 L Forearm", "Bip01 L Hand", "", ""],
            ["Bip01 L Thigh", "Bip01 L Calf", "Bip01 L Foot", "Bip01 L Toe0", "", ""],
        ],
        // Rigify
        [
            ["DEF-spine", "DEF-spine.001", "DEF-spine.002", "DEF-spine.003", "DEF-spine.004", "DEF-spine.006"],
            ["DEF-shoulder.L", "DEF-upper_arm.L", "DEF-forearm.L", "DEF-hand.L", "", ""],
            ["DEF-thigh.L", "DEF-shin.L", "DEF-foot.L", "DEF-toe.L", "", ""],
        ],
        // Kinect for Azure
        [
            ["PELVIS", "SPINE_NAVEL", "SPINE_CHEST", "SPINE_TOP", "NECK", "HEAD"],
            ["CLAVICLE_LEFT", "SHOULDER_LEFT", "ELBOW_LEFT", "WRIST_LEFT", "", ""],
            ["HIP_LEFT", "KNEE_LEFT", "ANKLE_LEFT", "FOOT_LEFT", "", ""],
        ],
        // Kinect
        [
            ["SpineBase", "SpineMid", "SpineHigh", "SpineShoulder", "Neck", "Head"],
            ["CollarLeft", "ShoulderLeft", "ElbowLeft", "WristLeft", "", ""],
            ["HipLeft", "KneeLeft", "AnkleLeft", "FootLeft", "", ""],
        ],
        // Xsens
        [
            ["Hips", "Chest", "Chest2", "Chest3", "Neck", "Head"],
            ["LeftCollar", "LeftShoulder", "LeftElbow", "LeftWrist", "", ""],
            ["LeftHip", "LeftKnee", "LeftAnkle", "LeftToe", "", ""],
        ],
        // OptiTrack
        [
            ["Skeleton_Hip", "Skeleton_Ab", "Skeleton_Waist", "Skeleton_Chest", "Skeleton_Neck", "Skeleton_Head"],
            ["Skeleton_LShoulder", "Skeleton_LUArm", "Skeleton_LFArm", "Skeleton_LHand", "", ""],
            ["Skeleton_LThigh", "Skeleton_LShin", "Skeleton_LFoot", "Skeleton_LToe", "", ""],
        ],
        // SMPL
        [
            ["m_avg_Pelvis", "m_avg_Spine1", "m_avg_Spine2", "m_avg_Spine3", "m_avg_Neck", "m_avg_Head"],
            ["m_avg_L_Collar", "m_avg_L_Shoulder", "m_avg_L_Elbow", "m_avg_L_Wrist", "", ""],
            ["m_avg_L_Hip", "m_avg_L_Knee", "m_avg_L_Ankle", "m_avg_L_Foot", "", ""],
        ],
        // Rokoko
        [
            ["Hips", "Spine1", "Spine2", "Spine3", "Neck", "Head"],
            ["LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", "", ""],
            ["LeftThigh", "LeftShin", "LeftFoot", "LeftToe", "", ""],
        ],
        // MikuMikuDance in English
        [
            ["center", "waist", "upper body", "upper body2", "neck", "head"],
            ["shoulder_L", "arm_L", "elbow_L", "wrist_L", "", ""],
            ["leg_L", "knee_L", "ankle_L", "toe_L", "", ""],
        ],
        // AdvancedSkeleton
        [
            ["Root_M", "Spine1_M", "Spine2_M", "Chest_M", "Neck_M", "Head_M"],
            ["Scapula_L", "Shoulder_L", "Elbow_L", "Wrist_L", "", ""],
            ["Hip_L", "Knee_L", "Ankle_L", "Toes_L", "", ""],
        ],
    ];
    conventions.extend(others.map(|parts| parts.map(|names| names.map(str::to_owned))));
    let right = |name: &str| {
        let mut name = name.replace("Left", "Right").replace("LEFT", "RIGHT").replace("left", "right");
        for (left, right) in [
            (".L", ".R"),
            ("_L_", "_R_"),
            (" L ", " R "),
            ("_LS", "_RS"),
            ("_LU", "_RU"),
            ("_LF", "_RF"),
            ("_LH", "_RH"),
            ("_LT", "_RT"),
        ] {
            name = name.replace(left, right);
        }
        name = name.strip_suffix("_l").map_or(name.clone(), |start| format!("{start}_r"));
        name = name.strip_suffix("_L").map_or(name.clone(), |start| format!("{start}_R"));
        match name.strip_prefix('l') {
            Some(rest) if !rest.starts_with("ower") && !name.ends_with("_R") => format!("r{rest}"),
            _ => name,
        }
    };
    for [trunk, arm, leg] in &conventions {
        let four = |names: &'_ [String; 6]| -> [String; 4] { std::array::from_fn(|place| names[place].clone()) };
        let (arm, leg) = (four(arm), four(leg));
        let (text, expected) = person(
            trunk.each_ref().map(String::as_str),
            arm.each_ref().map(String::as_str),
            leg.each_ref().map(String::as_str),
            right,
        );
        let expected: Vec<(&str, &str)> = expected.iter().map(|(joint, bone)| (*joint, bone.as_str())).collect();
        assert_maps(&text, &expected);
    }
}

#[test]
fn smplx_names_are_their_own_joints() {
    fn text(joint: usize) -> String {
        let skeleton = smplx::skeleton();
        let is_child = |child: &usize| skeleton.parents[*child] == Some(joint);
        let children: Vec<String> = (0..skeleton.joints.len()).filter(is_child).map(text).collect();
        let name = &skeleton.joints[joint];
        if children.is_empty() { name.clone() } else { format!("{name}({})", children.join(",")) }
    }
    let found = mapped(&text(0));
    assert_eq!(found.len(), smplx::skeleton().joints.len());
    assert!(found.iter().all(|(joint, bone)| joint == bone), "{found:?}");
}

const LEGS: &str = "LeftUpLeg(LeftLeg(LeftFoot)),RightUpLeg(RightLeg(RightFoot))";
const ARMS: &str = "LeftShoulder(LeftArm(LeftForeArm)),RightShoulder(RightArm(RightForeArm))";

/// The bones of the joints named.
fn bones_of<'a>(text: &str, joints: &[&'a str]) -> Vec<(&'a str, String)> {
    let found = mapped(text);
    joints.iter().map(|joint| (*joint, found.get(joint).cloned().unwrap_or_default())).collect()
}

fn assert_bones(text: &str, expected: &[(&str, &str)]) {
    let joints: Vec<&str> = expected.iter().map(|(joint, _)| *joint).collect();
    let found = bones_of(text, &joints);
    let found: Vec<(&str, &str)> = found.iter().map(|(joint, bone)| (*joint, bone.as_str())).collect();
    assert_eq!(found, expected, "{text}");
}

// A helper may stand above its joint, in its joint's place, or in the joint's place below it; LowerBack has no length.
#[test]
fn helper_bones_leave_the_joints_what_they_are() {
    assert_bones(
        &format!(
            "Hips(LHipJoint*(LeftUpLeg(LeftLeg)),RHipJoint*(RightUpLeg(RightLeg)),LowerBack*(Spine(Spine1(Spine2(Neck(Neck1(Head)),{ARMS})))))"
        ),
        &[
            ("pelvis", "Hips"),
            ("left_hip", "LeftUpLeg"),
            ("spine1", "Spine"),
            ("spine2", "Spine1"),
            ("spine3", "Spine2"),
            ("neck", "Neck"),
            ("head", "Head"),
        ],
    );
    assert_bones(
        &format!("reference(Hips(Pelvis*({LEGS},Spine(Spine1(Spine2(turn*(neck_01*(Neck(Head(Skull*))),{ARMS})))))))"),
        &[("pelvis", "Pelvis"), ("spine3", "turn"), ("neck", "Neck"), ("head", "Skull"), ("left_shoulder", "LeftArm")],
    );
    assert_bones(
        &format!("CC_Base_Hip(CC_Base_Pelvis({LEGS}),CC_Base_Waist(Spine01(Spine02(NeckTwist01(Head),{ARMS}))))"),
        &[("pelvis", "CC_Base_Hip"), ("spine1", "CC_Base_Waist"), ("neck", "NeckTwist01")],
    );
    assert_bones(
        &format!("Hips({LEGS},Spine(Neck(Head(__jaw(jaw))),{ARMS}))"),
        &[("jaw", "jaw"), ("spine2", "Spine"), ("neck", "Neck"), ("head", "Head")],
    );
    assert_bones(
        "root(pelvis.L(upperleg01.L(upperleg02.L(lowerleg01.L(foot.L)))),pelvis.R(upperleg01.R(lowerleg01.R)),\
         spine05(clavicle.L(shoulder01.L(upperarm01.L(upperarm02.L(lowerarm01.L)))),clavicle.R(upperarm01.R(lowerarm01.R))))",
        &[
            ("pelvis", "root"),
            ("left_hip", "upperleg01.L"),
            ("left_collar", "clavicle.L"),
            ("left_shoulder", "upperarm01.L"),
        ],
    );
}

#[test]
fn fingers_are_known_by_name_by_number_and_by_phalanx() {
    for (names, expected) in [
        ("LeftHandThumb1,LeftHandIndex2,LeftHandPinky3", ["LeftHandThumb1", "LeftHandIndex2", "LeftHandPinky3"]),
        ("lThumb1,lMid1,lIndex2,lPinky3", ["lThumb1", "lIndex2", "lPinky3"]),
        (
            "Bip01 L Finger0,Bip01 L Finger11,Bip01 L Finger42,Bip01 L Hand",
            ["Bip01 L Finger0", "Bip01 L Finger11", "Bip01 L Finger42"],
        ),
        ("finger1-1.L,finger2-2.L,finger5-3.L", ["finger1-1.L", "finger2-2.L", "finger5-3.L"]),
        (
            "Left Thumb Proximal,Left Index Intermediate,Left Little Distal",
            ["Left Thumb Proximal", "Left Index Intermediate", "Left Little Distal"],
        ),
        (
            "leftThumbMetacarpal,leftThumbProximal,leftIndexIntermediate,leftLittleDistal",
            ["leftThumbMetacarpal", "leftIndexIntermediate", "leftLittleDistal"],
        ),
        ("thumb.01.L,f_index.02.L,f_pinky.03.L", ["thumb.01.L", "f_index.02.L", "f_pinky.03.L"]),
        ("index_metacarpal_l,thumb_01_l,index_02_l,pinky_03_l", ["thumb_01_l", "index_02_l", "pinky_03_l"]),
        ("LeftThumb0,LeftIndex1,LeftPinky2", ["LeftThumb0", "LeftIndex1", "LeftPinky2"]),
    ] {
        let joints = ["left_thumb1", "left_index2", "left_pinky3"];
        let expected: Vec<(&str, &str)> = joints.into_iter().zip(expected).collect();
        assert_bones(&format!("Hips({names})"), &expected);
    }
}

#[test]
fn a_map_that_names_nothing_is_refused() {
    let joints = skeleton("Hips");
    let map = |pairs: &[(&str, &str)]| {
        declared(&joints, &pairs.iter().map(|(bone, joint)| (bone.to_string(), joint.to_string())).collect())
    };
    assert_eq!(map(&[("Hips", "pelvis")]).unwrap()[0], Some(0));
    assert!(map(&[("Hip", "pelvis")]).unwrap_err().to_string().contains("Hips"));
    assert!(map(&[("Hips", "pelves")]).unwrap_err().to_string().contains("left_hip"));
}

#[test]
fn a_draft_of_a_map_has_every_bone() {
    let joints = skeleton("Hips(Tail)");
    let draft = draft(&joints, &recognised(&joints));
    assert_eq!(draft, ["\"Hips\" = \"pelvis\"", "# \"Tail\" = \"\""]);
}
