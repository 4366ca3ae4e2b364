//! Named files of a folder, of a zip archive such as a Python wheel, or of a gzipped tar archive such as a package of npm, read alike.
//!
//! Names are paths with `/`. A member that ends in `.gz` comes out unpacked. What one member unpacks to is bounded in proportion to what it
//! takes up, as for every file here ([`Budget`]); members must not share bytes.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;
use zip::ZipArchive;

use crate::budget::Budget;
use crate::fault::Fault;
use crate::input_file::{open_file, read_bytes};
use crate::tarball;
use crate::{Error, Result};

const FORMAT: &str = "zip archive";
const TARBALL: &str = "gzipped tar archive";
/// What gzip begins with.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Where named files are.
#[derive(Debug)]
pub struct FileTree {
    path: PathBuf,
    content: Content,
}

#[derive(Debug)]
enum Content {
    Folder,
    Archive(Box<ZipArchive<File>>),
    /// Unpacked, and where each file is in it.
    Tarball(Vec<u8>, BTreeMap<String, Range<usize>>),
}

impl FileTree {
    /// Opens a folder, a zip archive or a gzipped tar archive.
    ///
    /// # Errors
    /// [`Error::Malformed`] for a file that is no zip archive, [`Error::Refused`] for one whose members share bytes; those of opening it.
    pub fn open(path: &Path) -> Result<Self> {
        if path.is_dir() {
            return Ok(Self { path: path.into(), content: Content::Folder });
        }
        let mut first = [0; 2];
        let is_gzip = open_file(path)?.read_exact(&mut first).is_ok() && first == GZIP;
        if is_gzip {
            let packed = read_bytes(path)?;
            let budget = Budget::of_file(packed.len());
            let unpack = || {
                let bytes = unpacked(GzDecoder::new(packed.as_slice()), &budget)?;
                let files = tarball::files(&bytes)?;
                Ok(Content::Tarball(bytes, files))
            };
            return Ok(Self {
                path: path.into(),
                content: unpack().map_err(|fault: Fault| fault.in_file(path, TARBALL))?,
            });
        }
        let broken = |error: zip::result::ZipError| {
            Fault::malformed("zip directory", error, "a zip archive").in_file(path, FORMAT)
        };
        let mut archive = ZipArchive::new(open_file(path)?).map_err(broken)?;
        if archive.has_overlapping_entries().map_err(broken)? {
            return Err(
                Fault::refused("members that share compressed bytes, as decompression bombs do").in_file(path, FORMAT)
            );
        }
        Ok(Self { path: path.into(), content: Content::Archive(Box::new(archive)) })
    }

    /// The folder or archive.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether there is a file of this name.
    pub fn has(&self, name: &str) -> bool {
        match &self.content {
            Content::Folder => self.path.join(name).is_file(),
            Content::Archive(archive) => archive.index_for_name(name).is_some(),
            Content::Tarball(_, files) => files.contains_key(name),
        }
    }

    /// The content of a file.
    ///
    /// # Errors
    /// [`Error::Missing`] if there is none of this name; [`Error::Malformed`] or [`Error::TooLarge`] for one that does not unpack.
    pub fn bytes(&mut self, name: &str) -> Result<Vec<u8>> {
        if !self.has(name) {
            return Err(Error::Missing {
                path: self.path.clone(),
                what: name.into(),
                remedy: "give the whole folder or archive, as it was downloaded".into(),
            });
        }
        let bytes = match &mut self.content {
            Content::Folder => read_bytes(&self.path.join(name))?,
            Content::Archive(archive) => member(archive, name).map_err(|fault| fault.in_file(&self.path, FORMAT))?,
            Content::Tarball(bytes, files) => {
                files.get(name).and_then(|place| bytes.get(place.clone())).unwrap_or_default().to_vec()
            }
        };
        if !name.ends_with(".gz") {
            return Ok(bytes);
        }
        let budget = Budget::of_file(bytes.len());
        let unpacked = unpacked(GzDecoder::new(bytes.as_slice()), &budget).map_err(|fault| fault.within(name));
        unpacked.map_err(|fault| fault.in_file(&self.path, FORMAT))
    }

