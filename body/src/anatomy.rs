//! What a body model is made of, whatever its family: template, skeleton, weights, and what shape, expression and pose do.
//!
//! A family's reader fills it, [`BodyModel::assemble`] checks it. V vertices, J joints, S shape and E expression coefficients;
//! metres.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::influences::Influences;
use super::{BlendShapes, BodyModel, HandSpace, Skeleton};
use xavatar_formats::{Error, Result};

/// How far rows of weights may sum from 1: f32 rounding over many joints, with a margin.
const SUM_TOLERANCE: f32 = 1e-3;

/// The parts of a body model.
#[derive(Clone, Debug)]
pub struct Anatomy {
    /// The joints (J), and what is said of them.
    pub skeleton: Skeleton,
    /// Vertices of the mean shape at rest (V).
    pub template: Vec<Vec3>,
    /// Corners of each face.
    pub faces: Vec<[u32; 3]>,
    /// Skinning weights (V, J), row-major; each row sums to 1.
    pub skinning_weights: Vec<f32>,
    /// S directions of shape, then E of expression.
    pub shapes: BlendShapes,
    /// E: how many of `shapes` are expression, the last ones.
    pub expressions: usize,
    /// Where the joints are.
    pub joints: JointBasis,
    /// What a pose adds beyond skinning.
    pub correctives: Correctives,
    /// What the family's hand conventions are relative to; a family without such conventions has none.
    pub hands: Vec<HandSpace>,
}

/// The joints at rest as an affine function of the coefficients, which every family's joint regressor comes to; in double precision,
/// since joints are sums over thousands of vertices.
#[derive(Clone, Debug)]
pub struct JointBasis {
    /// Joints of the mean shape (J).
    pub template: Vec<DVec3>,
    /// What each direction of shape and expression does to them (S + E, J).
    pub directions: Vec<Vec<DVec3>>,
}

/// Blend shapes that a pose drives.
#[derive(Clone, Debug)]
pub enum Correctives {
    /// None.
    None,
    /// By the entries, row by row, of R - I of every joint but the root: 9 (J - 1) directions (SMPL).
    RotationEntries(BlendShapes),
    /// By q - (0, 0, 0, 1), x y z w, of the joints' unit quaternions (STAR, SUPR).
    Quaternions {
        /// The first joint that drives: 1, or 0 with the root.
        first_joint: usize,
        /// The coefficient that is one more feature, the last (STAR's second).
        coefficient: Option<usize>,
        /// 4 directions a joint, and one of that coefficient.
        shapes: BlendShapes,
    },
}

impl Correctives {
    /// What they add, a direction for each feature.
    pub(super) fn shapes(&self) -> Option<&BlendShapes> {
        match self {
            Self::None => None,
            Self::RotationEntries(shapes) | Self::Quaternions { shapes, .. } => Some(shapes),
        }
    }

    /// F: how many features drive them.
    pub fn count(&self) -> usize {
        self.shapes().map_or(0, BlendShapes::count)
    }

    /// F, of a skeleton of this many joints.
    fn features(&self, joints: usize) -> usize {
        match self {
            Self::None => 0,
            Self::RotationEntries(_) => 9 * (joints - 1),
            Self::Quaternions { first_joint, coefficient, .. } => {
                4 * joints.saturating_sub(*first_joint) + usize::from(coefficient.is_some())
            }
        }
    }
}

impl fmt::Display for Correctives {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = self.count();
        match self {
            Self::None => formatter.write_str("none"),
            Self::RotationEntries(_) => write!(formatter, "{count} by entries of rotations"),
            Self::Quaternions { coefficient: Some(index), .. } => {
                write!(formatter, "{count} by quaternions and coefficient {} of shape", index + 1)
            }
            Self::Quaternions { .. } => write!(formatter, "{count} by quaternions"),
        }
    }
}

impl Anatomy {
    /// S.
    pub fn shape_coefficients(&self) -> usize {
        self.shapes.count() - self.expressions
    }

    fn check(&self) -> Result<()> {
        self.skeleton.check()?;
        let (vertices, joints, shapes) = (self.template.len(), self.skeleton.joints.len(), self.shapes.count());
        let wrong =
            |name: &str, found: String, expected: String| Err(Error::Value { name: name.into(), found, expected });
        if vertices == 0 {
            return wrong("number of template vertices", "0".into(), "at least one".into());
        }
        let weights = self.skinning_weights.len();
        if weights != vertices * joints {
            return wrong("number of skinning weights", weights.to_string(), format!("{vertices} rows of {joints}"));
        }
        let rows = self.skinning_weights.chunks_exact(joints).map(|row| row.iter().sum::<f32>());
        if let Some((vertex, sum)) = rows.enumerate().find(|(_, sum)| sum.is_nan() || (sum - 1.0).abs() > SUM_TOLERANCE)
        {
            return wrong(&format!("the sum of the skinning weights of vertex {vertex}"), sum.to_string(), "1".into());
        }
        if let Some(corner) = self.faces.iter().flatten().find(|corner| **corner as usize >= vertices) {
            return wrong("a face's corner", corner.to_string(), format!("below {vertices}"));
        }
        let JointBasis { template, directions } = &self.joints;
        let rows = std::iter::once(template).chain(directions);
        if directions.len() != shapes || self.expressions > shapes || rows.into_iter().any(|row| row.len() != joints) {
            let found = format!("{} and {} directions", template.len(), directions.len());
            return wrong("joint positions", found, format!("{joints} positions, and as many in {shapes} directions"));
        }
        let correctives = self.correctives.shapes();
        let (found, expected) = (self.correctives.count(), self.correctives.features(joints));
        if found != expected {
            return wrong("number of pose correctives", found.to_string(), expected.to_string());
        }
        if let Correctives::Quaternions { coefficient: Some(coefficient), .. } = self.correctives
            && coefficient >= shapes
        {
            return wrong(
                "the coefficient that drives a corrective",
                coefficient.to_string(),
                format!("below {shapes}"),
            );
        }
        let moved = [Some(&self.shapes), correctives];
        match moved.into_iter().flatten().filter_map(BlendShapes::vertices).find(|moved| *moved != vertices) {
            Some(moved) => wrong("vertices that a blend shape moves", moved.to_string(), vertices.to_string()),
            None => Ok(()),
        }
    }
}

impl BodyModel {
    /// The model of these parts; `path` is what messages name, and beside it part labels are looked for.
    ///
    /// # Errors
    /// [`Error::Value`] naming what does not agree: numbers of vertices, joints or directions, weights that do not sum to 1.
    pub fn assemble(path: &Path, anatomy: Anatomy) -> Result<Self> {
        anatomy.check()?;
        let influences = Influences::of(&anatomy.skinning_weights, anatomy.skeleton.joints.len());
        let skeleton = anatomy.skeleton.clone();
        Ok(Self { path: path.to_path_buf(), anatomy: Arc::new(anatomy), influences: Arc::new(influences), skeleton })
    }
}
