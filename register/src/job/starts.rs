//! Poses that other programs found, as one start of each frame's fit among others. Which way the person faces, and where, is the scan's to say.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use xavatar_body::BodyModel;
use xavatar_data::{Clip, FrameId, MotionOptions};
use xavatar_formats::{Error, Result};

use super::recorded::Recordings;
use crate::linear::{FramePose, Linkage};

/// A pose of every frame of some sequences.
#[derive(Clone, Debug)]
pub struct StartPoses {
    /// By split and sequence, in the order of the frames.
    sequences: BTreeMap<(String, String), Vec<FramePose>>,
}

impl StartPoses {
    /// Reads motions of any format that is read ([`Clip::load`]): one, of the only sequence, or a folder with one a sequence, called as it is.
    ///
    /// # Errors
    /// [`Error::Missing`] if a folder has a motion of no sequence; [`Error::Mismatch`] for a motion with more or fewer poses than its sequence has
    /// frames; what is wrong with a motion; that of poses of another body.
    pub fn read(path: &Path, recordings: &Recordings, body: &BodyModel) -> Result<Self> {
        let mut counts: BTreeMap<(String, String), usize> = BTreeMap::new();
        for frame in recordings.frames() {
            let FrameId { split, sequence, .. } = frame.id();
            *counts.entry((split.clone(), sequence.clone())).or_default() += 1;
        }
        let extents = Linkage::of(body).extents();
        let mut sequences = BTreeMap::new();
        for (key, count) in &counts {
            let named = motion_named(path, &key.1)?;
            let Some(file) = named.or_else(|| (counts.len() == 1).then(|| path.to_owned())) else { continue };
            let clip = Clip::load(&file, &MotionOptions::default())?;
            if clip.frames.len() != *count {
                return Err(Error::Mismatch {
                    path: file,
                    found: format!("{} poses", clip.frames.len()),
                    expected: format!("one for each of the {count} frames of {}/{}", key.0, key.1),
                    remedy: "give poses of these frames and no others".into(),
                });
            }
            let poses = clip.poses(Some(body))?;
            sequences.insert(key.clone(), poses.iter().map(|pose| FramePose::of(pose, extents)).collect());
        }
        if sequences.is_empty() {
            let names: Vec<&str> = counts.keys().map(|(_, sequence)| sequence.as_str()).collect();
            return Err(Error::Missing {
                path: path.into(),
                what: "a motion of any sequence".into(),
                remedy: format!("give a folder with a motion for each, called {}", names.join(", ")).into(),
            });
        }
        Ok(Self { sequences })
    }

    /// The pose of the frame at a place of its sequence, if there is one.
    pub fn of(&self, id: &FrameId, place: usize) -> Option<&FramePose> {
        self.sequences.get(&(id.split.clone(), id.sequence.clone()))?.get(place)
    }
}

/// The file or folder in a folder that is called as a sequence, whatever its extension.
fn motion_named(folder: &Path, sequence: &str) -> Result<Option<PathBuf>> {
    if !folder.is_dir() {
        return Ok(None);
    }
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        let name = if path.is_dir() { path.file_name() } else { path.file_stem() };
        if name.is_some_and(|name| name == sequence) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found.into_iter().next())
}
