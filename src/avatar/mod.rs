//! The product of training: fields and skeleton, to query, extract and pose.
//!
//! One self-contained safetensors file: parameters under `field.parameter`, the configuration and the subject as text. It
//! carries what the user's own training made, and joints, never a body model's blend shapes.

mod animator;
mod fixed_topology;
mod official;
mod query;
mod shading;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::Vec3;
use serde::{Deserialize, Serialize};
use xavatar_network::{Representation, Trace};

pub use self::animator::Animator;
pub use self::fixed_topology::FixedTopology;
pub use self::official::OfficialMeta;
pub use self::query::Sample;

use self::shading::{Posing, shade};
use crate::body::{BodyModel, BodyParameters, Gender, JOINTS, PartLabels};
use crate::config::{Config, SkinningSettings};
use crate::fields::{CONDITION, Fields, Skinning, condition};
use crate::mesh::{Colouring, Component, ExtractionGrid, Sign, TriangleMesh, extract, largest_component};
use crate::train::{insert_parameters, load_parameters, load_voxels};
use crate::{Error, InputError, Result};
use xavatar_formats::TensorFile;

/// Version of the file's layout.
const VERSION: u32 = 2;
/// Rows a thread evaluates at a time.
const BLOCK_ROWS: usize = 256;

/// Whom an avatar was made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Subject {
    /// The body model's gender.
    pub gender: Gender,
    /// Shape coefficients.
    pub betas: [f32; 10],
    /// Canonical joints (J), metres.
    pub joints: Vec<Vec3>,
    /// Lowest and highest corner of the canonical box, metres.
    pub bounds: (Vec3, Vec3),
    /// Frames it was trained on.
    pub frames: usize,
}

/// An animatable avatar.
#[derive(Clone, Debug)]
pub struct Avatar {
    /// Geometry, texture and skinning.
    pub fields: Fields<f32>,
    /// The configuration it was trained with.
    pub config: Config,
    /// Whom it was made of.
    pub subject: Subject,
    /// Steps on frames it was trained for.
    pub steps: u64,
}

/// A mesh extracted from an avatar.
#[derive(Clone, Debug)]
pub struct Extraction {
    /// The largest component, with normals and vertex colours.
    pub mesh: TriangleMesh,
    /// Smaller components that were left out.
    pub dropped_components: usize,
}

impl Avatar {
    /// The file's name in a run folder.
    pub const FILE: &str = "avatar.safetensors";

