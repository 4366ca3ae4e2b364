//! `xavatar body separate`: a head, a hand or a foot of a body, as a model of its own.

use std::path::PathBuf;

use clap::ValueEnum;
use serde::Serialize;
use xavatar::body::{BodyModel, Coefficients};
use xavatar::formats::write_npz;

use crate::cli::Outcome;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;

/// Cut a part out of a body: in every pose it equals the whole there
#[derive(clap::Args)]
#[command(after_help = "Example:\n  \
    xavatar body separate models/SMPLX_NEUTRAL.npz --part left_hand --out hand.npz\n\n\
    The part's root is the lowest joint above all that move it; turned and placed as that joint is in the whole, the part equals the whole.")]
pub struct Separate {
    /// A model's file: .npz, .pkl, or SUPR's .npy
    #[arg(value_name = "BODY")]
    body: PathBuf,
    /// What to cut out
    #[arg(long, value_enum, value_name = "PART")]
    part: PartName,
    /// The model to write, .npz
    #[arg(long, value_name = "PART.npz")]
    out: PathBuf,
    #[command(flatten)]
    json: JsonArgument,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
#[value(rename_all = "snake_case")]
enum PartName {
    Head,
    LeftHand,
    RightHand,
    LeftFoot,
    RightFoot,
}

/// What was written.
#[derive(Serialize)]
struct Written<'a> {
    file: &'a PathBuf,
    vertices: usize,
    joints: Vec<String>,
    shapes: usize,
    /// Places of the part's vertices in the whole.
    of_whole: Vec<usize>,
}

impl PartName {
    /// The joint from which on a part is cut.
    fn joint(self) -> &'static str {
        match self {
            Self::Head => "head",
            Self::LeftHand => "left_wrist",
            Self::RightHand => "right_wrist",
            Self::LeftFoot => "left_ankle",
            Self::RightFoot => "right_ankle",
        }
    }
}

impl Separate {
    pub fn run(self) -> anyhow::Result<Outcome> {
        files::new_file(&self.out)?;
        self.json.check()?;
        let body = BodyModel::from_arrays_with(&self.body, &BodyModel::read_arrays(&self.body)?, Coefficients::All)?;
        let part = body.separated(&body.vertices_from(self.part.joint())?, 0.0)?;
        write_npz(&self.out, &part.model.to_arrays())?;
        let joints = part.model.skeleton().joints.clone();
        let line = format!(
            "{}: {} of {} vertices, {} joints below {}",
            self.out.display(),
            part.vertices.len(),
            body.vertex_count(),
            joints.len(),
            joints[0]
        );
        let shapes = part.model.shape_coefficients();
        let written =
            Written { file: &self.out, vertices: part.vertices.len(), joints, shapes, of_whole: part.vertices };
        self.json.print(&written, &line)?;
        Ok(Outcome::Done)
    }
}
