//! `xavatar body train`: a body of registrations, or its feet on the ground.

use std::fmt;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::ValueEnum;
use serde::Serialize;
use xavatar::body::{BodyModel, Coefficients, smpl};
use xavatar::formats::{ArrayMap, npy_bytes, write_npz};
use xavatar::learned::core::Family;
use xavatar::learned::kept::Kept;
use xavatar::learned::registrations::Registrations;
use xavatar::learned::sparse::{Kind, Progress as Round, Training};
use xavatar::synthetic::BuiltInSubject;

use super::bones_and_flesh::{self, Identity};
use super::feet;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;
use crate::cli::verbs::register::stopped;
use crate::cli::{Outcome, stop, wrong_usage};

/// Fewer people or poses than these do not tell shape from pose.
const ENOUGH: (usize, usize) = (10, 30);
/// Shape coefficients of a BLSM body at most.
const CODES: usize = 32;

/// Train a body model on registrations: template, joints, weights, shapes, sparse pose correctives
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar body synth --out people && xavatar body train people --out body.npz\n  \
    xavatar body train registrations --from models/SMPLX_NEUTRAL.npz --out body.npz\n  \
    xavatar body train people --kind blsm --out blsm.npz\n  \
    xavatar body train people --kind blsm --identity spiral --codes 32 --out blsm.npz\n  \
    xavatar body train anna --from models/SMPLX_NEUTRAL.npz --kind blsm --out dressed.npz\n  \
    xavatar body train dfaust --from models/SMPL_NEUTRAL.pkl --kind star --out star.npz\n  \
    xavatar body train standing --from body.npz --kind feet --ground 0 --out body-with-feet.npz\n\n\
    Registrations are meshes in the topology of the body that training begins with: a folder a person, X-Humans' subjects, FAUST's files; \
    of a person's folders each is a take, with clothes of its own under --kind blsm. \
    The result is a body file for every verb with --body (docs/trained-bodies.md). After Ctrl-C or a crash, the same call with --resume goes on; until it is done \
    BODY.npz.training has what was found.")]
pub struct Train {
    /// Folders of registrations
    #[arg(value_name = "REGISTRATIONS", required = true)]
    registrations: Vec<PathBuf>,
    /// The model to write, .npz
    #[arg(long, value_name = "BODY.npz")]
    out: PathBuf,
    /// Body that training begins with: skeleton, weights, topology; without it the built-in one
    #[arg(long, value_name = "BODY")]
    from: Option<PathBuf>,
    /// What the body is: star for SMPL's 24 joints, supr for any, blsm with bones and flesh apart (no correctives of poses),
    /// feet for the body of --from with what the ground does to its feet; without it star or supr by the joints
    #[arg(long, value_enum, value_name = "KIND")]
    kind: Option<FileKind>,
    /// How a BLSM body learns people's flesh: sums of shapes, or these bent by a network
    #[arg(long, value_enum, value_name = "HOW", requires = "kind")]
    identity: Option<Identity>,
    /// Shape coefficients of a BLSM body at most [default: 32]
    #[arg(long, value_name = "N", requires = "kind", value_parser = clap::value_parser!(u16).range(1..))]
    codes: Option<u16>,
    /// Pose correctives: sparse, dense as SMPL's, or none
    #[arg(long, value_enum, value_name = "HOW", default_value = "sparse")]
    correctives: Correctives,
    /// Leave skinning weights as they are
    #[arg(long)]
    keep_weights: bool,
    /// Height of the ground under --kind feet, metres; without it each registration's own, where its feet are flat
    #[arg(long, value_name = "Y", requires = "kind", allow_hyphen_values = true)]
    ground: Option<f64>,
    /// Go on with the training that an interrupted call with the same arguments began
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    json: JsonArgument,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum FileKind {
    Star,
    Supr,
    Blsm,
    Feet,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Correctives {
    Sparse,
    Dense,
    None,
}

/// What was trained.
#[derive(Serialize)]
struct Trained<'a> {
    file: &'a PathBuf,
    family: String,
    subjects: usize,
    registrations: usize,
    shapes: usize,
    /// After each round, of registrations that were held out, the first with plain skinning.
    held_out_mm: Vec<f64>,
    /// The share of corrective blocks that are not zero.
    density: f64,
    heaviness_correlation: Option<f64>,
    symmetric: bool,
}

impl Train {
    pub fn run(self) -> anyhow::Result<Outcome> {
        files::new_file(&self.out)?;
        self.json.check()?;
        if (self.identity.is_some() || self.codes.is_some()) && !matches!(self.kind, Some(FileKind::Blsm)) {
            wrong_usage!("--identity and --codes are for --kind blsm")
        }
        if self.ground.is_some() && !matches!(self.kind, Some(FileKind::Feet)) {
            wrong_usage!("--ground is for --kind feet")
        }
        // Feet are measured with all shapes that a body has.
        let coefficients = match self.kind {
            Some(FileKind::Feet) => Coefficients::All,
            _ => Coefficients::Usual,
        };
        let (start, arrays) = match &self.from {
            Some(path) => {
                let arrays = BodyModel::read_arrays(path)?;
                (BodyModel::from_arrays_with(path, &arrays, coefficients)?, arrays)
            }
            None => {
                let built_in = BuiltInSubject::new()?.model().clone();
                let arrays = built_in.to_arrays();
                (built_in, arrays)
            }
        };
        let registrations = Registrations::find(&self.registrations, start.vertex_count())?;
        let fewest = registrations.subjects.iter().map(|subject| subject.frames.len()).min().unwrap_or_default();
        if registrations.subjects.len() < ENOUGH.0 || fewest < ENOUGH.1 {
            log::warn!(
                "{} people, one with {fewest} poses: shape and pose are told apart by {} people in {} poses each",
                registrations.subjects.len(),
                ENOUGH.0,
                ENOUGH.1
            );
        }
        let stop = stop::on_interrupt()?;
        let source = self.source(&arrays, &registrations)?;
        let mut kept = Kept::in_folder(&training_folder(&self.out), &source, self.resume, stop)?;
        let outcome = self.trained(&start, arrays, &registrations, &mut kept)?;
        if outcome == Outcome::Done {
            kept.remove()?;
        }
        Ok(outcome)
    }

