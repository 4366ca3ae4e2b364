//! `xavatar animate`: an avatar through a motion, one mesh a frame, each written as soon as it is made.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use anyhow::{Context, bail};
use rayon::prelude::*;
use serde::Serialize;
use xavatar::avatar::Avatar;
use xavatar::body::Pose;
use xavatar::formats::{read_bytes, read_text};

use crate::cli::options::meshes::MeshFormat;
use crate::cli::options::motion::MotionArguments;
use crate::cli::options::posing::PosingArguments;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;
use crate::cli::{Outcome, stop};

/// Write one mesh for each frame of a motion
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar animate runs/00016 data/00016/test/Take4 --body models/smplx --out animation\n  \
    xavatar animate avatar.safetensors amass.npz --fps 30 --frames 1..300 --body models/smplx --out animation --format obj\n  \
    xavatar animate runs/00016 walk.bvh --translation origin --body models/smplx --out animation --fixed-topology\n  \
    xavatar animate runs/demo dance --out animation\n\n\
    Frames are written as they are made. After Ctrl-C or a crash, the same call with --resume makes those that are missing.")]
pub struct Animate {
    #[command(flatten)]
    posing: PosingArguments,
    /// An X-Humans sequence, AMASS, GRAB or pose estimator's .npz or .pkl, a .bvh (docs/motion.md), or `dance`: a built-in one
    #[arg(value_name = "MOTION")]
    motion: PathBuf,
    /// The folder that gets mesh-f00001.ply and so on; new or empty
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Go on with the animation that an interrupted call with the same arguments began in the folder
    #[arg(long)]
    resume: bool,
    /// How meshes are written
    #[arg(long, value_enum, default_value_t = MeshFormat::Ply)]
    format: MeshFormat,
    #[command(flatten)]
    json: JsonArgument,
}

/// What is in the folder.
#[derive(Serialize)]
struct Animated<'a> {
    folder: &'a Path,
    meshes: usize,
    /// Fewer meshes if the animation was stopped.
    frames: usize,
    frames_per_second: f32,
    /// Smaller parts that were left out of the meshes made by this call.
    dropped_components: usize,
}

/// A mesh to be made.
struct Frame {
    path: PathBuf,
    pose: Pose,
}

/// What a folder's meshes are made from, so that two animations never mix.
#[derive(Serialize)]
struct Source<'a> {
    avatar: PathBuf,
    avatar_checksum: u32,
    motion: PathBuf,
    motion_checksum: u32,
    frames: usize,
    frames_per_second: f32,
    format: &'static str,
    resolution: usize,
    fixed_topology: bool,
    options: &'a MotionArguments,
}

impl Animate {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        let PosingArguments { avatar: path, resolution, fixed_topology, motion: options, .. } = &self.posing;
        let (avatar, body, labels) = self.posing.load()?;
        let clip = options.load(&self.motion, &avatar, Some(&body))?;
        let (total, frames_per_second) = (clip.poses.len(), clip.frames_per_second);
        let avatar_file = if path.is_dir() { path.join(Avatar::FILE) } else { path.clone() };
        Source {
            avatar: std::path::absolute(path)?,
            avatar_checksum: checksum(&read_bytes(&avatar_file)?),
            motion: std::path::absolute(&self.motion)?,
            motion_checksum: checksum(format!("{:?}", clip.poses).as_bytes()),
            frames: total,
            frames_per_second,
            format: self.format.extension(),
            resolution: *resolution,
            fixed_topology: *fixed_topology,
            options,
        }
        .claim(&self.out, self.resume)?;
        let file = |number: usize| self.out.join(format!("mesh-f{number:05}.{}", self.format.extension()));
        let frames = (1..).zip(clip.poses).map(|(number, pose)| Frame { path: file(number), pose });
        let missing: Vec<Frame> = frames.filter(|frame| !frame.path.exists()).collect();
        let kept = total - missing.len();
        if kept > 0 {
            log::info!("{kept} of {total} meshes are there already and are kept");
        }
        let stop = stop::on_interrupt()?;
        let mut progress = Progress::new();
        let mut done = kept;
        let mut show = |more: usize| {
            done += more;
            progress.show("meshes", done as f64 / total as f64, &format!("{done} of {total}"));
            done
        };
        show(0);
        let poser = self.posing.poser(&avatar, &body, &labels, *fixed_topology)?;
        let mut dropped_components = poser.dropped_components();
        for frames in missing.chunks(poser.at_once()).take_while(|_| !stop.load(Ordering::Relaxed)) {
            let made = frames.par_iter().map(|frame| {
                let extraction = poser.extraction(&frame.pose)?;
                self.format.write(&frame.path, &extraction.mesh)?;
                Ok(extraction.dropped_components)
            });
            dropped_components += made.sum::<xavatar::Result<usize>>()?;
            show(frames.len());
        }
        let done = show(0);
        progress.finish();
        if dropped_components > 0 {
            log::info!("kept the largest part of each mesh; {dropped_components} smaller ones left out");
        }
        let folder = self.out.display();
        let (outcome, line) = if done < total {
            let line = format!("{folder}: {done} of {total} meshes; go on with the same call and --resume");
            (Outcome::Stopped, line)
        } else {
            (Outcome::Done, format!("{folder}: {total} meshes, {frames_per_second} per second"))
        };
        let animated =
            Animated { folder: &self.out, meshes: done, frames: total, frames_per_second, dropped_components };
        self.json.print(&animated, &line)?;
        Ok(outcome)
    }
}

impl Source<'_> {
    const FILE: &'static str = "animation.json";

    /// Notes the source in a new folder; to resume, finds the same noted there.
    fn claim(&self, folder: &Path, resume: bool) -> anyhow::Result<()> {
        let note = folder.join(Self::FILE);
        if files::is_new_or_empty(folder)? {
            files::existing_folder(folder)?;
            return files::write_json(&note, self);
        }
        if !resume {
            bail!("{}: the folder is not empty; give a new --out, or --resume to go on with it", folder.display());
        }
        let text = read_text(&note)
            .with_context(|| format!("{}: no animation was begun in this folder; give a new --out", note.display()))?;
        let noted: serde_json::Value = serde_json::from_str(&text)
            .with_context(|| format!("{}: not readable; give a new --out", note.display()))?;
        // Through text as well, so that numbers are rounded alike.
        let asked: serde_json::Value = serde_json::from_str(&serde_json::to_string(self)?)?;
        let mut differences = Vec::new();
        compare("", &noted, &asked, &mut differences);
        if !differences.is_empty() {
            let differences = differences.join("; ");
            bail!(
                "{}: not the same animation: {differences}; repeat the first call's arguments, or give a new --out",
                folder.display()
            );
        }
        Ok(())
    }
}

/// Lists what differs between two JSON values, each with its name.
fn compare(name: &str, noted: &serde_json::Value, asked: &serde_json::Value, differences: &mut Vec<String>) {
    if let (Some(noted), Some(asked)) = (noted.as_object(), asked.as_object()) {
        let names: std::collections::BTreeSet<&String> = noted.keys().chain(asked.keys()).collect();
        for name in names {
            let [noted, asked] = [noted, asked].map(|values| values.get(name).unwrap_or(&serde_json::Value::Null));
            compare(name, noted, asked, differences);
        }
    } else if noted != asked {
        differences.push(format!("{name} was {noted}, now {asked}"));
    }
}

fn checksum(bytes: &[u8]) -> u32 {
    let mut checksum = flate2::Crc::new();
    checksum.update(bytes);
    checksum.sum()
}
