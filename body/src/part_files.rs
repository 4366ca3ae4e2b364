//! Part labels from the files that people keep beside a body model.
//!
//! X-Avatar's `{non_,}watertight_{gender}_vertex_labels.pkl`: index arrays `body`, `left_hand`, `right_hand`, `face`,
//! `eyes_mouth` that cover all V vertices. Official: `MANO_SMPLX_vertex_ids.pkl` (`left_hand`, `right_hand`) and
//! `SMPL-X__FLAME_vertex_ids.npy` (the head). Where lists overlap, hands win over the face, the face over the body.

use std::path::{Path, PathBuf};

use super::{BodyModel, Gender, Part, PartLabelSource, PartLabels};
use xavatar_formats::{Array, ArrayData, ArrayMap, read_npy, read_pickle_arrays};
use xavatar_formats::{Error, Result};

const VERTEX_LABELS: &str = "_vertex_labels.pkl";
const MANO_IDS: &str = "MANO_SMPLX_vertex_ids.pkl";
const FLAME_IDS: &str = "SMPL-X__FLAME_vertex_ids.npy";

impl PartLabels {
    /// The labels of a model from the best source beside its file; `source` says which that was.
    ///
    /// # Errors
    /// A label file that is there but broken, or made for another model, is an error, never passed over.
    pub fn find(model: &BodyModel) -> Result<Self> {
        let folder = model.path().parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if let Some(path) = vertex_labels_in(folder, Gender::of_file_name(model.path())) {
            return Self::from_vertex_labels(&path, &read_pickle_arrays(&path)?, model.vertex_count());
        }
        let (mano, flame) = (folder.join(MANO_IDS), folder.join(FLAME_IDS));
        let mut labels = Self::from_skinning_weights(model.skinning_weights());
        if mano.is_file() && flame.is_file() {
            labels.use_mano_and_flame((&mano, &read_pickle_arrays(&mano)?), (&flame, &read_npy(&flame)?))?;
            labels.source = PartLabelSource::ManoAndFlame(folder.to_path_buf());
        }
        Ok(labels)
    }

    /// The labels of X-Avatar's dictionary for a model of V `vertices`.
    ///
    /// # Errors
    /// [`Error::Malformed`] for a missing list, an index out of range, or vertices that no list has.
    pub fn from_vertex_labels(path: &Path, arrays: &ArrayMap, vertices: usize) -> Result<Self> {
        let mut parts = vec![None; vertices];
        let mut eyes_mouth = vec![false; vertices];
        let lists = [("body", Part::Body), ("face", Part::Face), ("eyes_mouth", Part::Face)];
        let hands = [("left_hand", Part::LeftHand), ("right_hand", Part::RightHand)];
        for (key, part) in lists.into_iter().chain(hands) {
            let list = arrays.get(key).ok_or_else(|| malformed(path, key, "absent", "a list of vertices"))?;
            for vertex in vertex_indices(path, key, list, vertices)? {
                parts[vertex as usize] = Some(part);
                eyes_mouth[vertex as usize] = key == "eyes_mouth";
            }
        }
        let unlabelled = parts.iter().filter(|part| part.is_none()).count();
        let parts = parts.into_iter().collect::<Option<Vec<Part>>>().ok_or_else(|| {
            let found = format!("without a label for {unlabelled} of {vertices} vertices");
            malformed(
                path,
                "the labelling",
                found,
                "a label for each vertex of the body model (is it made for another?)",
            )
        })?;
        Ok(Self { parts, eyes_mouth, source: PartLabelSource::VertexLabels(path.to_path_buf()) })
    }

    /// The dictionary that [`from_vertex_labels`](Self::from_vertex_labels) reads: five lists that share no vertex.
    pub fn to_vertex_labels(&self) -> ArrayMap {
        let list = |wanted: &dyn Fn(usize) -> bool| {
            let vertices: Vec<i64> = (0..self.parts.len()).filter(|v| wanted(*v)).map(|v| v as i64).collect();
            Array { shape: vec![vertices.len()], data: ArrayData::I64(vertices) }
        };
        let of_part = |part: Part| list(&|vertex| self.parts[vertex] == part && !self.eyes_mouth[vertex]);
        [
            ("body", of_part(Part::Body)),
            ("face", of_part(Part::Face)),
            ("left_hand", of_part(Part::LeftHand)),
            ("right_hand", of_part(Part::RightHand)),
            ("eyes_mouth", list(&|vertex| self.eyes_mouth[vertex])),
        ]
        .into_iter()
        .map(|(key, vertices)| (key.to_owned(), vertices))
        .collect()
    }

    /// Replaces hands and face by the official lists; eyeballs stay what the skinning weights say.
    fn use_mano_and_flame(&mut self, mano: (&Path, &ArrayMap), flame: (&Path, &Array)) -> Result<()> {
        let vertices = self.parts.len();
        self.parts.fill(Part::Body);
        for vertex in vertex_indices(flame.0, "the array", flame.1, vertices)? {
            self.parts[vertex as usize] = Part::Face;
        }
        for (key, part) in [("left_hand", Part::LeftHand), ("right_hand", Part::RightHand)] {
            let list = mano.1.get(key).ok_or_else(|| malformed(mano.0, key, "absent", "a list of vertices"))?;
            for vertex in vertex_indices(mano.0, key, list, vertices)? {
                self.parts[vertex as usize] = part;
            }
        }
        Ok(())
    }
}