    /// What the training depends on, a line each.
    fn source(&self, arrays: &ArrayMap, registrations: &Registrations) -> anyhow::Result<String> {
        let mut body = flate2::Crc::new();
        for (name, array) in arrays {
            body.update(name.as_bytes());
            body.update(&npy_bytes(array));
        }
        let mut meshes = flate2::Crc::new();
        for path in registrations.subjects.iter().flat_map(|subject| &subject.frames) {
            meshes.update(path.as_os_str().as_encoded_bytes());
            meshes.update(&std::fs::metadata(path).with_context(|| path.display().to_string())?.len().to_le_bytes());
        }
        let [kind, identity, correctives] = [named(self.kind), named(self.identity), named(Some(self.correctives))];
        let (codes, ground, keep_weights) = (number(self.codes), number(self.ground), self.keep_weights);
        Ok(format!(
            "{} registrations of {} people ({:08x})\nbody {:08x}\n--kind {kind}\n--identity {identity}\n--codes {codes}\n\
             --correctives {correctives}\n--keep-weights {keep_weights}\n--ground {ground}\n",
            registrations.frames(),
            registrations.subjects.len(),
            meshes.sum(),
            body.sum()
        ))
    }

    fn trained(
        &self,
        start: &BodyModel,
        arrays: ArrayMap,
        registrations: &Registrations,
        kept: &mut Kept<'_>,
    ) -> anyhow::Result<Outcome> {
        let family = match self.kind {
            Some(FileKind::Blsm) => {
                let flesh = (self.identity.unwrap_or(Identity::Linear), self.codes.map_or(CODES, usize::from));
                let trained = bones_and_flesh::train(start, registrations, self.keep_weights, flesh, &self.out, kept)?;
                let Some(trained) = trained else { return Ok(stopped()) };
                self.json.print(&trained, &trained)?;
                return Ok(Outcome::Done);
            }
            Some(FileKind::Feet) => {
                let trained = feet::train(start, arrays, registrations, self.ground, &self.out, kept)?;
                let Some(trained) = trained else { return Ok(stopped()) };
                self.json.print(&trained, &trained)?;
                return Ok(Outcome::Done);
            }
            Some(FileKind::Star) => Family::Star,
            Some(FileKind::Supr) => Family::Supr,
            None if start.skeleton().joints == smpl::skeleton().joints => Family::Star,
            None => Family::Supr,
        };
        let kind = match self.correctives {
            Correctives::Sparse => Kind::Sparse,
            Correctives::Dense => Kind::Dense,
            Correctives::None => Kind::Plain,
        };
        let mut progress = Progress::new();
        let training = Training { family, kind, weights: !self.keep_weights };
        let trained = training.train(start, registrations, kept, |round: Round| {
            let done = round.round * round.subjects + round.done;
            let message = format!("round {}, person {} of {}", round.round + 1, round.done + 1, round.subjects);
            progress.show("training", done as f64 / (round.rounds * round.subjects) as f64, &message);
            Ok(())
        })?;
        progress.finish();
        let Some(trained) = trained else { return Ok(stopped()) };
        let body = BodyModel::from_arrays_with(&self.out, &trained.arrays, Coefficients::All)?;
        write_npz(&self.out, &trained.arrays)?;
        let written = Trained {
            file: &self.out,
            family: body.skeleton().family.clone(),
            subjects: registrations.subjects.len(),
            registrations: registrations.frames(),
            shapes: body.shape_coefficients(),
            held_out_mm: trained.held_out.iter().map(|distance| distance * 1e3).collect(),
            density: trained.correctives.density(body.skeleton().joints.len() - 1),
            heaviness_correlation: trained.heaviness,
            symmetric: trained.is_symmetric,
        };
        self.json.print(&written, &written)?;
        Ok(Outcome::Done)
    }
}

/// Where a training keeps what it found until its file is written.
fn training_folder(file: &Path) -> PathBuf {
    let mut name = file.file_name().unwrap_or_default().to_os_string();
    name.push(".training");
    file.with_file_name(name)
}

impl fmt::Display for Trained<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, family, subjects, registrations, shapes, density, .. } = self;
        writeln!(
            formatter,
            "{}: a {family} body of {registrations} registrations of {subjects} people, {shapes} shapes",
            file.display()
        )?;
        let distances: Vec<String> = self.held_out_mm.iter().map(|distance| format!("{distance:.2}")).collect();
        writeln!(formatter, "held out, after each round: {} mm", distances.join(", "))?;
        writeln!(formatter, "corrective blocks that are not zero: {:.1} %", 100.0 * density)?;
        if let Some(correlation) = self.heaviness_correlation {
            writeln!(formatter, "the second coefficient and volume over height cubed: correlation {correlation:.2}")?;
        }
        match self.symmetric {
            true => Ok(()),
            false => writeln!(formatter, "the template is not its own mirror image: no symmetry was asked for"),
        }
    }
}

/// An argument's value as it is typed.
fn named(value: Option<impl ValueEnum>) -> String {
    let value = value.and_then(|value| value.to_possible_value());
    value.map_or("by default".into(), |value| value.get_name().to_owned())
}

fn number(value: Option<impl std::fmt::Display>) -> String {
    value.map_or("by default".into(), |value| value.to_string())
}
