//! What is kept of a frame while a subject is registered, a file a frame, so that a run that was stopped goes on.

use std::io::Write;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::{Deserialize, Serialize};
use xavatar_data::FrameId;
use xavatar_formats::{Error, Result, create_folder, read_bytes, write_atomically};
use xavatar_mesh::Note;

use crate::fit::FrameQuality;
use crate::linear::{Extents, FramePose, so3};

/// A fitted frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Axis-angle of each joint (J).
    turns: Vec<[f64; 3]>,
    translation: [f64; 3],
    expression: Vec<f64>,
    /// The middle of the box around the scan, metres.
    pub middle: [f64; 3],
    /// How well it lies.
    pub quality: FrameQuality,
    /// Landmarks that were believed.
    pub landmarks: usize,
    /// The names of those that were not.
    pub dropped: Vec<String>,
    /// What was noted of the scan as it was read.
    #[serde(default)]
    pub notes: Vec<Note>,
    /// Whether it has been tried again from its neighbours.
    pub tried_again: bool,
}

/// What is known of a frame besides its pose.
#[derive(Clone, Debug)]
pub struct Circumstances {
    /// The middle of the box around the scan, metres.
    pub middle: DVec3,
    /// Landmarks that were believed.
    pub landmarks: usize,
    /// The names of those that were not.
    pub dropped: Vec<String>,
    /// What was noted of the scan as it was read.
    pub notes: Vec<Note>,
}

impl Record {
    /// Of a pose.
    pub fn new(pose: &FramePose, quality: FrameQuality, circumstances: Circumstances) -> Self {
        let Circumstances { middle, landmarks, dropped, notes } = circumstances;
        Self {
            turns: pose.rotations.iter().map(|rotation| so3::log(rotation).to_array()).collect(),
            translation: pose.translation.to_array(),
            expression: pose.expression.clone(),
            middle: middle.to_array(),
            quality,
            landmarks,
            dropped,
            notes,
            tried_again: false,
        }
    }

    /// The pose.
    pub fn pose(&self, extents: Extents) -> FramePose {
        let turns = self.turns.iter().take(extents.joints).enumerate().map(|(joint, turn)| (joint, DVec3::from(*turn)));
        let mut pose = FramePose::turned(extents, turns);
        pose.translation = self.translation.into();
        pose.expression.iter_mut().zip(&self.expression).for_each(|(own, kept)| *own = *kept);
        pose
    }

    /// The same with another pose and how well that lies.
    #[must_use]
    pub fn replaced(&self, pose: &FramePose, quality: FrameQuality) -> Self {
        let middle = self.middle.into();
        let (dropped, notes) = (self.dropped.clone(), self.notes.clone());
        let circumstances = Circumstances { middle, landmarks: self.landmarks, dropped, notes };
        Self::new(pose, quality, circumstances)
    }

    /// The same, not to be tried again.
    #[must_use]
    pub fn marked_as_tried_again(self) -> Self {
        Self { tried_again: true, ..self }
    }

    /// Reads the record of a frame, if there is one.
    ///
    /// # Errors
    /// [`Error::Malformed`] for a file that is no record; [`Error::Io`].
    pub fn read(folder: &Path, id: &FrameId) -> Result<Option<Self>> {
        let path = file_of(folder, id);
        if !path.is_file() {
            return Ok(None);
        }
        let record: Self = serde_json::from_slice(&read_bytes(&path)?).map_err(|error| Error::Malformed {
            path: path.clone(),
            format: "record of a frame",
            place: "the text".into(),
            found: error.to_string(),
            expected: "what registration writes; remove the file to fit the frame again".into(),
        })?;
        Ok(Some(record))
    }

    /// Writes the record of a frame and reads it again: what follows rests on what is in the file, whether the run was stopped or not.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn kept(self, folder: &Path, id: &FrameId) -> Result<Self> {
        let path = file_of(folder, id);
        let text = serde_json::to_vec(&self).map_err(|error| Error::io(&path)(error.into()))?;
        create_folder(folder)?;
        write_atomically(&path, |writer| writer.write_all(&text))?;
        Ok(Self::read(folder, id)?.unwrap_or(self))
    }
}

fn file_of(folder: &Path, id: &FrameId) -> PathBuf {
    folder.join(format!("{}-{}-f{:05}.json", id.split, id.sequence, id.number))
}
