//! The npz format: a zip archive of npy files, stored or deflated.
//!
//! Memory grows only with bytes that were really decompressed: the sizes an archive claims are never allocated, its
//! members must not overlap (which bounds the total by deflate's ratio), and each must be as long as its header says.

use std::io::{Cursor, Read, Write};
use std::path::Path;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use super::ArrayMap;
use super::fault::Fault;
use super::npy::{NpyFile, npy_bytes};
use super::pickle::{flatten, parse_pickle};
use crate::atomic_file::write_atomically;
use crate::{Error, Result};

const FORMAT: &str = "npz archive";

/// Reads every array of a `.npz` file.
///
/// Arrays of Python objects (a dict saved by `np.savez`) go through the allow-list pickle interpreter; the entries of
/// a dict `body` are named `body.key`. What has no array form (several strings, `None`) is left out.
///
/// # Errors
/// [`Error::Malformed`] names the array that could not be read; [`Error::Refused`] one that asks for code to be run.
pub fn read_npz(path: impl AsRef<Path>) -> Result<ArrayMap> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    parse_npz(&bytes).map_err(|fault| fault.in_file(path, FORMAT))
}

fn parse_npz(bytes: &[u8]) -> std::result::Result<ArrayMap, Fault> {
    let broken = |error: zip::result::ZipError| Fault::malformed("zip directory", error, "a zip archive");
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(broken)?;
    if archive.has_overlapping_entries().map_err(broken)? {
        return Err(Fault::refused("members that share compressed bytes, as decompression bombs do"));
    }
    let mut arrays = ArrayMap::new();
    for index in 0..archive.len() {
        let mut file = archive.by_index(index).map_err(broken)?;
        let file_name = file.name().map_err(broken)?.into_owned();
        let Some(name) = file_name.strip_suffix(".npy") else { continue };
        let mut member = Vec::new();
        file.read_to_end(&mut member).map_err(|error| Fault::malformed(name, error, "an intact member"))?;
        insert_member(&mut arrays, name, &member).map_err(|fault| fault.within(&format!("array `{name}`")))?;
    }
    Ok(arrays)
}

fn insert_member(arrays: &mut ArrayMap, name: &str, member: &[u8]) -> std::result::Result<(), Fault> {
    let npy = NpyFile::parse(member)?;
    if npy.is_objects() {
        flatten(name, parse_pickle(npy.data)?, member.len(), arrays)
    } else if npy.element.is_text() && npy.shape.iter().any(|&extent| extent != 1) {
        Ok(())
    } else {
        arrays.insert(name.to_owned(), npy.array()?);
        Ok(())
    }
}

/// Writes arrays to a `.npz` file, deflated; the file appears whole or not at all, with the same bytes each time.
///
/// # Errors
/// [`Error::Io`] if the file cannot be written.
pub fn write_npz(path: impl AsRef<Path>, arrays: &ArrayMap) -> Result<()> {
    let path = path.as_ref();
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let mut fill = || {
        for (name, array) in arrays {
            let member = npy_bytes(array);
            // The current time would make equal contents differ.
            let options = SimpleFileOptions::default()
                .compression_method(CompressionMethod::Deflated)
                .compression_level(Some(1))
                .last_modified_time(DateTime::default())
                .large_file(member.len() >= u32::MAX as usize / 2);
            archive.start_file(format!("{name}.npy"), options)?;
            archive.write_all(&member)?;
        }
        Ok::<(), zip::result::ZipError>(())
    };
    fill().map_err(|error| Error::io(path)(error.into()))?;
    let bytes = archive.finish().map_err(|error| Error::io(path)(error.into()))?.into_inner();
    write_atomically(path, |writer| writer.write_all(&bytes))
}
