//! Forward kinematics, twice and independent of the library's: of a BVH file from its own numbers, and of SMPL-X from parameters.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};
use xavatar_body::{HandPose, PoseAxisAngle, smplx};

/// A bone of a file in a frame.
#[derive(Clone, Copy)]
pub struct Bone {
    pub turn: DQuat,
    pub place: DVec3,
}

/// The bones of every frame of a BVH file, by name. For files as simple as the fixtures': a word a blank, one root.
pub fn of_file(text: &str) -> Vec<BTreeMap<String, Bone>> {
    let mut words = text.split_whitespace();
    let mut tree: Vec<(String, Option<usize>, DVec3, Vec<String>)> = Vec::new();
    let mut open: Vec<Option<usize>> = Vec::new();
    let number = |words: &mut std::str::SplitWhitespace| words.next().unwrap().parse::<f64>().unwrap();
    loop {
        match words.next().unwrap() {
            "ROOT" | "JOINT" => {
                let parent = open.last().copied().flatten();
                tree.push((words.next().unwrap().to_owned(), parent, DVec3::ZERO, Vec::new()));
                open.push(Some(tree.len() - 1));
            }
            "End" => open.push(None),
            "OFFSET" => {
                let offset = DVec3::new(number(&mut words), number(&mut words), number(&mut words));
                if let Some(bone) = *open.last().unwrap() {
                    tree[bone].2 = offset;
                }
            }
            "CHANNELS" => {
                let count = number(&mut words) as usize;
                let bone = open.last().unwrap().unwrap();
                tree[bone].3 = (0..count).map(|_| words.next().unwrap().to_owned()).collect();
            }
            "}" => drop(open.pop()),
            "MOTION" => break,
            _ => {}
        }
    }
    let mut words = words.skip_while(|word| *word != "Time:").skip(1);
    words.next();
    let values: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
    let width = tree.iter().map(|(.., channels)| channels.len()).sum();
    let frame = |row: &[f64]| {
        let mut row = row.iter();
        let mut bones: Vec<Bone> = Vec::new();
        for (_, parent, offset, channels) in &tree {
            let (mut turn, mut place) = (DQuat::IDENTITY, *offset);
            for channel in channels {
                let value = *row.next().unwrap();
                match channel.as_str() {
                    "Xposition" => place.x = value,
                    "Yposition" => place.y = value,
                    "Zposition" => place.z = value,
                    "Xrotation" => turn *= DQuat::from_rotation_x(value.to_radians()),
                    "Yrotation" => turn *= DQuat::from_rotation_y(value.to_radians()),
                    _ => turn *= DQuat::from_rotation_z(value.to_radians()),
                }
            }
            bones.push(match parent.map(|parent| bones[parent]) {
                Some(above) => Bone { turn: above.turn * turn, place: above.place + above.turn * place },
                None => Bone { turn, place },
            });
        }
        tree.iter().map(|(name, ..)| name.clone()).zip(bones).collect()
    };
    values.chunks_exact(width).map(frame).collect()
}

/// The rotations of SMPL-X's joints in the world: those of all above a joint, composed.
pub fn of_parameters(frame: &smplx::Parameters) -> Vec<DQuat> {
    let mut world: Vec<DQuat> = Vec::new();
    for (turn, parent) in rotations(frame).into_iter().zip(&smplx::skeleton().parents) {
        let own = DQuat::from_scaled_axis(turn.0.as_dvec3());
        world.push(parent.map_or(own, |parent| world[parent] * own));
    }
    world
}

/// The name of a joint.
pub fn name(joint: usize) -> &'static str {
    &smplx::skeleton().joints[joint]
}

fn rotations(frame: &smplx::Parameters) -> [PoseAxisAngle; 55] {
    let hand = |hand: &HandPose| match hand {
        HandPose::Flat(joints) | HandPose::RelativeToMean(joints) => *joints,
        HandPose::Pca(_) => [PoseAxisAngle::default(); 15],
    };
    let (left, right) = (hand(&frame.left_hand_pose), hand(&frame.right_hand_pose));
    std::array::from_fn(|joint| match joint {
        0 => frame.global_orient,
        1..=21 => frame.body_pose[joint - 1],
        22 => frame.jaw_pose,
        23 => frame.left_eye_pose,
        24 => frame.right_eye_pose,
        25..=39 => left[joint - 25],
        _ => right[joint - 40],
    })
}
