//! The paper's three networks against the matrix product itself, all threads, 8,192 points in blocks of 256 rows.
//!
//! The reference is a plain f32 product, the best of a few sizes. Reference and case alternate, round by round, so that
//! other work on the machine slows both; `*_of_gemm` is the median of the rounds' ratios.

use rayon::prelude::*;
use xavatar::config::{Config, SkinningSettings};
use xavatar::fields::{CONDITION, Fields, Skinning};
use xavatar_network::{Backward, Mlp, MlpGradient, SkinningTrace, SkinningWeights, Trace};

use crate::report::{Report, Seconds};

const POINTS: usize = 8192;
/// As `train/losses.rs` has them.
const BLOCK_ROWS: usize = 256;
const ROUNDS: usize = 5;
/// Rows, inner extent and columns of the reference products: large, and as one block of the geometry network.
const REFERENCES: [[usize; 3]; 3] = [[1024, 1024, 1024], [512, 512, 512], [BLOCK_ROWS, 512, 512]];

/// One thread's memory.
struct Worker {
    trace: Trace<f32>,
    skinning: SkinningTrace<f32>,
    gradients: Vec<MlpGradient<f32>>,
    weights: Vec<f32>,
    slopes: Vec<f32>,
    cotangent: Vec<f32>,
    along: Vec<f32>,
}

/// Operations of one product of every weight with every point.
fn operations(mlp: &Mlp<f32>) -> f64 {
    let weights = mlp.layout().entries().iter().filter(|entry| entry.name.ends_with("weight_v"));
    2.0 * (POINTS * weights.map(|entry| entry.range.len()).sum::<usize>()) as f64
}

/// One product of the same extents on every thread.
struct Product {
    extents: [usize; 3],
    operands: Vec<[Vec<f32>; 3]>,
}

impl Product {
    fn new(extents: [usize; 3]) -> Self {
        let [rows, inner, columns] = extents;
        let operands = || [vec![0.0; rows * columns], vec![0.5; rows * inner], vec![0.25; inner * columns]];
        Self { extents, operands: (0..rayon::current_num_threads()).map(|_| operands()).collect() }
    }

    /// Operations a second of one product on every thread, repeated to about 2^28 multiply-adds.
    fn rate(&mut self) -> f64 {
        let [rows, inner, columns] = self.extents;
        let repeats = (1 << 28) / (rows * inner * columns);
        let seconds = Seconds::of(1, || {
            self.operands.par_iter_mut().for_each(|[product, left, right]| {
                for _ in 0..repeats {
                    // SAFETY: the three slices have rows x columns, rows x inner and inner x columns entries.
                    unsafe {
                        gemm::gemm(
                            rows,
                            columns,
                            inner,
                            product.as_mut_ptr(),
                            1,
                            columns as isize,
                            false,
                            left.as_ptr(),
                            1,
                            inner as isize,
                            right.as_ptr(),
                            1,
                            columns as isize,
                            0.0,
                            1.0,
                            false,
                            false,
                            false,
                            gemm::Parallelism::None,
                        );
                    }
                }
            });
        });
        2.0 * (self.operands.len() * repeats * rows * inner * columns) as f64 / seconds.shortest()
    }
}

