//! `xavatar body eval`: how well a body fits registrations.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;
use xavatar::body::{BodyModel, Coefficients};
use xavatar::learned::evaluation::{AtCoefficients, Evaluation, OfFeet, OnGround, Pressed, evaluate};
use xavatar::learned::registrations::Registrations;
use xavatar::learned::truth::KnownTruth;
use xavatar::report::LineFigure;

use super::feet;
use crate::cli::Outcome;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;

/// Measure how near a body comes to registrations, by the number of its coefficients
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar body eval trained.npz unseen-people --json eval.json\n  \
    xavatar body eval models/SMPLX_NEUTRAL.npz 00901 --coefficients 2,5,10 --figure eval.svg\n\n\
    Registrations are meshes in the body's topology: folders of people, X-Humans' subjects, FAUST's tr_reg_000.ply.")]
pub struct Eval {
    /// A model's file: .npz, .pkl, or SUPR's .npy
    #[arg(value_name = "BODY")]
    body: PathBuf,
    /// Folders of registrations, or meshes
    #[arg(value_name = "REGISTRATIONS", required = true)]
    registrations: Vec<PathBuf>,
    /// Numbers of coefficients that are fitted; those that the body has, and always all of them
    #[arg(long, value_name = "K,...", value_delimiter = ',', default_value = "1,2,5,10,16,32,64,100,300")]
    coefficients: Vec<usize>,
    /// Height of the ground under registrations, metres, of a body whose feet were trained; without it each registration's own, where its feet are flat
    #[arg(long, value_name = "Y", allow_hyphen_values = true)]
    ground: Option<f64>,
    /// Draw distances over numbers of coefficients: of registrations, of people at rest, of people that are made up
    #[arg(long, value_name = "FILE.svg")]
    figure: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgument,
}

/// What is printed.
#[derive(Serialize)]
#[serde(transparent)]
struct Table(Evaluation);

impl Eval {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        self.figure.as_deref().map_or(Ok(()), files::new_file)?;
        let arrays = BodyModel::read_arrays(&self.body)?;
        let model = BodyModel::from_arrays_with(&self.body, &arrays, Coefficients::All)?;
        let registrations = Registrations::find(&self.registrations, model.vertex_count())?;
        let truth = KnownTruth::find(&self.registrations)?;
        let feet = feet::of_file(&self.body, &arrays, &model, self.ground)?;
        let on_ground = feet.as_ref().map(|feet| OnGround { feet, ground: self.ground });
        let mut progress = Progress::new();
        let found = evaluate(&model, &registrations, &self.coefficients, on_ground, truth.as_ref(), |share| {
            progress.show("fitting", share, "people");
            Ok(())
        })?;
        progress.finish();
        if let Some(path) = &self.figure {
            files::write_text(path, &figure(&found).svg()?)?;
        }
        let table = Table(found);
        self.json.print(&table, &table)?;
        Ok(Outcome::Done)
    }
}

/// Distances over numbers of coefficients.
fn figure(found: &Evaluation) -> LineFigure {
    let line = |name: &str, of: fn(&AtCoefficients) -> f64| {
        (name.to_owned(), found.shapes.iter().map(|at| (at.coefficients as f64, of(at))).collect())
    };
    LineFigure {
        title: format!("{} registrations of {} people", found.frames, found.subjects),
        axes: "coefficients; mean distance of a vertex, mm".into(),
        lines: vec![
            line("registrations", |at| at.mean_mm),
            line("people at rest (generalisation)", |at| at.generalisation_mm.unwrap_or(f64::NAN)),
            line("made-up people from the nearest (specificity)", |at| at.specificity_mm.unwrap_or(f64::NAN)),
        ],
    }
}

impl fmt::Display for Table {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Evaluation { frames, subjects, shapes, poses_mm, by_subject, pruning, feet, truth } = &self.0;
        writeln!(formatter, "{frames} registrations of {subjects} people")?;
        writeln!(
            formatter,
            "{:>12}  {:>8}  {:>9}  {:>11}  {:>17}  {:>14}",
            "coefficients", "mean mm", "AUC 10 mm", "compactness", "generalisation mm", "specificity mm"
        )?;
        for at in shapes {
            let of_space = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3}"));
            writeln!(
                formatter,
                "{:>12}  {:>8.3}  {:>9.4}  {:>11}  {:>17}  {:>14}",
                at.coefficients,
                at.mean_mm,
                at.auc,
                of_space(at.compactness),
                of_space(at.generalisation_mm),
                of_space(at.specificity_mm)
            )?;
        }
        if let Some(poses) = poses_mm {
            writeln!(formatter, "other poses in the shape of the first: {poses:.3} mm")?;
        }
        if let Some(worst) = by_subject.iter().max_by(|one, other| one.mean_mm.total_cmp(&other.mean_mm)) {
            writeln!(formatter, "worst: {}, {:.3} mm", worst.name, worst.mean_mm)?;
        }
        for at in pruning {
            writeln!(
                formatter,
                "correctives below {:.0} mm pruned: {:.1} % of the blocks left, vertices {:.3} mm off, {:.1} mm at most",
                at.level_mm,
                100.0 * at.blocks,
                at.mean_mm,
                at.largest_mm
            )?;
        }
        if let Some(OfFeet { in_contact, others }) = feet {
            for (name, Pressed { without_mm, with_mm, .. }) in [("on the ground", in_contact), ("above it", others)] {
                writeln!(formatter, "feet {name}: {without_mm:.3} mm, {with_mm:.3} mm as the ground presses them")?;
            }
        }
        let Some(truth) = truth else { return Ok(()) };
        if let Some(joints) = truth.joints_mm {
            writeln!(formatter, "joints from where they are known to be: {joints:.2} mm")?;
        }
        match truth.support_f1 {
            Some(f1) => writeln!(formatter, "correctives' support: F1 {f1:.3}"),
            None => Ok(()),
        }
    }
}
