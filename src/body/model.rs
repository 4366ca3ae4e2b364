//! An SMPL-X model: what its file holds, verified and laid out for posing (thesis ch. 4.1).
//!
//! Files have 10 + 10 or 300 + 100 shape columns; betas are the first 10, expression the 10 after the shape columns.
//! V vertices (any number), J = 55 joints; metres.

use std::path::{Path, PathBuf};

use glam::Vec3;

use super::blend_shapes::BlendShapes;
use super::gender::Gender;
use super::model_file::ModelFile;
use super::skeleton::JOINTS;
use super::stand_in::{read_npz, read_pickle_arrays};
use crate::data::ArrayMap;
use crate::mesh::TriangleMesh;
use crate::{Error, Result};

/// Coefficients of the body's shape, and as many of the expression.
pub(super) const BETAS: usize = 10;
/// Entries of the 54 rotation matrices that drive the pose correctives.
pub(super) const POSE_FEATURES: usize = (JOINTS - 1) * 9;
/// Components of one hand's pose: 15 joints.
pub(super) const HAND_COMPONENTS: usize = 45;

/// An SMPL-X body model. [`pose`](Self::pose) turns [`BodyParameters`](super::BodyParameters) into a body.
#[derive(Clone, Debug)]
pub struct BodyModel {
    pub(super) path: PathBuf,
    /// (V), rest pose, mean shape.
    pub(super) template: Vec<Vec3>,
    pub(super) faces: Vec<[u32; 3]>,
    /// (V, J) row-major.
    pub(super) skinning_weights: Vec<f32>,
    /// 10 betas, then 10 of expression.
    pub(super) shapes: BlendShapes,
    /// 486 directions, of the entries of R(theta_1..) - I.
    pub(super) pose_correctives: BlendShapes,
    /// Joints of the template.
    pub(super) joint_template: [Vec3; JOINTS],
    /// What `shapes` does to each joint.
    pub(super) joint_shapes: Vec<[Vec3; 2 * BETAS]>,
    pub(super) left_hand: HandSpace,
    pub(super) right_hand: HandSpace,
}

/// The pose space of one hand.
#[derive(Clone, Debug)]
pub(super) struct HandSpace {
    /// The relaxed hand, axis-angle of 15 joints.
    pub(super) mean: [f32; HAND_COMPONENTS],
    /// Principal components, one a row.
    pub(super) components: Vec<[f32; HAND_COMPONENTS]>,
}

