//! A body that is quick to train: a tube of five joints, and registrations of people like it.

use std::path::PathBuf;

use glam::DVec3;
use xavatar_body::{Anatomy, BlendShapes, BodyModel, Correctives, JointBasis, PartGroup, Skeleton, smpl};
use xavatar_learned::population::{Population, Truth};
use xavatar_mesh::{TriangleMesh, write_ply};

/// A chain of five joints along y in a tube of 16 rings of 12 vertices, which may be thick and long.
pub fn tube() -> BodyModel {
    let (rings, around, joints) = (16, 12, 5);
    let height = |ring: usize| ring as f32 / (rings - 1) as f32;
    let place = |ring: usize, side: usize| {
        let angle = side as f32 / around as f32 * std::f32::consts::TAU;
        glam::Vec3::new(0.1 * angle.sin(), height(ring), 0.08 * angle.cos())
    };
    let all = || (0..rings).flat_map(|ring| (0..around).map(move |side| (ring, side)));
    let template: Vec<glam::Vec3> = all().map(|(ring, side)| place(ring, side)).collect();
    let at = |ring: usize, side: usize| (ring * around + side % around) as u32;
    let faces = (0..rings - 1).flat_map(|ring| (0..around).map(move |side| (ring, side))).flat_map(|(ring, side)| {
        let [a, b, c, d] = [at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side)];
        [[a, b, c], [a, c, d]]
    });
    let weights = all().flat_map(|(ring, _)| {
        let along = height(ring) * (joints - 1) as f32;
        (0..joints).map(move |joint| (1.0 - (along - joint as f32).abs()).max(0.0))
    });
    let direction =
        |scale: glam::Vec3| template.iter().flat_map(|place| (*place * scale).to_array()).collect::<Vec<f32>>();
    let shapes = [glam::Vec3::new(0.2, 0.0, 0.2), glam::Vec3::new(0.0, 0.1, 0.0)];
    let joint = |joint: usize| DVec3::Y * (joint as f64 / (joints - 1) as f64);
    let anatomy = Anatomy {
        skeleton: Skeleton {
            joints: (0..joints).map(|joint| format!("link{joint}")).collect(),
            parents: (0..joints).map(|joint: usize| joint.checked_sub(1)).collect(),
            parts: vec![PartGroup {
                joints: (0..joints).collect(),
                starts: vec![0],
                ..smpl::skeleton().parts[0].clone()
            }],
            starts: vec![0],
            canonical: vec![Default::default(); joints],
            conditioning: (1..joints).collect(),
            family: "tube".into(),
        },
        faces: faces.collect(),
        skinning_weights: weights.collect(),
        shapes: BlendShapes::from_directions(shapes.map(direction).to_vec()),
        expressions: 0,
        joints: JointBasis {
            template: (0..joints).map(joint).collect(),
            directions: shapes.map(|scale| (0..joints).map(|of| joint(of) * scale.as_dvec3()).collect()).to_vec(),
        },
        correctives: Correctives::None,
        hands: Vec::new(),
        template,
    };
    BodyModel::assemble("tube".as_ref(), anatomy).unwrap()
}

/// Writes the registrations of some subjects.
pub fn written(truth: &Truth, population: &Population, folder: PathBuf, subjects: std::ops::Range<usize>) {
    for subject in subjects {
        for frame in 0..population.poses {
            let path = folder.join(format!("{subject:02}/{frame:03}.ply"));
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            let vertices = population.registration(truth, subject, frame).unwrap();
            let faces = truth.model.faces().to_vec();
            write_ply(path, &TriangleMesh { vertices, faces, ..TriangleMesh::default() }).unwrap();
        }
    }
}
