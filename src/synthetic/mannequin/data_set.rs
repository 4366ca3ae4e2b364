//! The built-in subject as a data set on disk: scans with their registrations, and the body model with its part labels.

use std::path::Path;

use super::BuiltInSubject;
use crate::body::Gender;
use crate::data::{Split, write_subject};
use crate::formats::{Result, create_folder, write_npz, write_pickle};

impl BuiltInSubject {
    /// The folder in a data set's that holds the body model.
    pub const BODY_FOLDER: &str = "body";

    /// Writes the subject in X-Humans' layout, with so many frames to train and to measure on, and its body model in
    /// [`BODY_FOLDER`](Self::BODY_FOLDER).
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write_data(&self, folder: &Path, training_frames: usize, unseen_frames: usize) -> Result<()> {
        let body = folder.join(Self::BODY_FOLDER);
        create_folder(&body)?;
        let takes = [(Split::Train, training_frames), (Split::Test, unseen_frames)];
        let frames = takes
            .into_iter()
            .flat_map(|(split, count)| (0..count).map(move |index| (split, index, count)))
            .map(|(split, index, count)| self.frame(split, index, count));
        write_subject(folder, Gender::Neutral, self.betas(), frames)?;
        write_npz(body.join("SMPLX_NEUTRAL.npz"), self.model_arrays())?;
        let labels = self.part_labels().to_vertex_labels(self.model().skeleton());
        write_pickle(body.join("neutral_vertex_labels.pkl"), &labels)
    }
}
