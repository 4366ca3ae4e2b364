//! Feet that the ground presses, of people who stand: what is learned, kept, written and read.

use std::path::Path;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::{DVec3, Vec3};
use xavatar_body::{Anatomy, BlendShapes, BodyModel, Correctives, JointBasis, PartGroup, Pose, Skeleton, smpl};
use xavatar_formats::{Array, ArrayData, ArrayMap};
use xavatar_learned::evaluation::{OnGround, evaluate};
use xavatar_learned::feet::{Feet, FeetTraining, TrainedFeet};
use xavatar_learned::kept::Kept;
use xavatar_learned::population::Population;
use xavatar_learned::registrations::Registrations;

use super::tube::written;

const JOINTS: [(&str, Option<usize>, [f64; 3]); 7] = [
    ("pelvis", None, [0.0, 0.9, 0.0]),
    ("left_knee", Some(0), [0.1, 0.5, 0.0]),
    ("right_knee", Some(0), [-0.1, 0.5, 0.0]),
    ("left_ankle", Some(1), [0.1, 0.08, 0.0]),
    ("right_ankle", Some(2), [-0.1, 0.08, 0.0]),
    ("left_foot", Some(3), [0.1, 0.03, 0.12]),
    ("right_foot", Some(4), [-0.1, 0.03, 0.12]),
];
/// Rings of a foot, of the shin and of the pelvis, and vertices of each.
const RINGS: [usize; 3] = [9, 3, 1];
const AROUND: usize = 10;

