//! `xavatar body convert`: a model with its shapes mirrored, or on another mesh.

use std::path::PathBuf;

use xavatar::body::{BodyModel, mano};
use xavatar::formats::write_npz;

use super::{Outcome, outputs};
use crate::cli::wrong_usage;

/// Write a body model anew: mended
#[derive(clap::Args)]
#[command(after_help = "Example:\n  xavatar body convert models/MANO_LEFT.pkl --mirror-shapes --out MANO_LEFT.npz")]
pub struct Convert {
    /// A model's file: .npz, .pkl, or SUPR's .npy
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Change the sign of x in all shapes: for left hands that `body info` finds it wrong in
    #[arg(long)]
    mirror_shapes: bool,
    /// The model to write, .npz
    #[arg(long, value_name = "BODY.npz")]
    out: PathBuf,
}

impl Convert {
    pub fn run(self) -> anyhow::Result<Outcome> {
        outputs::new_file(&self.out)?;
        if !self.mirror_shapes {
            wrong_usage!("nothing to change: give --mirror-shapes");
        }
        let arrays = mano::with_mirrored_shapes(BodyModel::read_arrays(&self.file)?)?;
        let body = BodyModel::from_arrays(&self.out, &arrays)?;
        write_npz(&self.out, &arrays)?;
        outputs::print(&format!("{}: {}\n", self.out.display(), body.skeleton().family))?;
        Ok(Outcome::Done)
    }
}
