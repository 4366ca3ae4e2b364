//! Where results go: never over something that is there already, and whole or not at all.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use xavatar::formats::{harmless, is_vacant, write_atomically};

/// Makes the folder, which may be there but must be empty.
pub fn new_folder(folder: &Path, remedy: &str) -> anyhow::Result<()> {
    if !is_new_or_empty(folder)? {
        bail!("{}: the folder is not empty; {remedy}", folder.display());
    }
    existing_folder(folder)
}

/// Makes the folder if it is not there.
pub fn existing_folder(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())
}

/// Whether there is nothing of this name, or a folder in which nothing was finished.
pub fn is_new_or_empty(folder: &Path) -> anyhow::Result<bool> {
    Ok(is_vacant(folder)?)
}

/// Checks, before the work, that a folder which a verb goes on with later is new, unless it does go on.
pub fn new_or_resumed(folder: &Path, resume: bool) -> anyhow::Result<()> {
    if !resume && !is_new_or_empty(folder)? {
        bail!("{}: the folder is not empty; give a new --out, or --resume to go on", folder.display());
    }
    Ok(())
}

/// Checks, before the work, that a file can be written: its folder is there, and it is not, or is empty.
pub fn new_file(path: &Path) -> anyhow::Result<()> {
    if std::fs::metadata(path).is_ok_and(|found| found.is_dir() || found.len() > 0) {
        bail!("{}: exists already; remove it or choose another name", path.display());
    }
    match folder_of(path) {
        folder if folder.is_dir() => Ok(()),
        folder => bail!("{}: no such folder; make it first", folder.display()),
    }
}

/// Prints a result, which may be long; a reader that has seen enough, such as `head`, is no error. Control characters are escaped:
/// results name what is in files, and files are anybody's.
pub fn print(text: &str) -> anyhow::Result<()> {
    match std::io::stdout().write_all(harmless(text).as_bytes()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        written => written.context("stdout"),
    }
}

/// Writes JSON for scripts.
pub fn write_json(path: &Path, value: &impl serde::Serialize) -> anyhow::Result<()> {
    write_text(path, &(serde_json::to_string_pretty(value)? + "\n"))
}

/// Writes a text file.
pub fn write_text(path: &Path, text: &str) -> anyhow::Result<()> {
    Ok(write_atomically(path, |file| file.write_all(text.as_bytes()))?)
}

fn folder_of(path: &Path) -> PathBuf {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")).into()
}
