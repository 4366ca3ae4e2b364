//! What a training that takes minutes keeps while it goes on: stopped or killed anywhere, it is gone on with and ends with the same bits.
//!
//! A folder with a file of arrays a part, each written whole, at most every ten seconds, and a line for each thing that the training depends on. It is gone when
//! the training is done.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use xavatar_formats::{ArrayMap, Choice, Error, FolderLock, Remedy, Result, is_vacant, read_npz, read_text};
use xavatar_formats::{write_atomically, write_npz};

/// Between two writings: what is lost when a training is killed.
const EVERY: Duration = Duration::from_secs(10);
const SOURCE: &str = "source.txt";

static NEVER: AtomicBool = AtomicBool::new(false);

/// Where a training keeps its state, and what stops it.
#[derive(Debug)]
pub struct Kept<'a> {
    folder: Option<(PathBuf, FolderLock)>,
    stop: &'a AtomicBool,
    written: Instant,
}

impl Kept<'static> {
    /// Of a training that keeps nothing and is not stopped.
    pub fn nothing() -> Self {
        Self { folder: None, stop: &NEVER, written: Instant::now() }
    }
}

impl<'a> Kept<'a> {
    /// In a folder that is new, or of a training that is gone on with. `source` names in lines what the training depends on.
    ///
    /// # Errors
    /// [`Error::Mismatch`] if there is something and it is not to be gone on with, or it is another training's; [`Error::Io`].
    pub fn in_folder(folder: &Path, source: &str, is_resumed: bool, stop: &'a AtomicBool) -> Result<Self> {
        let is_new = is_vacant(folder)?;
        let lock = FolderLock::take(folder)?;
        let path = folder.join(SOURCE);
        let kept = if is_new { None } else { Some(read_text(&path)?) };
        let mismatch = |found: &str, expected: &str, remedy: Remedy| {
            Err(Error::Mismatch { path: folder.into(), found: found.into(), expected: expected.into(), remedy })
        };
        match kept {
            None => write_atomically(&path, |file| file.write_all(source.as_bytes()))?,
            Some(_) if !is_resumed => {
                let remedy = Remedy::choosing(Choice::ContinueRun, "go on with it, or remove the folder");
                return mismatch("a training that was begun", "nothing", remedy);
            }
            Some(kept) if kept != source => {
                let other = kept.lines().zip(source.lines()).find(|(kept, own)| kept != own);
                let (found, expected) = other.unwrap_or(("another training", "this one"));
                return mismatch(found, expected, "repeat the first call's arguments, or remove the folder".into());
            }
            Some(_) => {}
        }
        Ok(Self { folder: Some((folder.into(), lock)), stop, written: Instant::now() })
    }

    /// What was kept of a part, and the file that it is from.
    ///
    /// # Errors
    /// Those of reading an npz.
    pub fn part(&self, part: &str) -> Result<Option<(PathBuf, ArrayMap)>> {
        let file = self.folder.as_ref().map(|(folder, _)| folder.join(format!("{part}.npz")));
        let Some(file) = file.filter(|file| file.is_file()) else { return Ok(None) };
        let arrays = read_npz(&file)?;
        Ok(Some((file, arrays)))
    }

    /// Keeps a part.
    ///
    /// # Errors
    /// [`Error::Io`]; what `arrays` returns.
    pub fn keep(&mut self, part: &str, arrays: impl FnOnce() -> Result<ArrayMap>) -> Result<()> {
        if let Some((folder, _)) = &self.folder {
            write_npz(folder.join(format!("{part}.npz")), &arrays()?)?;
            self.written = Instant::now();
        }
        Ok(())
    }

    /// Whether the training is to stop.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Keeps a part if that was long ago, or if the training is to stop: whether it is.
    ///
    /// # Errors
    /// As [`keep`](Self::keep).
    pub fn pause(&mut self, part: &str, arrays: impl FnOnce() -> Result<ArrayMap>) -> Result<bool> {
        let is_stopped = self.is_stopped();
        if is_stopped || self.written.elapsed() >= EVERY {
            self.keep(part, arrays)?;
        }
        Ok(is_stopped)
    }

    /// Removes what was kept: the training is done.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove(self) -> Result<()> {
        match self.folder {
            None => Ok(()),
            Some((folder, _lock)) => std::fs::remove_dir_all(&folder).map_err(Error::io(&folder)),
        }
    }
}
