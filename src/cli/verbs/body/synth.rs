//! `xavatar body synth`: a made-up population whose truth is known, to try every training of bodies on.

use std::path::PathBuf;

use clap::ValueEnum;
use serde::Serialize;
use xavatar::body::{BodyModel, Gender};
use xavatar::learned::blsm::BlsmPopulation;
use xavatar::learned::population::Population;
use xavatar::synthetic::BuiltInSubject;

use crate::cli::Outcome;
use crate::cli::options::inputs;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;
use crate::cli::wrong_usage;

/// Write registrations of a made-up population, with the truth about it
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar body synth --out people\n  \
    xavatar body synth --body anny.npz --subjects 5 --poses 20 --out few\n  \
    xavatar body synth --ground --out standing\n\n\
    People differ in the body's shapes; poses are random; sparse correctives of two joints a vertex are planted. `truth/` has the body, and where joints are.")]
pub struct Synth {
    /// Folder to make: a folder a person with a mesh a pose, and `truth`
    #[arg(long, value_name = "REGISTRATIONS")]
    out: PathBuf,
    /// Body whose skeleton, weights and shapes people have; without it the built-in one
    #[arg(long, value_name = "BODY")]
    body: Option<PathBuf>,
    /// How people differ: supr in shapes, with sparse pose correctives; blsm in three modes of bones and in flesh
    #[arg(long, value_enum, value_name = "KIND", default_value = "supr")]
    kind: Kind,
    /// How many people
    #[arg(long, value_name = "N", default_value_t = 20)]
    subjects: usize,
    /// Registrations of each
    #[arg(long, value_name = "N", default_value_t = 50)]
    poses: usize,
    /// Noise of a registration, millimetres a coordinate
    #[arg(long, value_name = "MM", default_value_t = 2.0)]
    noise: f64,
    /// People stand on the ground, y = 0, which presses their feet; for --kind supr
    #[arg(long)]
    ground: bool,
    /// Others than those of another number
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    json: JsonArgument,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    Supr,
    Blsm,
}

/// What was written.
#[derive(Serialize)]
struct Written<'a> {
    folder: &'a PathBuf,
    subjects: usize,
    registrations: usize,
    vertices: usize,
}

impl Synth {
    pub fn run(self) -> anyhow::Result<Outcome> {
        files::new_folder(&self.out, "choose another")?;
        self.json.check()?;
        if self.ground && matches!(self.kind, Kind::Blsm) {
            wrong_usage!("--ground is for --kind supr")
        }
        let start: BodyModel = match &self.body {
            Some(path) => inputs::load_body(path, Gender::of_file_name(path).unwrap_or_default())?.0,
            None => BuiltInSubject::new()?.model().clone(),
        };
        let (subjects, poses, noise, seed) = (self.subjects, self.poses, self.noise * 1e-3, self.seed);
        let mut progress = Progress::new();
        let tell = |share: f64| {
            progress.show("people", share, "registrations");
            Ok(())
        };
        match self.kind {
            Kind::Supr => {
                let population =
                    Population { subjects, poses, noise, ground: self.ground, seed, ..Population::default() };
                population.write(&start, &self.out, tell)?;
            }
            Kind::Blsm => drop(BlsmPopulation { subjects, poses, noise, seed }.write(&start, &self.out, tell)?),
        }
        progress.finish();
        let registrations = self.subjects * self.poses;
        let written =
            Written { folder: &self.out, subjects: self.subjects, registrations, vertices: start.vertex_count() };
        let line = format!(
            "{}: {registrations} registrations of {} people, {} vertices each, and the truth about them",
            self.out.display(),
            self.subjects,
            start.vertex_count()
        );
        self.json.print(&written, &line)?;
        Ok(Outcome::Done)
    }
}
