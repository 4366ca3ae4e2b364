//! `xavatar convert`: a checkpoint of the released X-Avatar code as an avatar.

use std::path::PathBuf;

use xavatar::avatar::{Avatar, OfficialMeta};

use crate::cli::Outcome;
use crate::cli::options::inputs::load_body;
use crate::cli::output::files;

/// Make an avatar of a checkpoint that the released X-Avatar code trained
#[derive(clap::Args)]
#[command(after_help = "Example:\n  \
    xavatar convert checkpoints/last.ckpt --meta meta_info.npz --body models/smplx --out avatar.safetensors\n\n\
    Nothing in the checkpoint is run: it is read as data, and refused if it asks for more.")]
pub struct Convert {
    /// A .pth of three state dicts, or a .ckpt of PyTorch Lightning
    #[arg(value_name = "CHECKPOINT")]
    checkpoint: PathBuf,
    /// The meta_info.npz beside it: gender, shape, representation
    #[arg(long, value_name = "FILE")]
    meta: PathBuf,
    /// SMPL-X model file, or the folder that holds SMPLX_{GENDER}.npz or .pkl (the meta file chooses)
    #[arg(long, value_name = "BODY")]
    body: PathBuf,
    /// The avatar to write
    #[arg(long, value_name = "FILE", default_value = Avatar::FILE)]
    out: PathBuf,
}

impl Convert {
    pub fn run(self) -> anyhow::Result<Outcome> {
        files::new_file(&self.out)?;
        let meta = OfficialMeta::read(&self.meta)?;
        let (body, _) = load_body(&self.body, meta.gender)?;
        let avatar = Avatar::from_official(&self.checkpoint, &meta, &body)?;
        avatar.save(&self.out)?;
        files::print(&format!("{}\n", self.out.display()))?;
        Ok(Outcome::Done)
    }
}
