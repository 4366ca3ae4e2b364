//! Networks along spirals beside principal components on made-up people whose shapes are not linear, as a table.
//!
//! `cargo run --release -p xavatar-learned --example spiral_bodies -- BODY.npz [flesh|posed] [PEOPLE] [EPOCHS] [VERTICES]` makes PEOPLE people with two bulges
//! that each sit elsewhere, on BODY's mesh with about VERTICES vertices left: of the same bones and at rest, as flesh is where bones are apart, or with bones and
//! limbs of their own. It trains on them with 16, 32 and 64 codes and measures an eighth as many others: the mean distance of a vertex when the shape is squeezed to that many
//! numbers and made again, by principal components, by the autoencoder, and by the auto-decoder, whose codes are found by least squares.

use std::path::PathBuf;
use std::time::Instant;

use glam::DVec3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use xavatar_body::{BodyModel, Gender};
use xavatar_formats::Result;
use xavatar_learned::blsm::{BlsmBody, BlsmParameters, BlsmPopulation};
use xavatar_learned::core::{Identity, shapes_of};
use xavatar_learned::descent::{Descent, Learner};
use xavatar_learned::spiral::{AutodecoderTraining, Autoencoder, FACTORS, Level, levels};
use xavatar_mesh::{TriangleMesh, decimated};

/// Numbers that a shape is squeezed to.
const CODES: [usize; 3] = [16, 32, 64];
/// Joints that are turned, and the axis: legs forward and back, arms up and down, elbows.
const LIMBS: [(&str, usize); 4] = [("hip", 0), ("knee", 0), ("shoulder", 2), ("elbow", 1)];
/// How wide a bulge is, and how deep at least, metres.
const BULGE: [f64; 2] = [0.06, 0.02];
/// Where bulges sit: heights from the hips, and how far to a side, metres.
const REGION: [f64; 2] = [0.45, 0.15];

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let file = PathBuf::from(arguments.next().unwrap_or_else(|| "SMPLX_NEUTRAL.npz".into()));
    let is_posed = arguments.next().is_some_and(|word| word == "posed");
    let mut number = |default: usize| arguments.next().and_then(|text| text.parse().ok()).unwrap_or(default);
    let (people, epochs, vertices) = (number(400), number(150), number(400));
    let start = BodyModel::load(&file, Gender::of_file_name(&file).unwrap_or_default())?;
    let population = BlsmPopulation { subjects: 0, poses: 1, noise: 0.0, seed: 0 };
    let whole = population.body(&start);
    let few = decimated(&whole.bent(), 2 * vertices);
    let chosen: Vec<usize> = few.sources.iter().map(|vertex| *vertex as usize).collect();
    let body = BlsmBody { faces: few.mesh.faces, ..whole.chosen(&chosen) };
    let made: Vec<Vec<DVec3>> =
        (0..people + people.div_ceil(8)).map(|person| shape(&body, &population, person, is_posed)).collect();
    let (known, others) = made.split_at(people);
    let levels = levels(&body.bent(), &FACTORS)?;
    let sizes: Vec<usize> = levels.iter().map(|level| level.points.len()).collect();
    println!("{people} people, {} others, {epochs} epochs; levels of {sizes:?} vertices", others.len());
    println!(
        "| codes | principal components, mm | autoencoder, mm | auto-decoder, mm | seconds |\n|---|---|---|---|---|"
    );
    for codes in CODES {
        let began = Instant::now();
        let components = 1e3 * of_components(known, others, codes);
        let autoencoder = 1e3 * of_autoencoder(&levels, known, others, codes, epochs)?;
        let autodecoder = 1e3 * of_autodecoder(&levels, known, others, codes, epochs)?;
        let seconds = began.elapsed().as_secs_f64();
        println!("| {codes} | {components:.2} | {autoencoder:.2} | {autodecoder:.2} | {seconds:.0} |");
    }
    Ok(())
}

