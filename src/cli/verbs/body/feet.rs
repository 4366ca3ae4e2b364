//! Feet that the ground presses, of a body that stands: training them, and those of a file.

use std::fmt;
use std::path::Path;

use serde::Serialize;
use xavatar::body::BodyModel;
use xavatar::formats::{ArrayMap, write_npz};
use xavatar::learned::feet::{Feet, FeetTraining};
use xavatar::learned::kept::Kept;
use xavatar::learned::registrations::Registrations;

use crate::cli::output::progress::Progress;
use crate::cli::wrong_usage;

/// Times that the networks see all registrations at most.
const EPOCHS: usize = 400;
/// Of the networks.
const SEED: u64 = 0;

/// What was trained.
#[derive(Serialize)]
pub struct Trained<'a> {
    file: &'a Path,
    subjects: usize,
    registrations: usize,
    /// Of both feet.
    vertices: usize,
    epochs: usize,
    /// Of registrations that were held out, the mean distance of a foot's vertex from the body, and from the body whose feet are pressed as its networks say.
    before_mm: f64,
    held_out_mm: f64,
}

/// Trains the feet of a body on registrations, and writes its file, whose arrays are these, with them; none if that was stopped.
pub fn train<'a>(
    model: &BodyModel,
    mut arrays: ArrayMap,
    registrations: &Registrations,
    ground: Option<f64>,
    file: &'a Path,
    kept: &mut Kept<'_>,
) -> anyhow::Result<Option<Trained<'a>>> {
    let mut progress = Progress::new();
    let training = FeetTraining { epochs: EPOCHS, seed: SEED, ground };
    let trained = training.train(model, registrations, kept, |phase, share| {
        progress.show(phase, share, "on the ground");
        Ok(())
    })?;
    progress.finish();
    let Some(trained) = trained else { return Ok(None) };
    arrays.extend(trained.feet.to_arrays()?);
    write_npz(file, &arrays)?;
    Ok(Some(Trained {
        file,
        subjects: registrations.subjects.len(),
        registrations: registrations.frames(),
        vertices: trained.feet.vertices().count(),
        epochs: trained.held_out.len(),
        before_mm: 1e3 * trained.before,
        held_out_mm: 1e3 * trained.held_out.iter().copied().fold(f64::INFINITY, f64::min),
    }))
}

/// The feet in the file of a body, if it has any; a ground without feet is wrong usage.
pub fn of_file(path: &Path, arrays: &ArrayMap, model: &BodyModel, ground: Option<f64>) -> anyhow::Result<Option<Feet>> {
    match Feet::are_in(arrays) {
        true => Ok(Some(Feet::from_arrays(path, arrays, model)?)),
        false if ground.is_some() => {
            wrong_usage!("--ground: the feet of {} were not trained (xavatar body train --kind feet)", path.display())
        }
        false => Ok(None),
    }
}

impl fmt::Display for Trained<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, subjects, registrations, vertices, epochs, before_mm, held_out_mm } = self;
        writeln!(
            formatter,
            "{}: with feet of {vertices} vertices that the ground presses, of {registrations} registrations of {subjects} people",
            file.display()
        )?;
        writeln!(formatter, "held out: {before_mm:.2} mm without, {held_out_mm:.2} mm with them, {epochs} epochs")
    }
}