/// Two boots below a pelvis, each other's mirror images, which may be long and wide.
fn boots() -> BodyModel {
    let (mut template, mut weights, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    for side in [1.0, -1.0] {
        let [knee, ankle, toes] = if side > 0.0 { [1, 3, 5] } else { [2, 4, 6] };
        let mut grid =
            |rings: usize, at: &dyn Fn(f64, f64, f64) -> [f64; 3], of: &dyn Fn(&Vec3) -> [(usize, f32); 2]| {
                let first = template.len() as u32;
                for ring in 0..rings {
                    for number in 0..AROUND {
                        let angle = number as f64 / AROUND as f64 * std::f64::consts::TAU;
                        let [x, y, z] = at((ring as f64 + 0.5) / rings as f64, angle.sin(), angle.cos());
                        let place = DVec3::new(side * (0.1 + x), y, z).as_vec3();
                        let mut row = [0.0; JOINTS.len()];
                        of(&place).iter().for_each(|(joint, weight)| row[*joint] += weight);
                        weights.extend(row);
                        template.push(place);
                    }
                }
                let corner = |ring: usize, number: usize| first + (ring * AROUND + number % AROUND) as u32;
                for (ring, number) in (1..rings).flat_map(|ring| (0..AROUND).map(move |number| (ring - 1, number))) {
                    let [a, b] = [corner(ring, number), corner(ring, number + 1)];
                    let [c, d] = [corner(ring + 1, number + 1), corner(ring + 1, number)];
                    faces.extend(if side > 0.0 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
                }
            };
        // Long ellipsoids along z, flat below.
        let foot = |share: f64, sine: f64, cosine: f64| {
            let (wide, along) = (share * std::f64::consts::PI).sin_cos();
            [0.045 * wide * sine, (0.04 + 0.055 * wide * cosine).max(0.0), 0.05 - 0.13 * along]
        };
        grid(RINGS[0], &foot, &|place| {
            let share = ((place.z - 0.09) / 0.06).clamp(0.0, 1.0);
            [(ankle, 1.0 - share), (toes, share)]
        });
        let shin = |share: f64, sine: f64, cosine: f64| [0.04 * sine, 0.1 + 0.4 * share, 0.04 * cosine];
        grid(RINGS[1], &shin, &|_| [(knee, 1.0), (ankle, 0.0)]);
        let hips = |_: f64, sine: f64, cosine: f64| [0.03 * sine, 0.9 + 0.05 * cosine, 0.05 * cosine];
        grid(RINGS[2], &hips, &|_| [(0, 1.0), (knee, 0.0)]);
    }
    let scaled =
        |scale: Vec3| template.iter().flat_map(|place: &Vec3| (*place * scale).to_array()).collect::<Vec<f32>>();
    let joints = JOINTS.len();
    let anatomy = Anatomy {
        skeleton: Skeleton {
            joints: JOINTS.iter().map(|(name, ..)| (*name).into()).collect(),
            parents: JOINTS.iter().map(|(_, parent, _)| *parent).collect(),
            parts: vec![PartGroup {
                joints: (0..joints).collect(),
                starts: vec![0],
                ..smpl::skeleton().parts[0].clone()
            }],
            starts: vec![0],
            canonical: vec![Default::default(); joints],
            conditioning: (1..joints).collect(),
            family: "boots".into(),
        },
        faces,
        skinning_weights: weights,
        shapes: BlendShapes::from_directions(vec![scaled(Vec3::Z * 0.1), scaled(Vec3::new(0.03, 0.0, 0.0))]),
        expressions: 0,
        joints: JointBasis {
            template: JOINTS.iter().map(|(.., place)| DVec3::from_array(*place)).collect(),
            directions: vec![vec![DVec3::ZERO; joints]; 2],
        },
        correctives: Correctives::None,
        hands: Vec::new(),
        template,
    };
    BodyModel::assemble("boots".as_ref(), anatomy).unwrap()
}

/// People on the ground, and what was trained on those that are known.
struct Case {
    _folder: tempfile::TempDir,
    model: BodyModel,
    known: Registrations,
    unseen: Registrations,
    trained: TrainedFeet,
}

const TRAINING: FeetTraining = FeetTraining { epochs: 100, seed: 3, ground: Some(0.0) };

static CASE: LazyLock<Case> = LazyLock::new(|| {
    let population = Population { subjects: 10, poses: 30, noise: 1e-4, effect: 0.0, ground: true, seed: 2 };
    let (model, folder) = (boots(), tempfile::tempdir().unwrap());
    let truth = population.truth(&model).unwrap();
    written(&truth, &population, folder.path().join("known"), 0..8);
    written(&truth, &population, folder.path().join("unseen"), 8..10);
    let found = |name: &str| Registrations::find(&[folder.path().join(name)], model.vertex_count()).unwrap();
    let (known, unseen) = (found("known"), found("unseen"));
    let trained = TRAINING.train(&model, &known, &mut Kept::nothing(), |_, _| Ok(())).unwrap().unwrap();
    Case { _folder: folder, model, known, unseen, trained }
});

#[test]
fn people_who_were_not_trained_on_stand_nearer_to_where_they_stood() {
    let Case { model, unseen, trained, .. } = &*CASE;
    let on_ground = OnGround { feet: &trained.feet, ground: Some(0.0) };
    let found = evaluate(model, unseen, &[], Some(on_ground), None, |_| Ok(())).unwrap().feet.unwrap();
    let (touching, others) = (&found.in_contact, &found.others);
    let least = trained.held_out.iter().copied().fold(f64::MAX, f64::min);
    assert!(least < 0.95 * trained.before, "{least} of {}", trained.before);
    assert!(touching.vertices > 100 && touching.with_mm < 0.8 * touching.without_mm, "{found:?}");
    assert!(others.with_mm < others.without_mm, "{found:?}");
}

#[test]
fn a_training_that_was_stopped_ends_with_the_same_bits() {
    let Case { model, known, .. } = &*CASE;
    let training = FeetTraining { epochs: 5, ..TRAINING };
    let whole = training.train(model, known, &mut Kept::nothing(), |_, _| Ok(())).unwrap().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("body.training");
    let mut calls = 0;
    // Among the poses, and after some epochs.
    for end in [3, 14] {
        let stop = AtomicBool::new(false);
        let mut kept = Kept::in_folder(&state, "feet\n", true, &stop).unwrap();
        let stopped = training.train(model, known, &mut kept, |_, _| {
            calls += 1;
            stop.store(calls >= end, Ordering::Relaxed);
            Ok(())
        });
        assert!(stopped.unwrap().is_none(), "{end}");
    }
    let never = AtomicBool::new(false);
    let refused = |source: &str, resume: bool| Kept::in_folder(&state, source, resume, &never).unwrap_err().to_string();
    assert!(refused("feet\n", false).contains("a training that was begun"));
    assert!(refused("bones\n", true).contains("feet, expected bones"));
    let mut kept = Kept::in_folder(&state, "feet\n", true, &never).unwrap();
    let mut phases = Vec::new();
    let resumed = training.train(model, known, &mut kept, |phase, _| {
        phases.push(phase);
        Ok(())
    });
    let resumed = resumed.unwrap().unwrap();
    assert!(phases.iter().filter(|phase| **phase == "feet").count() < 5);
    assert_eq!(resumed.held_out, whole.held_out);
    assert_eq!(resumed.feet.to_arrays().unwrap(), whole.feet.to_arrays().unwrap());
    kept.remove().unwrap();
    assert!(!state.exists());
}

#[test]
fn feet_survive_their_file_and_what_cannot_be_is_named() {
    let Case { model, trained, .. } = &*CASE;
    let arrays = trained.feet.to_arrays().unwrap();
    assert!(Feet::are_in(&arrays) && !Feet::are_in(&model.to_arrays()));
    let read = |arrays: &ArrayMap| Feet::from_arrays(Path::new("body.npz"), arrays, model);
    let pose = Pose { translation: Vec3::Y * -0.004, ..model.skeleton().rest_pose() };
    let pressed = |feet: &Feet| feet.posed(model, &pose, 0.0).unwrap();
    let own = pressed(&trained.feet);
    assert_eq!(own, pressed(&read(&arrays).unwrap()));
    // On its own feet 4 mm in the ground, and far above it.
    let plain = model.pose(&pose).unwrap().vertices;
    let below = |heights: &mut dyn Iterator<Item = f64>| heights.map(|height| height.min(0.0)).sum::<f64>();
    let sunk = below(&mut plain.iter().map(|vertex| f64::from(vertex.y)));
    assert!(below(&mut own.iter().map(|vertex| vertex.y)) > 0.5 * sunk, "{sunk}");
    for name in arrays.keys() {
        let mut missing = arrays.clone();
        missing.remove(name);
        let message = read(&missing).unwrap_err().to_string();
        assert!(message.contains("body.npz") && message.contains(&format!("`{name}`")), "{name}: {message}");
    }
    for (name, value) in [
        ("foot.left.vertices", 1e6),
        ("foot.right.joints", -1.0),
        ("foot.left.mean", f64::NAN),
        ("foot.right.directions", f64::INFINITY),
        ("foot.left.4.b", f64::NAN),
    ] {
        let mut wrong = arrays.clone();
        let mut numbers = wrong[name].to_f64().unwrap();
        numbers[0] = value;
        let shape = wrong[name].shape.clone();
        wrong.insert(name.into(), Array { shape, data: ArrayData::F64(numbers) });
        let message = read(&wrong).unwrap_err().to_string();
        assert!(message.contains(&format!("`{name}`")), "{name}: {message}");
    }
}

#[test]
fn a_body_without_ankles_has_no_feet() {
    let registrations = Registrations { subjects: Vec::new(), vertices: 0 };
    let found = TRAINING.train(&super::tube::tube(), &registrations, &mut Kept::nothing(), |_, _| Ok(()));
    assert!(found.unwrap_err().to_string().contains("left_ankle"));
}
