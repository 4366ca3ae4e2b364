//! A skinning network written for being right, not fast: one point at a time, f64, dense derivatives.
//!
//! METHOD section 2: weight-normalised softplus (beta = 100) layers, logits times 20, tree-structured softmax.

use std::collections::HashMap;
use std::path::Path;

use candle_core::{DType, Device, Tensor};
use xavatar_deformer::BoneTransform;
use xavatar_network::{Real, SkinningWeights};

const BETA: f64 = 100.0;
const BLEND: f64 = 20.0;

/// Parents of the SMPL-X skeleton.
pub const PARENTS: [usize; 55] = [
    usize::MAX,
    0,
    0,
    0,
    1,
    2,
    3,
    4,
    5,
    6,
    7,
    8,
    9,
    9,
    9,
    12,
    13,
    14,
    16,
    17,
    18,
    19,
    15,
    15,
    15,
    20,
    25,
    26,
    20,
    28,
    29,
    20,
    31,
    32,
    20,
    34,
    35,
    20,
    37,
    38,
    21,
    40,
    41,
    21,
    43,
    44,
    21,
    46,
    47,
    21,
    49,
    50,
    21,
    52,
    53,
];

/// The golden tensors by name.
pub struct Golden(HashMap<String, Tensor>);

impl Golden {
    pub fn read() -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/correspondence.safetensors");
        Self(candle_core::safetensors::load(path, &Device::Cpu).expect("the golden file reads"))
    }

    pub fn values(&self, name: &str) -> Vec<f64> {
        let tensor = self.0.get(name).unwrap_or_else(|| panic!("golden tensor {name}"));
        let flat = tensor.to_dtype(DType::F64).and_then(|tensor| tensor.flatten_all()).expect("a numeric tensor");
        flat.to_vec1().expect("f64")
    }

    pub fn points(&self, name: &str) -> Vec<[f64; 3]> {
        self.values(name).as_chunks::<3>().0.to_vec()
    }

    pub fn bones(&self, pose: usize) -> Vec<BoneTransform<f64>> {
        let matrices = self.values(&format!("pose{pose}.bone_transforms"));
        matrices.as_chunks::<16>().0.iter().map(|matrix| std::array::from_fn(|index| matrix[index])).collect()
    }
}

/// One layer: y = (g v / |v|) x + b; rows of v are (out, in).
#[derive(Clone)]
pub struct Layer {
    pub v: Vec<f64>,
    pub g: Vec<f64>,
    pub b: Vec<f64>,
    /// |v| of each row, and g v / |v|.
    norms: Vec<f64>,
    weights: Vec<f64>,
}

impl Layer {
    fn new(v: Vec<f64>, g: Vec<f64>, b: Vec<f64>) -> Self {
        let inputs = v.len() / g.len();
        let norms: Vec<f64> = v.chunks(inputs).map(|row| row.iter().map(|v| v * v).sum::<f64>().sqrt()).collect();
        let weights = v.iter().enumerate().map(|(i, v)| g[i / inputs] * v / norms[i / inputs]).collect();
        Self { v, g, b, norms, weights }
    }

    fn inputs(&self) -> usize {
        self.v.len() / self.g.len()
    }

    fn linear(&self, x: &[f64]) -> Vec<f64> {
        self.weights.chunks(x.len()).map(|row| row.iter().zip(x).map(|(w, x)| w * x).sum()).collect()
    }
}

/// The network: layers, softplus between them, tree-structured softmax.
#[derive(Clone)]
pub struct NaiveSkinning {
    pub layers: Vec<Layer>,
}

impl NaiveSkinning {
    pub fn golden(golden: &Golden) -> Self {
        let layer = |l| {
            let values = |name| golden.values(&format!("skin.{l}.{name}"));
            Layer::new(values("v"), values("g"), values("b"))
        };
        Self { layers: (0..5).map(layer).collect() }
    }

    /// A network of the same shapes to sum gradients in.
    pub fn zeros(&self) -> Self {
        let zero = |layer: &Layer| {
            let zeros = |values: &Vec<f64>| vec![0.0; values.len()];
            Layer::new(zeros(&layer.v), zeros(&layer.g), zeros(&layer.b))
        };
        Self { layers: self.layers.iter().map(zero).collect() }
    }

    /// Inputs of each layer, softplus' derivatives after each, and the scaled logits.
    fn forward(&self, x: [f64; 3]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>, Vec<f64>) {
        let (mut inputs, mut slopes, mut h) = (Vec::new(), Vec::new(), x.to_vec());
        for (index, layer) in self.layers.iter().enumerate() {
            let mut y = layer.linear(&h);
            y.iter_mut().zip(&layer.b).for_each(|(y, b)| *y += b);
            inputs.push(std::mem::take(&mut h));
            if index + 1 == self.layers.len() {
                h = y.iter().map(|y| BLEND * y).collect();
            } else {
                slopes.push(y.iter().map(|y| 1.0 / (1.0 + (-BETA * y).exp())).collect());
                h = y.iter().map(|y| y.max(0.0) + (-BETA * y.abs()).exp().ln_1p() / BETA).collect();
            }
        }
        (inputs, slopes, h)
    }

