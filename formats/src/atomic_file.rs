//! Files that appear whole or not at all: written to a temporary name in the same folder, synced, renamed; then the folder is synced,
//! so that the new name outlasts a power failure.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::{Error, Result};

/// How the temporary names begin, which a killed process leaves.
pub(crate) const PARTIAL: &str = ".partial-";

/// Writes `path` through `write`; if anything fails, what stood at `path` before still does.
///
/// # Errors
/// [`Error::Io`] if the folder does not exist or cannot be written to, or if `write` fails.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut fs::File>) -> io::Result<()>,
) -> Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let attempt = || {
        let mut builder = tempfile::Builder::new();
        // Like any other new file, not private to the owner as temporary files are.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut temporary = builder.prefix(PARTIAL).tempfile_in(folder)?;
        let mut writer = BufWriter::new(temporary.as_file_mut());
        write(&mut writer)?;
        writer.flush()?;
        drop(writer);
        temporary.as_file().sync_all()?;
        temporary.persist(path)?;
        sync_folder(folder)
    };
    attempt().map_err(Error::io(path))
}

/// Returns once the names in a folder are on the disk. Only Unix opens folders as files.
#[allow(clippy::disallowed_methods, reason = "what is opened is a folder")]
pub(crate) fn sync_folder(folder: &Path) -> io::Result<()> {
    #[cfg(unix)]
    fs::File::open(folder)?.sync_all()?;
    #[cfg(not(unix))]
    let _ = folder;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("motion.npz");
        write_atomically(&path, |writer| writer.write_all(b"old")).unwrap();
        let failed = write_atomically(&path, |writer| {
            writer.write_all(b"new")?;
            Err(io::Error::other("disk full"))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
