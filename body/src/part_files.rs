//! Part labels from the files that people keep beside a body model.
//!
//! X-Avatar's `{non_,}watertight_{gender}_vertex_labels.pkl`: index arrays named as the skeleton's parts and their details (for
//! SMPL-X `body`, `face`, `eyes_mouth`, `left_hand`, `right_hand`) that cover all V vertices. Official: `MANO_SMPLX_vertex_ids.pkl`
//! (`left_hand`, `right_hand`) and `SMPL-X__FLAME_vertex_ids.npy` (the head). Where lists overlap, a later part wins: hands over
//! the face, the face over the body.

use std::path::{Path, PathBuf};

use super::{BodyModel, Gender, Part, PartLabelSource, PartLabels, Role, Skeleton};
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
        if let Some(path) = vertex_labels_in(folder, model.path()) {
            return Self::from_vertex_labels(
                &path,
                &read_pickle_arrays(&path)?,
                model.skeleton(),
                model.vertex_count(),
            );
        }
        let (mano, flame) = (folder.join(MANO_IDS), folder.join(FLAME_IDS));
        let mut labels = Self::from_skinning_weights(model);
        if mano.is_file() && flame.is_file() {
            let (mano, flame) = ((mano.as_path(), &read_pickle_arrays(&mano)?), (flame.as_path(), &read_npy(&flame)?));
            labels.use_mano_and_flame(model.skeleton(), mano, flame)?;
            labels.source = PartLabelSource::ManoAndFlame(folder.to_path_buf());
        }
        Ok(labels)
    }

    /// The labels of X-Avatar's dictionary for a model of this skeleton with V `vertices`.
    ///
    /// # Errors
    /// [`Error::Malformed`] for a missing list, an index out of range, or vertices that no list has.
    pub fn from_vertex_labels(path: &Path, arrays: &ArrayMap, skeleton: &Skeleton, vertices: usize) -> Result<Self> {
        let mut parts = vec![None; vertices];
        let mut detail = vec![false; vertices];
        for (key, part, is_detail) in lists_of(skeleton) {
            let list = arrays.get(key).ok_or_else(|| malformed(path, key, "absent", "a list of vertices"))?;
            for vertex in vertex_indices(path, key, list, vertices)? {
                parts[vertex as usize] = Some(part);
                detail[vertex as usize] = is_detail;
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
        Ok(Self { parts, detail, source: PartLabelSource::VertexLabels(path.to_path_buf()) })
    }

    /// The dictionary that [`from_vertex_labels`](Self::from_vertex_labels) reads: lists that share no vertex.
    pub fn to_vertex_labels(&self, skeleton: &Skeleton) -> ArrayMap {
        let list = |part: Part, is_detail: bool| {
            let wanted = |vertex: &usize| self.parts[*vertex] == part && self.detail[*vertex] == is_detail;
            let vertices: Vec<i64> = (0..self.parts.len()).filter(wanted).map(|vertex| vertex as i64).collect();
            Array { shape: vec![vertices.len()], data: ArrayData::I64(vertices) }
        };
        lists_of(skeleton).map(|(key, part, is_detail)| (key.to_owned(), list(part, is_detail))).collect()
    }

    /// Replaces hands and face by the official lists; eyeballs stay what the skinning weights say.
    fn use_mano_and_flame(
        &mut self,
        skeleton: &Skeleton,
        mano: (&Path, &ArrayMap),
        flame: (&Path, &Array),
    ) -> Result<()> {
        let vertices = self.parts.len();
        self.parts.fill(skeleton.parts_of(Role::Body).next().unwrap_or_default());
        for face in skeleton.parts_of(Role::Face) {
            for vertex in vertex_indices(flame.0, "the array", flame.1, vertices)? {
                self.parts[vertex as usize] = face;
            }
        }
        for (part, group) in skeleton.parts().filter(|(_, group)| group.role == Role::Hands) {
            let key = &group.name;
            let list = mano.1.get(key).ok_or_else(|| malformed(mano.0, key, "absent", "a list of vertices"))?;
            for vertex in vertex_indices(mano.0, key, list, vertices)? {
                self.parts[vertex as usize] = part;
            }
        }
        Ok(())
    }
}

/// The lists of a label file: each part's and its detail's, the ones that win last.
fn lists_of(skeleton: &Skeleton) -> impl Iterator<Item = (&str, Part, bool)> {
    skeleton.parts().flat_map(|(part, group)| {
        let detail = group.detail.as_ref().map(|detail| (detail.name.as_str(), part, true));
        [(group.name.as_str(), part, false)].into_iter().chain(detail)
    })
}

/// The label file that is named as the model, else one that belongs to no other: for the gender if the model's name states one, else the
/// first; `non_watertight` (the model's own topology) sorts first.
fn vertex_labels_in(folder: &Path, model: &Path) -> Option<PathBuf> {
    let own = format!("{}{VERTEX_LABELS}", model.file_stem().unwrap_or_default().to_string_lossy());
    if folder.join(&own).is_file() {
        return Some(folder.join(own));
    }
    let gender = Gender::of_file_name(model);
    let is_of_another = |path: &Path| {
        let name = path.file_name().and_then(|name| name.to_str())?.strip_suffix(VERTEX_LABELS)?;
        Some(["npz", "pkl", "npy"].iter().any(|extension| folder.join(format!("{name}.{extension}")).is_file()))
    };
    let mut candidates: Vec<PathBuf> = std::fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| is_of_another(path) == Some(false))
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
    use crate::families::smplx::{self, tests::model_of_weights};

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
        let labels = PartLabels::from_vertex_labels(Path::new("a.pkl"), &lists(), smplx::skeleton(), 7).unwrap();
        let [body, face, left, right] = [0, 1, 2, 3].map(Part);
        assert_eq!(labels.parts, [body, body, face, face, face, left, right]);
        assert_eq!(labels.detail, [false, false, false, false, true, false, false]);
        assert_eq!(labels.vertices_of(face), [2, 3, 4]);
        assert_eq!(labels.to_vertex_labels(smplx::skeleton()), lists());
    }

    #[test]
    fn labels_of_another_model_are_refused() {
        let refused = |lists: &ArrayMap, vertices| {
            PartLabels::from_vertex_labels(Path::new("a.pkl"), lists, smplx::skeleton(), vertices)
                .unwrap_err()
                .to_string()
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
        let skeleton = smplx::skeleton();
        let joints = skeleton.joints.len();
        let mut weights = vec![0.0; 4 * joints];
        [9, 15, 20, 23].into_iter().enumerate().for_each(|(vertex, joint)| weights[vertex * joints + joint] = 1.0);
        let mut labels = PartLabels::from_skinning_weights(&model_of_weights(weights));
        let mano = [("left_hand".to_owned(), list(&[2])), ("right_hand".to_owned(), list(&[]))].into_iter().collect();
        let (mano_path, flame_path) = (Path::new(MANO_IDS), Path::new(FLAME_IDS));
        labels.use_mano_and_flame(skeleton, (mano_path, &mano), (flame_path, &list(&[0, 2, 3]))).unwrap();
        assert_eq!(labels.parts, [1, 0, 2, 1].map(Part));
        assert_eq!(labels.detail, [false, false, false, true]);
        assert!(labels.use_mano_and_flame(skeleton, (mano_path, &mano), (flame_path, &list(&[4]))).is_err());
    }

    #[test]
    fn the_file_of_the_models_gender_is_chosen() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["watertight_male", "non_watertight_female", "non_watertight_male", "watertight_female"] {
            std::fs::write(folder.path().join(format!("{name}{VERTEX_LABELS}")), []).unwrap();
        }
        let chosen = |model: &str| {
            let found = vertex_labels_in(folder.path(), &folder.path().join(model));
            found.map(|path| path.file_name().unwrap().to_str().unwrap().to_owned())
        };
        assert_eq!(chosen("SMPLX_MALE.npz").unwrap(), "non_watertight_male_vertex_labels.pkl");
        assert_eq!(chosen("SMPLX_FEMALE.npz").unwrap(), "non_watertight_female_vertex_labels.pkl");
        assert_eq!(chosen("SMPLX_NEUTRAL.npz"), None);
        // Those of a model beside it are that model's.
        std::fs::write(folder.path().join("anny_vertex_labels.pkl"), []).unwrap();
        std::fs::write(folder.path().join("anny.npz"), []).unwrap();
        assert_eq!(chosen("anny.npz").unwrap(), "anny_vertex_labels.pkl");
        assert_eq!(chosen("a.npz").unwrap(), "non_watertight_female_vertex_labels.pkl");
    }
}
