//! The chunks of a GLB file: a header, JSON, and the buffer that it describes.

use super::document::Document;
use crate::Parsed;
use xavatar_formats::Fault;

const JSON: u32 = 0x4e4f_534a;
const BINARY: u32 = 0x004e_4942;

/// A GLB file.
pub(super) struct Container<'a> {
    pub(super) document: Document,
    /// The first buffer's bytes.
    pub(super) binary: &'a [u8],
    /// Of the file.
    pub(super) length: usize,
}

impl<'a> Container<'a> {
    pub(super) fn parse(bytes: &'a [u8]) -> Parsed<Self> {
        let word = |place: usize| {
            let bytes = bytes.get(place..place + 4)?;
            Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
        };
        let truncated = |place: usize| Fault::malformed(format!("byte {place}"), "the end of the file", "a whole GLB");
        if !bytes.starts_with(b"glTF") {
            return Err(Fault::malformed("the start of the file", "something else", "`glTF`"));
        }
        let version = word(4).ok_or_else(|| truncated(4))?;
        if version != 2 {
            return Err(Fault::malformed("the version", version.to_string(), "2"));
        }
        let claimed = word(8).ok_or_else(|| truncated(8))? as usize;
        if claimed > bytes.len() {
            let found = format!("{claimed} bytes, of which {} are there", bytes.len());
            return Err(Fault::malformed("the file's length", found, "a whole file"));
        }
        let (mut json, mut binary) = (None, &[][..]);
        let mut place = 12;
        while place < claimed {
            let (length, kind) = word(place).zip(word(place + 4)).ok_or_else(|| truncated(place))?;
            let start = place + 8;
            let content = bytes[..claimed].get(start..start + length as usize).ok_or_else(|| truncated(place))?;
            match kind {
                JSON if json.is_none() => json = Some(content),
                BINARY if binary.is_empty() => binary = content,
                _ => {}
            }
            place = start + length as usize;
        }
        let json = json.ok_or_else(|| Fault::malformed("the chunks", "without JSON", "a description of the scene"))?;
        let document = serde_json::from_slice(json)
            .map_err(|error| Fault::malformed("the JSON", error.to_string(), "what glTF 2.0 describes"))?;
        Ok(Self { document, binary, length: bytes.len() })
    }

    /// The bytes of a buffer view, and the bytes from one of its rows to the next if it says.
    pub(super) fn view(&self, index: usize) -> Parsed<(&'a [u8], Option<usize>)> {
        let place = || format!("buffer view {index}");
        let views = &self.document.buffer_views;
        let view =
            views.get(index).ok_or_else(|| Fault::malformed(place(), "missing", format!("one of {}", views.len())))?;
        let buffer = self.document.buffers.get(view.buffer);
        if view.buffer != 0 || buffer.is_none_or(|buffer| buffer.uri.is_some()) {
            return Err(Fault::malformed(place(), "in another file", "all data in the GLB itself"));
        }
        let end = view.byte_offset.checked_add(view.byte_length);
        let bytes = end.and_then(|end| self.binary.get(view.byte_offset..end)).ok_or_else(|| {
            let found = format!("{} bytes from {}", view.byte_length, view.byte_offset);
            Fault::malformed(place(), found, format!("inside the {} that there are", self.binary.len()))
        })?;
        Ok((bytes, view.byte_stride))
    }
}