/// Measures the reference and each network.
pub fn measure(report: &mut Report) -> Result<(), Box<dyn std::error::Error>> {
    report.section("networks, 8,192 points");
    let config = Config::preset("paper-scan")?;
    let SkinningSettings::Network(shape) = &config.fields.skinning else { return Err("the paper has networks".into()) };
    let skinning = Skinning::network(shape)?;
    let mut fields = Fields::<f32>::new(&config.fields, skinning, (glam::Vec3::NEG_ONE, glam::Vec3::ONE))?;
    fields.initialise(1);
    let Skinning::Network(field) = &fields.skinning else { return Err("the paper has networks".into()) };
    let embedded = fields.geometry.mlp.embed(&[0.1; CONDITION]);
    let joints = field.joints();
    let points: Vec<[f32; 3]> =
        (0..POINTS).map(|point| std::array::from_fn(|axis| (0.618 * (point * (axis + 3)) as f32).sin())).collect();
    let texture_points: Vec<f32> = points.iter().flat_map(|[x, y, z]| [*x, *y, *z, *y, *z, *x]).collect();
    let width = config.fields.geometry.width;
    let features: Vec<f32> = (0..POINTS * width).map(|index| (index % 7) as f32 * 0.1).collect();

    let mut references = REFERENCES.map(Product::new);
    let mut reference = || references.iter_mut().map(Product::rate).fold(0.0, f64::max);
    let threads = rayon::current_num_threads();
    let mut workers: Vec<Worker> = (0..threads)
        .map(|_| Worker {
            trace: Trace::default(),
            skinning: SkinningTrace::default(),
            gradients: fields.networks().into_iter().map(Mlp::zero_gradient).collect(),
            weights: vec![0.0; BLOCK_ROWS * joints],
            slopes: vec![0.0; 3 * BLOCK_ROWS * joints],
            cotangent: vec![1.0; 3 * BLOCK_ROWS],
            along: vec![1e-3; 3 * BLOCK_ROWS],
        })
        .collect();
    // Blocks go to threads as in training: every T-th to each.
    let mut rates = Vec::new();
    let mut case = |report: &mut Report, name: &str, operations: f64, block: &(dyn Fn(&mut Worker, usize) + Sync)| {
        let (mut seconds, mut shares) = (Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            let peak = reference();
            let once = Seconds::of(1, || {
                workers.par_iter_mut().enumerate().for_each(|(thread, worker)| {
                    (0..POINTS).step_by(BLOCK_ROWS).skip(thread).step_by(threads).for_each(|row| block(worker, row));
                });
            });
            shares.push(operations / once.shortest() / peak);
            seconds.push(once.shortest());
            rates.push(peak);
        }
        shares.sort_by(f64::total_cmp);
        report.rate(&format!("{name}_gflops"), operations * 1e-9, &seconds.into(), "Gflop");
        report.number(&format!("{name}_of_gemm"), shares[ROUNDS / 2], "of the product's rate in the same round");
    };

    let network = &fields.geometry.mlp;
    let one = operations(network);
    let forward = |worker: &mut Worker, row: usize| {
        network.forward(&mut worker.trace, points[row..row + BLOCK_ROWS].as_flattened(), &embedded, &[]);
    };
    case(report, "geometry_forward", one, &forward);
    // Forward, down; up, backward and twice as many rows in the weights' gradient: six products.
    case(report, "geometry_normal_step", 6.0 * one, &|worker, row| {
        forward(worker, row);
        let Worker { trace, gradients, cotangent, along, .. } = worker;
        network.input_gradient(trace, &cotangent[..BLOCK_ROWS]);
        let values = &cotangent[..BLOCK_ROWS];
        network.backward(trace, values, Some(along), Backward::Parameters, &mut gradients[0]);
    });
    let network = &fields.texture.mlp;
    let one = operations(network);
    let forward = |worker: &mut Worker, row: usize| {
        let features = &features[row * width..(row + BLOCK_ROWS) * width];
        network.forward(&mut worker.trace, &texture_points[6 * row..6 * (row + BLOCK_ROWS)], &embedded, features);
    };
    case(report, "texture_forward", one, &forward);
    case(report, "texture_step", 3.0 * one, &|worker, row| {
        forward(worker, row);
        let Worker { trace, gradients, cotangent, .. } = worker;
        network.backward(trace, cotangent, None, Backward::ParametersAndPoints, &mut gradients[1]);
    });
    let one = operations(field.mlp());
    case(report, "skinning_forward", one, &|worker, row| {
        field.weights(&mut worker.skinning, &points[row..row + BLOCK_ROWS], &mut worker.weights);
    });
    // Values and three tangents, each forward, back and into the gradient.
    case(report, "skinning_step", 12.0 * one, &|worker, row| {
        let Worker { skinning, gradients, weights, slopes, .. } = worker;
        field.weights_and_gradients(skinning, &points[row..row + BLOCK_ROWS], weights, slopes);
        field.backward(skinning, weights, Some(slopes), Backward::Parameters, &mut gradients[2]);
    });
    rates.sort_by(f64::total_cmp);
    let best = rates[rates.len() - 1];
    report.number("gemm_gflops", rates[rates.len() / 2] * 1e-9, &format!("Gflop/s, best {:.3}", best * 1e-9));
    Ok(())
}
