//! Landmarks in our own format, written: `{"names": [..], "frames": {"train/Take1/f00001": [[x, y, z, confidence], null, ..]}}`.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::Path;

use glam::DVec3;
use serde_json::{Value, json};
use xavatar_formats::{Result, write_atomically};

/// The file, among scans or in what is made of them.
pub const LANDMARKS_FILE: &str = "landmarks.json";

/// A point: its name, place and confidence.
pub type NamedPoint = (String, DVec3, f64);

/// Writes the points of frames by name. Frames and points that are not there are null when read.
///
/// # Errors
/// [`Error::Io`](xavatar_formats::Error::Io).
pub fn write_own(path: &Path, frames: &[(String, Vec<NamedPoint>)]) -> Result<()> {
    let names: BTreeSet<&str> =
        frames.iter().flat_map(|(_, points)| points.iter().map(|(name, ..)| name.as_str())).collect();
    let row = |points: &[NamedPoint]| -> Value {
        let point = |name: &&str| match points.iter().find(|(own, ..)| own == name) {
            Some((_, place, confidence)) => json!([place.x, place.y, place.z, confidence]),
            None => Value::Null,
        };
        names.iter().map(point).collect()
    };
    write_atomically(path, |writer| {
        write!(writer, "{{\"names\": {}, \"frames\": {{", json!(names))?;
        for (index, (frame, points)) in frames.iter().enumerate() {
            let comma = if index == 0 { "" } else { "," };
            write!(writer, "{comma}\n{}: {}", json!(frame), row(points))?;
        }
        writeln!(writer, "}}}}")
    })
}