    /// The content of a text file.
    ///
    /// # Errors
    /// As [`bytes`](Self::bytes); [`Error::Malformed`] for what is not UTF-8.
    pub fn text(&mut self, name: &str) -> Result<String> {
        String::from_utf8(self.bytes(name)?).map_err(|error| Error::Malformed {
            path: self.path.clone(),
            format: "text file",
            place: format!("{name}, byte {}", error.utf8_error().valid_up_to()),
            found: "no character".into(),
            expected: "UTF-8".into(),
        })
    }
}

fn member(archive: &mut ZipArchive<File>, name: &str) -> std::result::Result<Vec<u8>, Fault> {
    let broken = |error: zip::result::ZipError| Fault::malformed(name, error, "an intact member");
    let file = archive.by_name(name).map_err(broken)?;
    let budget = Budget::of_file(usize::try_from(file.compressed_size()).unwrap_or(usize::MAX));
    unpacked(file, &budget).map_err(|fault| fault.within(name))
}

/// All that a decoder gives, on a budget.
pub(crate) fn unpacked(packed: impl Read, budget: &Budget) -> std::result::Result<Vec<u8>, Fault> {
    const STEP: usize = 1 << 16;
    let damaged = |error: io::Error| Fault::malformed("compressed data", error, "intact data");
    let mut packed = packed;
    let mut bytes = Vec::new();
    loop {
        budget.spend(STEP, "unpacking")?;
        let before = bytes.len();
        packed.by_ref().take(STEP as u64).read_to_end(&mut bytes).map_err(damaged)?;
        if bytes.len() - before < STEP {
            return Ok(bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;
    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    use super::*;

    fn packed(text: &[u8]) -> Vec<u8> {
        let mut gzip = GzEncoder::new(Vec::new(), Compression::best());
        gzip.write_all(text).unwrap();
        gzip.finish().unwrap()
    }

    /// A folder, and archives of the same files.
    fn all(files: &[(&str, Vec<u8>)]) -> (tempfile::TempDir, [FileTree; 3]) {
        let folder = tempfile::tempdir().unwrap();
        let archive = folder.path().join("tree.zip");
        let mut writer = ZipWriter::new(File::create(&archive).unwrap());
        for (name, bytes) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
            writer.start_file(*name, SimpleFileOptions::default()).unwrap();
            writer.write_all(bytes).unwrap();
        }
        writer.finish().unwrap();
        let tarball = folder.path().join("tree.tgz");
        std::fs::write(&tarball, packed(&tarball::packed(files))).unwrap();
        let trees = [folder.path(), &archive, &tarball].map(|path| FileTree::open(path).unwrap());
        (folder, trees)
    }

    #[test]
    fn a_folder_and_archives_say_the_same() {
        let (_folder, trees) = all(&[("a/notes.txt", b"two\nlines".to_vec()), ("a/b.target.gz", packed(b"1 0 0 0"))]);
        for mut tree in trees {
            assert_eq!(tree.text("a/notes.txt").unwrap(), "two\nlines");
            assert_eq!(tree.text("a/b.target.gz").unwrap(), "1 0 0 0");
            assert!(tree.has("a/notes.txt") && !tree.has("a"));
            let message = tree.bytes("a/c").unwrap_err().to_string();
            assert!(message.contains("a/c not found"), "{message}");
        }
    }

    #[test]
    fn what_is_damaged_or_unpacks_to_much_is_refused() {
        let bomb = packed(&vec![0; 100 << 20]);
        let cut = packed(b"whole")[..12].to_vec();
        let (_folder, trees) = all(&[("bomb.gz", bomb), ("cut.gz", cut), ("latin.txt", b"\xff".to_vec())]);
        for mut tree in trees {
            assert!(matches!(tree.bytes("bomb.gz"), Err(Error::TooLarge { .. })));
            assert!(matches!(tree.bytes("cut.gz"), Err(Error::Malformed { .. })));
            assert!(matches!(tree.text("latin.txt"), Err(Error::Malformed { .. })));
        }
        let file = tempfile::NamedTempFile::new().unwrap();
        assert!(matches!(FileTree::open(file.path()), Err(Error::Malformed { .. })));
    }
}
