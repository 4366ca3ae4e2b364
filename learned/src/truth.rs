//! What is known of a made-up population, as files beside its registrations: the body, and where every joint of every frame is.
//!
//! `truth/body.npz`, a body file, and `truth/<subject>.npz` with `joints` (frames, J, 3), metres, in the order of the frames' names.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use xavatar_body::{BodyModel, Coefficients};
use xavatar_formats::{Array, ArrayMap, Error, Result, create_folder, read_npz, write_npz};
use xavatar_mesh::{TriangleMesh, write_ply};

use crate::core::with_identity;
use crate::population::{Population, Truth};
use crate::registrations::TRUTH;

const BODY: &str = "body.npz";
const JOINTS: &str = "joints";

/// The truth of a population that was read.
pub struct KnownTruth {
    /// The body.
    pub model: BodyModel,
    /// Of each subject's frames the joints (J).
    pub joints: BTreeMap<String, Vec<Vec<DVec3>>>,
}

impl Population {
    /// Writes registrations of people like `start` to a folder, with their truth. `progress` is told the share that is done.
    ///
    /// # Errors
    /// If a file cannot be written; what `progress` returns.
    pub fn write(
        &self,
        start: &BodyModel,
        folder: &Path,
        mut progress: impl FnMut(f64) -> Result<()>,
    ) -> Result<Truth> {
        let truth = self.truth(start)?;
        let known = folder.join(TRUTH);
        create_folder(&known)?;
        write_npz(known.join(BODY), &truth.model.to_arrays())?;
        for (subject, identity) in truth.subjects.iter().enumerate() {
            let name = format!("{subject:02}");
            let own = folder.join(&name);
            create_folder(&own)?;
            let body = with_identity(&truth.model, identity)?;
            let mut joints: Vec<Vec3> = Vec::new();
            for frame in 0..self.poses {
                let done = (subject * self.poses + frame) as f64 / (self.subjects * self.poses) as f64;
                progress(done)?;
                let vertices = self.registrations_of(&truth, &body, subject, frame)?;
                joints.extend(body.pose(&truth.poses[subject][frame])?.joints);
                let mesh = TriangleMesh { vertices, faces: body.faces().to_vec(), ..TriangleMesh::default() };
                write_ply(own.join(format!("{frame:04}.ply")), &mesh)?;
            }
            let count = identity.joints.len();
            let values = joints.iter().flat_map(|joint| joint.to_array()).collect();
            let array = Array::from_f32(&[self.poses, count, 3], values);
            write_npz(known.join(format!("{name}.npz")), &ArrayMap::from([(JOINTS.to_owned(), array)]))?;
        }
        Ok(truth)
    }
}

impl KnownTruth {
    /// The truth in the first of these folders that has one.
    ///
    /// # Errors
    /// Those of reading its files.
    pub fn find(paths: &[PathBuf]) -> Result<Option<Self>> {
        let mut folders = paths.iter().map(|path| path.join(TRUTH));
        let Some(folder) = folders.find(|folder| folder.join(BODY).is_file()) else { return Ok(None) };
        let file = folder.join(BODY);
        let model = BodyModel::from_arrays_with(&file, &read_npz(&file)?, Coefficients::All)?;
        let count = model.skeleton().joints.len();
        let mut joints = BTreeMap::new();
        for entry in std::fs::read_dir(&folder).map_err(Error::io(&folder))? {
            let path = entry.map_err(Error::io(&folder))?.path();
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            if path == file {
                continue;
            }
            let arrays = read_npz(&path)?;
            let Some(values) = arrays.get(JOINTS).and_then(Array::to_f64) else { continue };
            let points: Vec<DVec3> = values.as_chunks::<3>().0.iter().map(|point| DVec3::from_array(*point)).collect();
            joints.insert(name, points.chunks_exact(count).map(<[DVec3]>::to_vec).collect());
        }
        Ok(Some(Self { model, joints }))
    }
}
