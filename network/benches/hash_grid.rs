//! Samples a second of a hash grid with a small network, on all threads, in blocks of 256 rows: `cargo bench --bench hash_grid`.
//!
//! Points near the surface of a body-like set of capsules, in random order; levels from 16 to 256 cells, 2 features, two hidden
//! layers of 64 units. "encode" is a network of one unit: the grid with next to nothing behind it. "backward" follows a forward
//! sweep and wants table, layers and points; "gradient loss" adds the down and up sweeps of a loss on the input gradient.
//! "step" is summing the threads' gradients and Adam, milliseconds after one pass over the points.

use std::hint::black_box;
use std::time::Instant;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use xavatar_network::{
    Adam, AdamSettings, Backward, Bounds, EncodingShape, HashGridShape, Mlp, MlpGradient, MlpShape, NetworkUpdate,
    ParameterGroup, Result, Trace,
};

const ROWS: usize = 256;
const BLOCKS: usize = 256;
const REPEATS: usize = 7;
const BOUNDS: Bounds = Bounds { lowest: [-1.1, -1.4, -0.35], highest: [1.1, 0.7, 0.35] };

/// Ends and radii of trunk, head, arms and legs, metres.
const CAPSULES: [([f32; 3], [f32; 3], f32); 6] = [
    ([0.0, -0.3, 0.0], [0.0, 0.15, 0.0], 0.15),
    ([0.0, 0.35, 0.0], [0.0, 0.45, 0.0], 0.1),
    ([0.2, 0.2, 0.0], [0.85, 0.2, 0.0], 0.05),
    ([-0.2, 0.2, 0.0], [-0.85, 0.2, 0.0], 0.05),
    ([0.1, -0.4, 0.0], [0.35, -1.2, 0.0], 0.07),
    ([-0.1, -0.4, 0.0], [-0.35, -1.2, 0.0], 0.07),
];

fn points(random: &mut ChaCha8Rng) -> Vec<f32> {
    let mut points = Vec::with_capacity(3 * ROWS * BLOCKS);
    for _ in 0..ROWS * BLOCKS {
        let (start, end, radius) = CAPSULES[random.random_range(0..CAPSULES.len())];
        let along: f32 = random.random();
        let direction: [f32; 3] = std::array::from_fn(|_| random.sample(rand_distr::StandardNormal));
        let length = direction.iter().map(|x| x * x).sum::<f32>().sqrt();
        let distance = radius + 0.01 * random.sample::<f32, _>(rand_distr::StandardNormal);
        points.extend(
            (0..3).map(|axis| start[axis] + along * (end[axis] - start[axis]) + distance * direction[axis] / length),
        );
    }
    points
}

fn network(levels: usize, log2_entries: u32, depth: usize, width: usize) -> Result<Mlp<f32>> {
    let grid = HashGridShape { levels, coarsest: 16, finest: 256, log2_entries, features: 2 };
    let mut mlp = Mlp::new(MlpShape {
        inputs: 3,
        encoding: EncodingShape::HashGrid { grid, bounds: BOUNDS },
        condition: 0,
        embedded: 0,
        row_condition: 0,
        depth,
        width,
        skip: None,
        outputs: 1,
    })?;
    mlp.initialise_uniform(&mut ChaCha8Rng::seed_from_u64(1));
    Ok(mlp)
}

/// One thread's share of the work.
struct Worker {
    trace: Trace<f32>,
    gradient: MlpGradient<f32>,
}

/// Median seconds of a pass of all threads over all blocks.
fn seconds(workers: &mut [Worker], points: &[f32], block: impl Fn(&mut Worker, &[f32]) + Sync) -> f64 {
    let threads = workers.len();
    let mut times: Vec<f64> = (0..REPEATS)
        .map(|_| {
            let start = Instant::now();
            workers.par_iter_mut().enumerate().for_each(|(thread, worker)| {
                points.chunks(3 * ROWS).skip(thread).step_by(threads).for_each(|points| block(worker, points));
            });
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[REPEATS / 2]
}

fn workers(mlp: &Mlp<f32>) -> Vec<Worker> {
    let worker = || Worker { trace: Trace::default(), gradient: mlp.zero_gradient() };
    (0..rayon::current_num_threads()).map(|_| worker()).collect()
}

fn main() -> Result<()> {
    let points = points(&mut ChaCha8Rng::seed_from_u64(2));
    let samples = 1e-6 * (ROWS * BLOCKS) as f64;
    let ones = [1.0; ROWS];
    let on_gradient = [0.5; 3 * ROWS];
    println!("{} threads, blocks of {ROWS}, M samples/s", rayon::current_num_threads());
    println!("levels  table  parameters  encode  forward  backward  both  gradient loss  step ms");
    for (levels, log2_entries) in [(12, 18), (12, 17), (12, 16), (10, 18), (10, 17), (10, 16)] {
        let bare = network(levels, log2_entries, 1, 1)?;
        let mut workers_of_bare = workers(&bare);
        let encode = seconds(&mut workers_of_bare, &points, |worker, points| {
            bare.forward(&mut worker.trace, points, &[], &[]);
            black_box(worker.trace.output());
        });
        drop(workers_of_bare);
        let mut mlp = network(levels, log2_entries, 2, 64)?;
        let mut workers = workers(&mlp);
        let forward = seconds(&mut workers, &points, |worker, points| {
            mlp.forward(&mut worker.trace, points, &[], &[]);
            black_box(worker.trace.output());
        });
        let both = seconds(&mut workers, &points, |Worker { trace, gradient }, points| {
            mlp.forward(trace, points, &[], &[]);
            mlp.backward(trace, &ones, None, Backward::ParametersAndPoints, gradient);
        });
        let gradient_loss = seconds(&mut workers, &points, |Worker { trace, gradient }, points| {
            mlp.forward(trace, points, &[], &[]);
            mlp.input_gradient(trace, &ones);
            mlp.backward(trace, &ones, Some(&on_gradient), Backward::ParametersAndPoints, gradient);
        });
        let mut adam = Adam::new(mlp.parameters().len());
        let group = |rate| ParameterGroup { settings: AdamSettings::default(), rate };
        let update = NetworkUpdate { network: group(1e-3), grid: group(1e-2), factor: 1.0 };
        let mut steps = Vec::new();
        for _ in 0..REPEATS {
            seconds(&mut workers, &points[..3 * ROWS * BLOCKS / REPEATS], |Worker { trace, gradient }, points| {
                let rows = points.len() / 3;
                mlp.forward(trace, points, &[], &[]);
                mlp.backward(trace, &ones[..rows], None, Backward::Parameters, gradient);
            });
            let start = Instant::now();
            let sum = mlp.sum_gradients(workers.iter_mut().map(|worker| &mut worker.gradient));
            adam.step_network(&update, sum, &mut mlp);
            steps.push(1e3 * start.elapsed().as_secs_f64());
        }
        steps.sort_by(f64::total_cmp);
        println!(
            "{levels:6}   2^{log2_entries}  {:10}  {:6.2}  {:7.2}  {:8.2}  {:4.2}  {:13.2}  {:7.2}",
            mlp.parameters().len(),
            samples / encode,
            samples / forward,
            samples / (both - forward),
            samples / both,
            samples / gradient_loss,
            steps[REPEATS / 2],
        );
    }
    Ok(())
}
