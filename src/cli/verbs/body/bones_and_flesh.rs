//! BLSM bodies, whose bones and flesh are apart, in the verbs that take any body: what they hold, a pose of them, training one.

use std::fmt;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::Serialize;
use xavatar::body::{BodyModel, Skeleton, smpl, smplx};
use xavatar::data::{MotionOptions, RestPose};
use xavatar::formats::{ArrayFile, ArrayMap, write_npz};
use xavatar::learned::blsm::{BlsmBody, BlsmParameters, BlsmTraining, FleshedBody, SpiralTraining};
use xavatar::learned::kept::Kept;
use xavatar::learned::registrations::Registrations;
use xavatar::synthetic::load_poses;

use crate::cli::output::progress::Progress;
use crate::cli::wrong_usage;

/// Times that a network sees all people's flesh.
const EPOCHS: usize = 200;
/// Of the network.
const SEED: u64 = 0;

/// What makes shapes.
const LINEAR: &str = "linear";
const SPIRAL: &str = "by a network along spirals";

/// What a body's file holds.
#[derive(Serialize)]
pub struct Description {
    family: &'static str,
    vertices: usize,
    faces: usize,
    joints: Vec<String>,
    atoms: usize,
    bone_modes: usize,
    shape_coefficients: usize,
    /// What makes shapes: sums, or a network.
    identity: &'static str,
}

/// How people's flesh is learned.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Identity {
    /// Sums of shapes, principal components
    Linear,
    /// Principal components bent by a network along spirals on the mesh
    Spiral,
}

/// What was trained.
#[derive(Serialize)]
pub struct Trained<'a> {
    file: &'a Path,
    family: &'static str,
    subjects: usize,
    registrations: usize,
    bone_modes: usize,
    /// The share of the variance of bones' lengths that the modes have.
    bones_explained: f64,
    identity: &'static str,
    shapes: usize,
    /// Of the registrations, after each round.
    mean_mm: Vec<f64>,
}

impl Description {
    /// Of the arrays of a file.
    pub fn of(path: &Path, arrays: &ArrayMap) -> xavatar::Result<Self> {
        let body = FleshedBody::from_arrays(path, arrays)?;
        let identity = match &body {
            FleshedBody::Linear(_) => LINEAR,
            FleshedBody::Spiral(_) => SPIRAL,
        };
        let body = body.mean()?.into_owned();
        Ok(Self {
            identity,
            family: "BLSM",
            vertices: body.template.len(),
            faces: body.faces.len(),
            atoms: body.atoms.count(),
            bone_modes: body.bone_basis.len(),
            shape_coefficients: body.shape_basis.len(),
            joints: body.names,
        })
    }
}

impl fmt::Display for Description {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { family, vertices, faces, joints, atoms, bone_modes, shape_coefficients, identity } = self;
        writeln!(formatter, "{family} body model, bones and flesh apart: {vertices} vertices, {faces} faces")?;
        writeln!(formatter, "{} joints, turned by {atoms} atoms: {}", joints.len(), joints.join(", "))?;
        writeln!(formatter, "coefficients: {bone_modes} of bones, {shape_coefficients} of shape, {identity}")
    }
}

impl fmt::Display for Trained<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, family, subjects, registrations, bone_modes, shapes, identity, .. } = self;
        writeln!(
            formatter,
            "{}: a {family} body of {registrations} registrations of {subjects} people",
            file.display()
        )?;
        writeln!(
            formatter,
            "{bone_modes} modes of bones with {:.1} % of the variance, {shapes} shapes, {identity}",
            100.0 * self.bones_explained
        )?;
        let distances: Vec<String> = self.mean_mm.iter().map(|distance| format!("{distance:.2}")).collect();
        let shapes = if self.identity == SPIRAL { ", with linear shapes" } else { "" };
        writeln!(formatter, "registrations, after each round{shapes}: {} mm", distances.join(", "))
    }
}

/// Trains a body on registrations and writes it; none if that was stopped.
pub fn train<'a>(
    start: &BodyModel,
    registrations: &Registrations,
    keep_weights: bool,
    (identity, codes): (Identity, usize),
    file: &'a Path,
    kept: &mut Kept<'_>,
) -> anyhow::Result<Option<Trained<'a>>> {
    let mut progress = Progress::new();
    let trained = BlsmTraining { shapes: codes, keep_weights }.train(start, registrations, kept, |share| {
        progress.show("training", share, "bones and flesh");
        Ok(())
    })?;
    progress.finish();
    let Some(trained) = trained else { return Ok(None) };
    let (arrays, shapes, identity) = match identity {
        Identity::Linear => (trained.body.to_arrays(), trained.body.shape_basis.len(), LINEAR),
        Identity::Spiral => {
            let mut progress = Progress::new();
            let training = SpiralTraining { codes, epochs: EPOCHS, seed: SEED };
            let found = training.train(trained.body.clone(), &trained.flesh, kept, |share| {
                progress.show("flesh", share, "by a network along spirals");
                Ok(())
            })?;
            progress.finish();
            let Some((body, _)) = found else { return Ok(None) };
            (body.to_arrays()?, body.code_count(), SPIRAL)
        }
    };
    write_npz(file, &arrays)?;
    Ok(Some(Trained {
        file,
        family: "BLSM",
        subjects: registrations.subjects.len(),
        registrations: registrations.frames(),
        bone_modes: trained.body.bone_basis.len(),
        bones_explained: trained.explained,
        identity,
        shapes,
        mean_mm: trained.distances.iter().map(|distance| distance * 1e3).collect(),
    }))
}

/// The skeleton of another family with the same joints, by which motions are read.
pub fn skeleton_of(body: &BlsmBody) -> Option<&'static Skeleton> {
    [smplx::skeleton(), smpl::skeleton()].into_iter().find(|skeleton| skeleton.joints == body.names)
}

/// The parameters of the frames of a file: the body's own, or a motion of a skeleton with the same joints.
pub fn frames_of(body: &BlsmBody, path: &PathBuf) -> anyhow::Result<Vec<BlsmParameters>> {
    if let Some(found) = if path.is_file() { ArrayFile::read(path)? } else { None }
        && BlsmBody::has_parameters(&found.arrays)
    {
        return Ok(body.parameters_of(path, &found.arrays)?);
    }
    let Some(skeleton) = skeleton_of(body) else {
        wrong_usage!("motions drive bodies with the joints of SMPL-X or SMPL; give parameters of `xavatar body fit`")
    };
    let rest: Vec<glam::Vec3> = body.skeleton.rest().iter().map(|joint| joint.as_vec3()).collect();
    let options = MotionOptions { rest: RestPose::of_canonical(skeleton, &rest), ..MotionOptions::default() };
    let clip = load_poses(path, &options, skeleton, None)?;
    clip.report.iter().for_each(|line| log::info!("{line}"));
    let (bones, shape) = (vec![0.0; body.bone_basis.len()], vec![0.0; body.shape_basis.len()]);
    let frames = clip.poses.iter().map(|pose| body.in_pose(pose, &bones, &shape));
    let (frames, cuts): (Vec<BlsmParameters>, Vec<f64>) = frames.unzip();
    let cut = cuts.into_iter().fold(0.0, f64::max).to_degrees();
    if cut > 1.0 {
        log::warn!("joints turn as far as their atoms do: up to {cut:.0} degrees of the motion are cut off");
    }
    Ok(frames)
}
