//! `xavatar animate`: an avatar through a motion, one mesh a frame.

use std::path::{Path, PathBuf};

use anyhow::bail;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use xavatar::avatar::{Animator, Avatar, FixedTopology};
use xavatar::body::BodyParameters;
use xavatar::data::read_motion;

use super::extract::MeshFormat;
use super::inputs::load_body;
use super::progress::Progress;
use super::{Outcome, outputs};

/// Write one mesh for each frame of a motion
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar animate runs/00016 data/00016/test/Take4 --body models/smplx --out animation\n  \
    xavatar animate avatar.safetensors dance.npz --z-up --body models/smplx --out animation --format obj\n  \
    xavatar animate runs/00016 dance.npz --body models/smplx --out animation --fixed-topology\n\n\
    Frames that an interrupted call has written are kept; the same call again writes the rest.")]
pub struct Animate {
    /// An avatar.safetensors or a run's folder
    #[arg(value_name = "AVATAR")]
    avatar: PathBuf,
    /// A folder of X-Humans SMPLX/*.pkl, an AMASS or GRAB .npz, or the .npz of docs/motion.md
    #[arg(value_name = "MOTION")]
    motion: PathBuf,
    /// SMPL-X model file, or the folder that holds SMPLX_{GENDER}.npz or .pkl
    #[arg(long, value_name = "BODY")]
    body: PathBuf,
    /// The folder that gets mesh-f00001.ply and so on: new, empty, or that of the same call before
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// How meshes are written
    #[arg(long, value_enum, default_value_t = MeshFormat::Ply)]
    format: MeshFormat,
    /// Cells along the longest side of the box around the body
    #[arg(long, value_name = "R", default_value_t = 256, value_parser = super::extract::resolution)]
    resolution: usize,
    /// The motion stands along Z (AMASS, GRAB): turn it to stand along Y
    #[arg(long)]
    z_up: bool,
    /// Skin one canonical mesh to every frame instead of extracting each: many frames a second, and the same faces in all of
    /// them, as other programs want; but what one part of the body hides of another stays in the mesh
    #[arg(long)]
    fixed_topology: bool,
}

/// A mesh to be made.
struct Frame {
    path: PathBuf,
    parameters: BodyParameters,
}

/// What a folder's meshes were made from, so that two animations never mix.
#[derive(PartialEq, Serialize, Deserialize)]
struct Source {
    avatar: PathBuf,
    motion: PathBuf,
    frames: usize,
    resolution: usize,
    z_up: bool,
    fixed_topology: bool,
}

impl Animate {
    pub fn run(self) -> anyhow::Result<Outcome> {
        let avatar = Avatar::load(&self.avatar)?;
        let (body, labels) = load_body(&self.body, avatar.subject.gender)?;
        let mut motion = read_motion(&self.motion)?;
        if self.z_up {
            motion = motion.turned_from_z_up();
        }
        log::info!("{} frames: {}", motion.frames.len(), motion.source);
        // The shape is the avatar's own, whoever the motion was captured from.
        let absent: Vec<_> = motion.zeroed.iter().filter(|name| *name != "betas").map(String::as_str).collect();
        if !absent.is_empty() {
            log::info!("not in the motion, so zero: {}", absent.join(", "));
        }
        let total = motion.frames.len();
        Source {
            avatar: std::path::absolute(&self.avatar)?,
            motion: std::path::absolute(&self.motion)?,
            frames: total,
            resolution: self.resolution,
            z_up: self.z_up,
            fixed_topology: self.fixed_topology,
        }
        .claim(&self.out)?;
        let file = |number: usize| self.out.join(format!("mesh-f{number:05}.{}", self.format.extension()));
        let frames = (1..).zip(motion.frames).map(|(number, parameters)| Frame { path: file(number), parameters });
        let missing: Vec<Frame> = frames.filter(|frame| !frame.path.exists()).collect();
        let kept = total - missing.len();
        let mut progress = Progress::new();
        let mut done = kept;
        let mut show = |more: usize| {
            done += more;
            progress.show("meshes", done as f64 / total as f64, &format!("{done} of {total}"));
        };
        let mut dropped_components = 0;
        if self.fixed_topology {
            let topology = FixedTopology::new(&avatar, &body, self.resolution)?;
            dropped_components = topology.dropped_components();
            // Files of different frames are written at the same time.
            for frames in missing.chunks(rayon::current_num_threads()) {
                frames
                    .par_iter()
                    .try_for_each(|frame| self.format.write(&frame.path, &topology.pose(&frame.parameters)?))?;
                show(frames.len());
            }
        } else {
            let animator = Animator::new(&avatar, &body, &labels)?;
            for frame in &missing {
                let extraction = animator.extract(&frame.parameters, self.resolution)?;
                dropped_components += extraction.dropped_components;
                self.format.write(&frame.path, &extraction.mesh)?;
                show(1);
            }
        }
        progress.finish();
        if kept > 0 {
            log::info!("{kept} of {total} meshes were there already and are kept");
        }
        if dropped_components > 0 {
            log::info!("kept the largest part of each mesh; {dropped_components} smaller ones left out");
        }
        println!("{}: {total} meshes", self.out.display());
        Ok(Outcome::Done)
    }
}

impl Source {
    const FILE: &str = "animation.json";

    /// Notes the source in a new folder; finds it noted in that of an earlier call.
    fn claim(&self, folder: &Path) -> anyhow::Result<()> {
        let note = folder.join(Self::FILE);
        if outputs::is_new_or_empty(folder)? {
            outputs::existing_folder(folder)?;
            return outputs::write_json(&note, self);
        }
        let text = std::fs::read_to_string(&note).unwrap_or_default();
        if serde_json::from_str(&text).ok().as_ref() != Some(self) {
            bail!("{}: the folder is not empty, and not of the same animation; give a new --out", folder.display());
        }
        Ok(())
    }
}
