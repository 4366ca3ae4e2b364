//! What verbs take that pose an avatar again and again: the avatar, its body, a motion, and how a pose becomes a mesh.

use std::path::PathBuf;

use xavatar::Result;
use xavatar::avatar::{Animator, Avatar, Extraction, FixedTopology};
use xavatar::body::{BodyModel, PartLabels, Pose};

use crate::cli::options::inputs::body_of;
use crate::cli::options::meshes::resolution;
use crate::cli::options::motion::MotionArguments;

/// An avatar, and how it is posed.
#[derive(clap::Args)]
pub struct PosingArguments {
    /// An avatar.safetensors or a run's folder
    #[arg(value_name = "AVATAR")]
    pub avatar: PathBuf,
    /// Body model file of any family, or a folder that holds SMPLX_{GENDER}.npz or .pkl; the demo's avatar needs none
    #[arg(long, value_name = "BODY")]
    body: Option<PathBuf>,
    /// Cells along the longest side of the box around the body
    #[arg(long, value_name = "R", default_value_t = 256, value_parser = resolution)]
    pub resolution: usize,
    /// Skin one canonical mesh to every frame instead of extracting each: many frames a second, and the same faces in all of
    /// them, as other programs want; but what one part of the body hides of another stays in the mesh
    #[arg(long)]
    pub fixed_topology: bool,
    #[command(flatten)]
    pub motion: MotionArguments,
}

impl PosingArguments {
    /// The avatar, its body and the body's parts.
    pub fn load(&self) -> anyhow::Result<(Avatar, BodyModel, PartLabels)> {
        let avatar = Avatar::load(&self.avatar)?;
        let (body, labels) = body_of(&avatar, self.body.as_deref())?;
        Ok((avatar, body, labels))
    }

    /// Extracts a mesh for every pose, or skins one to all.
    pub fn poser<'a>(
        &self,
        avatar: &'a Avatar,
        body: &'a BodyModel,
        labels: &'a PartLabels,
        is_skinned: bool,
    ) -> Result<Poser<'a>> {
        Ok(match is_skinned {
            true => Poser::Skinned(Box::new(FixedTopology::new(avatar, body, self.resolution)?)),
            false => Poser::Extracted(Box::new(Animator::new(avatar, body, labels)?), self.resolution),
        })
    }
}

/// Where meshes of poses come from.
pub enum Poser<'a> {
    Extracted(Box<Animator<'a>>, usize),
    Skinned(Box<FixedTopology>),
}

impl Poser<'_> {
    /// The mesh of a pose; of a skinned mesh, nothing is dropped in a pose.
    pub fn extraction(&self, pose: &Pose) -> Result<Extraction> {
        match self {
            Self::Extracted(animator, resolution) => animator.extract(pose, *resolution),
            Self::Skinned(topology) => Ok(Extraction { mesh: topology.pose(pose)?, dropped_components: 0 }),
        }
    }

    /// Smaller parts that are missing in every pose.
    pub fn dropped_components(&self) -> usize {
        match self {
            Self::Extracted(..) => 0,
            Self::Skinned(topology) => topology.dropped_components(),
        }
    }

    /// Poses to make at the same time: an extraction has work for all threads, a skinned mesh for one.
    pub fn at_once(&self) -> usize {
        match self {
            Self::Extracted(..) => 1,
            Self::Skinned(_) => rayon::current_num_threads(),
        }
    }
}
