//! BVH motions, written here from known SMPL-X parameters: another skeleton's turns must come back as those.

use std::fmt::Write;
use std::path::PathBuf;

use glam::{DQuat, DVec3, EulerRot};
use xavatar::body::{BodyParameters, HandPose, PoseAxisAngle, smplx};
use xavatar::data::{Clip, Motion, MotionOptions, RestPose, UpAxis, read_motion};

const FRAMES: usize = 3;

/// A skeleton to write: joints in SMPL-X's order and tree, at rest in a pose of its own.
struct Skeleton {
    names: Vec<String>,
    places: Vec<DVec3>,
    /// Units per metre.
    unit: f64,
}

impl Skeleton {
    /// SMPL-X's own, in centimetres.
    fn own() -> Self {
        let rest = RestPose::default();
        let places = rest.joints().iter().map(|place| place.as_dvec3()).collect();
        Self { names: smplx::skeleton().joints.clone(), places, unit: 100.0 }
    }

    /// Turned as a whole.
    fn turned(mut self, turn: DQuat) -> Self {
        self.places.iter_mut().for_each(|place| *place = turn * *place);
        self
    }

    /// With what is below a joint turned about it, at rest.
    fn bent(mut self, joint: usize, turn: DQuat) -> Self {
        let pivot = self.places[joint];
        for below in (joint + 1..self.places.len()).filter(|below| is_below(*below, joint)) {
            self.places[below] = pivot + turn * (self.places[below] - pivot);
        }
        self
    }

    /// The file: the pelvis at `path`, in metres, and the joints turned from their rest.
    fn text(&self, turns: impl Fn(usize, usize) -> DQuat, path: impl Fn(usize) -> DVec3) -> String {
        let mut text = "HIERARCHY\n".to_owned();
        self.write_joint(0, &mut text);
        writeln!(text, "MOTION\nFrames: {FRAMES}\nFrame Time: 0.0083333").unwrap();
        for frame in 0..FRAMES {
            let place = path(frame) * self.unit;
            write!(text, "{} {} {}", place.x, place.y, place.z).unwrap();
            // Written in the order in which the joints come in the file.
            for joint in self.order() {
                let (z, x, y) = turns(frame, joint).to_euler(EulerRot::ZXY);
                write!(text, " {} {} {}", z.to_degrees(), x.to_degrees(), y.to_degrees()).unwrap();
            }
            text.push('\n');
        }
        text
    }

    fn children(joint: usize) -> impl Iterator<Item = usize> {
        let parents = &smplx::skeleton().parents;
        (1..parents.len()).filter(move |child| parents[*child] == Some(joint))
    }

    fn order(&self) -> Vec<usize> {
        fn visit(joint: usize, order: &mut Vec<usize>) {
            order.push(joint);
            Skeleton::children(joint).for_each(|child| visit(child, order));
        }
        let mut order = Vec::new();
        visit(0, &mut order);
        order
    }

    fn write_joint(&self, joint: usize, text: &mut String) {
        let parent = smplx::skeleton().parents[joint].map_or(DVec3::ZERO, |parent| self.places[parent]);
        let offset = (self.places[joint] - parent) * self.unit;
        let (kind, channels) = if joint == 0 {
            ("ROOT", "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation")
        } else {
            ("JOINT", "3 Zrotation Xrotation Yrotation")
        };
        writeln!(text, "{kind} {}\n{{\nOFFSET {} {} {}", self.names[joint], offset.x, offset.y, offset.z).unwrap();
        writeln!(text, "CHANNELS {channels}").unwrap();
        Self::children(joint).for_each(|child| self.write_joint(child, text));
        if Self::children(joint).count() == 0 {
            text.push_str("End Site\n{\nOFFSET 0 1 0\n}\n");
        }
        text.push_str("}\n");
    }
}

fn is_below(joint: usize, ancestor: usize) -> bool {
    std::iter::successors(Some(joint), |joint| smplx::skeleton().parents[*joint]).any(|above| above == ancestor)
}

/// A turn for each joint and frame, up to about half a radian.
fn turn(frame: usize, joint: usize) -> DQuat {
    let component = |axis: usize| (((frame * 165 + 3 * joint + axis) % 97) as f64 - 48.0) / 120.0;
    DQuat::from_scaled_axis(DVec3::new(component(0), component(1), component(2)))
}

fn path(frame: usize) -> DVec3 {
    DVec3::new(0.1 * frame as f64, 0.9, -0.2 * frame as f64)
}

fn rotations(frame: &smplx::Parameters) -> Vec<PoseAxisAngle> {
    BodyParameters::from(frame.clone()).absolute().expect("BVH rotations are absolute").rotations
}

/// Where SMPL-X's joints are, in metres.
fn posed(frame: &smplx::Parameters) -> Vec<DVec3> {
    let rest: Vec<DVec3> = RestPose::default().joints().iter().map(|place| place.as_dvec3()).collect();
    let turns: Vec<DQuat> =
        rotations(frame).into_iter().map(|turn| DQuat::from_scaled_axis(turn.0.as_dvec3())).collect();
    fk(&rest, |joint| turns[joint], rest[0] + frame.transl.as_dvec3())
}

fn fk(rest: &[DVec3], turn: impl Fn(usize) -> DQuat, root: DVec3) -> Vec<DVec3> {
    let (mut places, mut world) = (vec![root; rest.len()], vec![DQuat::IDENTITY; rest.len()]);
    world[0] = turn(0);
    for (joint, parent) in smplx::skeleton().parents.iter().enumerate() {
        let Some(parent) = *parent else { continue };
        places[joint] = places[parent] + world[parent] * (rest[joint] - rest[parent]);
        world[joint] = world[parent] * turn(joint);
    }
    places
}

