//! Files that users name, opened without trust: regular files only, of bounded size.
//!
//! A pipe or a device would block or never end, and a file larger than any that is used here would fill the memory before its
//! format is known.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::MemoryLimit;
use crate::{Error, Result};

/// Largest file that is read whole, bytes; the largest body model known has 544 MB.
const LARGEST: u64 = 4 << 30;

/// Opens a file for reading.
///
/// # Errors
/// [`Error::Mismatch`] names what is no regular file; [`Error::Io`] if it cannot be opened.
#[allow(clippy::disallowed_methods, reason = "the one place that opens files")]
pub fn open_file(path: &Path) -> Result<File> {
    // Asked before it is opened: opening a pipe waits for somebody to write to it.
    let metadata = std::fs::metadata(path).map_err(Error::io(path))?;
    if !metadata.is_file() {
        return Err(Error::Mismatch {
            path: path.into(),
            found: if metadata.is_dir() { "a folder" } else { "a pipe, a device or a socket" }.into(),
            expected: "a file".into(),
            remedy: "name a file, or copy its content into one first".into(),
        });
    }
    File::open(path).map_err(Error::io(path))
}

/// The content of a file.
///
/// # Errors
/// As [`open_file`]; [`Error::TooLarge`] for a file beyond 4 GiB or the system's memory.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    let mut file = open_file(path)?;
    let size = file.metadata().map_err(Error::io(path))?.len();
    let too_large = |limit| Error::TooLarge { path: path.into(), purpose: "the file".into(), bytes: size, limit };
    if size > LARGEST {
        return Err(too_large(MemoryLimit::OfFile { file_bytes: size, bytes: LARGEST }));
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(size as usize).map_err(|_| too_large(MemoryLimit::OfSystem))?;
    // A file that grows meanwhile is read as far as it was.
    (&mut file).take(size).read_to_end(&mut bytes).map_err(Error::io(path))?;
    Ok(bytes)
}

/// The content of a text file.
///
/// # Errors
/// As [`read_bytes`]; [`Error::Malformed`] for what is not UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    String::from_utf8(read_bytes(path)?).map_err(|error| Error::Malformed {
        path: path.into(),
        format: "text file",
        place: format!("byte {}", error.utf8_error().valid_up_to()),
        found: "no character".into(),
        expected: "UTF-8".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_and_folders_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notes.txt");
        std::fs::write(&path, "two\nlines").unwrap();
        assert_eq!(read_text(&path).unwrap(), "two\nlines");
        std::fs::write(&path, b"ab\xff").unwrap();
        assert!(matches!(read_text(&path), Err(Error::Malformed { place, .. }) if place == "byte 2"));
        assert!(matches!(read_bytes(folder.path()), Err(Error::Mismatch { found, .. }) if found == "a folder"));
        assert!(matches!(read_bytes(&folder.path().join("none")), Err(Error::Io { .. })));
    }

    #[cfg(unix)]
    #[test]
    fn devices_do_not_block() {
        for device in ["/dev/zero", "/dev/null"] {
            let refused = read_bytes(Path::new(device)).unwrap_err();
            assert!(matches!(&refused, Error::Mismatch { .. }) && refused.to_string().contains(device), "{refused}");
        }
    }

    // Such a file takes no room on the disk; read, it would take the memory.
    #[test]
    fn files_beyond_the_limit_are_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sparse.npy");
        std::fs::File::create(&path).unwrap().set_len(LARGEST + 1).unwrap();
        assert!(matches!(read_bytes(&path), Err(Error::TooLarge { .. })));
    }
}
