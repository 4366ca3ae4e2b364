//! Registered meshes: each body moved vertex by vertex onto its scan, in the body's topology, so that a vertex is the same place of the person
//! in all frames. `offsets/train/Take1/f00001.ply`, metres, Y up.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;
use xavatar_formats::{Error, Result, create_folder};
use xavatar_mesh::write_ply;

use super::record::Record;
use super::recorded::{Recording, scan};
use super::report::{FrameReport, Verdict};
use super::{Observer, Working};
use crate::fit::Shaped;
use crate::free_form::{free_form, freedoms};

/// The folder in the data's.
pub const OFFSETS_FOLDER: &str = "offsets";

impl Working<'_> {
    /// Writes the mesh of every frame that is registered, those that are there already apart; whether it came to the end, and was not stopped.
    pub(super) fn write_free_forms(
        &self,
        records: &[Option<Record>],
        reports: &[FrameReport],
        shaped: &Shaped,
        observe: &mut Observer<'_>,
        stop: &AtomicBool,
    ) -> Result<bool> {
        let freedoms = freedoms(self.job.body, self.job.labels);
        let batch = rayon::current_num_threads();
        for first in (0..records.len()).step_by(batch) {
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            observe("offsets", first as f64 / records.len() as f64, &self.files[first].id().to_string());
            (first..records.len().min(first + batch)).into_par_iter().try_for_each(|index| -> Result<()> {
                let path = self.free_form_path(index);
                let report = &reports[index];
                let Some(record) = records[index].as_ref().filter(|_| report.verdict == Verdict::Registered) else {
                    return if path.exists() { std::fs::remove_file(&path).map_err(Error::io(&path)) } else { Ok(()) };
                };
                if path.is_file() {
                    return Ok(());
                }
                let Recording::Scan(files) = self.files[index] else { return Ok(()) };
                let pose = self.pose_of(index, record, &report.missing_hands).pose(&shaped.shape);
                let body = self.job.body.mesh(self.job.body.pose(&pose)?.vertices);
                let mesh = free_form(&body, &freedoms, &scan(files, self.coordinates)?.mesh);
                path.parent().map_or(Ok(()), create_folder)?;
                write_ply(&path, &mesh.map_err(|error| error.in_frame(files.id.to_string()))?)
            })?;
        }
        Ok(true)
    }

    /// Where a frame's mesh is written.
    fn free_form_path(&self, index: usize) -> PathBuf {
        let id = self.files[index].id();
        let folder = self.job.out.join(OFFSETS_FOLDER).join(&id.split).join(&id.sequence);
        folder.join(format!("f{:05}.ply", id.number))
    }
}
