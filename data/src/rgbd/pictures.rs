//! RGB-D pictures of one person before a body is registered to them, in either layout that subjects have.

use std::path::{Path, PathBuf};

use super::subject::{RgbdFiles, RgbdSubject};
use super::{plain, recordings, xhumans};
use crate::Split;
use crate::xhumans::{GENDER_FILE, gender_in};
use xavatar_body::Gender;
use xavatar_formats::{Error, Result};

/// RGB-D pictures of one person; registrations in their folder are not looked at.
#[derive(Clone, Debug)]
pub struct RgbdPictures {
    /// Their folder.
    pub folder: PathBuf,
    /// What the folder says, if it does.
    pub gender: Option<Gender>,
    frames: [Vec<RgbdFiles>; 2],
}

impl RgbdPictures {
    /// Finds the frames in `folder`, as [`RgbdSubject::open`] does; gender, shape and bodies need not be there.
    ///
    /// # Errors
    /// As [`RgbdSubject::open`].
    pub fn open(folder: impl AsRef<Path>) -> Result<Self> {
        let folder = folder.as_ref();
        recordings::refuse(folder)?;
        let (gender, frames) = if folder.join(RgbdSubject::LAYOUT_FILE).is_file() {
            plain::pictures(folder)?
        } else {
            let gender = folder.join(GENDER_FILE);
            let frames = xhumans::frames(folder)?.map(without_registrations);
            (gender.is_file().then(|| gender_in(&gender)).transpose()?, frames)
        };
        match frames.iter().all(Vec::is_empty) {
            true => Err(no_frame_in(folder)),
            false => Ok(Self { folder: folder.into(), gender, frames }),
        }
    }

    /// The frames of one split; their bodies are as nobody stands, with no shape.
    pub fn files(&self, split: Split) -> &[RgbdFiles] {
        &self.frames[split as usize]
    }
}

fn without_registrations(frames: Vec<RgbdFiles>) -> Vec<RgbdFiles> {
    frames.into_iter().map(|files| RgbdFiles { registration: None, ..files }).collect()
}

pub(super) fn no_frame_in(folder: &Path) -> Error {
    Error::Missing {
        path: folder.into(),
        what: "an RGB-D frame".into(),
        remedy: "give an X-Humans subject with train/<sequence>/render, or a folder with a rgbd.toml (docs/rgbd.md)"
            .into(),
    }
}
