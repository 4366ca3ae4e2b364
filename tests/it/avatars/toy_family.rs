//! A family of one body: a tube with round ends, three joints along it, no hands and no face, one shape coefficient (length).
//!
//! Y up, metres. What a family's file in the library has to say, said here from outside it.

use std::path::Path;

use glam::Vec3;
use xavatar::body::{
    Anatomy, BlendShapes, BodyModel, Correctives, JointBasis, PartGroup, Pose, PoseAxisAngle, Role, Skeleton, skin,
};
use xavatar::data::{FrameId, ScanFrame};
use xavatar::mesh::{Colouring, TriangleMesh};

/// Where the joints are on the axis.
const JOINTS: [f32; 3] = [0.0, 0.3, 0.6];
const LENGTH: f32 = 0.9;
const RADIUS: f32 = 0.1;
/// What is worn over it.
const CLOTHES: f32 = 0.006;
/// How much longer a unit of the shape coefficient makes it.
const STRETCH: f32 = 0.1;
/// Over which length a joint's weight gives way to the next one's.
const BLEND: f32 = 0.2;

pub fn skeleton() -> Skeleton {
    Skeleton {
        family: "toy".into(),
        joints: ["base", "middle", "tip"].map(str::to_owned).into(),
        parents: vec![None, Some(0), Some(1)],
        parts: vec![PartGroup {
            name: "tube".into(),
            role: Role::Body,
            joints: vec![0, 1, 2],
            starts: vec![0, 1, 2],
            detail: None,
        }],
        starts: vec![0, 1, 2],
        canonical: [0.0, 0.1, 0.0].map(|angle| PoseAxisAngle(Vec3::Z * angle)).into(),
        conditioning: vec![1, 2],
    }
}

pub fn model() -> BodyModel {
    let mesh = tube(RADIUS, 0.0, [28, 24]);
    let longer: Vec<f32> = mesh.vertices.iter().flat_map(|vertex| [0.0, STRETCH * vertex.y, 0.0]).collect();
    let anatomy = Anatomy {
        skeleton: skeleton(),
        skinning_weights: mesh.vertices.iter().flat_map(|vertex| weights(vertex.y)).collect(),
        template: mesh.vertices,
        faces: mesh.faces,
        shapes: BlendShapes::from_columns(&longer, 1, 0..1),
        expressions: 0,
        joints: JointBasis {
            template: JOINTS.map(|y| (Vec3::Y * y).as_dvec3()).into(),
            directions: vec![JOINTS.map(|y| (Vec3::Y * STRETCH * y).as_dvec3()).into()],
        },
        correctives: Correctives::None,
        hands: Vec::new(),
    };
    BodyModel::assemble(Path::new("the toy family"), anatomy).unwrap()
}

/// The tube bent by two angles about two axes, somewhere.
pub fn bent(shape: f32, angles: [f32; 2], translation: Vec3) -> Pose {
    let mut pose = Pose { translation, ..skeleton().rest_pose().in_shape(&[shape]) };
    pose.rotations[1] = PoseAxisAngle(Vec3::Z * angles[0]);
    pose.rotations[2] = PoseAxisAngle(Vec3::new(0.0, 0.6, 0.8) * angles[1]);
    pose
}

/// What a scanner sees of it in a pose: a striped cover a little off its surface.
pub fn scan(model: &BodyModel, split: &str, number: u32, pose: &Pose) -> ScanFrame {
    let mut scan = tube(RADIUS + CLOTHES, pose.shape[0], [56, 48]);
    let rest = |y: f32| y / (1.0 + STRETCH * pose.shape[0]);
    let weights: Vec<f32> = scan.vertices.iter().flat_map(|vertex| weights(rest(vertex.y))).collect();
    let stripe = |vertex: &Vec3| if (12.0 * vertex.y).rem_euclid(1.0) < 0.5 { [200, 60, 40] } else { [40, 90, 160] };
    scan.colouring = Colouring::Vertex(scan.vertices.iter().map(stripe).collect());
    skin(&mut scan.vertices, &weights, &model.pose(pose).unwrap().bone_transforms);
    scan.vertices.iter_mut().for_each(|vertex| *vertex += pose.translation);
    scan.normals = Some(scan.vertex_normals());
    let id = FrameId { split: split.into(), sequence: "Bend1".into(), number };
    ScanFrame { id, scan, parameters: pose.clone().into(), unseen_parts: Vec::new(), notes: Vec::new() }
}

/// The weights of the three joints at a height of the mean shape.
fn weights(y: f32) -> [f32; 3] {
    let above = |joint: f32| {
        let share = ((y - joint) / BLEND + 0.5).clamp(0.0, 1.0);
        share * share * (3.0 - 2.0 * share)
    };
    let [middle, tip] = [above(JOINTS[1]), above(JOINTS[2])];
    [1.0 - middle, middle * (1.0 - tip), middle * tip]
}

/// A tube with half balls as ends, in rings around the axis; `stretched` along it.
fn tube(radius: f32, stretched: f32, [rings, sectors]: [u32; 2]) -> TriangleMesh {
    // Along the profile from pole to pole: a quarter circle, the side, a quarter circle.
    let quarter = std::f32::consts::FRAC_PI_2 * radius;
    let profile = |share: f32| {
        let along = share * (2.0 * quarter + LENGTH);
        let (angle, y) = match along {
            along if along < quarter => (along / radius - std::f32::consts::FRAC_PI_2, 0.0),
            along if along < quarter + LENGTH => (0.0, along - quarter),
            along => ((along - quarter - LENGTH) / radius, LENGTH),
        };
        [radius * angle.cos(), y + radius * angle.sin()]
    };
    let place = |ring: u32, sector: u32| {
        let [out, y] = profile(ring as f32 / rings as f32);
        let (sin, cos) = (std::f32::consts::TAU * sector as f32 / sectors as f32).sin_cos();
        Vec3::new(out * sin, y * (1.0 + STRETCH * stretched), out * cos)
    };
    let mut vertices = vec![place(0, 0), place(rings, 0)];
    vertices.extend((1..rings).flat_map(|ring| (0..sectors).map(move |sector| place(ring, sector))));
    let index = |ring: u32, sector: u32| match ring {
        0 => 0,
        ring if ring == rings => 1,
        ring => 2 + (ring - 1) * sectors + sector % sectors,
    };
    let quads = (0..rings).flat_map(|ring| (0..sectors).map(move |sector| (ring, sector)));
    let faces = quads.flat_map(|(ring, sector)| {
        let [a, b] = [index(ring, sector), index(ring, sector + 1)];
        let [c, d] = [index(ring + 1, sector), index(ring + 1, sector + 1)];
        [[a, b, d], [a, d, c]]
    });
    let faces = faces.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    TriangleMesh { vertices, faces, ..TriangleMesh::default() }
}
