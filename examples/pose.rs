//! Loads an avatar and poses it: one frame as exact as it gets, then many with the same faces.
//!
//!     cargo run --release --example train -- runs/example
//!     cargo run --release --example pose -- runs/example posed.ply

use std::path::PathBuf;

use glam::Vec3;
use xavatar::avatar::{Animator, Avatar, FixedTopology};
use xavatar::body::PoseAxisAngle;
use xavatar::mesh::write_ply;
use xavatar::synthetic::BuiltInSubject;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1).map(PathBuf::from);
    let (avatar, out) = arguments.next().zip(arguments.next()).ok_or("give an avatar and a .ply to write")?;
    let avatar = Avatar::load(&avatar)?;
    // For a subject of your own: `BodyModel::load` and `PartLabels::find`.
    let subject = BuiltInSubject::new()?;

    // The T-pose, with the left arm raised by half a right angle and the mouth open. Rotations are axis times angle, radians.
    let skeleton = &avatar.subject.skeleton;
    let joint = |name: &str| skeleton.joint(name).ok_or("no such joint");
    let (shoulder, jaw) = (joint("left_shoulder")?, joint("jaw")?);
    let mut pose = skeleton.rest_pose();
    pose.rotations[shoulder] = PoseAxisAngle(Vec3::Z * std::f32::consts::FRAC_PI_4);
    pose.rotations[jaw] = PoseAxisAngle(Vec3::X * 0.2);

    // Searches canonical correspondences of every lattice point: the union of all, without hidden surfaces.
    let animator = Animator::new(&avatar, subject.model(), subject.part_labels())?;
    let mesh = animator.extract(&pose, 96)?.mesh;
    write_ply(&out, &mesh)?;
    println!("{}: {} vertices, {} faces", out.display(), mesh.vertices.len(), mesh.faces.len());

    // One canonical mesh, skinned to each pose: fast, and the same faces in every frame.
    let topology = FixedTopology::new(&avatar, subject.model(), 96)?;
    for degrees in [0.0_f32, 30.0, 60.0] {
        pose.rotations[shoulder] = PoseAxisAngle(Vec3::Z * degrees.to_radians());
        let highest = topology.pose(&pose)?.vertices.iter().map(|vertex| vertex.y).fold(f32::MIN, f32::max);
        println!("arm at {degrees:2} degrees: {highest:.2} m high");
    }
    Ok(())
}
