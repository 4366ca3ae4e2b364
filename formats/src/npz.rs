//! The npz format: a zip archive of npy files, stored or deflated.
//!
//! Unpacked bytes and arrays come out of one [`Budget`] a file, so that a small archive cannot claim much; members must not
//! overlap, and each must be as long as the directory says.

use std::io::{self, Cursor, Read, Write};
use std::path::Path;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use crate::atomic_file::write_atomically;
use crate::budget::Budget;
use crate::fault::Fault;
use crate::input_file::read_bytes;
use crate::npy::{NpyFile, npy_bytes};
use crate::pickle::{flatten, interpret};
use crate::{ArrayMap, Error, Result};

const FORMAT: &str = "npz archive";

/// Reads every array of a `.npz` file.
///
/// Arrays of Python objects (a dict saved by `np.savez`) go through the allow-list pickle interpreter; the entries of
/// a dict `body` are named `body.key`. What has no array form (several strings, `None`) is left out.
///
/// # Errors
/// [`Error::Malformed`] names the array that could not be read; [`Error::Refused`] one that asks for code to be run;
/// [`Error::TooLarge`] one that unpacks to more than the file's size explains.
pub fn read_npz(path: impl AsRef<Path>) -> Result<ArrayMap> {
    let path = path.as_ref();
    parse_npz(&read_bytes(path)?).map_err(|fault| fault.in_file(path, FORMAT))
}

/// The arrays of an npz file's bytes.
///
/// # Errors
/// As [`read_npz`], without the file's name.
pub fn parse_npz(bytes: &[u8]) -> std::result::Result<ArrayMap, Fault> {
    let broken = |error: zip::result::ZipError| Fault::malformed("zip directory", error, "a zip archive");
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(broken)?;
    if archive.has_overlapping_entries().map_err(broken)? {
        return Err(Fault::refused("members that share compressed bytes, as decompression bombs do"));
    }
    let budget = Budget::of_file(bytes.len());
    let mut arrays = ArrayMap::new();
    for index in 0..archive.len() {
        let file = archive.by_index(index).map_err(broken)?;
        let file_name = file.name().map_err(broken)?.into_owned();
        let Some(name) = file_name.strip_suffix(".npy") else { continue };
        let size = usize::try_from(file.size()).unwrap_or(usize::MAX);
        let inserted = unpack(file, size, &budget).and_then(|member| {
            insert_member(&mut arrays, name, &member, &budget)?;
            budget.give_back(member.len());
            Ok(())
        });
        inserted.map_err(|fault| fault.within(&format!("array `{name}`")))?;
    }
    Ok(arrays)
}

/// A member's bytes: `size` of them, as the directory says, or it is a fault.
fn unpack(mut member: impl Read, size: usize, budget: &Budget) -> std::result::Result<Vec<u8>, Fault> {
    let mut bytes = budget.vector(size, "unpacking")?;
    let damaged = |error: io::Error| Fault::malformed("member", error, "an intact member");
    member.by_ref().take(size as u64).read_to_end(&mut bytes).map_err(damaged)?;
    // Reading beyond the end compares the checksum.
    let beyond = member.read(&mut [0]).map_err(damaged)?;
    if bytes.len() < size || beyond > 0 {
        return Err(Fault::malformed("member", "another size", format_args!("the {size} bytes of the zip directory")));
    }
    Ok(bytes)
}

fn insert_member(arrays: &mut ArrayMap, name: &str, member: &[u8], budget: &Budget) -> std::result::Result<(), Fault> {
    let npy = NpyFile::parse(member)?;
    if npy.is_objects() {
        flatten(name, interpret(npy.data, budget)?, budget, arrays)
    } else if npy.element.is_text() && npy.shape.iter().any(|&extent| extent != 1) {
        Ok(())
    } else {
        arrays.insert(name.to_owned(), npy.array(budget)?);
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
