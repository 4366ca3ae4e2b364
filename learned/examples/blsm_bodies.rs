//! What keeping bones and flesh apart is worth on made-up people whose bones differ in three known modes, as a table.
//!
//! `cargo run --release -p xavatar-learned --example blsm_bodies -- BODY.npz [PEOPLE] [POSES]` trains on PEOPLE people in POSES poses each with 2 mm of noise,
//! beside SMPL's way on the same skeleton, weights and number of coefficients, whose shapes are principal components of whole people; both are
//! measured on a quarter as many others. Then it fits 40 people from nothing.

use std::path::PathBuf;
use std::time::Instant;

use glam::DVec3;
use xavatar_body::{BodyModel, Gender};
use xavatar_formats::{Error, Result};
use xavatar_learned::blsm::{BlsmBody, BlsmFit, BlsmPopulation, BlsmTraining, Free, whole_bodies};
use xavatar_learned::evaluation::evaluate;
use xavatar_learned::kept::Kept;
use xavatar_learned::registrations::Registrations;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let file = PathBuf::from(arguments.next().unwrap_or_else(|| "SMPLX_NEUTRAL.npz".into()));
    let mut number = |default: usize| arguments.next().and_then(|text| text.parse().ok()).unwrap_or(default);
    let (people, poses) = (number(20), number(10));
    let unseen = people.div_ceil(4);
    let start = BodyModel::load(&file, Gender::of_file_name(&file).unwrap_or_default())?;
    let folder = std::env::temp_dir().join(format!("blsm-bodies-{}", std::process::id()));
    let population = BlsmPopulation { subjects: people + unseen, poses, noise: 2e-3, seed: 0 };
    let truth = population.write(&start, &folder, |_| Ok(()))?;
    let of = |range: std::ops::Range<usize>| {
        let paths: Vec<PathBuf> = range.map(|subject| folder.join(format!("{subject:02}"))).collect();
        Registrations::find(&paths, start.vertex_count())
    };
    let (known, others) = (of(0..people)?, of(people..people + unseen)?);
    println!("{people} people, {poses} poses, {} vertices; measured on {unseen} others", start.vertex_count());
    let began = Instant::now();
    let training = BlsmTraining { shapes: 7, keep_weights: false };
    let Some(trained) = training.train(&start, &known, &mut Kept::nothing(), |_| Ok(()))? else { return Ok(()) };
    let minutes = began.elapsed().as_secs_f64() / 60.0;
    let body = &trained.body;
    println!(
        "{} modes of bones with {:.1} % of the variance, planted ones within {:.1} degrees of them; {minutes:.1} minutes",
        body.bone_basis.len(),
        100.0 * trained.explained,
        largest_angle(&truth, body).to_degrees()
    );
    let fit = BlsmFit::new(body, 1e-6);
    let mut distances = Vec::new();
    for path in others.subjects.iter().flat_map(|subject| &subject.frames) {
        let frame = others.read(path)?;
        distances.push(fit.distance(&fit.nearest(&frame, Free::All, None), &frame));
    }
    let coefficients = body.bone_basis.len() + body.shape_basis.len();
    println!("| body | coefficients | other people and poses, mm |\n|---|---|---|");
    println!("| bones and flesh apart | {coefficients} | {:.2} |", 1e3 * mean(&distances));
    let whole = whole_bodies(&start, &known, coefficients)?;
    for at in evaluate(&whole, &others, &[], None, None, |_| Ok(()))?.shapes {
        println!("| whole people's principal components | {} | {:.2} |", at.coefficients, at.mean_mm);
    }
    let exact = BlsmFit::new(&truth, 0.0);
    let recovered = |subject: &usize| {
        let target: Vec<DVec3> =
            truth.posed(&BlsmPopulation { noise: 0.0, ..population }.parameters(&truth, *subject, 0)).vertices;
        exact.distance(&exact.nearest(&target, Free::All, None), &target) < 1e-4
    };
    println!("from nothing, {} of 40 people within 0.1 mm", (1000..1040).filter(recovered).count());
    std::fs::remove_dir_all(&folder).map_err(Error::io(&folder))
}

/// The largest angle between a planted mode of bone lengths and the space of those that were found, radians.
fn largest_angle(truth: &BlsmBody, found: &BlsmBody) -> f64 {
    let lengths = |mode: &Vec<f64>| -> Vec<f64> {
        mode.iter().zip(&truth.skeleton.offsets).skip(1).map(|(scale, offset)| scale * offset.length()).collect()
    };
    let dot = |one: &[f64], other: &[f64]| one.iter().zip(other).map(|(one, other)| one * other).sum::<f64>();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for mut row in found.bone_basis.iter().map(lengths) {
        for other in &basis {
            let along = dot(&row, other);
            row.iter_mut().zip(other).for_each(|(value, entry)| *value -= along * entry);
        }
        let length = dot(&row, &row).sqrt();
        basis.push(row.iter().map(|value| value / length).collect());
    }
    let angle = |mode: Vec<f64>| {
        let within: f64 = basis.iter().map(|row| dot(&mode, row).powi(2)).sum();
        (within / dot(&mode, &mode)).sqrt().min(1.0).acos()
    };
    truth.bone_basis.iter().map(lengths).map(angle).fold(0.0, f64::max)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}
