use glam::{DVec3, Vec3};

use super::*;
use crate::{Anatomy, BlendShapes, Correctives, JointBasis, smplx};

/// Rows and columns of a sheet with a bump, which is a face.
const SIDE: usize = 24;

/// The sheet of so many rows, 20 cm wide, 5 cm before the head, and its triangles.
fn sheet(side: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let place = |at: usize| {
        let [x, y] = [at % side, at / side].map(|step| step as f64 / (side - 1) as f64 - 0.5);
        DVec3::new(0.2 * x, 1.5 + 0.2 * y, 0.05 + 0.04 * (-30.0 * (x * x + y * y)).exp())
    };
    let faces = (0..side - 1).flat_map(|row| {
        (0..side - 1).flat_map(move |column| {
            let [a, b] = [row * side + column, (row + 1) * side + column].map(|corner| corner as u32);
            [[a, a + 1, b], [a + 1, b + 1, b]]
        })
    });
    ((0..side * side).map(place).collect(), faces.collect())
}

/// How far from the middle of the face something is moved.
fn bump(at: DVec3, middle: [f64; 2]) -> f64 {
    (-2000.0 * ((at.x - middle[0]).powi(2) + (at.y - middle[1]).powi(2))).exp()
}

/// A face that is a body of SMPL-X's skeleton: half of it is the jaw's, and one expression draws its left up.
fn body(side: usize, scale: f64) -> BodyModel {
    let skeleton = smplx::skeleton().clone();
    let (vertices, faces) = sheet(side);
    let count = skeleton.joints.len();
    let (head, jaw) = (skeleton.joint("head").unwrap(), skeleton.joint("jaw").unwrap());
    let mut weights = vec![0.0; vertices.len() * count];
    for (vertex, at) in vertices.iter().enumerate() {
        weights[vertex * count + if at.y < 1.49 { jaw } else { head }] = 1.0;
    }
    let drawn = vertices.iter().flat_map(|at| [0.0, (0.01 * scale * bump(*at, [0.03, 1.52])) as f32, 0.0]).collect();
    let anatomy = Anatomy {
        template: vertices.iter().map(|at| (*at * scale).as_vec3()).collect(),
        faces,
        skinning_weights: weights,
        shapes: BlendShapes::from_directions(vec![drawn]),
        expressions: 1,
        joints: JointBasis {
            template: joints().map(|joint| joint * scale).collect(),
            directions: vec![vec![DVec3::ZERO; count]],
        },
        correctives: Correctives::None,
        hands: Vec::new(),
        skeleton,
    };
    BodyModel::assemble("face.npz".as_ref(), anatomy).unwrap()
}

fn joints() -> impl Iterator<Item = DVec3> {
    smplx::skeleton().joints.iter().map(|name| match name.as_str() {
        "head" => DVec3::new(0.0, 1.5, 0.0),
        "jaw" => DVec3::new(0.0, 1.49, 0.01),
        "left_eye" => DVec3::new(0.03, 1.54, 0.05),
        "right_eye" => DVec3::new(-0.03, 1.54, 0.05),
        "neck" => DVec3::new(0.0, 1.4, 0.0),
        _ => DVec3::new(0.0, 1.0, 0.0),
    })
}

/// A jaw turned by 0.1, half of the expression, and a bump of 5 mm on the right that nothing of the body's does.
fn units() -> FaceUnits {
    let (vertices, faces) = sheet(SIDE);
    let jaw = DVec3::new(0.0, 1.49, 0.01);
    let opened = |at: &DVec3| if at.y < 1.49 { DVec3::X.cross(*at - jaw) * 0.1 } else { DVec3::ZERO };
    let drawn = |at: &DVec3| DVec3::Y * 0.005 * bump(*at, [0.03, 1.52]);
    let bumped = |at: &DVec3| DVec3::Z * 0.005 * bump(*at, [-0.03, 1.52]);
    let names = smplx::skeleton().joints.iter().cloned();
    FaceUnits {
        offsets: vec![
            ("jawOpen".into(), vertices.iter().map(opened).collect()),
            ("mouthSmileLeft".into(), vertices.iter().map(drawn).collect()),
            ("cheekPuff".into(), vertices.iter().map(bumped).collect()),
        ],
        joints: names.zip(joints()).collect(),
        vertices,
        faces,
    }
}

#[test]
fn what_expressions_and_the_jaw_do_is_found_and_the_rest_is_kept() {
    let fitted = units().fitted(&body(SIDE, 1.0), &[]).unwrap();
    let jaw = smplx::skeleton().joint("jaw").unwrap();
    let turn = |unit: &FittedUnit| unit.turns.iter().find(|(joint, _)| *joint == jaw).unwrap().1;
    assert!(turn(&fitted[0]).distance(Vec3::X * 0.1) < 1e-5 && fitted[0].error.max < 1e-5, "{:?}", fitted[0].error);
    // The prior takes a share of an expression, which the rest gives back.
    assert!((fitted[1].expression[0] - 0.5).abs() < 0.01 && fitted[1].error.max < 1e-4, "{:?}", fitted[1].error);
    assert!((fitted[2].error.max - 0.005).abs() < 2e-4 && fitted[2].error.max <= fitted[2].error.size);
    for unit in &fitted {
        assert_eq!(unit.offsets.len(), SIDE * SIDE);
        let largest = unit.offsets.iter().map(|offset| offset.length()).fold(0.0, f32::max);
        assert!((f64::from(largest) - unit.error.size).abs() < 1e-7);
    }
}

// On a finer mesh of a face that is larger by a fifth, actions are larger by as much and at the same places.
#[test]
fn actions_are_carried_to_another_mesh() {
    let (scale, finer) = (1.2, 41);
    let other = body(finer, scale);
    let carried = units().on(&other).unwrap();
    let (places, _) = sheet(finer);
    let largest = |offsets: &[DVec3]| offsets.iter().map(|offset| offset.length()).fold(0.0, f64::max);
    for (action, wanted) in carried.iter().zip(&units().offsets).skip(1) {
        assert!((largest(action) / largest(&wanted.1) - scale).abs() < 0.05, "{}", wanted.0);
    }
    for (offset, at) in carried[2].iter().zip(&places) {
        let wanted = DVec3::Z * 0.005 * scale * bump(*at, [-0.03, 1.52]);
        assert!(offset.distance(wanted) < 5e-4, "{at}: {offset}, expected {wanted}");
    }
}

#[test]
fn a_body_without_a_head_is_refused() {
    let mut anatomy = body(30, 1.0).anatomy().clone();
    for name in ["neck", "head", "jaw", "left_eye", "right_eye"] {
        let joint = anatomy.skeleton.joint(name).unwrap();
        anatomy.skeleton.joints[joint] = format!("no {name}");
    }
    let body = BodyModel::assemble("hand.npz".as_ref(), anatomy).unwrap();
    let error = units().fitted(&body, &[]).unwrap_err().to_string();
    assert!(error.contains("hand.npz") && error.contains("head"), "{error}");
}

#[test]
fn on_their_own_mesh_actions_are_what_they_are() {
    let units = units();
    for (action, (_, own)) in units.on(&body(SIDE, 1.0)).unwrap().iter().zip(&units.offsets) {
        assert_eq!(action, own);
    }
}
