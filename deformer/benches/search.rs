//! What the search costs: roots a second on a baked and on an exact field, with and without pruned starts, and the
//! frame's and the gradient's fixed costs. Prints a table; every figure is the best of several runs.
//!
//! The body is a stick figure of the 22 SMPL bones whose weights fall off with the distance to the bones.

use std::hint::black_box;
use std::time::Instant;

use glam::{Affine3A, EulerRot, Quat, Vec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use xavatar_deformer::{
    Axis, BakedWeights, BoneTransform, Candidates, ExactWarp, Grid, SearchSettings, StartGroups, Warp, bone_transform,
    deform, search,
};
use xavatar_network::{KinematicTree, SkinningField, SkinningWeights};

const POINTS: usize = 10_000;
const RUNS: usize = 7;

/// Parents and joints of a body in a star pose, metres.
const BONES: [(Option<usize>, [f32; 3]); 22] = [
    (None, [0.0, -0.2, 0.0]),
    (Some(0), [0.08, -0.3, 0.0]),
    (Some(0), [-0.08, -0.3, 0.0]),
    (Some(0), [0.0, -0.1, 0.0]),
    (Some(1), [0.2, -0.7, 0.0]),
    (Some(2), [-0.2, -0.7, 0.0]),
    (Some(3), [0.0, 0.04, 0.0]),
    (Some(4), [0.32, -1.1, 0.0]),
    (Some(5), [-0.32, -1.1, 0.0]),
    (Some(6), [0.0, 0.1, 0.0]),
    (Some(7), [0.34, -1.16, 0.12]),
    (Some(8), [-0.34, -1.16, 0.12]),
    (Some(9), [0.0, 0.3, 0.0]),
    (Some(9), [0.06, 0.22, 0.0]),
    (Some(9), [-0.06, 0.22, 0.0]),
    (Some(12), [0.0, 0.4, 0.02]),
    (Some(13), [0.17, 0.23, 0.0]),
    (Some(14), [-0.17, 0.23, 0.0]),
    (Some(16), [0.42, 0.22, 0.0]),
    (Some(17), [-0.42, 0.22, 0.0]),
    (Some(18), [0.67, 0.22, 0.0]),
    (Some(19), [-0.67, 0.22, 0.0]),
];

/// Thickness of the body around its bones, metres.
const THICKNESS: f32 = 0.08;

fn joint(bone: usize) -> Vec3 {
    Vec3::from_array(BONES[bone].1)
}

/// The distance of a point to a bone's segment: from its joint to its child's, or a little on at an end.
fn distance(bone: usize, point: Vec3) -> f32 {
    let start = joint(bone);
    let end = match (bone + 1..BONES.len()).find(|&child| BONES[child].0 == Some(bone)) {
        Some(child) => joint(child),
        None => start + 0.5 * (start - joint(BONES[bone].0.unwrap_or(0))),
    };
    let along = end - start;
    let share = ((point - start).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    point.distance(start + share * along)
}

struct StickFigure;

impl SkinningWeights<f32> for StickFigure {
    type Workspace = ();

    fn joints(&self) -> usize {
        BONES.len()
    }

    fn weights(&self, _: &mut (), points: &[[f32; 3]], weights: &mut [f32]) {
        for (point, row) in points.iter().zip(weights.chunks_exact_mut(BONES.len())) {
            let point = Vec3::from_array(*point);
            let distances: Vec<f32> = (0..BONES.len()).map(|bone| distance(bone, point)).collect();
            let nearest = distances.iter().copied().fold(f32::INFINITY, f32::min);
            row.iter_mut().zip(&distances).for_each(|(weight, d)| *weight = ((nearest - d) / 0.02).exp());
            let total: f32 = row.iter().sum();
            row.iter_mut().for_each(|weight| *weight /= total);
        }
    }

    fn weights_and_gradients(&self, _: &mut (), _: &[[f32; 3]], _: &mut [f32], _: &mut [f32]) {
        unreachable!("only sampled")
    }
}

/// A pose: every joint turns by up to `angle`.
fn pose(generator: &mut ChaCha8Rng, angle: f32) -> Vec<BoneTransform<f32>> {
    let mut posed: Vec<Affine3A> = Vec::new();
    for (bone, (parent, _)) in BONES.iter().enumerate() {
        let mut turn = || generator.random_range(-angle..angle);
        let turn = Quat::from_euler(EulerRot::XYZ, turn(), turn(), turn());
        let pivot = joint(bone);
        let local = Affine3A::from_translation(pivot) * Affine3A::from_quat(turn) * Affine3A::from_translation(-pivot);
        posed.push(parent.map_or(local, |parent| posed[parent] * local));
    }
    posed.iter().map(bone_transform).collect()
}

/// Deformed points of canonical ones near the body.
fn deformed_points(warp: &impl Warp<f32>, generator: &mut ChaCha8Rng) -> Vec<[f32; 3]> {
    let canonical: Vec<[f32; 3]> = std::iter::repeat_with(|| {
        [generator.random_range(-0.9..0.9), generator.random_range(-1.25..0.6), generator.random_range(-0.15..0.2)]
    })
    .filter(|&point| (0..BONES.len()).any(|bone| distance(bone, Vec3::from_array(point)) < THICKNESS))
    .take(POINTS)
    .collect();
    let (mut transforms, mut deformed) = (vec![[0.0; 12]; POINTS], vec![[0.0; 3]; POINTS]);
    warp.transforms(&mut Default::default(), &canonical, &mut transforms);
    deform(&transforms, &canonical, &mut deformed).expect("one transform a point");
    deformed
}

/// Seconds of the fastest of several runs, and what the last returned.
fn fastest<R>(mut run: impl FnMut() -> R) -> (f64, R) {
    let mut best = f64::INFINITY;
    let mut result = None;
    for _ in 0..RUNS {
        let start = Instant::now();
        result = Some(black_box(run()));
        best = best.min(start.elapsed().as_secs_f64());
    }
    (best, result.expect("at least one run"))
}

fn print(name: &str, seconds: f64, found: &Candidates<f32>) {
    let s = found.statistics;
    println!(
        "{name:<34}{:>9.2} ms {:>9.0} k roots/s {:>8.0} k points/s {:>5.2} evaluations/start  {s:?}",
        seconds * 1e3,
        s.converged as f64 / seconds * 1e-3,
        found.len() as f64 / seconds * 1e-3,
        s.evaluations as f64 / s.starts as f64,
    );
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut generator = ChaCha8Rng::seed_from_u64(1);
    let settings = SearchSettings::default();
    let body = vec![0, 1, 2, 4, 5, 16, 17, 18, 19];
    let groups = StartGroups::new(BONES.len(), Vec::new(), body)?;
    let bones = pose(&mut generator, 0.5);

    let hands = [(-1.0, -0.65, 0.012), (0.65, 1.0, 0.012)];
    let grid = Grid::new([
        Axis::refined(-1.0, 1.0, 0.02, &hands)?,
        Axis::refined(-1.3, 0.65, 0.02, &[(0.3, 0.6, 0.012)])?,
        Axis::refined(-0.25, 0.25, 0.025, &[(-0.1, 0.1, 0.02)])?,
    ])?;
    let near = |grid: &Grid<f32>, cell: usize| {
        let [low, high] = grid.cell_corners(cell).map(Vec3::from_array);
        let reach = THICKNESS + 0.08 + 0.5 * low.distance(high);
        (0..BONES.len()).any(|bone| distance(bone, 0.5 * (low + high)) < reach)
    };
    let matters: Vec<bool> = (0..grid.cells()).map(|cell| near(&grid, cell)).collect();
    let mut baked = BakedWeights::sample(&StickFigure, grid)?;
    let kept: usize = (0..baked.grid().len()).map(|node| baked.weights().row(node).0.len()).sum();
    println!("{} nodes, {:.2} bones a node", baked.grid().len(), kept as f64 / baked.grid().len() as f64);

    let (seconds, _) = fastest(|| baked.warp(&bones, None).map(drop));
    println!("{:<34}{:>9.2} ms", "warp", seconds * 1e3);
    let offsets = vec![[0.001; 3]; baked.grid().len()];
    let (seconds, _) = fastest(|| baked.warp(&bones, Some(&offsets)).map(drop));
    println!("{:<34}{:>9.2} ms", "warp with offsets", seconds * 1e3);
    let points = deformed_points(&baked.warp(&bones, None)?, &mut generator);
    let warp = baked.warp(&bones, None)?;
    let (seconds, found) = fastest(|| search(&warp, &groups, &points, None, &settings));
    print("search, baked", seconds, &found?);
    drop(warp);

    baked.prune_starts(&groups, &matters)?;
    let (seconds, _) = fastest(|| baked.warp(&bones, None).map(drop));
    println!("{:<34}{:>9.2} ms", "warp with start boxes", seconds * 1e3);
    let warp = baked.warp(&bones, None)?;
    let (seconds, found) = fastest(|| search(&warp, &groups, &points, None, &settings));
    print("search, baked, pruned starts", seconds, &found?);

    let parents: Vec<_> = BONES.iter().map(|bone| bone.0).collect();
    let mut field = SkinningField::<f32>::new(KinematicTree::new(&parents)?, 5, 128, 0, 20.0)?;
    field.initialise(&mut generator);
    let exact = ExactWarp::new(&field, &bones)?;
    let points = deformed_points(&exact, &mut generator);
    let (seconds, found) = fastest(|| search(&exact, &groups, &points, None, &settings));
    print("search, exact 5 x 128", seconds, &found?);
    Ok(())
}
