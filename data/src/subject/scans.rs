//! Scans without registrations, in any layout that subjects have, or as a plain folder of meshes with a folder a sequence.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::frame::FrameFiles;
use super::frames_by_split;
use super::layout::find_scans;
use super::rules::Rules;
use super::scan_file::read_scan;
use crate::Split;
use crate::xhumans::{GENDER_FILE, gender_in};
use xavatar_body::Gender;
use xavatar_formats::{Error, Result};
use xavatar_mesh::{Loss, Note, ReadMesh, without_surroundings};

/// Scans of one person, before a body is registered to them. Coordinates are the files' own.
#[derive(Clone, Debug)]
pub struct Scans {
    /// Their folder.
    pub folder: PathBuf,
    /// What `gender.txt` says, if there is one.
    pub gender: Option<Gender>,
    frames: [Vec<FrameFiles>; 2],
}

impl Scans {
    /// Finds the scans in `folder`. Sequences named in `test` are for tests; where none is, folders `train` and `test` decide, else the last
    /// of several sequences is.
    ///
    /// # Errors
    /// [`Error::Missing`] if there is no scan, or no sequence of a name in `test`; [`Error::Mismatch`] for a wrong `gender.txt`.
    pub fn open(folder: impl AsRef<Path>, test: &[String]) -> Result<Self> {
        let folder = folder.as_ref();
        let sequences = find_scans(folder)?;
        if sequences.is_empty() {
            return Err(Error::Missing {
                path: folder.into(),
                what: "a scan (.ply, .obj, .glb, or .pkl in meshes_pkl), here or in folders of sequences".into(),
                remedy: "give the folder of one person's scans".into(),
            });
        }
        if let Some(name) = test.iter().find(|name| sequences.iter().all(|sequence| sequence.name != **name)) {
            let known: Vec<&str> = sequences.iter().map(|sequence| sequence.name.as_str()).collect();
            return Err(Error::Missing {
                path: folder.into(),
                what: format!("the sequence {name}"),
                remedy: format!("name one of {}", known.join(", ")).into(),
            });
        }
        let gender = folder.join(GENDER_FILE);
        Ok(Self {
            folder: folder.into(),
            gender: gender.is_file().then(|| gender_in(&gender)).transpose()?,
            frames: frames_by_split(&sequences, test, &Arc::new(Rules::default())),
        })
    }

    /// The frames of one split; each has a scan and no parameters.
    pub fn files(&self, split: Split) -> &[FrameFiles] {
        &self.frames[split as usize]
    }
}

impl FrameFiles {
    /// Reads the frame's scan alone, in the coordinates of its file, without what it shows besides the person, which is noted.
    ///
    /// # Errors
    /// As [`read_frame`](super::read_frame), naming the frame; [`Error::Mismatch`] for a scan of several people.
    pub fn read_scan(&self) -> Result<ReadMesh> {
        self.read_person().map_err(|error| error.in_frame(self.id.to_string()))
    }

    fn read_person(&self) -> Result<ReadMesh> {
        let path = self.scan.require("the frame's scan")?;
        let ReadMesh { mesh: scan, mut notes } = read_scan(path)?;
        let Some((mesh, surroundings)) = without_surroundings(&scan) else { return Ok(ReadMesh { mesh: scan, notes }) };
        if surroundings.rivals > 0 {
            return Err(Error::Mismatch {
                path: path.into(),
                found: format!("{} separate surfaces, each as large as a person", surroundings.rivals + 1),
                expected: "a scan of one person".into(),
                remedy: "cut the others away, or move the file out of the folder".into(),
            });
        }
        notes.push(Note::new(Loss::Surroundings, surroundings.to_string()));
        Ok(ReadMesh { mesh, notes })
    }
}
