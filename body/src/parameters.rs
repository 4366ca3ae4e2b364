//! One frame's body as its source states it, before any body model is at hand.

use glam::Vec3;

use super::families::{mano, smplx};
use super::{BodyModel, Pose};
use xavatar_formats::{Error, Result};

/// A pose in the terms of its source. [`BodyModel::resolve`] makes it one that bodies take.
#[derive(Clone, Debug, PartialEq)]
pub enum BodyParameters {
    /// Absolute rotations of a skeleton's joints.
    Absolute(Pose),
    /// SMPL-X's parameters with their hand conventions.
    Smplx(Box<smplx::Parameters>),
    /// MANO's parameters with their hand convention.
    Mano(Box<mano::Parameters>),
}

impl BodyParameters {
    /// Translation added to every vertex, metres.
    pub fn translation(&self) -> Vec3 {
        match self {
            Self::Absolute(pose) => pose.translation,
            Self::Smplx(parameters) => parameters.transl,
            Self::Mano(parameters) => parameters.transl,
        }
    }

    /// SMPL-X's parameters, which some layouts of files are made for.
    ///
    /// # Errors
    /// [`Error::Value`] if they are none.
    pub fn smplx(&self) -> Result<&smplx::Parameters> {
        let found = match self {
            Self::Smplx(parameters) => return Ok(parameters),
            Self::Absolute(pose) => format!("{} absolute rotations", pose.rotations.len()),
            Self::Mano(_) => "MANO's".into(),
        };
        Err(Error::Value {
            name: "a frame's parameters".into(),
            found,
            expected: "SMPL-X's, as its files have them".into(),
        })
    }

    /// The pose, if it takes no body model to say what it is.
    ///
    /// # Errors
    /// [`Error::Value`] for hands that are stated relative to a model's mean hand.
    pub fn absolute(&self) -> Result<Pose> {
        match self {
            Self::Absolute(pose) => Ok(pose.clone()),
            Self::Smplx(parameters) => parameters.absolute(),
            Self::Mano(parameters) => parameters.absolute(),
        }
    }
}

impl From<Pose> for BodyParameters {
    fn from(pose: Pose) -> Self {
        Self::Absolute(pose)
    }
}

impl From<smplx::Parameters> for BodyParameters {
    fn from(parameters: smplx::Parameters) -> Self {
        Self::Smplx(Box::new(parameters))
    }
}

impl From<mano::Parameters> for BodyParameters {
    fn from(parameters: mano::Parameters) -> Self {
        Self::Mano(Box::new(parameters))
    }
}

impl BodyModel {
    /// The pose that parameters mean on this model.
    ///
    /// # Errors
    /// [`Error::Value`] if they are those of another skeleton, or of hands that the model does not know.
    pub fn resolve(&self, parameters: &BodyParameters) -> Result<Pose> {
        match parameters {
            BodyParameters::Absolute(pose) => {
                self.check(pose)?;
                Ok(pose.clone())
            }
            BodyParameters::Smplx(parameters) => {
                self.skeleton().require(smplx::skeleton(), "the parameters")?;
                parameters.resolve(self.hands())
            }
            BodyParameters::Mano(parameters) => {
                let pose = parameters.resolve(self.hands())?;
                self.check(&pose)?;
                Ok(pose)
            }
        }
    }
}
