//! `xavatar extract`: an avatar as a mesh, in its canonical pose or another.

use std::path::{Path, PathBuf};

use serde::Serialize;
use xavatar::avatar::{Avatar, Extraction};
use xavatar::data::{MotionOptions, RestPose};
use xavatar::synthetic::load_poses;

use crate::cli::Outcome;
use crate::cli::options::inputs::load_body;
use crate::cli::options::meshes::{MeshFormat, resolution};
use crate::cli::options::motion::warn;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;

/// Write an avatar as a coloured mesh
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar extract runs/00016 --resolution 512 --out canonical.ply\n  \
    xavatar extract avatar.safetensors --pose wave.npz --body models/smplx --out wave.obj")]
pub struct Extract {
    /// An avatar.safetensors or a run's folder
    #[arg(value_name = "AVATAR")]
    avatar: PathBuf,
    /// Cells along the longest side of the box around the body
    #[arg(long, value_name = "R", default_value_t = 256, value_parser = resolution)]
    resolution: usize,
    /// The mesh to write, .ply or .obj
    #[arg(long, value_name = "FILE", default_value = "avatar.ply")]
    out: PathBuf,
    /// Pose it as in the first frame of a motion, instead of the canonical pose
    #[arg(long, value_name = "FILE", requires = "body")]
    pose: Option<PathBuf>,
    /// Body model file or folder, to pose with
    #[arg(long, value_name = "BODY")]
    body: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgument,
}

/// What was written.
#[derive(Serialize)]
struct Extracted<'a> {
    file: &'a Path,
    vertices: usize,
    faces: usize,
    /// Smaller parts that were left out.
    dropped_components: usize,
}

impl Extract {
    pub fn run(self) -> anyhow::Result<Outcome> {
        let format = MeshFormat::of(&self.out)?;
        files::new_file(&self.out)?;
        self.json.check()?;
        let avatar = Avatar::load(&self.avatar)?;
        let Extraction { mesh, dropped_components } = match (&self.pose, &self.body) {
            (Some(pose), Some(body)) => {
                let (body, labels) = load_body(body, avatar.subject.gender)?;
                let rest = RestPose::of_canonical(&avatar.subject.skeleton, &avatar.subject.joints);
                let options = MotionOptions { rest, ..MotionOptions::default() };
                let clip = load_poses(pose, &options, &avatar.subject.skeleton, Some(&body))?;
                warn(&clip.warnings);
                let first = clip.poses.into_iter().next();
                let pose = first.unwrap_or_else(|| body.skeleton().rest_pose());
                avatar.extract_posed(&body, &labels, &pose, self.resolution)?
            }
            _ => {
                let canonical = avatar.subject.skeleton.canonical_pose(&avatar.subject.betas);
                avatar.extract_canonical(&canonical, self.resolution)?
            }
        };
        if dropped_components > 0 {
            log::info!("kept the largest part; {dropped_components} smaller ones left out");
        }
        format.write(&self.out, &mesh)?;
        let (vertices, faces) = (mesh.vertices.len(), mesh.faces.len());
        let extracted = Extracted { file: &self.out, vertices, faces, dropped_components };
        self.json.print(&extracted, &format!("{}: {vertices} vertices, {faces} faces", self.out.display()))?;
        Ok(Outcome::Done)
    }
}
