//! `xavatar body info`: what a body model is, whatever its family and its container.

use std::path::PathBuf;

use xavatar::body::BodyModel;
use xavatar::learned::blsm::BlsmBody;

use super::{BodyDescription, bones_and_flesh};
use crate::cli::Outcome;
use crate::cli::output::json::JsonArgument;

/// Say what a body model is: family, joints, coefficients, parts, and what is wrong with it
#[derive(clap::Args)]
#[command(after_help = "Example:\n  xavatar body info models/SMPLX_NEUTRAL.npz")]
pub struct Info {
    /// A model's file: .npz, .pkl, or SUPR's .npy
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    json: JsonArgument,
}

impl Info {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        let arrays = BodyModel::read_arrays(&self.file)?;
        if BlsmBody::is_in(&arrays) {
            let described = bones_and_flesh::Description::of(&self.file, &arrays)?;
            self.json.print(&described, &described)?;
        } else {
            let described = BodyDescription::of(&self.file, &arrays)?;
            self.json.print(&described, &described)?;
        }
        Ok(Outcome::Done)
    }
}
