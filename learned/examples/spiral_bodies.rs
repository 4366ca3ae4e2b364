//! Networks along spirals beside principal components on made-up people whose shapes are not linear, as a table.
//!
//! `cargo run --release -p xavatar-learned --example spiral_bodies -- BODY.npz [flesh|posed] [PEOPLE] [EPOCHS] [VERTICES]` makes PEOPLE people with two bulges
//! that each sit elsewhere, on BODY's mesh with about VERTICES vertices left: of the same bones and at rest, as flesh is where bones are apart, or with bones and
//! limbs of their own. It trains on them with 16, 32 and 64 codes and measures an eighth as many others: the mean distance of a vertex when the shape is squeezed to that many
//! numbers and made again, by principal components and by the auto-decoder, whose codes are found by least squares; at last by the autoencoder with 16.

mod people;

use std::path::PathBuf;
use std::time::Instant;

use glam::DVec3;
use xavatar_formats::Result;
use xavatar_learned::core::{Identity, shapes_of};
use xavatar_learned::descent::{Descent, Learner};
use xavatar_learned::spiral::{AutodecoderTraining, Autoencoder, FACTORS, Level, levels};

use people::mean_distance;

/// Numbers that a shape is squeezed to.
const CODES: [usize; 3] = [16, 32, 64];

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let file = PathBuf::from(arguments.next().unwrap_or_else(|| "SMPLX_NEUTRAL.npz".into()));
    let is_posed = arguments.next().is_some_and(|word| word == "posed");
    let mut number = |default: usize| arguments.next().and_then(|text| text.parse().ok()).unwrap_or(default);
    let (count, epochs, vertices) = (number(800), number(150), number(300));
    let body = people::body(&file, vertices)?;
    let made: Vec<Vec<DVec3>> =
        (0..count + count.div_ceil(8)).map(|person| people::shape(&body, person, is_posed)).collect();
    let (known, others) = made.split_at(count);
    let levels = levels(&body.bent(), &FACTORS)?;
    let sizes: Vec<usize> = levels.iter().map(|level| level.points.len()).collect();
    println!("{count} people, {} others, {epochs} epochs; levels of {sizes:?} vertices", others.len());
    println!("| codes | principal components, mm | auto-decoder, mm | seconds |\n|---|---|---|---|");
    for codes in CODES {
        let components = of_components(known, others, codes);
        let began = Instant::now();
        let autodecoder = of_autodecoder(&levels, known, others, codes, epochs)?;
        let seconds = began.elapsed().as_secs_f64();
        println!("| {codes} | {:.2} | {:.2} | {seconds:.0} |", 1e3 * components, 1e3 * autodecoder);
    }
    let began = Instant::now();
    let autoencoder = of_autoencoder(&levels, known, others, CODES[0], epochs)?;
    println!("autoencoder, {} codes: {:.2} mm, {:.0} s", CODES[0], 1e3 * autoencoder, began.elapsed().as_secs_f64());
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
