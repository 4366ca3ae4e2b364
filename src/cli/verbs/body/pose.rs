//! `xavatar body pose`: a body model in a pose, as a mesh.

use std::path::PathBuf;

use serde::Serialize;
use xavatar::body::{BodyModel, Gender, Pose};
use xavatar::data::{MotionOptions, RestPose};
use xavatar::learned::blsm::{BlsmBody, FleshedBody};
use xavatar::mesh::TriangleMesh;
use xavatar::synthetic::load_poses;

use super::{bones_and_flesh, feet};
use crate::cli::Outcome;
use crate::cli::options::meshes::MeshFormat;
use crate::cli::options::{inputs, motion};
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::wrong_usage;

/// Write a body model in the pose of a frame
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar body pose models/SMPLX_NEUTRAL.npz amass.npz --frame 20 --out body.ply\n  \
    xavatar body pose models/MANO_RIGHT.pkl grasp.npz --out hand.obj\n  \
    xavatar body pose models/SMPL_NEUTRAL.pkl rest --shape 1.5,-0.5 --out body.ply\n  \
    xavatar body pose body-with-feet.npz walk.npz --frame 20 --ground 0 --out standing.ply")]
pub struct PoseBody {
    /// A model's file: .npz, .pkl, or SUPR's .npy
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Any motion, a file with `pose` (three numbers a joint), `dance`, or `rest`
    #[arg(value_name = "POSE")]
    pose: PathBuf,
    /// The frame of the file, counted from 1
    #[arg(long, value_name = "N", default_value_t = 1)]
    frame: usize,
    /// Shape coefficients instead of the file's, with commas
    #[arg(long, value_name = "B", value_delimiter = ',', allow_hyphen_values = true)]
    shape: Option<Vec<f32>>,
    /// Height of the ground, metres, that presses the feet of a body of `body train --kind feet`
    #[arg(long, value_name = "Y", allow_hyphen_values = true)]
    ground: Option<f64>,
    /// The mesh to write, .ply or .obj
    #[arg(long, value_name = "FILE", default_value = "body.ply")]
    out: PathBuf,
    #[command(flatten)]
    json: JsonArgument,
}

/// The word for the pose with all rotations zero.
const REST: &str = "rest";

/// What was written.
#[derive(Serialize)]
struct Posed<'a> {
    file: &'a PathBuf,
    vertices: usize,
    joints: std::collections::BTreeMap<&'a str, [f32; 3]>,
}

impl PoseBody {
    pub fn run(self) -> anyhow::Result<Outcome> {
        let format = MeshFormat::of(&self.out)?;
        files::new_file(&self.out)?;
        self.json.check()?;
        let arrays = if self.file.is_file() { Some(BodyModel::read_arrays(&self.file)?) } else { None };
        if let Some(arrays) = arrays.as_ref().filter(|arrays| BlsmBody::is_in(arrays)) {
            if self.ground.is_some() {
                wrong_usage!("--ground is for bodies of `xavatar body train --kind feet`")
            }
            return self.pose_blsm(&FleshedBody::from_arrays(&self.file, arrays)?, format);
        }
        let body = match &arrays {
            Some(arrays) => BodyModel::from_arrays(&self.file, arrays)?,
            None => inputs::load_body(&self.file, Gender::default())?.0,
        };
        let skeleton = body.skeleton();
        let mut pose = if self.pose.as_os_str() == REST && !self.pose.exists() {
            skeleton.rest_pose()
        } else {
            let rest = RestPose::of_canonical(skeleton, &body.canonical_joints(&[])?);
            let options = MotionOptions { rest, ..MotionOptions::default() };
            let clip = load_poses(&self.pose, &options, skeleton, Some(&body))?;
            clip.report.iter().for_each(|line| log::info!("{line}"));
            motion::warn(&clip.warnings);
            let count = clip.poses.len();
            let wanted = self.frame.checked_sub(1).and_then(|index| clip.poses.into_iter().nth(index));
            match wanted {
                Some(pose) => pose,
                None => wrong_usage!("--frame {}: {} has {count} frames", self.frame, self.pose.display()),
            }
        };
        if let Some(shape) = self.shape {
            pose = Pose { shape, ..pose };
        }
        pose.shape.truncate(body.shape_coefficients());
        pose.expression.truncate(body.expression_coefficients());
        let mut posed = body.pose(&pose)?;
        if let Some(ground) = self.ground
            && let Some(feet) = feet::of_file(&self.file, &arrays.unwrap_or_default(), &body, self.ground)?
        {
            posed.vertices = feet.posed(&body, &pose, ground)?.iter().map(|vertex| vertex.as_vec3()).collect();
        }
        let joints = skeleton.joints.iter().map(String::as_str).zip(posed.joints.iter().map(|joint| joint.to_array()));
        let written = Posed { file: &self.out, vertices: posed.vertices.len(), joints: joints.collect() };
        format.write(&self.out, &body.mesh(posed.vertices.clone()))?;
        let line = format!("{}: {} vertices of {}", self.out.display(), written.vertices, skeleton.description());
        self.json.print(&written, &line)?;
        Ok(Outcome::Done)
    }

    /// A body whose bones and flesh are apart, in a frame of its parameters or of a motion.
    fn pose_blsm(&self, fleshed: &FleshedBody, format: MeshFormat) -> anyhow::Result<Outcome> {
        let body = fleshed.mean()?;
        let mut parameters = if self.pose.as_os_str() == REST && !self.pose.exists() {
            body.rest()
        } else {
            let frames = bones_and_flesh::frames_of(&body, &self.pose)?;
            let count = frames.len();
            match self.frame.checked_sub(1).and_then(|index| frames.into_iter().nth(index)) {
                Some(parameters) => parameters,
                None => wrong_usage!("--frame {}: {} has {count} frames", self.frame, self.pose.display()),
            }
        };
        if let Some(shape) = &self.shape {
            let own = shape.iter().map(|value| f64::from(*value)).chain(std::iter::repeat(0.0));
            parameters.shape = own.take(body.shape_basis.len()).collect();
        }
        let posed = fleshed.at(&parameters.shape)?.posed(&parameters);
        let vertices: Vec<glam::Vec3> = posed.vertices.iter().map(|vertex| vertex.as_vec3()).collect();
        let places = posed.skeleton.places.iter().map(|place| place.as_vec3().to_array());
        let joints = body.names.iter().map(String::as_str).zip(places).collect();
        let written = Posed { file: &self.out, vertices: vertices.len(), joints };
        format.write(&self.out, &TriangleMesh { vertices, faces: body.faces.clone(), ..TriangleMesh::default() })?;
        let line = format!("{}: {} vertices of a BLSM body", self.out.display(), written.vertices);
        self.json.print(&written, &line)?;
        Ok(Outcome::Done)
    }
}
