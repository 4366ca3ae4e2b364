//! Where results go: never over something that is there already, and whole or not at all.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use xavatar::formats::harmless;

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

/// Whether there is nothing of this name, or an empty folder.
pub fn is_new_or_empty(folder: &Path) -> anyhow::Result<bool> {
    match std::fs::read_dir(folder) {
        Ok(mut entries) => Ok(entries.next().is_none()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(true),
        Err(error) => Err(error).with_context(|| folder.display().to_string()),
    }
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
    let write = || {
        let mut partial = tempfile::Builder::new();
        // Temporary files are private by default; results are for everyone the umask allows.
        #[cfg(unix)]
        partial.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut partial = partial.prefix(".partial-").tempfile_in(folder_of(path))?;
        partial.write_all(text.as_bytes())?;
        partial.persist(path).map(drop).map_err(|failure| failure.error)
    };
    write().with_context(|| path.display().to_string())
}

fn folder_of(path: &Path) -> PathBuf {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")).into()
}