/// The label file for the gender if one is stated, else the first; `non_watertight` (the model's own topology) sorts first.
fn vertex_labels_in(folder: &Path, gender: Option<Gender>) -> Option<PathBuf> {
    let mut candidates: Vec<PathBuf> = std::fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.ends_with(VERTEX_LABELS))
        })
        .filter(|path| gender.is_none() || Gender::of_file_name(path).is_none_or(|named| Some(named) == gender))
        .collect();
    candidates.sort();
    candidates.into_iter().next()
}

fn vertex_indices(path: &Path, key: &str, array: &Array, vertices: usize) -> Result<Vec<u32>> {
    let indices = array.to_indices(vertices);
    indices.ok_or_else(|| malformed(path, key, array.description(), format!("vertex indices below {vertices}")))
}

fn malformed(path: &Path, place: &str, found: impl Into<String>, expected: impl Into<String>) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "part label file",
        place: place.into(),
        found: found.into(),
        expected: expected.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::JOINTS;

    fn list(indices: &[i64]) -> Array {
        Array { shape: vec![indices.len()], data: ArrayData::I64(indices.to_vec()) }
    }

    fn lists() -> ArrayMap {
        let lists: [(&str, &[i64]); 5] =
            [("body", &[0, 1]), ("face", &[2, 3]), ("eyes_mouth", &[4]), ("left_hand", &[5]), ("right_hand", &[6])];
        lists.into_iter().map(|(key, indices)| (key.to_owned(), list(indices))).collect()
    }

    #[test]
    fn eyes_and_mouth_are_face() {
        let labels = PartLabels::from_vertex_labels(Path::new("a.pkl"), &lists(), 7).unwrap();
        use Part::{Body, Face, LeftHand, RightHand};
        assert_eq!(labels.parts, [Body, Body, Face, Face, Face, LeftHand, RightHand]);
        assert_eq!(labels.eyes_mouth, [false, false, false, false, true, false, false]);
        assert_eq!(labels.vertices_of(Face), [2, 3, 4]);
        assert_eq!(labels.to_vertex_labels(), lists());
    }

    #[test]
    fn labels_of_another_model_are_refused() {
        let refused = |lists: &ArrayMap, vertices| {
            PartLabels::from_vertex_labels(Path::new("a.pkl"), lists, vertices).unwrap_err().to_string()
        };
        assert!(refused(&lists(), 6).contains("right_hand is integer (1), expected vertex indices below 6"));
        assert!(refused(&lists(), 9).contains("without a label for 2 of 9"));
        let mut broken = lists();
        broken.insert("face".into(), list(&[-1]));
        assert!(refused(&broken, 7).contains("face is integer (1), expected"));
        broken.remove("face");
        assert!(refused(&broken, 7).contains("face is absent"));
    }

    // Official lists overlap at the neck and the wrists.
    #[test]
    fn hands_win_over_the_face_and_the_face_over_the_body() {
        let mut weights = vec![0.0; 4 * JOINTS];
        [9, 15, 20, 23].into_iter().enumerate().for_each(|(vertex, joint)| weights[vertex * JOINTS + joint] = 1.0);
        let mut labels = PartLabels::from_skinning_weights(&weights);
        let mano = [("left_hand".to_owned(), list(&[2])), ("right_hand".to_owned(), list(&[]))].into_iter().collect();
        let (mano_path, flame_path) = (Path::new(MANO_IDS), Path::new(FLAME_IDS));
        labels.use_mano_and_flame((mano_path, &mano), (flame_path, &list(&[0, 2, 3]))).unwrap();
        assert_eq!(labels.parts, [Part::Face, Part::Body, Part::LeftHand, Part::Face]);
        assert_eq!(labels.eyes_mouth, [false, false, false, true]);
        assert!(labels.use_mano_and_flame((mano_path, &mano), (flame_path, &list(&[4]))).is_err());
    }

    #[test]
    fn the_file_of_the_models_gender_is_chosen() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["watertight_male", "non_watertight_female", "non_watertight_male", "watertight_female"] {
            std::fs::write(folder.path().join(format!("{name}{VERTEX_LABELS}")), []).unwrap();
        }
        let chosen = |gender| vertex_labels_in(folder.path(), gender).map(|path| path.file_name().unwrap().to_owned());
        assert_eq!(chosen(Some(Gender::Male)).unwrap(), "non_watertight_male_vertex_labels.pkl");
        assert_eq!(chosen(Some(Gender::Female)).unwrap(), "non_watertight_female_vertex_labels.pkl");
        assert_eq!(chosen(Some(Gender::Neutral)), None);
    }
}