/// The mean distance of a vertex of others from their projections onto components of those who are known, metres.
fn of_components(known: &[Vec<DVec3>], others: &[Vec<DVec3>], codes: usize) -> f64 {
    let known: Vec<Identity> =
        known.iter().map(|shape| Identity { template: shape.clone(), joints: Vec::new() }).collect();
    let space = shapes_of(&known, codes);
    let dot = |one: &[DVec3], other: &[DVec3]| one.iter().zip(other).map(|(one, other)| one.dot(*other)).sum::<f64>();
    let projected = |shape: &Vec<DVec3>| -> Vec<DVec3> {
        let left: Vec<DVec3> = shape.iter().zip(&space.mean).map(|(place, mean)| *place - *mean).collect();
        let mut projected = space.mean.clone();
        for direction in &space.directions {
            let along = dot(&left, direction) / dot(direction, direction);
            projected.iter_mut().zip(direction).for_each(|(place, offset)| *place += *offset * along);
        }
        projected
    };
    mean_distance(others, &others.iter().map(projected).collect::<Vec<_>>())
}

fn of_autoencoder(
    levels: &[Level],
    known: &[Vec<DVec3>],
    others: &[Vec<DVec3>],
    codes: usize,
    epochs: usize,
) -> Result<f64> {
    let network = Autoencoder::new(levels, known, codes, 0)?;
    descend(&network, epochs)?;
    Ok(mean_distance(others, &network.reconstructed(others)?))
}

fn of_autodecoder(
    levels: &[Level],
    known: &[Vec<DVec3>],
    others: &[Vec<DVec3>],
    codes: usize,
    epochs: usize,
) -> Result<f64> {
    let training = AutodecoderTraining::new(levels.to_vec(), known, codes, 0)?;
    descend(&training, epochs)?;
    let (decoder, _) = training.finished()?;
    let again = |shape: &Vec<DVec3>| Ok(decoder.decoded(&decoder.code_of(shape, 1e-9)?)?.shape);
    Ok(mean_distance(others, &others.iter().map(again).collect::<Result<Vec<_>>>()?))
}

fn descend(learner: &impl Learner, epochs: usize) -> Result<()> {
    let mut descent = Descent::new(learner, 0)?;
    (0..epochs).try_for_each(|_| descent.epoch(learner).map(|_| ()))
}

/// A person of the population with two bulges: with its bones, and limbs turned as far as half of their limits, or with the mean bones and at rest.
fn shape(body: &BlsmBody, population: &BlsmPopulation, person: usize, is_posed: bool) -> Vec<DVec3> {
    let own = population.parameters(body, person, 0);
    let angles = body.atoms.angles(&own.atoms);
    let turned = |(atom, angle): (&xavatar_learned::blsm::Atom, f64)| {
        let is_turned =
            is_posed && LIMBS.iter().any(|(limb, axis)| body.names[atom.joint].contains(limb) && *axis == atom.axis);
        atom.coordinate(if is_turned { angle } else { 0.0 })
    };
    let atoms = body.atoms.list.iter().zip(angles).map(turned).collect();
    let bones = if is_posed { own.bones } else { vec![0.0; own.bones.len()] };
    let parameters = BlsmParameters { bones, shape: own.shape, atoms, ..body.rest() };
    let mut random = ChaCha8Rng::seed_from_u64(77);
    random.set_stream(person as u64);
    let vertices = body.template.iter().map(|place| place.as_vec3()).collect();
    let mesh = TriangleMesh { vertices, faces: body.faces.clone(), ..TriangleMesh::default() };
    let normals = mesh.vertex_normals();
    let mut bulging = BlsmBody { template: body.template.clone(), ..body.clone() };
    let hips = body.skeleton.rest()[0];
    for side in [-1.0, 1.0] {
        let (up, across) = (REGION[0] * random.random::<f64>(), REGION[1] * random.random::<f64>());
        let deep: f64 = StandardNormal.sample(&mut random);
        let middle = hips + DVec3::new(side * across, up, 0.1 * side);
        for ((place, normal), rest) in bulging.template.iter_mut().zip(&normals).zip(&body.template) {
            let share = (-rest.distance_squared(middle) / (2.0 * BULGE[0] * BULGE[0])).exp();
            *place += normal.as_dvec3() * (BULGE[1] * (1.0 + deep.abs()) * share);
        }
    }
    bulging.posed(&parameters).vertices
}

/// Of a vertex of these from those.
fn mean_distance(these: &[Vec<DVec3>], those: &[Vec<DVec3>]) -> f64 {
    let pairs = these.iter().flatten().zip(those.iter().flatten());
    pairs.map(|(one, other)| one.distance(*other)).sum::<f64>() / these.iter().map(Vec::len).sum::<usize>() as f64
}