impl BodyModel {
    /// Reads a model file, or the `SMPLX_{GENDER}.npz` or `.pkl` of a folder.
    ///
    /// # Errors
    /// [`Error::Missing`] if there is none; [`Error::Mismatch`] if the file's name states another gender or its skeleton
    /// is that of SMPL, SMPL+H, MANO or FLAME; those of the readers and of [`from_arrays`](Self::from_arrays).
    pub fn load(path: &Path, gender: Gender) -> Result<Self> {
        let file = if path.is_dir() { model_in_folder(path, gender)? } else { path.to_path_buf() };
        if let Some(named) = Gender::of_file_name(&file).filter(|named| *named != gender) {
            return Err(Error::Mismatch {
                path: file,
                found: format!("a {named} model by its name"),
                expected: format!("the subject's gender, {gender}"),
                remedy: "give the folder with all models, or correct gender.txt".into(),
            });
        }
        let is_pickle = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("pkl"));
        let arrays = if is_pickle { read_pickle_arrays(&file)? } else { read_npz(&file)? };
        Self::from_arrays(&file, &arrays)
    }

    /// Builds the model from the arrays of its file; `path` is named in errors and is where part labels are looked for.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for a model of another family, [`Error::Malformed`] for a key that is missing, has another
    /// shape, is not finite, or holds indices, weights or a kinematic tree that cannot be.
    pub fn from_arrays(path: &Path, arrays: &ArrayMap) -> Result<Self> {
        let file = ModelFile { path, arrays };
        file.require_smplx()?;
        let (template, shape) = file.floats("v_template", &[0, 3])?;
        let vertices = shape[0];
        if vertices == 0 {
            return Err(file.malformed("v_template", "empty", "at least one vertex"));
        }
        file.require_kinematic_tree()?;
        let faces = file.faces(vertices)?;
        let skinning_weights = file.skinning_weights(vertices)?;
        let regressor = file.joint_regressor(vertices)?;

        let (directions, shape) = file.floats("shapedirs", &[vertices, 3, 0])?;
        let columns = shape[2];
        let first_expression = match columns {
            20 => 10,
            400 => 300,
            _ => {
                let found = format!("{columns} shape columns");
                let remedy = "use the SMPL-X release itself; 16 columns and no expressions are SMPL+H's, as in AMASS";
                return Err(file.mismatch(found, "10 + 10 or 300 + 100 (shape + expression)", remedy));
            }
        };
        let shape_columns = || (0..BETAS).chain(first_expression..first_expression + BETAS);
        let joint_template = regress(&regressor, |vertex, axis| template[vertex * 3 + axis]);
        let by_column: Vec<[Vec3; JOINTS]> = shape_columns()
            .map(|column| regress(&regressor, |vertex, axis| directions[(vertex * 3 + axis) * columns + column]))
            .collect();
        let joint_shapes = (0..JOINTS).map(|joint| std::array::from_fn(|shape| by_column[shape][joint])).collect();
        let shapes = BlendShapes::from_columns(&directions, columns, shape_columns());

        let (correctives, _) = file.floats("posedirs", &[vertices, 3, POSE_FEATURES])?;
        Ok(Self {
            path: path.to_path_buf(),
            template: template
                .chunks_exact(3)
                .map(|point| Vec3::new(point[0] as f32, point[1] as f32, point[2] as f32))
                .collect(),
            faces,
            skinning_weights,
            shapes,
            pose_correctives: BlendShapes::from_columns(&correctives, POSE_FEATURES, 0..POSE_FEATURES),
            joint_template,
            joint_shapes,
            left_hand: HandSpace::read(&file, "hands_meanl", "hands_componentsl")?,
            right_hand: HandSpace::read(&file, "hands_meanr", "hands_componentsr")?,
        })
    }

    /// The file that the model came from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// V.
    pub fn vertex_count(&self) -> usize {
        self.template.len()
    }

    /// Vertex indices of each face (F).
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Skinning weights (V, J), row-major; each row sums to 1.
    pub fn skinning_weights(&self) -> &[f32] {
        &self.skinning_weights
    }

    /// The mesh with these vertex positions (V), without colour.
    pub fn mesh(&self, vertices: Vec<Vec3>) -> TriangleMesh {
        TriangleMesh { vertices, faces: self.faces.clone(), ..TriangleMesh::default() }
    }
}

impl HandSpace {
    fn read(file: &ModelFile, mean: &str, components: &str) -> Result<Self> {
        let row = |values: &[f64]| std::array::from_fn(|component| values[component] as f32);
        let (mean, _) = file.floats(mean, &[HAND_COMPONENTS])?;
        let (components, _) = file.floats(components, &[0, HAND_COMPONENTS])?;
        Ok(Self { mean: row(&mean), components: components.chunks_exact(HAND_COMPONENTS).map(row).collect() })
    }
}

/// The joints that the regressor gives for a field over vertices, in f64 as in the reference.
fn regress(regressor: &[Vec<(usize, f64)>], value: impl Fn(usize, usize) -> f64) -> [Vec3; JOINTS] {
    std::array::from_fn(|joint| {
        let axis = |axis| regressor[joint].iter().map(|(vertex, weight)| weight * value(*vertex, axis)).sum::<f64>();
        Vec3::new(axis(0) as f32, axis(1) as f32, axis(2) as f32)
    })
}

fn model_in_folder(folder: &Path, gender: Gender) -> Result<PathBuf> {
    let stem = format!("SMPLX_{}", gender.to_string().to_uppercase());
    let candidates = ["npz", "pkl"].map(|extension| folder.join(format!("{stem}.{extension}")));
    candidates.into_iter().find(|candidate| candidate.is_file()).ok_or_else(|| Error::Missing {
        path: folder.to_path_buf(),
        what: format!("{stem}.npz or {stem}.pkl"),
        remedy: "download the SMPL-X models from https://smpl-x.is.tue.mpg.de, or name the model file itself".into(),
    })
}
