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
use xavatar_formats::{ArrayMap, read_npz, read_pickle_arrays};
use xavatar_formats::{Error, Result};
use xavatar_mesh::TriangleMesh;

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

        let correctives = file.floats_f32("posedirs", &[vertices, 3, POSE_FEATURES])?;
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

    /// The vertices (V) of the mean shape in the rest pose.
    pub fn template(&self) -> &[Vec3] {
        &self.template
    }

    /// Vertex indices of each face (F).
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Skinning weights (V, J), row-major; each row sums to 1.
    pub fn skinning_weights(&self) -> &[f32] {
        &self.skinning_weights
    }

    /// Principal components of the left and the right hand's pose, one a row.
    pub fn hand_components(&self) -> [&[[f32; HAND_COMPONENTS]]; 2] {
        [&self.left_hand.components, &self.right_hand.components]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PARENTS;
    use xavatar_formats::{Array, ArrayData};

    const VERTICES: usize = 4;

    /// A model of four vertices, all bound to the root.
    fn arrays() -> ArrayMap {
        let zeros = |shape: &[usize]| (shape.to_vec(), vec![0.0; shape.iter().product()]);
        let first_in_rows = |rows: usize, columns: usize| {
            let values = (0..rows * columns).map(|at| f64::from(u8::from(at % columns == 0))).collect();
            (vec![rows, columns], values)
        };
        let parents = (0..JOINTS).map(|joint| if joint == 0 { 4_294_967_295.0 } else { PARENTS[joint] as f64 });
        [
            ("v_template", (vec![VERTICES, 3], (0..12).map(f64::from).collect())),
            ("f", (vec![2, 3], vec![0.0, 1.0, 2.0, 0.0, 2.0, 3.0])),
            ("weights", first_in_rows(VERTICES, JOINTS)),
            ("J_regressor", first_in_rows(JOINTS, VERTICES)),
            ("kintree_table", (vec![2, JOINTS], parents.chain((0..JOINTS).map(|joint| joint as f64)).collect())),
            ("shapedirs", zeros(&[VERTICES, 3, 20])),
            ("posedirs", zeros(&[VERTICES, 3, POSE_FEATURES])),
            ("hands_meanl", zeros(&[45])),
            ("hands_meanr", zeros(&[45])),
            ("hands_componentsl", zeros(&[45, 45])),
            ("hands_componentsr", zeros(&[45, 45])),
        ]
        .into_iter()
        .map(|(key, (shape, values))| (key.to_owned(), Array { shape, data: ArrayData::F64(values) }))
        .collect()
    }

    fn read(arrays: &ArrayMap) -> Result<BodyModel> {
        BodyModel::from_arrays(Path::new("SMPLX_MALE.npz"), arrays)
    }

    /// The message after `key` became an array of `shape`, filled with `value`.
    fn message_with(key: &str, shape: &[usize], value: f64) -> String {
        let mut arrays = arrays();
        let data = ArrayData::F64(vec![value; shape.iter().product()]);
        arrays.insert(key.into(), Array { shape: shape.to_vec(), data });
        read(&arrays).expect_err(key).to_string()
    }

    #[test]
    fn models_of_other_families_are_named() {
        for (joints, name) in [(24, "an SMPL model"), (52, "an SMPL+H model"), (16, "a MANO model"), (7, "7 joints")] {
            let message = message_with("kintree_table", &[2, joints], 0.0);
            assert!(message.contains(name) && message.contains("SMPLX_MALE.npz"), "{message}");
        }
        assert!(message_with("shapedirs", &[VERTICES, 3, 16], 0.0).contains("16 shape columns"));
    }

    #[test]
    fn every_missing_or_misshapen_array_is_named() {
        for key in arrays().keys() {
            let mut without = arrays();
            without.remove(key);
            assert!(read(&without).unwrap_err().to_string().contains(&format!("{key} is absent")), "{key}");
            let message = message_with(key, &[3, 5], 0.0);
            assert!(message.contains(key.as_str()) || message.contains("5 joints"), "{message}");
        }
    }

    #[test]
    fn numbers_that_cannot_be_are_refused() {
        assert!(
            message_with("v_template", &[VERTICES, 3], f64::NAN)
                .contains("v_template is not a finite number at element 0")
        );
        assert!(message_with("posedirs", &[VERTICES, 3, POSE_FEATURES], 1e300).contains("posedirs is"));
        assert!(message_with("weights", &[VERTICES, JOINTS], 0.5).contains("weights[0] is a row with sum 27.5"));
        assert!(message_with("J_regressor", &[JOINTS, VERTICES], 0.0).contains("J_regressor[0]"));
        assert!(message_with("f", &[1, 3], 4.0).contains("4 in face 0, expected vertex indices below 4"));
        assert!(message_with("f", &[1, 3], -1.0).contains("-1 in face 0"));
        assert!(message_with("v_template", &[0, 3], 0.0).contains("at least one vertex"));
        assert!(message_with("kintree_table", &[2, JOINTS], 0.0).contains("kintree_table[1][1] is 0, expected 1"));
    }

    #[test]
    fn a_tree_out_of_order_is_refused() {
        let mut arrays = arrays();
        let Some(Array { data: ArrayData::F64(tree), .. }) = arrays.get_mut("kintree_table") else { unreachable!() };
        tree[4] = 7.0;
        let message = read(&arrays).unwrap_err().to_string();
        assert!(message.contains("kintree_table[0][4] is 7, expected 1 (the parent in SMPL-X)"), "{message}");
    }

    // An extent and a length that disagree must not reach the slicing.
    #[test]
    fn arrays_shorter_than_their_shape_are_refused() {
        for key in arrays().keys() {
            let mut arrays = arrays();
            if let Some(Array { data: ArrayData::F64(values), .. }) = arrays.get_mut(key) {
                values.pop();
            }
            assert!(read(&arrays).unwrap_err().to_string().contains(key.as_str()), "{key}");
        }
    }

    #[test]
    fn expression_columns_of_the_full_release_start_at_300() {
        let mut arrays = arrays();
        let mut values = vec![0.0; VERTICES * 3 * 400];
        values[300] = 2.0;
        values[10] = 5.0;
        let data = ArrayData::F64(values);
        arrays.insert("shapedirs".into(), Array { shape: vec![VERTICES, 3, 400], data });
        let mut parameters = crate::BodyParameters::default();
        parameters.expression[0] = 1.0;
        let offsets = read(&arrays).unwrap().vertex_offsets(&parameters).unwrap();
        assert_eq!(offsets, [Vec3::X * 2.0, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO]);
    }

    #[test]
    fn the_name_of_the_file_has_to_agree_with_the_gender() {
        let folder = tempfile::tempdir().unwrap();
        let message = |path: &Path, gender| BodyModel::load(path, gender).unwrap_err().to_string();
        assert!(message(folder.path(), Gender::Female).contains("SMPLX_FEMALE.npz or SMPLX_FEMALE.pkl not found"));
        let path = folder.path().join("SMPLX_MALE.npz");
        assert!(message(&path, Gender::Female).contains("a male model by its name"));
    }
}
