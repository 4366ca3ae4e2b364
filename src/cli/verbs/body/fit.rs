//! `xavatar body fit`: the parameters in which a BLSM body comes nearest to registrations.

use std::path::PathBuf;

use serde::Serialize;
use xavatar::formats::write_npz;
use xavatar::learned::blsm::{BlsmFit, FleshedBody};
use xavatar::learned::registrations::Registrations;

use crate::cli::Outcome;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;

/// What a coefficient that is 1 costs, metres^2: a millimetre of one vertex.
const HELD: f64 = 1e-6;

/// Find the pose, the bones and the shape of a BLSM body in registrations of one person
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar body fit blsm.npz people/07/0003.ply --out params.npz\n  \
    xavatar body fit blsm.npz people/07 --out params.npz && xavatar body pose blsm.npz params.npz --out body.ply\n\n\
    Several registrations have the same bones and shape. docs/trained-bodies.md says how bones and flesh are told apart.")]
pub struct Fit {
    /// A body of `body train --kind blsm`
    #[arg(value_name = "BODY")]
    body: PathBuf,
    /// A mesh of the body's topology, or a folder with one person's
    #[arg(value_name = "REGISTRATION")]
    registration: PathBuf,
    /// Parameters to write, .npz
    #[arg(long, value_name = "PARAMS")]
    out: PathBuf,
    #[command(flatten)]
    json: JsonArgument,
}

/// What was found.
#[derive(Serialize)]
struct Found<'a> {
    file: &'a PathBuf,
    registrations: usize,
    /// The mean distance of a vertex, millimetres.
    mean_mm: f64,
    /// Coefficients of the bones' modes, and of the shape.
    bones: Vec<f64>,
    shape: Vec<f64>,
}

impl Fit {
    pub fn run(self) -> anyhow::Result<Outcome> {
        files::new_file(&self.out)?;
        self.json.check()?;
        let body = FleshedBody::read(&self.body)?;
        let vertices = body.mean()?.template.len();
        let found = Registrations::find(std::slice::from_ref(&self.registration), vertices)?;
        let paths = found.subjects.iter().flat_map(|subject| &subject.frames);
        let frames = paths.map(|path| found.read(path)).collect::<Result<Vec<_>, _>>()?;
        let (parameters, body) = body.person(&frames, HELD)?;
        let fit = BlsmFit::new(&body, HELD);
        let distances = parameters.iter().zip(&frames).map(|(parameters, frame)| fit.distance(parameters, frame));
        let mean_mm = 1e3 * distances.sum::<f64>() / frames.len() as f64;
        write_npz(&self.out, &body.parameter_arrays(&parameters))?;
        let (bones, shape) = (parameters[0].bones.clone(), parameters[0].shape.clone());
        let written = Found { file: &self.out, registrations: frames.len(), mean_mm, bones, shape };
        let line = format!("{}: {} registrations, {mean_mm:.2} mm away", self.out.display(), frames.len());
        self.json.print(&written, &line)?;
        Ok(Outcome::Done)
    }
}
