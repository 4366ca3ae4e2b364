//! A body model: what its file holds, verified and laid out for posing (thesis ch. 4.1).
//!
//! Any family's: [`families`](super::families) recognises and reads files. V vertices, J joints; metres.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;

use super::families::{read, stems};
use super::influences::Influences;
use super::{Anatomy, Correctives, Gender, HandSpace, Skeleton};
use xavatar_formats::{ArrayFile, ArrayMap, Error, Result};
use xavatar_mesh::TriangleMesh;

/// Which coefficients of a file are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coefficients {
    /// The first ten of shape, and of expression where there is one: what registrations usually have and avatars are told.
    #[default]
    Usual,
    /// All that the file has.
    All,
}

/// A body model. [`pose`](Self::pose) turns a [`Pose`](super::Pose) into a body. Clones share what is large.
#[derive(Clone, Debug)]
pub struct BodyModel {
    pub(super) path: PathBuf,
    pub(super) anatomy: Arc<Anatomy>,
    pub(super) influences: Arc<Influences>,
    /// The anatomy's, perhaps with another canonical pose.
    pub(super) skeleton: Skeleton,
}

impl BodyModel {
    /// Reads a model file, or the `{FAMILY}_{GENDER}.npz` or `.pkl` of a folder.
    ///
    /// # Errors
    /// [`Error::Missing`] if there is none; [`Error::Mismatch`] if the file's name states another gender or its arrays are those
    /// of no family that is read; those of the readers and of [`from_arrays`](Self::from_arrays).
    pub fn load(path: &Path, gender: Gender) -> Result<Self> {
        let file = if path.is_dir() { model_in_folder(path, gender)? } else { path.to_path_buf() };
        if !file.exists() {
            return Err(Error::Missing {
                path: file,
                what: format!("a body model (its file, or a folder with {})", file_names(gender).join(" or ")),
                remedy: REMEDY.into(),
            });
        }
        if let Some(named) = Gender::of_file_name(&file).filter(|named| *named != gender) {
            return Err(Error::Mismatch {
                path: file,
                found: format!("a {named} model by its name"),
                expected: format!("the subject's gender, {gender}"),
                remedy: "give the folder with all models, or correct the subject's gender".into(),
            });
        }
        Self::from_arrays(&file, &Self::read_arrays(&file)?)
    }

    /// The arrays of a model's file: an npz, a pickle, or the dict in an npy, told by what it begins with.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for a file of anything else; those of the container's reader.
    pub fn read_arrays(file: &Path) -> Result<ArrayMap> {
        let found = ArrayFile::read(file)?.ok_or_else(|| Error::Mismatch {
            path: file.into(),
            found: "none of an npz, a pickle or an npy".into(),
            expected: "a body model".into(),
            remedy: "give the model's file as it was downloaded".into(),
        })?;
        Ok(found.arrays)
    }

    /// Builds the model from the arrays of its file; `path` is named in errors and is where part labels are looked for.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for a model of a family that is not read, [`Error::Malformed`] for a key that is missing, has another
    /// shape, is not finite, or holds indices, weights or a kinematic tree that cannot be.
    pub fn from_arrays(path: &Path, arrays: &ArrayMap) -> Result<Self> {
        Self::from_arrays_with(path, arrays, Coefficients::Usual)
    }

    /// As [`from_arrays`](Self::from_arrays), with a choice of coefficients.
    ///
    /// # Errors
    /// As [`from_arrays`](Self::from_arrays).
    pub fn from_arrays_with(path: &Path, arrays: &ArrayMap, coefficients: Coefficients) -> Result<Self> {
        Self::assemble(path, read(path, arrays, coefficients)?)
    }

    /// The file that the model came from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The same body in the canonical pose of a skeleton that is otherwise its own.
    ///
    /// # Errors
    /// As [`Skeleton::require`].
    pub fn in_canonical_pose_of(&self, skeleton: &Skeleton) -> Result<Self> {
        skeleton.require(self.skeleton(), "the body model")?;
        let canonical = skeleton.canonical.clone();
        Ok(Self { skeleton: Skeleton { canonical, ..self.skeleton.clone() }, ..self.clone() })
    }

    /// What the model is made of.
    pub fn anatomy(&self) -> &Anatomy {
        &self.anatomy
    }

    /// The joints, parts and canonical pose.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// V.
    pub fn vertex_count(&self) -> usize {
        self.anatomy.template.len()
    }

    /// How many shape coefficients there are.
    pub fn shape_coefficients(&self) -> usize {
        self.anatomy.shape_coefficients()
    }

    /// How many expression coefficients there are.
    pub fn expression_coefficients(&self) -> usize {
        self.anatomy.expressions
    }

    /// The vertices (V) of the mean shape in the rest pose.
    pub fn template(&self) -> &[Vec3] {
        &self.anatomy.template
    }

    /// Vertex indices of each face (F).
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.anatomy.faces
    }

    /// Skinning weights (V, J), row-major; each row sums to 1.
    pub fn skinning_weights(&self) -> &[f32] {
        &self.anatomy.skinning_weights
    }

    /// What a pose adds to skinning.
    pub fn correctives(&self) -> &Correctives {
        &self.anatomy.correctives
    }

    /// What the family's hand conventions are relative to: the left hand's and the right hand's, or none.
    pub fn hands(&self) -> &[HandSpace] {
        &self.anatomy.hands
    }

    /// The mesh with these vertex positions (V), without colour.
    pub fn mesh(&self, vertices: Vec<Vec3>) -> TriangleMesh {
        TriangleMesh { vertices, faces: self.anatomy.faces.clone(), ..TriangleMesh::default() }
    }
}

const REMEDY: &str =
    "download the SMPL-X models from https://smpl-x.is.tue.mpg.de, import a free body, or name the model file itself";

/// What a folder's file of a gender may be called.
fn file_names(gender: Gender) -> Vec<String> {
    let gender = gender.to_string().to_uppercase();
    stems().flat_map(|stem| ["npz", "pkl"].map(|extension| format!("{stem}_{gender}.{extension}"))).collect()
}

fn model_in_folder(folder: &Path, gender: Gender) -> Result<PathBuf> {
    let names = file_names(gender);
    let found = names.iter().map(|name| folder.join(name)).find(|candidate| candidate.is_file());
    found.ok_or_else(|| Error::Missing { path: folder.to_path_buf(), what: names.join(" or "), remedy: REMEDY.into() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_the_file_has_to_agree_with_the_gender() {
        let folder = tempfile::tempdir().unwrap();
        let message = |path: &Path, gender| BodyModel::load(path, gender).unwrap_err().to_string();
        assert!(message(folder.path(), Gender::Female).contains("SMPLX_FEMALE.npz or SMPLX_FEMALE.pkl"));
        let path = folder.path().join("SMPLX_MALE.npz");
        std::fs::write(&path, b"").unwrap();
        assert!(message(&path, Gender::Female).contains("a male model by its name"));
    }
}