    /// w(x) and, per axis, its derivatives.
    fn evaluate(&self, x: [f64; 3]) -> (Vec<f64>, [Vec<f64>; 3]) {
        let (_, slopes, logits) = self.forward(x);
        let (weights, log_slopes) = tree_softmax(&logits);
        let gradients = std::array::from_fn(|axis| {
            let mut tangent = vec![0.0; 3];
            tangent[axis] = 1.0;
            for (layer, slopes) in self.layers.iter().zip(&slopes) {
                tangent = layer.linear(&tangent).iter().zip(slopes).map(|(t, s)| t * s).collect();
            }
            tangent = self.layers[self.layers.len() - 1].linear(&tangent);
            let slope = |row: &Vec<f64>| BLEND * row.iter().zip(&tangent).map(|(a, t)| a * t).sum::<f64>();
            weights.iter().zip(&log_slopes).map(|(w, row)| w * slope(row)).collect()
        });
        (weights, gradients)
    }

    /// Adds the parameter gradients of sum_j cotangent_j w_j(x) to `sum`, which has this network's shapes.
    pub fn backward(&self, x: [f64; 3], cotangent: &[f64], sum: &mut Self) {
        let (inputs, slopes, logits) = self.forward(x);
        let (weights, log_slopes) = tree_softmax(&logits);
        let mut bar = vec![0.0; logits.len()];
        for ((w, c), row) in weights.iter().zip(cotangent).zip(&log_slopes) {
            bar.iter_mut().zip(row).for_each(|(bar, slope)| *bar += BLEND * w * c * slope);
        }
        for (l, layer) in self.layers.iter().enumerate().rev() {
            let width = layer.inputs();
            let mut down = vec![0.0; width];
            for (o, &bar) in bar.iter().enumerate() {
                let (row, norm) = (&layer.v[o * width..][..width], layer.norms[o]);
                let along = row.iter().zip(&inputs[l]).map(|(v, x)| v * x).sum::<f64>() / norm;
                let to = &mut sum.layers[l];
                to.b[o] += bar;
                to.g[o] += bar * along;
                for (i, v) in row.iter().enumerate() {
                    to.v[o * width + i] += bar * layer.g[o] / norm * (inputs[l][i] - along * v / norm);
                    down[i] += bar * layer.weights[o * width + i];
                }
            }
            if l > 0 {
                bar = down.iter().zip(&slopes[l - 1]).map(|(d, s)| d * s).collect();
            }
        }
    }
}

/// The weights of 59 logits, and d ln w_j / d logits (55 rows).
fn tree_softmax(logits: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
    let joints = PARENTS.len();
    let ln_sigmoid = |z: f64| -((-z.abs()).exp().ln_1p() + (-z).max(0.0));
    let mut logs = vec![0.0; joints];
    let mut slopes = vec![vec![0.0; logits.len()]; joints];
    let mut extra = joints;
    // A parent precedes its children, so a joint's row holds the mass that arrives at it when its turn comes.
    for joint in 0..joints {
        let children: Vec<_> = (0..joints).filter(|&child| PARENTS[child] == joint).collect();
        let gate = match children.len() {
            0 => continue,
            _ if joint == 0 => 0,
            1 => children[0],
            _ => {
                extra += 1;
                extra - 1
            }
        };
        let onward = 1.0 / (1.0 + (-logits[gate]).exp());
        let most = children.iter().map(|&child| logits[child]).fold(f64::MIN, f64::max);
        let total: f64 = children.iter().map(|&child| (logits[child] - most).exp()).sum();
        for &child in &children {
            logs[child] = logs[joint] + ln_sigmoid(logits[gate]) + logits[child] - most - total.ln();
            slopes[child] = slopes[joint].clone();
            slopes[child][gate] += 1.0 - onward;
            slopes[child][child] += 1.0;
            for &sibling in &children {
                slopes[child][sibling] -= (logits[sibling] - most).exp() / total;
            }
        }
        logs[joint] += ln_sigmoid(-logits[gate]);
        slopes[joint][gate] -= onward;
    }
    (logs.iter().map(|log| log.exp()).collect(), slopes)
}

impl<T: Real> SkinningWeights<T> for NaiveSkinning {
    type Workspace = ();

    fn joints(&self) -> usize {
        PARENTS.len()
    }

    fn weights(&self, _: &mut (), points: &[[T; 3]], weights: &mut [T]) {
        for (&x, row) in points.iter().zip(weights.chunks_exact_mut(PARENTS.len())) {
            let (_, _, logits) = self.forward(x.map(Real::wide));
            row.iter_mut().zip(tree_softmax(&logits).0).for_each(|(to, from)| *to = T::of(from));
        }
    }

    fn weights_and_gradients(&self, _: &mut (), points: &[[T; 3]], weights: &mut [T], gradients: &mut [T]) {
        let rows = weights.chunks_exact_mut(PARENTS.len()).zip(gradients.chunks_exact_mut(3 * PARENTS.len()));
        for (&x, (row, slopes)) in points.iter().zip(rows) {
            let (w, g) = self.evaluate(x.map(Real::wide));
            row.iter_mut().zip(w).for_each(|(to, from)| *to = T::of(from));
            slopes.iter_mut().zip(g.concat()).for_each(|(to, from)| *to = T::of(from));
        }
    }
}
