//! The product of training: fields and skeleton, to query, extract and pose.
//!
//! One self-contained safetensors file: parameters under `field.parameter`, the configuration and the subject as text. It
//! carries what the user's own training made, and joints, never a body model's blend shapes.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use xavatar_deformer::{BoneTransform, Jacobian, deformed_normals, skinning_jacobians};
use xavatar_network::{Representation, SkinningTrace, SkinningWeights, TextureField, Trace};

use crate::body::{BodyModel, BodyParameters, Gender, JOINTS, PartLabels, Registration};
use crate::config::Config;
use crate::correspondence::{
    Correspondence, PosedField, bake, bone_rows, part_label, start_groups, union_start_groups,
};
use crate::fields::{Fields, condition, skeleton_parents};
use crate::mesh::{Colouring, ExtractionGrid, Sign, TriangleMesh, extract, largest_component};
use crate::tensor_file::TensorFile;
use crate::train::{insert_parameters, load_parameters};
use crate::{Error, Result};

/// Version of the file's layout.
const VERSION: u32 = 1;
/// Points farther than this from the registered body are outside without a search, metres.
const REACH: f32 = 0.25;
const BLOCK_ROWS: usize = 256;
const IDENTITY: BoneTransform<f32> = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

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
            ("config".into(), self.config.to_toml()),
            ("subject".into(), serde_json::to_string(&self.subject).unwrap_or_default()),
            ("steps".into(), self.steps.to_string()),
        ]);
        file.write(path)
    }

    /// Reads an avatar file, or the one in a run folder.
    ///
    /// # Errors
    /// If the file is missing, broken, of another version, or its parameters do not fit its configuration.
    pub fn load(path: &Path) -> Result<Self> {
        let path: PathBuf = if path.is_dir() { path.join(Self::FILE) } else { path.into() };
        if !path.is_file() {
            return Err(Error::Missing {
                path,
                what: "avatar".into(),
                remedy: "pass an avatar.safetensors or the folder of a finished run".into(),
            });
        }
        let file = TensorFile::read(&path)?;
        let version: u32 = file.parsed(&path, "version")?;
        if version != VERSION {
            return Err(Error::Mismatch {
                path,
                found: format!("an avatar file of version {version}"),
                expected: format!("version {VERSION}"),
                remedy: "train it again, or use the program that wrote it".into(),
            });
        }
        let malformed = |place: &str, found: String| Error::Malformed {
            path: path.clone(),
            format: "avatar",
            place: format!("metadata `{place}`"),
            found,
            expected: "what this program writes".into(),
        };
        let config: Config =
            toml::from_str(file.text(&path, "config")?).map_err(|error| malformed("config", error.to_string()))?;
        let subject: Subject = serde_json::from_str(file.text(&path, "subject")?)
            .map_err(|error| malformed("subject", error.to_string()))?;
        let (low, high) = subject.bounds;
        if subject.joints.len() != JOINTS || !(low.is_finite() && high.is_finite() && low.cmplt(high).all()) {
            return Err(malformed("subject", format!("{} joints in {low} to {high}", subject.joints.len())));
        }
        let mut fields = Fields::new(&config.fields, &skeleton_parents(), subject.bounds)?;
        load_parameters(&file, &mut fields)?;
        Ok(Self { fields, config, subject, steps: file.parsed(&path, "steps")? })
    }

    /// The canonical surface under the condition of `parameters`, with `resolution` cells along the longest side.
    ///
    /// # Errors
    /// [`Error::NoSurface`] with the range of values seen; [`Error::Value`] for a resolution out of range.
    pub fn extract_canonical(&self, parameters: &BodyParameters, resolution: usize) -> Result<Extraction> {
        let embedded = self.fields.geometry.mlp.embed(&condition(parameters));
        let bones = vec![IDENTITY; JOINTS];
        let groups = start_groups(self.config.starts)?;
        let settings = &self.config.search;
        let posed = PosedField {
            fields: &self.fields,
            bones: &bones,
            embedded: &embedded,
            groups: &groups,
            settings,
            baked: None,
            bounds: self.subject.bounds,
        };
        let (minimum, maximum) = self.subject.bounds;
        let values = |points: &[Vec3], values: &mut [f32]| values.copy_from_slice(&posed.geometry(&arrays(points)));
        let mesh = extract(&values, self.grid(minimum, maximum, resolution))?;
        let (mut mesh, dropped_components) = largest_component(&mesh);
        let canonical = arrays(&mesh.vertices);
        self.shade(&posed, &canonical, &mut mesh)?;
        Ok(Extraction { mesh, dropped_components })
    }

    /// The surface posed by `parameters`: the union of all correspondences, without hidden surfaces; in the world.
    ///
    /// # Errors
    /// As [`Avatar::extract_canonical`], and if the parameters do not fit the body model.
    pub fn extract_posed(
        &self,
        body: &BodyModel,
        labels: &PartLabels,
        parameters: &BodyParameters,
        resolution: usize,
    ) -> Result<Extraction> {
        let parameters = BodyParameters { betas: self.subject.betas, ..parameters.clone() };
        let vertices: Vec<Vec3> =
            body.pose(&parameters)?.vertices.iter().map(|vertex| *vertex - parameters.transl).collect();
        let registration = Registration::new(&vertices, labels)?;
        let embedded = self.fields.geometry.mlp.embed(&condition(&parameters));
        let bones = bone_rows(&body.canonical_to_posed(&parameters)?);
        let groups = union_start_groups(self.config.starts)?;
        let baked = bake(&self.fields.skinning, self.config.searched_field, self.subject.bounds)?;
        let settings = &self.config.search;
        let fields = &self.fields;
        let posed = PosedField {
            fields,
            bones: &bones,
            embedded: &embedded,
            groups: &groups,
            settings,
            baked: baked.as_ref(),
            bounds: self.subject.bounds,
        };

        let query = |points: &[Vec3]| {
            let nearest: Vec<_> = points.par_iter().map(|point| registration.nearest(*point)).collect();
            let near: Vec<usize> = (0..points.len()).filter(|index| nearest[*index].1 < REACH).collect();
            let targets: Vec<_> = near.iter().map(|index| points[*index].to_array()).collect();
            let labels: Vec<_> = near.iter().map(|index| part_label(nearest[*index].0)).collect();
            let found = posed.correspondences(&targets, &labels)?;
            let mut all = vec![None; points.len()];
            for (index, found) in near.into_iter().zip(found) {
                all[index] = found;
            }
            Ok::<Vec<Option<Correspondence>>, Error>(all)
        };
        let outside = self.fields.geometry.representation.outside();
        let failure = std::sync::Mutex::new(None);
        let values = |points: &[Vec3], values: &mut [f32]| match query(points) {
            Ok(found) => {
                for (value, found) in values.iter_mut().zip(found) {
                    *value = found.map_or(outside, |found| found.value);
                }
            }
            Err(error) => {
                values.fill(outside);
                failure.lock().unwrap_or_else(std::sync::PoisonError::into_inner).get_or_insert(error);
            }
        };
        let corner = |fold: fn(Vec3, Vec3) -> Vec3| vertices.iter().copied().reduce(fold).unwrap_or_default();
        let (minimum, maximum) = (corner(Vec3::min) - REACH, corner(Vec3::max) + REACH);
        let extracted = extract(&values, self.grid(minimum, maximum, resolution));
        if let Some(error) = failure.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
            return Err(error);
        }
        let (mut mesh, dropped_components) = largest_component(&extracted?);

        let found = query(&mesh.vertices)?;
        // A vertex between a root and none has no correspondence of its own; its neighbour's is a cell away.
        let mut known = Vec3::ZERO.to_array();
        let canonical: Vec<_> = found
            .into_iter()
            .map(|found| {
                known = found.map_or(known, |found| found.canonical);
                known
            })
            .collect();
        self.shade(&posed, &canonical, &mut mesh)?;
        mesh.vertices.iter_mut().for_each(|vertex| *vertex += parameters.transl);
        Ok(Extraction { mesh, dropped_components })
    }

    fn grid(&self, minimum: Vec3, maximum: Vec3, resolution: usize) -> ExtractionGrid {
        let inside_is = match self.fields.geometry.representation {
            Representation::Occupancy => Sign::Positive,
            Representation::SignedDistance => Sign::Negative,
        };
        ExtractionGrid { minimum, maximum, resolution, level: 0.0, inside_is }
    }

    /// Sets normals and colours from the fields at each vertex's canonical point (V).
    fn shade(&self, posed: &PosedField, canonical: &[[f32; 3]], mesh: &mut TriangleMesh) -> Result<()> {
        let mut shades = vec![(Vec3::ZERO, [0u8; 3]); canonical.len()];
        shades
            .par_chunks_mut(BLOCK_ROWS)
            .zip(canonical.par_chunks(BLOCK_ROWS))
            .try_for_each_init(Shader::default, |shader, (shades, points)| shader.shade(posed, points, shades))?;
        mesh.normals = Some(shades.iter().map(|(normal, _)| *normal).collect());
        mesh.colouring = Colouring::Vertex(shades.into_iter().map(|(_, colour)| colour).collect());
        Ok(())
    }
}

