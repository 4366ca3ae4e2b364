//! The loss terms of signed distance fields, which no golden vector covers, against central differences in f64.

use glam::Vec3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use xavatar::body::smplx;
use xavatar::config::{Config, FieldSettings, LossSettings, SkinningSettings, SkinningShape};
use xavatar::fields::{Condition, Fields, Skinning};
use xavatar::train::losses::{Anchors, CanonicalBatch, LossEvaluator, WeightTargets};
use xavatar_network::{GeometryShape, Representation, TextureShape};

const STEP: f64 = 1e-6;

fn condition() -> Condition {
    Condition::new(smplx::skeleton(), smplx::EXPRESSIONS)
}

/// Sets one parameter of one field.
type Change = fn(&mut Fields<f64>, usize, f64);

fn points(random: &mut ChaCha8Rng, count: usize) -> Vec<[f64; 3]> {
    (0..count).map(|_| std::array::from_fn(|_| random.random_range(-0.8..0.8))).collect()
}

fn weights(random: &mut ChaCha8Rng, count: usize) -> WeightTargets<f64> {
    let joints = smplx::skeleton().joints.len();
    let weights = (0..count * joints).map(|_| random.random::<f64>() / joints as f64).collect();
    WeightTargets { points: points(random, count), weights }
}

fn batch(random: &mut ChaCha8Rng) -> CanonicalBatch<f64> {
    let mut unit = |_| {
        let normal: [f64; 3] = std::array::from_fn(|_| random.random_range(-1.0..1.0));
        let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
        normal.map(|x| x / length)
    };
    let on_normals = (0..9).map(&mut unit).collect();
    let bone = |joint: usize| {
        let (sin, cos) = (0.05 * joint as f64).sin_cos();
        [cos, -sin, 0.0, 0.01 * joint as f64, sin, cos, 0.0, 0.1, 0.0, 0.0, 1.0, -0.05]
    };
    CanonicalBatch {
        condition: (0..condition().width()).map(|_| random.random_range(-0.5..0.5)).collect(),
        bones: (0..smplx::skeleton().joints.len()).map(bone).collect(),
        off_points: points(random, 12),
        off_targets: (0..12).map(|_| random.random_range(-0.5..0.5)).collect(),
        on_points: points(random, 9),
        on_normals,
        on_colours: vec![[0.5; 3]; 9],
        anchors: Anchors {
            far_points: points(random, 7),
            far_targets: vec![0.5; 7],
            bone_points: points(random, 6),
            joint_weights: weights(random, 5),
            surface_weights: weights(random, 6),
            volume_weights: weights(random, 7),
            eikonal_points: points(random, 8),
        },
        implicit_gradient: false,
    }
}

// dL/dp against (L(p + h) - L(p - h)) / 2h for every 13th parameter of the geometry and skinning fields. The colour is left
// out: its feature is detached, so the loss's difference is not its gradient.
#[test]
fn gradients_match_differences() {
    let skinning = SkinningShape { depth: 2, width: 12, frequencies: 1, blend: 5 };
    let settings = FieldSettings {
        representation: Representation::SignedDistance,
        geometry: GeometryShape { depth: 3, width: 32, frequencies: 2, skip: Some(2), embedded: 3, grid: None },
        texture: TextureShape {
            depth: 2,
            width: 40,
            frequencies: 1,
            skip: Some(1),
            grid: None,
            normal: true,
            features: true,
        },
        skinning: SkinningSettings::Network(skinning.clone()),
        condition_dropout: 0.0,
    };
    let losses = LossSettings {
        distance: 3.0,
        truncation: 0.4,
        normal: 0.7,
        colour: 0.0,
        bone: 0.3,
        joint: 1.5,
        surface: 2.0,
        volume: 0.8,
        eikonal: 0.6,
        ..Config::preset("demo").unwrap().losses
    };
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let skinning = Skinning::network(&skinning, smplx::skeleton()).unwrap();
    let mut fields = Fields::<f64>::new(&settings, &condition(), skinning, (Vec3::NEG_ONE, Vec3::ONE)).unwrap();
    fields.initialise(11);
    let batch = batch(&mut random);
    let share = 0.5;
    let mut evaluator = LossEvaluator::new(&fields, 2);
    let terms = evaluator.accumulate(&fields, &batch, &losses, share).unwrap();
    for term in ["distance", "normal", "bone", "joint", "surface", "volume", "eikonal"] {
        assert!(terms[term] > 0.0, "{term} is {}", terms[term]);
    }
    let gradients = evaluator.sum_gradients(&fields, &mut []).to_vecs();

    let of_geometry: Change = |fields, index, value| fields.geometry.mlp.update(|parameters| parameters[index] = value);
    let of_skinning: Change = |fields, index, value| fields.skinning.update(|parameters| parameters[index] = value);
    let start = fields.parameters().map(<[f64]>::to_vec);
    for (name, change, start, gradient) in [
        ("geometry", of_geometry, start.geometry, gradients.geometry),
        ("skinning", of_skinning, start.skinning, gradients.skinning),
    ] {
        let scale = gradient.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
        for index in (0..start.len()).step_by(13) {
            let mut total_at = |offset: f64| {
                change(&mut fields, index, start[index] + offset);
                LossEvaluator::new(&fields, 1).accumulate(&fields, &batch, &losses, 1.0).unwrap()["total"]
            };
            let expected = share * (total_at(STEP) - total_at(-STEP)) / (2.0 * STEP);
            total_at(0.0);
            let found = gradient[index];
            assert!((found - expected).abs() < 1e-5 * scale, "{name} parameter {index}: {found} not {expected}");
        }
    }
}
