//! How fine meshes are, and as what they are written.

use std::path::Path;

use xavatar::mesh::{FINEST_RESOLUTION, TriangleMesh, write_obj, write_ply};

use crate::cli::wrong_usage;

/// How a mesh is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum MeshFormat {
    Ply,
    Obj,
}

impl MeshFormat {
    /// By the file's extension.
    pub fn of(path: &Path) -> anyhow::Result<Self> {
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("ply") => Ok(Self::Ply),
            Some("obj") => Ok(Self::Obj),
            _ => wrong_usage!("{}: name it .ply or .obj", path.display()),
        }
    }

    pub fn extension(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Obj => "obj",
        }
    }

    pub fn write(self, path: &Path, mesh: &TriangleMesh) -> xavatar::Result<()> {
        match self {
            Self::Ply => Ok(write_ply(path, mesh)?),
            Self::Obj => Ok(write_obj(path, mesh)?),
        }
    }
}

/// Parses a number of cells that the extraction takes.
pub fn resolution(text: &str) -> Result<usize, String> {
    let cells = text.parse().ok().filter(|cells| (16..=FINEST_RESOLUTION).contains(cells));
    cells.ok_or_else(|| format!("expected 16 to {FINEST_RESOLUTION} cells"))
}