/// One thread's memory while it shades vertices.
#[derive(Default)]
struct Shader {
    geometry: Trace<f32>,
    texture: Trace<f32>,
    skinning: SkinningTrace<f32>,
}

impl Shader {
    fn shade(&mut self, posed: &PosedField, points: &[[f32; 3]], shades: &mut [(Vec3, [u8; 3])]) -> Result<()> {
        let PosedField { fields, bones, embedded, .. } = posed;
        let count = points.len();
        let Self { geometry, texture, skinning } = self;
        let network = &fields.geometry.mlp;
        network.forward(geometry, points.as_flattened(), embedded, &[]);
        network.input_gradient(geometry, &vec![1.0; count]);
        let (mut weights, mut gradients) = (vec![0.0; count * JOINTS], vec![0.0; 3 * count * JOINTS]);
        fields.skinning.weights_and_gradients(skinning, points, &mut weights, &mut gradients);
        let mut transforms = vec![[0.0; 12]; count];
        xavatar_deformer::blend_transforms(&weights, bones, &mut transforms)?;
        let mut jacobians: Vec<Jacobian<f32>> = vec![[[0.0; 3]; 3]; count];
        skinning_jacobians(&transforms, &gradients, bones, points, &mut jacobians)?;
        let mut normals = vec![[0.0; 3]; count];
        let on_points = geometry.gradient().as_chunks().0;
        deformed_normals(on_points, &jacobians, fields.gradient_side(), &mut normals)?;
        let inputs: Vec<f32> =
            points.iter().zip(&normals).flat_map(|(point, normal)| [*point, *normal]).flatten().collect();
        fields.texture.mlp.forward(texture, &inputs, embedded, geometry.features(network));
        let mut colours = vec![0.0; 3 * count];
        TextureField::colours(texture.output(), &mut colours);
        for ((shade, normal), colour) in shades.iter_mut().zip(normals).zip(colours.as_chunks::<3>().0) {
            *shade = (Vec3::from_array(normal), colour.map(|channel| (channel * 255.0).round() as u8));
        }
        Ok(())
    }
}

fn arrays(points: &[Vec3]) -> Vec<[f32; 3]> {
    points.iter().map(Vec3::to_array).collect()
}
