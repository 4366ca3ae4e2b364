//! The paper's three networks against the matrix product itself, on all threads, in blocks of 256 rows.
//!
//! The reference is a plain f32 product, the best of a few sizes. Reference and case alternate, round by round, so that other work on the
//! machine slows both. Rates count the multiply-adds of matrix products only, two operations each.

use rayon::prelude::*;
use xavatar_network::{
    Backward, Bounds, GeometryField, KinematicTree, MlpGradient, SkinningField, SkinningTrace, SkinningWeights,
    TextureField, Trace,
};

use xavatar_vector::{Matrix, MatrixMut, Write, product};

use super::Seconds;
use crate::body::smplx;
use crate::config::{Config, SkinningSettings};
use crate::fields::{BLOCK_ROWS, Condition, PerField};
use crate::{Error, InputError, Result};

/// Rows, inner extent and columns of the reference products: large, and as one block of the geometry network.
const REFERENCES: [[usize; 3]; 3] = [[1024, 1024, 1024], [512, 512, 512], [BLOCK_ROWS, 512, 512]];
/// Multiply-adds of one measurement of the reference, a thread.
const REFERENCE_WORK: usize = 1 << 28;
const BOUNDS: Bounds = Bounds { lowest: [-1.0; 3], highest: [1.0; 3] };

/// What a network is measured at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetworkCase {
    /// The geometry field's values.
    GeometryForward,
    /// Value, input gradient and the backward of both: the normal loss.
    GeometryNormalStep,
    /// The texture field's values.
    TextureForward,
    /// Values and their backward.
    TextureStep,
    /// Skinning weights.
    SkinningForward,
    /// Weights, their derivatives in space, and the backward of both.
    SkinningStep,
}

impl NetworkCase {
    /// All cases.
    pub const ALL: [Self; 6] = [
        Self::GeometryForward,
        Self::GeometryNormalStep,
        Self::TextureForward,
        Self::TextureStep,
        Self::SkinningForward,
        Self::SkinningStep,
    ];

    /// The case's name in docs/performance.md.
    pub fn name(self) -> &'static str {
        match self {
            Self::GeometryForward => "geometry_forward",
            Self::GeometryNormalStep => "geometry_normal_step",
            Self::TextureForward => "texture_forward",
            Self::TextureStep => "texture_step",
            Self::SkinningForward => "skinning_forward",
            Self::SkinningStep => "skinning_step",
        }
    }
}

/// How fast a case is.
#[derive(Clone, Debug)]
pub struct NetworkSpeed {
    /// Operations of one run.
    pub operations: f64,
    /// Its time.
    pub seconds: Seconds,
    /// Share of the product's rate in the same round, median of the rounds.
    pub share_of_product: f64,
    /// The product's rates, operations a second, a round.
    pub product_rates: Vec<f64>,
}

/// The paper's networks, ready to be measured.
pub struct Networks {
    geometry: GeometryField<f32>,
    texture: TextureField<f32>,
    skinning: SkinningField<f32>,
    /// P, a multiple of the block.
    points: Vec<[f32; 3]>,
    texture_points: Vec<[f32; 6]>,
    embedded: Vec<f32>,
    features: Vec<f32>,
    references: Vec<Product>,
    workers: Vec<Worker>,
}

/// One thread's memory.
struct Worker {
    trace: Trace<f32>,
    skinning: SkinningTrace<f32>,
    gradients: PerField<MlpGradient<f32>>,
    weights: Vec<f32>,
    slopes: Vec<f32>,
    cotangent: Vec<f32>,
    along: Vec<f32>,
}

impl Networks {
    /// The networks of `paper-scan` and about `points` points.
    ///
    /// # Errors
    /// Only if that preset, which is part of the program, is broken.
    pub fn new(points: usize) -> Result<Self> {
        let fields = Config::preset("paper-scan")?.fields;
        let SkinningSettings::Network(shape) = &fields.skinning else {
            return Err(Error::from(InputError::Value {
                name: "fields.skinning of paper-scan".into(),
                found: "a grid".into(),
                expected: "a network".into(),
            }));
        };
        let random = || <rand_chacha::ChaCha8Rng as rand::SeedableRng>::seed_from_u64(1);
        let skeleton = smplx::skeleton();
        let condition = Condition::new(skeleton, smplx::EXPRESSIONS).width();
        let mut geometry = GeometryField::new(&fields.geometry, condition, fields.representation, BOUNDS)?;
        let width = fields.geometry.width;
        let mut texture = TextureField::new(&fields.texture, fields.geometry.embedded, width, BOUNDS)?;
        let tree = KinematicTree::new(&skeleton.parents)?;
        let mut skinning = SkinningField::new(tree, shape.depth, shape.width, shape.frequencies, shape.blend.into())?;
        geometry.initialise(&mut random());
        texture.initialise(&mut random());
        skinning.initialise(&mut random());
        let joints = skinning.joints();
        let points = points.next_multiple_of(BLOCK_ROWS);
        let place = |point: usize| std::array::from_fn(|axis| (0.618 * (point * (axis + 3)) as f32).sin());
        let points: Vec<[f32; 3]> = (0..points).map(place).collect();
        let worker = || Worker {
            trace: Trace::default(),
            skinning: SkinningTrace::default(),
            gradients: PerField {
                geometry: geometry.mlp.zero_gradient(),
                texture: texture.mlp.zero_gradient(),
                skinning: skinning.mlp().zero_gradient(),
            },
            weights: vec![0.0; BLOCK_ROWS * joints],
            slopes: vec![0.0; 3 * BLOCK_ROWS * joints],
            cotangent: vec![1.0; 3 * BLOCK_ROWS],
            along: vec![1e-3; 3 * BLOCK_ROWS],
        };
        Ok(Self {
            embedded: geometry.mlp.embed(&vec![0.1; condition]),
            texture_points: points.iter().map(|[x, y, z]| [*x, *y, *z, *y, *z, *x]).collect(),
            features: (0..points.len() * width).map(|index| (index % 7) as f32 * 0.1).collect(),
            references: REFERENCES.map(Product::new).into(),
            workers: (0..rayon::current_num_threads()).map(|_| worker()).collect(),
            geometry,
            texture,
            skinning,
            points,
        })
    }

