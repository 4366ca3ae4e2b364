//! All loss terms and every parameter gradient of one training step against float64 vectors
//! (`tests/golden/scan_step.safetensors`), in f64.

use std::collections::HashMap;

use candle_core::{DType, Device, Tensor};
use glam::Vec3;
use xavatar::body::smplx;
use xavatar::config::{Config, FieldSettings, SkinningSettings, SkinningShape};
use xavatar::fields::{Condition, Fields, Skinning};
use xavatar::train::losses::{CanonicalBatch, LossEvaluator, WeightTargets};
use xavatar_network::{GeometryShape, Mlp, Representation, TextureShape};

struct Golden(HashMap<String, Tensor>);

impl Golden {
    fn get(&self, name: &str) -> Vec<f64> {
        self.0[name].to_dtype(DType::F64).unwrap().flatten_all().unwrap().to_vec1().unwrap()
    }

    fn points(&self, name: &str) -> Vec<[f64; 3]> {
        self.get(name).as_chunks().0.to_vec()
    }

    fn parameters(&self, prefix: &str, mlp: &Mlp<f64>) -> Vec<f64> {
        let entries = mlp.layout().entries().iter();
        let names = entries.map(|entry| {
            let name = entry.name.replace("lin_p0.weight", "embed.w").replace("lin_p0.bias", "embed.b");
            name.replace("lin", "").replace("weight_", "").replace("bias", "b")
        });
        names.flat_map(|name| self.get(&format!("{prefix}.{name}"))).collect()
    }
}

#[test]
fn losses_and_gradients_match() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/scan_step.safetensors");
    let golden = Golden(candle_core::safetensors::load(path, &Device::Cpu).unwrap());
    let skinning = SkinningShape { depth: 4, width: 64, frequencies: 0, blend: 20 };
    let settings = FieldSettings {
        representation: Representation::Occupancy,
        geometry: GeometryShape { depth: 8, width: 48, frequencies: 4, skip: Some(4), embedded: 16, grid: None },
        texture: TextureShape { depth: 8, width: 72, frequencies: 4, skip: Some(4), grid: None, normal: true },
        skinning: SkinningSettings::Network(skinning.clone()),
        condition_dropout: 0.0,
    };
    let condition = Condition::new(smplx::skeleton(), smplx::EXPRESSIONS);
    let skinning = Skinning::network(&skinning, smplx::skeleton()).unwrap();
    let mut fields = Fields::<f64>::new(&settings, &condition, skinning, (Vec3::NEG_ONE, Vec3::ONE)).unwrap();
    let prefixes = ["shape", "texture", "skin"];
    for (network, prefix) in fields.networks_mut().into_iter().zip(prefixes) {
        let parameters = golden.parameters(prefix, network);
        network.update(|target| target.copy_from_slice(&parameters));
    }
    let bones = golden.get("bone_transforms");
    let batch = CanonicalBatch {
        condition: golden.get("cond"),
        bones: bones.chunks_exact(16).map(|bone| std::array::from_fn(|index| bone[index])).collect(),
        off_points: golden.points("x_canonical_off"),
        off_targets: golden.get("occupancy"),
        far_points: Vec::new(),
        far_targets: Vec::new(),
        on_points: golden.points("x_canonical_on"),
        on_normals: golden.points("normal"),
        on_colours: golden.points("colour"),
        bone_points: golden.points("bone_points"),
        joint_weights: WeightTargets { points: golden.points("joint_points"), weights: golden.get("joint_weights") },
        surface_weights: WeightTargets {
            points: golden.points("surface_points"),
            weights: golden.get("surface_weights"),
        },
        volume_weights: WeightTargets::default(),
        eikonal_points: golden.points("x_canonical_on"),
        free_points: Vec::new(),
        free_bounds: Vec::new(),
        implicit_gradient: true,
    };
    assert_eq!(batch.condition.len(), condition.width());
    let losses = Config::preset("paper-scan").unwrap().losses;

    for threads in [1, 3] {
        let mut evaluator = LossEvaluator::new(&fields, threads);
        let terms = evaluator.accumulate(&fields, &batch, &losses, 1.0).unwrap();
        for (term, name) in [
            ("occupancy", "loss_bce"),
            ("normal", "loss_normal"),
            ("colour", "loss_rgb"),
            ("bone", "loss_bone"),
            ("joint", "loss_joint"),
            ("surface", "loss_surface"),
            ("total", "total"),
        ] {
            let expected = golden.get(name)[0];
            assert!((terms[term] - expected).abs() < 1e-9 * expected.abs(), "{term}: {} not {expected}", terms[term]);
        }
        let gradients = evaluator.take_gradients(&fields);
        for ((network, prefix), found) in fields.networks().into_iter().zip(prefixes).zip(&gradients) {
            let expected = golden.parameters(&format!("d_total.{prefix}"), network);
            let scale = expected.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
            for entry in network.layout().entries() {
                for index in entry.range.clone() {
                    let error = (found[index] - expected[index]).abs() / scale;
                    assert!(error < 1e-9, "{prefix}.{}: {} not {}", entry.name, found[index], expected[index]);
                }
            }
        }
    }

    let only_eikonal = xavatar::config::LossSettings {
        occupancy: 0.0,
        normal: 0.0,
        colour: 0.0,
        bone: 0.0,
        joint: 0.0,
        surface: 0.0,
        eikonal: 1.0,
        ..losses
    };
    let terms = LossEvaluator::new(&fields, 1).accumulate(&fields, &batch, &only_eikonal, 1.0).unwrap();
    let expected = golden.get("loss_eikonal")[0];
    assert!((terms["eikonal"] - expected).abs() < 1e-9 * expected, "eikonal: {} not {expected}", terms["eikonal"]);
}
