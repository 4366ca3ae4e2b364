//! PyTorch files (`torch.save` since PyTorch 1.6: `.pth`, `.pt`, Lightning's `.ckpt`), read without PyTorch and without running anything.
//!
//! A zip archive of uncompressed members: `NAME/data.pkl`, a pickle in which tensors refer to storages; `NAME/data/KEY`, their
//! bytes; `NAME/byteorder`; in TorchScript's, `NAME/code/...`, which is not looked at. Nothing is copied before a tensor asks for it, on the file's [`Budget`].

use std::collections::HashMap;
use std::io::{self, Cursor};
use std::path::Path;

use zip::{CompressionMethod, ZipArchive};

use crate::budget::Budget;
use crate::fault::Fault;
use crate::input_file::read_bytes;
use crate::pickle::{Storages, interpret_with_tensors};
use crate::{Error, Result, Value};

const FORMAT: &str = "PyTorch file";
const ZIP: &[u8] = b"PK\x03\x04";
/// How files of PyTorch before 1.6 begin: protocol 2 and the number 0x1950a86a20f9469cfc6c.
pub(crate) const LEGACY: &[u8] = b"\x80\x02\x8a\x0a\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19";

/// What to do with those.
pub(crate) const REWRITE: &str = "rewrite it in Python: torch.save(torch.load(\"OLD\", map_location=\"cpu\"), \"NEW\")";

/// Whether a zip archive is one of PyTorch.
pub(crate) fn is_archive(bytes: &[u8]) -> bool {
    let Ok(archive) = ZipArchive::new(Cursor::new(bytes)) else { return false };
    archive.file_names().flatten().any(|name| name.ends_with("/data.pkl") && name.matches('/').count() == 1)
}

/// Reads a file written by `torch.save`: dicts, lists and numbers, tensors as [`Value::Array`].
///
/// Objects in which training frameworks keep settings (omegaconf, Lightning) are passed over, as `None`; modules of TorchScript
/// (`torch.jit.save`) are dicts of their attributes.
///
/// # Errors
/// [`Error::Refused`] names what the file wants to have called, if that is not on the allow-list; [`Error::Mismatch`] says how
/// to rewrite a file of PyTorch before 1.6; [`Error::Malformed`] names the member or byte that goes wrong.
pub fn read_torch(path: impl AsRef<Path>) -> Result<Value> {
    let path = path.as_ref();
    let bytes = read_bytes(path)?;
    if bytes.starts_with(LEGACY) {
        return Err(Error::Mismatch {
            path: path.into(),
            found: "a file in PyTorch's format before 1.6".into(),
            expected: "a zip archive as torch.save writes it since".into(),
            remedy: REWRITE.into(),
        });
    }
    parse_torch(&bytes).map_err(|fault| fault.in_file(path, FORMAT))
}

/// What the bytes of a PyTorch archive hold.
///
/// # Errors
/// As [`read_torch`], without the file's name.
pub fn parse_torch(bytes: &[u8]) -> std::result::Result<Value, Fault> {
    if !bytes.starts_with(ZIP) {
        return Err(Fault::malformed("byte 0", "something else", "a zip archive, as torch.save writes it"));
    }
    let members = members(bytes)?;
    let pickle = members.iter().filter(|(name, _)| name.ends_with("/data.pkl") && name.matches('/').count() == 1);
    let Some((name, pickle)) = pickle.min_by_key(|(name, _)| *name) else {
        return Err(Fault::malformed("zip directory", "no data.pkl", "an archive that torch.save wrote"));
    };
    let folder = name.trim_end_matches("data.pkl");
    let storages = Storages {
        members: members
            .iter()
            .filter_map(|(name, bytes)| Some((name.strip_prefix(folder)?.strip_prefix("data/")?.to_owned(), *bytes)))
            .collect(),
        big_endian: members.get(&format!("{folder}byteorder")).is_some_and(|order| *order == b"big"),
    };
    interpret_with_tensors(pickle, &storages, &Budget::of_file(bytes.len())).map_err(|fault| fault.within("data.pkl"))
}

/// The bytes of every member but code, where they lie in the file.
fn members(bytes: &[u8]) -> std::result::Result<HashMap<String, &[u8]>, Fault> {
    let broken = |error: zip::result::ZipError| Fault::malformed("zip directory", error, "a zip archive");
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(broken)?;
    if archive.has_overlapping_entries().map_err(broken)? {
        return Err(Fault::refused("members that share bytes, as decompression bombs do"));
    }
    let mut members = HashMap::with_capacity(archive.len());
    for index in 0..archive.len() {
        let mut member = archive.by_index(index).map_err(broken)?;
        let name = member.name().map_err(broken)?.into_owned();
        if name.split('/').nth(1) == Some("code") {
            continue;
        }
        if member.compression() != CompressionMethod::Stored || member.encrypted() {
            return Err(Fault::refused(format_args!("member {name:?} to be unpacked, where torch.save packs nothing")));
        }
        // Reading it to its end compares the checksum.
        io::copy(&mut member, &mut io::sink()).map_err(|error| Fault::malformed(&name, error, "an intact member"))?;
        let place = member.data_start().zip(Some(member.size()));
        let place = place.and_then(|(start, size)| {
            let (start, size) = (usize::try_from(start).ok()?, usize::try_from(size).ok()?);
            bytes.get(start..start.checked_add(size)?)
        });
        let place = place.ok_or_else(|| Fault::malformed(&name, "a member beyond the end", "one within the file"))?;
        members.insert(name, place);
    }
    Ok(members)
}
