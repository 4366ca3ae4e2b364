//! `xavatar body retarget`: the same angles, other bones.

use std::path::{Path, PathBuf};

use glam::Vec3;
use serde::Serialize;
use xavatar::body::{BodyModel, Gender, Pose, Skeleton, smplx};
use xavatar::data::{Motion, MotionOptions, PosedClip, RestPose, onto_legs, write_motion};
use xavatar::export::{RiggedMesh, write_glb};
use xavatar::formats::{ArrayFile, write_npz};
use xavatar::learned::blsm::{BlsmBody, BlsmParameters, FleshedBody};
use xavatar::synthetic::{BuiltInSubject, load_poses};

use super::bones_and_flesh::skeleton_of;
use crate::cli::options::inputs;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::{Outcome, wrong_usage};

/// More than this is cut off by limits, degrees: said.
const SAID: f64 = 1.0;

/// Put a motion on a body with other bones: its angles stay, its path becomes as long as the legs
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar body retarget dance --to blsm.npz --out dancer.glb\n  \
    xavatar body retarget walk.npz --from models/SMPLX_MALE.npz --to blsm.npz --person params.npz --out walker.glb\n  \
    xavatar body retarget walk.bvh --from models/SMPLX_MALE.npz --to child.npz --out walk-of-child.npz\n\n\
    A .glb holds the body itself, with its bones' sizes as scales of nodes; an .npz the motion alone.")]
pub struct Retarget {
    /// A motion of any format (docs/motion.md), or `dance`: a built-in one
    #[arg(value_name = "MOTION")]
    motion: PathBuf,
    /// Body that the motion was made on; without it the built-in one
    #[arg(long, value_name = "BODY")]
    from: Option<PathBuf>,
    /// Body that gets it: one of `body train --kind blsm`, or one with SMPL-X's joints
    #[arg(long, value_name = "BODY")]
    to: PathBuf,
    /// Parameters of `body fit` that say whose bones and shape the BLSM body has; without them the mean person's
    #[arg(long, value_name = "PARAMS")]
    person: Option<PathBuf>,
    /// What to write: .glb for a BLSM body that moves, .npz for its parameters or the motion
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    json: JsonArgument,
}

/// What was written.
#[derive(Serialize)]
struct Written<'a> {
    file: &'a Path,
    frames: usize,
    frames_per_second: f32,
    /// How long the legs are beside those that the motion was made on.
    legs: f32,
    /// The largest angle that limits of joints cut off, degrees.
    cut_degrees: f64,
}

impl Retarget {
    pub fn run(self) -> anyhow::Result<Outcome> {
        files::new_file(&self.out)?;
        self.json.check()?;
        let arrays = BodyModel::read_arrays(&self.to)?;
        let (clip, source, rest) = self.read()?;
        let frames_per_second = clip.frames_per_second;
        let (frames, legs, cut_degrees) = if BlsmBody::is_in(&arrays) {
            let body = FleshedBody::from_arrays(&self.to, &arrays)?;
            let person = self.person_of(&*body.mean()?)?;
            self.onto_blsm(&*body.at(&person.shape)?, person, clip, &source, &rest)?
        } else {
            self.onto_model(&BodyModel::from_arrays(&self.to, &arrays)?, clip, &source, &rest)?
        };
        let written = Written { file: &self.out, frames, frames_per_second, legs, cut_degrees };
        let line = format!("{}: {frames} frames, on legs {legs:.3} times as long", self.out.display());
        self.json.print(&written, &line)?;
        Ok(Outcome::Done)
    }