fn read(text: &str) -> xavatar::formats::Result<Motion> {
    let (_folder, path) = written(text);
    read_motion(path)
}

fn written(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("walk.bvh");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

#[test]
fn turns_of_the_same_skeleton_come_back() {
    let motion = read(&Skeleton::own().text(turn, path)).unwrap();
    assert_eq!((motion.frames.len(), motion.frames_per_second, motion.up), (FRAMES, Some(120.0), UpAxis::Y));
    for (index, frame) in motion.frames.iter().enumerate() {
        for (joint, found) in rotations(frame).into_iter().enumerate() {
            let expected = turn(index, joint).to_scaled_axis().as_vec3();
            assert!(found.0.distance(expected) < 1e-6, "frame {index}, {}: {found:?}", smplx::skeleton().joints[joint]);
        }
        let pelvis = RestPose::default().pelvis();
        assert!(frame.transl.distance(path(index).as_vec3() - pelvis) < 1e-5);
    }
    assert!(motion.notes[0].contains("55 of 55"), "{:?}", motion.notes);
    assert!(motion.notes.iter().any(|note| note.contains("1 unit is 0.0100 m")), "{:?}", motion.notes);
}

// Arms that hang at rest, legs apart: a bone of the file and SMPL-X's point the same way in every frame.
#[test]
fn bones_point_as_the_files_do_whatever_its_rest_pose() {
    let mut skeleton = Skeleton::own();
    for (joint, angle) in [(16, -1.4), (17, 1.4), (1, 0.25), (2, -0.25)] {
        skeleton = skeleton.bent(joint, DQuat::from_rotation_z(angle));
    }
    skeleton = skeleton.bent(18, DQuat::from_rotation_y(-0.4));
    let motion = read(&skeleton.text(turn, path)).unwrap();
    assert!(motion.notes.iter().any(|note| note.contains("left_shoulder 82 degrees")), "{:?}", motion.notes);
    for (index, frame) in motion.frames.iter().enumerate() {
        let file = fk(&skeleton.places, |joint| turn(index, joint), path(index));
        let found = posed(frame);
        for (from, to) in [(1, 4), (4, 7), (5, 8), (16, 18), (18, 20), (17, 19), (19, 21), (25, 26), (52, 53), (12, 15)]
        {
            let [expected, found] = [&file, &found].map(|places| (places[to] - places[from]).normalize());
            assert!(found.distance(expected) < 1e-5, "{} in frame {index}", smplx::skeleton().joints[from]);
        }
    }
}

// A skeleton that stands along Z and faces -Y (and is 1.7 times as large) is the same person.
#[test]
fn the_up_axis_the_facing_and_the_unit_are_found() {
    let to_z_up = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let mut skeleton = Skeleton::own().turned(to_z_up);
    skeleton.unit = 1.7;
    let turns = |frame: usize, joint: usize| to_z_up * turn(frame, joint) * to_z_up.inverse();
    let text = skeleton.text(turns, |frame| to_z_up * path(frame));
    let (_folder, file) = written(&text);
    assert_eq!(read_motion(&file).unwrap().up, UpAxis::Z);
    let clip = Clip::load(&file, &MotionOptions::default()).unwrap();
    let expected = read(&Skeleton::own().text(turn, path)).unwrap();
    for (found, expected) in clip.frames.iter().zip(&expected.frames) {
        for (found, expected) in rotations(found).iter().zip(rotations(expected)) {
            assert!(found.0.distance(expected.0) < 1e-5);
        }
        assert!(found.transl.distance(expected.transl) < 1e-5, "{} {}", found.transl, expected.transl);
    }
}

#[test]
fn bones_that_have_no_joint_are_reported_and_their_turns_go_on() {
    let mut skeleton = Skeleton::own();
    skeleton.names[13] = "Costume".into();
    let motion = read(&skeleton.text(turn, path)).unwrap();
    let notes = motion.notes.join("\n");
    assert!(notes.contains("54 of 55") && notes.contains("Costume"), "{notes}");
    assert!(notes.contains("follow their parents: left_collar"), "{notes}");
    let whole = read(&Skeleton::own().text(turn, path)).unwrap();
    for (found, expected) in motion.frames.iter().zip(&whole.frames) {
        let world = |frame: &smplx::Parameters| {
            let arm = [0, 3, 6, 9, 13, 16].map(|joint| DQuat::from_scaled_axis(rotations(frame)[joint].0.as_dvec3()));
            arm.into_iter().fold(DQuat::IDENTITY, |world, turn| world * turn)
        };
        assert!(world(found).angle_between(world(expected)) < 1e-5, "the upper arm is turned the same way");
    }
}

#[test]
fn bones_of_unknown_names_need_a_map() {
    let mut skeleton = Skeleton::own();
    skeleton.names = (0..skeleton.places.len()).map(|joint| format!("bone{joint}")).collect();
    let text = skeleton.text(turn, path);
    let (_folder, path) = written(&text);
    let message = read_motion(&path).unwrap_err().to_string();
    for word in ["pelvis", "left_shoulder", "map.toml", "bone17"] {
        assert!(message.contains(word), "{message}");
    }
    let map = |joints: usize| {
        let pairs = (0..joints).map(|joint| (format!("bone{joint}"), smplx::skeleton().joints[joint].clone()));
        MotionOptions { bone_map: Some(pairs.collect()), ..MotionOptions::default() }
    };
    let clip = Clip::load(&path, &map(22)).unwrap();
    assert!(clip.frames[1].body_pose[4].0.distance(turn(1, 5).to_scaled_axis().as_vec3()) < 1e-6);
    assert_eq!(clip.frames[1].left_hand_pose, HandPose::Flat(Default::default()));
    assert!(Clip::load(&path, &map(18)).unwrap_err().to_string().contains("left_elbow"));
}