    /// Measures a case in `rounds` rounds, and the product in each of them.
    pub fn measure(&mut self, case: NetworkCase, rounds: usize) -> NetworkSpeed {
        let network = match case {
            NetworkCase::GeometryForward | NetworkCase::GeometryNormalStep => &self.geometry.mlp,
            NetworkCase::TextureForward | NetworkCase::TextureStep => &self.texture.mlp,
            NetworkCase::SkinningForward | NetworkCase::SkinningStep => self.skinning.mlp(),
        };
        let products = match case {
            NetworkCase::GeometryForward | NetworkCase::TextureForward | NetworkCase::SkinningForward => 1.0,
            // Forward, down; up, backward and twice as many rows in the weights' gradient.
            NetworkCase::GeometryNormalStep => 6.0,
            NetworkCase::TextureStep => 3.0,
            // Values and three tangents, each forward, back and into the gradient.
            NetworkCase::SkinningStep => 12.0,
        };
        let weights = network.layout().entries().iter().filter(|entry| entry.name.ends_with("weight_v"));
        let weights: usize = weights.map(|entry| entry.range.len()).sum();
        let operations = products * 2.0 * (self.points.len() * weights) as f64;
        let (mut seconds, mut shares, mut product_rates) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..rounds.max(1) {
            let product = self.references.iter_mut().map(Product::rate).fold(0.0, f64::max);
            let once = self.run(case).shortest();
            shares.push(operations / once / product);
            seconds.push(once);
            product_rates.push(product);
        }
        shares.sort_by(f64::total_cmp);
        NetworkSpeed { operations, seconds: seconds.into(), share_of_product: shares[shares.len() / 2], product_rates }
    }

    /// Runs a case over all points. Blocks go to threads as in training: every T-th to each.
    fn run(&mut self, case: NetworkCase) -> Seconds {
        let Self { geometry, texture, skinning, points, texture_points, embedded, features, workers, .. } = self;
        let (threads, width) = (workers.len(), geometry.mlp.shape().width);
        let block = |worker: &mut Worker, row: usize| {
            let rows = row..row + BLOCK_ROWS;
            let Worker { trace, skinning: skinning_trace, gradients, weights, slopes, cotangent, along } = worker;
            match case {
                NetworkCase::GeometryForward | NetworkCase::GeometryNormalStep => {
                    geometry.mlp.forward(trace, points[rows].as_flattened(), embedded, &[]);
                    if case == NetworkCase::GeometryNormalStep {
                        let values = &cotangent[..BLOCK_ROWS];
                        geometry.mlp.input_gradient(trace, values);
                        geometry.mlp.backward(
                            trace,
                            values,
                            Some(along),
                            Backward::Parameters,
                            &mut gradients.geometry,
                        );
                    }
                }
                NetworkCase::TextureForward | NetworkCase::TextureStep => {
                    let features = &features[row * width..(row + BLOCK_ROWS) * width];
                    texture.mlp.forward(trace, texture_points[rows].as_flattened(), embedded, features);
                    if case == NetworkCase::TextureStep {
                        let wanted = Backward::ParametersAndPoints;
                        texture.mlp.backward(trace, cotangent, None, wanted, &mut gradients.texture);
                    }
                }
                NetworkCase::SkinningForward => skinning.weights(skinning_trace, &points[rows], weights),
                NetworkCase::SkinningStep => {
                    skinning.weights_and_gradients(skinning_trace, &points[rows], weights, slopes);
                    skinning.backward(
                        skinning_trace,
                        weights,
                        Some(slopes),
                        Backward::Parameters,
                        &mut gradients.skinning,
                    );
                }
            }
        };
        Seconds::of(1, || {
            workers.par_iter_mut().enumerate().for_each(|(thread, worker)| {
                let rows = (0..points.len()).step_by(BLOCK_ROWS).skip(thread).step_by(threads);
                rows.for_each(|row| block(worker, row));
            });
        })
    }
}

/// One product of the same extents on every thread.
struct Product {
    extents: [usize; 3],
    /// C, A and B of each thread.
    operands: Vec<[Vec<f32>; 3]>,
}

impl Product {
    fn new(extents: [usize; 3]) -> Self {
        let [rows, inner, columns] = extents;
        let operands = || [vec![0.0; rows * columns], vec![0.5; rows * inner], vec![0.25; inner * columns]];
        Self { extents, operands: (0..rayon::current_num_threads()).map(|_| operands()).collect() }
    }

    /// Operations a second.
    fn rate(&mut self) -> f64 {
        let [rows, inner, columns] = self.extents;
        let work = rows * inner * columns;
        let repeats = REFERENCE_WORK / work;
        let threads = self.operands.len();
        let seconds = Seconds::of(1, || {
            self.operands.par_iter_mut().for_each(|[c, a, b]| {
                for _ in 0..repeats {
                    let (a, b) = (Matrix::new(a, rows, inner, inner), Matrix::new(b, inner, columns, columns));
                    product(MatrixMut::new(c, rows, columns, columns), Write::Replace, a, b);
                }
            });
        });
        2.0 * (threads * repeats * work) as f64 / seconds.shortest()
    }
}
