//! What sparse correctives are worth on a made-up population, as a table.
//!
//! `cargo run --release -p xavatar-learned --example trained_bodies -- BODY.npz [PEOPLE] [POSES]` trains on PEOPLE people in POSES poses each, with
//! 12 mm of planted correctives and 2 mm of noise, and measures on a fifth as many other people.

use std::path::PathBuf;
use std::time::Instant;

use xavatar_body::{BodyModel, Coefficients, Gender};
use xavatar_formats::{Error, Result};
use xavatar_learned::core::Family;
use xavatar_learned::evaluation::evaluate;
use xavatar_learned::kept::Kept;
use xavatar_learned::population::Population;
use xavatar_learned::registrations::Registrations;
use xavatar_learned::sparse::{Kind, Training};
use xavatar_learned::truth::KnownTruth;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let body = PathBuf::from(arguments.next().unwrap_or_else(|| "SMPLX_NEUTRAL.npz".into()));
    let mut number = |default: usize| arguments.next().and_then(|text| text.parse().ok()).unwrap_or(default);
    let (people, poses) = (number(20), number(50));
    let unseen = people.div_ceil(5);
    let start = BodyModel::load(&body, Gender::of_file_name(&body).unwrap_or_default())?;
    let folder = std::env::temp_dir().join(format!("trained-bodies-{}", std::process::id()));
    let population = Population { subjects: people + unseen, poses, ..Population::default() };
    population.write(&start, &folder, |_| Ok(()))?;
    let of = |range: std::ops::Range<usize>| {
        let paths: Vec<PathBuf> = range.map(|subject| folder.join(format!("{subject:02}"))).collect();
        Registrations::find(&paths, start.vertex_count())
    };
    let (known, others) = (of(0..people)?, of(people..people + unseen)?);
    let truth = KnownTruth::find(std::slice::from_ref(&folder))?;
    println!("{people} people, {poses} poses, {} vertices; measured on {unseen} others", start.vertex_count());
    println!(
        "| correctives | other people and poses, mm | one shape, other poses, mm | joints, mm | support F1 | blocks | minutes |"
    );
    println!("|---|---|---|---|---|---|---|");
    for (name, kind) in [("none", Kind::Plain), ("dense, ridge", Kind::Dense), ("sparse", Kind::Sparse)] {
        let began = Instant::now();
        let training = Training { family: Family::Supr, kind, weights: false };
        let Some(trained) = training.train(&start, &known, &mut Kept::nothing(), |_| Ok(()))? else { break };
        let minutes = began.elapsed().as_secs_f64() / 60.0;
        let model = BodyModel::from_arrays_with(&body, &trained.arrays, Coefficients::All)?;
        let found = evaluate(&model, &others, &[], None, truth.as_ref(), |_| Ok(()))?;
        let shape = found.shapes.last().map_or(f64::NAN, |at| at.mean_mm);
        let (joints, f1) = found.truth.map_or((None, None), |truth| (truth.joints_mm, truth.support_f1));
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
        let blocks = trained.correctives.density(model.skeleton().joints.len() - 1) * 100.0;
        let poses_mm = number(found.poses_mm);
        println!(
            "| {name} | {shape:.2} | {poses_mm} | {} | {} | {blocks:.1} % | {minutes:.1} |",
            number(joints),
            number(f1)
        );
    }
    std::fs::remove_dir_all(&folder).map_err(Error::io(&folder))
}
