//! C3D, the binary files of markers of Vicon and others: a head of 512 bytes, parameters, then frames of points.
//!
//! Blocks of 512 bytes, numbered from 1. Little-endian, in floats or in integers of a scale; other processors' numbers are refused. A
//! point whose residual is negative was not seen.

use std::collections::BTreeMap;

use glam::DVec3;
use xavatar_formats::Fault;

use super::file::{Found, Track, TrackFrame};
use super::names;

type Parsed<T> = std::result::Result<T, Fault>;

const BLOCK: usize = 512;
/// Second byte of the file.
const MAGIC: u8 = 0x50;
/// Fourth byte of the parameters: Intel's order and IEEE's numbers.
const INTEL: u8 = 84;

/// Whether bytes are a C3D file's.
pub(super) fn is_c3d(bytes: &[u8]) -> bool {
    bytes.len() > BLOCK && bytes[1] == MAGIC && (1..=16).contains(&bytes[0])
}

/// The markers of a C3D file, in metres.
pub(super) fn parse(bytes: &[u8]) -> Parsed<Track> {
    let word = |at: usize| bytes.get(at..at + 2).map(|pair| u16::from_le_bytes([pair[0], pair[1]]));
    let short = || Fault::malformed("the file", format_args!("{} bytes", bytes.len()), "as many as its head says");
    let head = |number: usize| word(2 * (number - 1)).ok_or_else(short);
    let parameters = Parameters::read(bytes, (usize::from(bytes[0]) - 1) * BLOCK)?;
    let (points, analog) = (usize::from(head(2)?), usize::from(head(3)?));
    let (first, last) = (usize::from(head(4)?), usize::from(head(5)?));
    let scale =
        bytes.get(12..16).map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]])).ok_or_else(short)?;
    let data = (usize::from(head(9)?).max(1) - 1) * BLOCK;
    let units = parameters.texts("POINT", "UNITS").into_iter().next().unwrap_or_else(|| "mm".into());
    let metres = match units.trim() {
        "m" => 1.0,
        "cm" => 0.01,
        "mm" | "" => 0.001,
        other => return Err(Fault::malformed("POINT:UNITS", other, "m, cm or mm")),
    };
    let mut names: Vec<String> =
        parameters.texts("POINT", "LABELS").iter().map(|label| names::of_marker(label)).collect();
    names.resize(points, String::new());
    let is_float = scale < 0.0;
    let width = if is_float { 4 } else { 2 };
    let stride = width * (4 * points + analog);
    let number = |at: usize| -> Option<f64> {
        match is_float {
            true => {
                bytes.get(at..at + 4).map(|four| f64::from(f32::from_le_bytes([four[0], four[1], four[2], four[3]])))
            }
            false => word(at).map(|word| f64::from(word as i16)),
        }
    };
    let unit = if is_float { metres } else { metres * f64::from(scale) };
    let point = |at: usize| -> Option<Found> {
        let place = DVec3::new(number(at)?, number(at + width)?, number(at + 2 * width)?) * unit;
        let is_seen = number(at + 3 * width)? >= 0.0 && place.is_finite();
        Some(is_seen.then_some((place, 1.0)))
    };
    let frame = |index: usize| -> Option<TrackFrame> {
        let from = data.checked_add(index.checked_mul(stride)?)?;
        let points: Option<Vec<Found>> = (0..points).map(|marker| point(from + 4 * width * marker)).collect();
        Some(TrackFrame { name: String::new(), points: points? })
    };
    let count = (last + 1).saturating_sub(first);
    // A file that is cut short is refused before memory is taken for what it claims.
    if count > 0 && data.saturating_add(stride.saturating_mul(count)) > bytes.len() {
        return Err(short());
    }
    let frames: Option<Vec<TrackFrame>> = (0..count).map(frame).collect();
    Ok(Track { names, frames: frames.ok_or_else(short)? })
}

/// The texts among a file's parameters, by group and name.
struct Parameters(BTreeMap<(i8, String), Vec<String>>, BTreeMap<String, i8>);

impl Parameters {
    fn texts(&self, group: &str, name: &str) -> Vec<String> {
        let id = self.1.get(group).copied().unwrap_or_default();
        self.0.get(&(id, name.to_owned())).cloned().unwrap_or_default()
    }

    fn read(bytes: &[u8], start: usize) -> Parsed<Self> {
        let section = bytes.get(start..).filter(|section| section.len() > 4);
        let section = section.ok_or_else(|| Fault::malformed("the parameters", "beyond the end", "in the file"))?;
        if section[3] != INTEL {
            return Err(Fault::malformed("the processor", section[3], "84, Intel's; export the file again"));
        }
        let mut found = Self(BTreeMap::new(), BTreeMap::new());
        let mut at = 4;
        while let Some((next, id, name, content)) = record(section, at) {
            match id {
                0 => break,
                group if group < 0 => {
                    found.1.insert(name, -group);
                }
                group => {
                    if let Some(texts) = texts(content) {
                        found.0.insert((group, name), texts);
                    }
                }
            }
            let Some(next) = next else { break };
            at = next;
        }
        Ok(found)
    }
}

/// A record: where the next one is, its group, its name, and what follows.
fn record(section: &[u8], at: usize) -> Option<(Option<usize>, i8, String, &[u8])> {
    let length = usize::from((*section.get(at)? as i8).unsigned_abs());
    let id = *section.get(at + 1)? as i8;
    let name = section.get(at + 2..at + 2 + length)?;
    let pointer = at + 2 + length;
    let offset = section.get(pointer..pointer + 2).map(|pair| usize::from(u16::from_le_bytes([pair[0], pair[1]])))?;
    let next = (offset > 0).then_some(pointer + offset).filter(|next| *next < section.len());
    let name = String::from_utf8_lossy(name).trim().to_ascii_uppercase();
    Some((next, id, name, section.get(pointer + 2..)?))
}

/// The texts of a parameter of characters: rows of a length.
fn texts(content: &[u8]) -> Option<Vec<String>> {
    const CHARACTERS: u8 = 0xff;
    if *content.first()? != CHARACTERS {
        return None;
    }
    let dimensions = usize::from(*content.get(1)?);
    let extents = content.get(2..2 + dimensions)?;
    let length = extents.first().map_or(1, |extent| usize::from(*extent));
    let rows: usize = extents.iter().skip(1).map(|extent| usize::from(*extent)).product();
    let characters = content.get(2 + dimensions..2 + dimensions + length * rows)?;
    let text = |row: &[u8]| String::from_utf8_lossy(row).trim().to_owned();
    Some(if length == 0 { Vec::new() } else { characters.chunks_exact(length).map(text).collect() })
}