    /// The motion, the skeleton that it is of, and where its joints are at rest.
    fn read(&self) -> anyhow::Result<(PosedClip, Skeleton, Vec<Vec3>)> {
        let body = match &self.from {
            Some(path) => inputs::load_body(path, Gender::of_file_name(path).unwrap_or_default())?.0,
            None => BuiltInSubject::new()?.model().clone(),
        };
        let skeleton = body.skeleton().clone();
        let canonical = body.canonical_joints(&[])?;
        let options = MotionOptions { rest: RestPose::of_canonical(&skeleton, &canonical), ..MotionOptions::default() };
        let clip = load_poses(&self.motion, &options, &skeleton, Some(&body))?;
        clip.report.iter().for_each(|line| log::info!("{line}"));
        crate::cli::options::motion::warn(&clip.warnings);
        let rest = body.anatomy().joints.template.iter().map(|joint| joint.as_vec3()).collect();
        Ok((clip, skeleton, rest))
    }

    fn onto_blsm(
        &self,
        body: &BlsmBody,
        person: BlsmParameters,
        clip: PosedClip,
        source: &Skeleton,
        from: &[Vec3],
    ) -> anyhow::Result<(usize, f32, f64)> {
        let Some(skeleton) = skeleton_of(body) else {
            wrong_usage!("{}: motions drive bodies with the joints of SMPL-X or SMPL", self.to.display())
        };
        let places = body.posed(&BlsmParameters { bones: person.bones.clone(), ..body.rest() }).skeleton.places;
        let to: Vec<Vec3> = places.iter().map(|place| place.as_vec3()).collect();
        let mut poses: Vec<Pose> = clip.poses.iter().map(|pose| source.transfer(pose, skeleton).pose).collect();
        let legs = onto_legs(&mut poses, from, &to);
        let turned = poses.iter().map(|pose| body.in_pose(pose, &person.bones, &person.shape));
        let (frames, cuts): (Vec<BlsmParameters>, Vec<f64>) = turned.unzip();
        let cut = cuts.into_iter().fold(0.0, f64::max).to_degrees();
        if cut > SAID {
            log::warn!("joints turn as far as their atoms do: up to {cut:.0} degrees of the motion are cut off");
        }
        if self.is_glb() {
            write_glb(&self.out, &RiggedMesh::of_scaled_bones(body, &frames, clip.frames_per_second))?;
        } else {
            write_npz(&self.out, &body.parameter_arrays(&frames))?;
        }
        Ok((frames.len(), legs, cut))
    }

    fn onto_model(
        &self,
        body: &BodyModel,
        clip: PosedClip,
        source: &Skeleton,
        from: &[Vec3],
    ) -> anyhow::Result<(usize, f32, f64)> {
        if self.is_glb() || self.person.is_some() || body.skeleton().joints != smplx::skeleton().joints {
            wrong_usage!(
                "{}: a GLB, and a person, are for bodies of `xavatar body train --kind blsm`; a motion for bodies with SMPL-X's joints",
                self.to.display()
            )
        }
        let to: Vec<Vec3> = body.anatomy().joints.template.iter().map(|joint| joint.as_vec3()).collect();
        let mut poses: Vec<Pose> =
            clip.poses.iter().map(|pose| source.transfer(pose, smplx::skeleton()).pose).collect();
        let legs = onto_legs(&mut poses, from, &to);
        let motion = Motion {
            frames: poses.iter().map(|pose| smplx::Parameters { betas: Vec::new(), ..pose.into() }).collect(),
            frames_per_second: Some(clip.frames_per_second),
            ..Motion::default()
        };
        write_motion(&self.out, &motion)?;
        Ok((poses.len(), legs, 0.0))
    }

    /// Whose bones and shape the body has.
    fn person_of(&self, body: &BlsmBody) -> anyhow::Result<BlsmParameters> {
        let Some(path) = &self.person else { return Ok(body.rest()) };
        let arrays = ArrayFile::read(path)?.map(|file| file.arrays).unwrap_or_default();
        Ok(body.parameters_of(path, &arrays)?.into_iter().next().unwrap_or_else(|| body.rest()))
    }

    fn is_glb(&self) -> bool {
        self.out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("glb"))
    }
}
