//! All loss terms and every parameter gradient of one training step against float64 vectors
//! (`tests/golden/scan_step.safetensors`), in f64.

use std::collections::HashMap;

use candle_core::{DType, Device, Tensor};
use glam::Vec3;
use xavatar::body::smplx;
use xavatar::config::{Config, FieldSettings, SkinningSettings, SkinningShape};
use xavatar::fields::{Condition, Fields, PerField, Skinning};
use xavatar::train::losses::{Anchors, CanonicalBatch, LossEvaluator, WeightTargets};
use xavatar_network::{GeometryShape, KinematicTree, ParameterLayout, Representation, SkinningField, TextureShape};

struct Golden(HashMap<String, Tensor>);

impl Golden {
    fn get(&self, name: &str) -> Vec<f64> {
        self.0[name].to_dtype(DType::F64).unwrap().flatten_all().unwrap().to_vec1().unwrap()
    }

    fn points(&self, name: &str) -> Vec<[f64; 3]> {
        self.get(name).as_chunks().0.to_vec()
    }

    fn parameters(&self, prefix: &str, layout: &ParameterLayout) -> Vec<f64> {
        let entries = layout.entries().iter();
        let names = entries.map(|entry| {
            let name = entry.name.replace("lin_p0.weight", "embed.w").replace("lin_p0.bias", "embed.b");
            name.replace("lin", "").replace("weight_", "").replace("bias", "b")
        });
        names.flat_map(|name| self.get(&format!("{prefix}.{name}"))).collect()
    }
}

fn layout_of_skinning(shape: &SkinningShape) -> ParameterLayout {
    let tree = KinematicTree::new(&smplx::skeleton().parents).unwrap();
    let field = SkinningField::<f64>::new(tree, shape.depth, shape.width, shape.frequencies, shape.blend.into());
    field.unwrap().mlp().layout().clone()
}

#[test]
fn losses_and_gradients_match() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/scan_step.safetensors");
    let golden = Golden(candle_core::safetensors::load(path, &Device::Cpu).unwrap());
    let skinning = SkinningShape { depth: 4, width: 64, frequencies: 0, blend: 20 };
    let settings = FieldSettings {
        representation: Representation::Occupancy,
        geometry: GeometryShape { depth: 8, width: 48, frequencies: 4, skip: Some(4), embedded: 16, grid: None },
        texture: TextureShape {
            depth: 8,
            width: 72,
            frequencies: 4,
            skip: Some(4),
            grid: None,
            normal: true,
            features: true,
        },
        skinning: SkinningSettings::Network(skinning.clone()),
        condition_dropout: 0.0,
    };
    let condition = Condition::new(smplx::skeleton(), smplx::EXPRESSIONS);
    let learned = Skinning::network(&skinning, smplx::skeleton()).unwrap();
    let mut fields = Fields::<f64>::new(&settings, &condition, learned, (Vec3::NEG_ONE, Vec3::ONE)).unwrap();
    let layouts = PerField {
        geometry: ("shape", fields.geometry.mlp.layout().clone()),
        texture: ("texture", fields.texture.mlp.layout().clone()),
        skinning: ("skin", layout_of_skinning(&skinning)),
    };
    let stored = layouts.as_ref().map(|(prefix, layout)| golden.parameters(prefix, layout));
    fields.geometry.mlp.update(|target| target.copy_from_slice(&stored.geometry));
    fields.texture.mlp.update(|target| target.copy_from_slice(&stored.texture));
    fields.skinning.update(|target| target.copy_from_slice(&stored.skinning));
    let bones = golden.get("bone_transforms");
    let batch = CanonicalBatch {
        condition: golden.get("cond"),
        bones: bones.chunks_exact(16).map(|bone| std::array::from_fn(|index| bone[index])).collect(),
        off_points: golden.points("x_canonical_off"),
        off_targets: golden.get("occupancy"),
        on_points: golden.points("x_canonical_on"),
        on_normals: golden.points("normal"),
        on_colours: golden.points("colour"),
        anchors: Anchors {
            bone_points: golden.points("bone_points"),
            joint_weights: WeightTargets {
                points: golden.points("joint_points"),
                weights: golden.get("joint_weights"),
            },
            surface_weights: WeightTargets {
                points: golden.points("surface_points"),
                weights: golden.get("surface_weights"),
            },
            eikonal_points: golden.points("x_canonical_on"),
            ..Anchors::default()
        },
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
        let gradients = evaluator.sum_gradients(&fields, &mut []).to_vecs().named();
        for ((_, (prefix, layout)), (_, found)) in layouts.as_ref().named().into_iter().zip(gradients) {
            let expected = golden.parameters(&format!("d_total.{prefix}"), layout);
            let scale = expected.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
            for entry in layout.entries() {
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
