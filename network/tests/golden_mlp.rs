//! Values, features, input gradients and parameter gradients of the three networks against float64 vectors
//! (`tests/golden/mlp_*.safetensors`), in f64 to 1e-9 and in f32 to 1e-4.

use std::collections::HashMap;

use candle_core::{DType, Device, Tensor};
use xavatar_network::{Backward, EncodingShape, Mlp, MlpShape, Real, Trace};

struct Golden {
    tensors: HashMap<String, Tensor>,
}

impl Golden {
    fn load(name: &str) -> Self {
        let path = format!("{}/../tests/golden/{name}.safetensors", env!("CARGO_MANIFEST_DIR"));
        Self { tensors: candle_core::safetensors::load(path, &Device::Cpu).unwrap() }
    }

    fn get(&self, name: &str) -> Vec<f64> {
        let tensor = &self.tensors[name];
        tensor.to_dtype(DType::F64).unwrap().flatten_all().unwrap().to_vec1().unwrap()
    }

    fn real<T: Real>(&self, name: &str) -> Vec<T> {
        self.get(name).into_iter().map(T::of).collect()
    }

    /// The parameters under `prefix`, or a gradient with the same names, in the order of the network's layout.
    fn parameters<T: Real>(&self, prefix: &str, mlp: &Mlp<T>) -> Vec<T> {
        let mut flat = Vec::new();
        for entry in mlp.layout().entries() {
            let name = match entry.name.as_str() {
                "lin_p0.weight" => "embed.w".to_string(),
                "lin_p0.bias" => "embed.b".to_string(),
                name => {
                    let (layer, kind) = name.strip_prefix("lin").unwrap().split_once('.').unwrap();
                    let kind = match kind {
                        "weight_v" => "v",
                        "weight_g" => "g",
                        _ => "b",
                    };
                    format!("{layer}.{kind}")
                }
            };
            let values: Vec<T> = self.real(&format!("{prefix}.{name}"));
            // The last bias does not reach the input gradient; its entry in the file is a single zero.
            flat.extend(values.iter().copied().chain(std::iter::repeat(T::zero())).take(entry.range.len()));
        }
        flat
    }
}

fn assert_close<T: Real>(what: &str, found: &[T], expected: &[T], tolerance: f64) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let scale = expected.iter().map(|value| value.wide().abs()).fold(0.0, f64::max).max(1e-30);
    for (found, expected) in found.iter().zip(expected) {
        let error = (found.wide() - expected.wide()).abs() / scale;
        assert!(error < tolerance, "{what}: {found:?} instead of {expected:?}, relative {error:e}");
    }
}

fn check<T: Real>(name: &str, shape: MlpShape, tolerance: f64) {
    let golden = Golden::load(name);
    let mut mlp = Mlp::<T>::new(shape.clone()).unwrap();
    let parameters = golden.parameters("param", &mlp);
    mlp.update(|target| target.copy_from_slice(&parameters));

    let points: Vec<T> = golden.real("x");
    let rows = points.len() / shape.inputs;
    let condition: Vec<T> = if golden.tensors.contains_key("cond") { golden.real("cond") } else { Vec::new() };
    let shared = if shape.condition > 0 { mlp.embed(&condition) } else { condition.clone() };

    let mut trace = Trace::default();
    mlp.forward(&mut trace, &points, &shared, &[]);
    assert_close("value", trace.output(), &golden.real::<T>("y"), tolerance);
    assert_close("feature", trace.features(&mlp), &golden.real::<T>("feature"), tolerance);
    let mut alone = Trace::default();
    mlp.evaluate(&mut alone, &points, &shared, &[]);
    assert_eq!((alone.output(), alone.features(&mlp)), (trace.output(), trace.features(&mlp)));

    let seed: Vec<T> = golden.real("c");
    let mut gradient = mlp.zero_gradient();
    let on_shared = mlp.backward(&mut trace, &seed, None, Backward::Parameters, &mut gradient);
    if shape.condition > 0 {
        mlp.embed_backward(&condition, &on_shared, &mut gradient);
    }
    let mut found = vec![T::zero(); mlp.layout().len()];
    mlp.parameter_gradient(&gradient, &mut found);
    assert_close("first-order gradient", &found, &golden.parameters("d_first.param", &mlp), tolerance);

    mlp.input_gradient(&mut trace, &seed);
    assert_close("input gradient", trace.gradient(), &golden.real::<T>("grad_x"), tolerance);

    // mean over rows of |n - target|^2 with n = g / |g|
    let targets: Vec<T> = golden.real("normal_target");
    let mut loss = T::zero();
    let mut on_gradient = Vec::new();
    for (g, target) in trace.gradient().chunks(shape.inputs).zip(targets.chunks(shape.inputs)) {
        let length = g.iter().map(|g| *g * *g).sum::<T>().sqrt();
        let difference: Vec<T> = g.iter().zip(target).map(|(g, t)| *g / length - *t).collect();
        loss += difference.iter().map(|d| *d * *d).sum::<T>() / T::of(rows as f64);
        let along = g.iter().zip(&difference).map(|(g, d)| *g * *d).sum::<T>() / (length * length);
        on_gradient
            .extend(g.iter().zip(&difference).map(|(g, d)| T::of(2.0 / rows as f64) * (*d - along * *g) / length));
    }
    assert_close("normal loss", &[loss], &golden.real::<T>("normal_loss"), tolerance);
    gradient.clear();
    let silent = vec![T::zero(); rows * shape.outputs];
    let on_shared = mlp.backward(&mut trace, &silent, Some(&on_gradient), Backward::Parameters, &mut gradient);
    if shape.condition > 0 {
        mlp.embed_backward(&condition, &on_shared, &mut gradient);
    }
    mlp.parameter_gradient(&gradient, &mut found);
    assert_close("second-order gradient", &found, &golden.parameters("d_second.param", &mlp), tolerance);
}

fn geometry() -> MlpShape {
    MlpShape {
        inputs: 3,
        encoding: EncodingShape::Frequencies(4),
        condition: 73,
        embedded: 16,
        row_condition: 0,
        depth: 8,
        width: 48,
        skip: Some(4),
        outputs: 1,
    }
}

fn texture() -> MlpShape {
    MlpShape { inputs: 6, condition: 0, embedded: 64, width: 72, outputs: 3, ..geometry() }
}

fn skinning() -> MlpShape {
    MlpShape {
        encoding: EncodingShape::Frequencies(0),
        condition: 0,
        embedded: 0,
        depth: 5,
        width: 24,
        skip: None,
        outputs: 59,
        ..geometry()
    }
}

#[test]
fn geometry_matches_in_double_precision() {
    check::<f64>("mlp_geometry", geometry(), 1e-9);
}

#[test]
fn texture_matches_in_double_precision() {
    check::<f64>("mlp_texture", texture(), 1e-9);
}

#[test]
fn skinning_matches_in_double_precision() {
    check::<f64>("mlp_skinning", skinning(), 1e-9);
}

#[test]
fn all_match_in_single_precision() {
    check::<f32>("mlp_geometry", geometry(), 1e-4);
    check::<f32>("mlp_texture", texture(), 1e-4);
    check::<f32>("mlp_skinning", skinning(), 1e-4);
}