    /// Writes the avatar as one file, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self, path: &Path) -> Result<()> {
        let mut file = TensorFile::default();
        insert_parameters(&mut file, &self.fields);
        file.text = HashMap::from([
            ("version".into(), VERSION.to_string()),
            ("config".into(), self.config.to_toml()?),
            (
                "subject".into(),
                serde_json::to_string(&self.subject).map_err(|error| InputError::io(path)(error.into()))?,
            ),
            ("steps".into(), self.steps.to_string()),
        ]);
        Ok(file.write(path)?)
    }

    /// Reads an avatar file, or the one in a run folder.
    ///
    /// # Errors
    /// If the file is missing, broken, of another version, or its parameters do not fit its configuration.
    pub fn load(path: &Path) -> Result<Self> {
        let path: PathBuf = if path.is_dir() { path.join(Self::FILE) } else { path.into() };
        if !path.exists() {
            return Err(Error::from(InputError::Missing {
                path,
                what: "avatar".into(),
                remedy: "pass an avatar.safetensors or the folder of a finished run".into(),
            }));
        }
        let file = TensorFile::read(&path)?;
        let version: u32 = file.parsed(&path, "version")?;
        if version != VERSION {
            return Err(Error::from(InputError::Mismatch {
                path,
                found: format!("an avatar file of version {version}"),
                expected: format!("version {VERSION}"),
                remedy: "train it again, or use the program that wrote it".into(),
            }));
        }
        let malformed = |place: &str, found: String| {
            Error::from(InputError::Malformed {
                path: path.clone(),
                format: "avatar",
                place: format!("metadata `{place}`"),
                found,
                expected: "what this program writes".into(),
            })
        };
        let config: Config =
            toml::from_str(file.text(&path, "config")?).map_err(|error| malformed("config", error.to_string()))?;
        let subject: Subject = serde_json::from_str(file.text(&path, "subject")?)
            .map_err(|error| malformed("subject", error.to_string()))?;
        let (low, high) = subject.bounds;
        if subject.joints.len() != JOINTS || !(low.is_finite() && high.is_finite() && low.cmplt(high).all()) {
            return Err(malformed("subject", format!("{} joints in {low} to {high}", subject.joints.len())));
        }
        let skinning = match &config.fields.skinning {
            SkinningSettings::Network(shape) => Skinning::network(shape)?,
            SkinningSettings::Voxels(_) => Skinning::Voxels(load_voxels(&file, &path)?),
        };
        let mut fields = Fields::new(&config.fields, skinning, subject.bounds)?;
        load_parameters(&file, &mut fields)?;
        Ok(Self { fields, config, subject, steps: file.parsed(&path, "steps")? })
    }

    /// The canonical surface under the condition of `parameters`, with `resolution` cells along the longest side.
    ///
    /// # Errors
    /// [`Error::NoSurface`] with the range of values seen; [`Error::Value`] for a resolution out of range.
    pub fn extract_canonical(&self, parameters: &BodyParameters, resolution: usize) -> Result<Extraction> {
        self.canonical_surface(&condition(parameters), resolution)
    }

    /// The canonical surface under no condition: that of [`FixedTopology`].
    ///
    /// # Errors
    /// As [`Avatar::extract_canonical`].
    pub fn extract_unconditioned(&self, resolution: usize) -> Result<Extraction> {
        self.canonical_surface(&[0.0; CONDITION], resolution)
    }

    /// The colours (N), sRGB, of canonical points (N) on or near the surface, under no condition as those of [`FixedTopology`].
    ///
    /// # Errors
    /// Those of the fields: points that are not finite.
    pub fn colours(&self, points: &[Vec3]) -> Result<Vec<[u8; 3]>> {
        let embedded = self.fields.geometry.mlp.embed(&[0.0; CONDITION]);
        let mut mesh = TriangleMesh { vertices: points.to_vec(), ..TriangleMesh::default() };
        shade(&self.fields, &embedded, &Posing::Canonical, &arrays(points), &mut mesh)?;
        match mesh.colouring {
            Colouring::Vertex(colours) => Ok(colours),
            Colouring::None | Colouring::Texture { .. } => Ok(Vec::new()),
        }
    }

    /// The surface in one pose; for several, keep an [`Animator`].
    ///
    /// # Errors
    /// As [`Animator::extract`].
    pub fn extract_posed(
        &self,
        body: &BodyModel,
        labels: &PartLabels,
        parameters: &BodyParameters,
        resolution: usize,
    ) -> Result<Extraction> {
        Animator::new(self, body, labels)?.extract(parameters, resolution)
    }

    fn canonical_surface(&self, condition: &[f32], resolution: usize) -> Result<Extraction> {
        let embedded = self.fields.geometry.mlp.embed(condition);
        let network = &self.fields.geometry.mlp;
        let evaluate = |points: &[Vec3], values: &mut [f32]| {
            let mut trace = Trace::default();
            for (values, points) in values.chunks_mut(BLOCK_ROWS).zip(points.chunks(BLOCK_ROWS)) {
                network.evaluate(&mut trace, arrays(points).as_flattened(), &embedded, &[]);
                values.copy_from_slice(trace.output());
            }
        };
        let (minimum, maximum) = self.subject.bounds;
        let mesh = extract(&evaluate, self.grid(minimum, maximum, resolution))?.mesh;
        let Component { mut mesh, others: dropped_components, .. } = largest_component(&mesh);
        let canonical = arrays(&mesh.vertices);
        shade(&self.fields, &embedded, &Posing::Canonical, &canonical, &mut mesh)?;
        Ok(Extraction { mesh, dropped_components })
    }

    fn grid(&self, minimum: Vec3, maximum: Vec3, resolution: usize) -> ExtractionGrid {
        let inside_is = match self.fields.geometry.representation {
            Representation::Occupancy => Sign::Positive,
            Representation::SignedDistance => Sign::Negative,
        };
        ExtractionGrid { minimum, maximum, resolution, level: 0.0, inside_is }
    }
}

fn arrays(points: &[Vec3]) -> Vec<[f32; 3]> {
    points.iter().map(Vec3::to_array).collect()
}
