//! Folders that a program fills over several calls, any of which may be killed: what an interrupted call left, and one process at a time.

use std::fs::{self, File, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::Path;
use std::time::Duration;

use crate::atomic_file::{PARTIAL, sync_folder};
use crate::{Error, Result};

/// Held, never removed: a file that is removed can be held by two that do not see each other.
const LOCK: &str = ".lock";
/// How long asking who has a lock may hold it, and how often that is waited for.
const GLANCE: Duration = Duration::from_millis(2);
const GLANCES: usize = 25;

/// Whether there is nothing of this name, or a folder in which nothing was finished: it is empty, or has what a killed process left.
///
/// # Errors
/// [`Error::Io`] if it is no folder, or cannot be read.
pub fn is_vacant(folder: &Path) -> Result<bool> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(true),
        entries => entries.map_err(Error::io(folder))?,
    };
    for entry in entries {
        let name = entry.map_err(Error::io(folder))?.file_name();
        if name != LOCK && !name.to_string_lossy().starts_with(PARTIAL) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Makes a folder if it is not there, and those that it is in; their names outlast a power failure.
///
/// # Errors
/// [`Error::Io`].
pub fn create_folder(folder: &Path) -> Result<()> {
    if folder.is_dir() {
        return Ok(());
    }
    let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    create_folder(parent)?;
    match fs::create_dir(folder) {
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists && folder.is_dir() => Ok(()),
        made => made.and_then(|()| sync_folder(parent)).map_err(Error::io(folder)),
    }
}

/// A folder that no other process fills: it is the holder's until it is dropped, or its process ends in whatever way.
#[derive(Debug)]
pub struct FolderLock {
    file: File,
}

impl FolderLock {
    /// Makes the folder if it is not there, takes it, and removes what killed processes left of files in it.
    ///
    /// # Errors
    /// [`Error::Mismatch`] names the process that has it; [`Error::Io`] if it cannot be written to.
    pub fn take(folder: &Path) -> Result<Self> {
        create_folder(folder)?;
        let path = folder.join(LOCK);
        let opened = fs::OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
        let mut file = opened.map_err(Error::io(&path))?;
        match locked(&file) {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let holder = note_in(file);
                return Err(Error::Mismatch {
                    path: folder.into(),
                    found: format!("in use by {}", if holder.is_empty() { "another process" } else { holder.trim() }),
                    expected: "a folder that no other process fills".into(),
                    remedy: "wait until it has ended, or end it".into(),
                });
            }
            // A file system without locks: better unprotected than unusable.
            Err(TryLockError::Error(error)) if error.kind() == std::io::ErrorKind::Unsupported => {}
            Err(TryLockError::Error(error)) => return Err(Error::io(&path)(error)),
        }
        let note = format!("process {} on {}\n", std::process::id(), host_name());
        file.set_len(0)
            .and_then(|()| file.rewind())
            .and_then(|()| file.write_all(note.as_bytes()))
            .map_err(Error::io(&path))?;
        remove_partial(folder)?;
        Ok(Self { file })
    }

    /// Who fills a folder now, as far as it is known; none if nobody does.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be asked.
    #[allow(clippy::disallowed_methods, reason = "a lock of our own, by its name")]
    pub fn holder(folder: &Path) -> Result<Option<String>> {
        let path = folder.join(LOCK);
        let file = match File::open(&path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            opened => opened.map_err(Error::io(&path))?,
        };
        match file.try_lock_shared() {
            Err(TryLockError::WouldBlock) => {
                let holder = note_in(file);
                Ok(Some(if holder.is_empty() { "another process".into() } else { holder.trim().into() }))
            }
            Err(TryLockError::Error(error)) if error.kind() != std::io::ErrorKind::Unsupported => {
                Err(Error::io(&path)(error))
            }
            _ => Ok(None),
        }
    }
}

/// Takes a file's lock. One without a note is somebody's who only asks who has it, and gone in a moment.
fn locked(file: &File) -> std::result::Result<(), TryLockError> {
    for _ in 0..GLANCES {
        match file.try_lock() {
            Err(TryLockError::WouldBlock) if file.metadata().is_ok_and(|found| found.len() == 0) => {
                std::thread::sleep(GLANCE);
            }
            tried => return tried,
        }
    }
    file.try_lock()
}

/// What the holder of a lock wrote into it.
fn note_in(file: File) -> String {
    let mut note = String::new();
    // Some systems let nobody read what is locked.
    let _ = file.take(200).read_to_string(&mut note);
    note
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        // The lock itself goes with the file; a note that stays only names a process that has ended.
        let _ = self.file.set_len(0);
    }
}

/// Removes what killed processes left of files in a folder, if there is such a folder. Nobody may be writing to it.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_partial(folder: &Path) -> Result<()> {
    if !folder.is_dir() {
        return Ok(());
    }
    for entry in fs::read_dir(folder).map_err(Error::io(folder))? {
        let entry = entry.map_err(Error::io(folder))?;
        if entry.file_name().to_string_lossy().starts_with(PARTIAL) {
            fs::remove_file(entry.path()).map_err(Error::io(entry.path()))?;
        }
    }
    Ok(())
}

/// The machine's name, as far as it is known.
fn host_name() -> String {
    let variable = |name| std::env::var(name).ok();
    #[allow(clippy::disallowed_methods, reason = "the system's own file has no size")]
    let system = fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = system.or_else(|| variable("HOSTNAME")).or_else(|| variable("COMPUTERNAME"));
    name.map_or("this machine".into(), |name| name.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_vacant_until_something_in_it_was_finished() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("run");
        assert!(is_vacant(&folder).unwrap());
        fs::create_dir(&folder).unwrap();
        assert!(is_vacant(&folder).unwrap());
        fs::write(folder.join(".partial-abc"), "half").unwrap();
        drop(FolderLock::take(&folder).unwrap());
        fs::write(folder.join(".partial-def"), "half").unwrap();
        assert!(is_vacant(&folder).unwrap());
        fs::write(folder.join("config.toml"), "whole").unwrap();
        assert!(!is_vacant(&folder).unwrap());
        assert!(is_vacant(&folder.join("config.toml")).is_err());
    }

    #[test]
    fn folders_are_made_with_those_they_are_in() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("a/b/c");
        create_folder(&folder).unwrap();
        create_folder(&folder).unwrap();
        assert!(folder.is_dir());
        fs::write(folder.join("file"), "").unwrap();
        assert!(matches!(create_folder(&folder.join("file")), Err(Error::Io { .. })));
    }

    #[test]
    fn a_folder_is_one_holders_at_a_time_who_is_named() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(".partial-abc"), "half").unwrap();
        let lock = FolderLock::take(folder.path()).unwrap();
        assert!(!folder.path().join(".partial-abc").exists());
        let message = FolderLock::take(folder.path()).unwrap_err().to_string();
        let process = format!("process {} on ", std::process::id());
        assert!(message.contains(&format!("in use by {process}")), "{message}");
        assert!(FolderLock::holder(folder.path()).unwrap().is_some_and(|holder| holder.starts_with(&process)));
        drop(lock);
        assert_eq!(FolderLock::holder(folder.path()).unwrap(), None);
        FolderLock::take(folder.path()).unwrap();
        assert!(is_vacant(folder.path()).unwrap());
    }

    // The note of a process that was killed: nobody holds it any more.
    #[test]
    fn the_note_of_a_process_that_is_gone_holds_nobody_up() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(LOCK), "process 1 on elsewhere\n").unwrap();
        FolderLock::take(folder.path()).unwrap();
    }
}
