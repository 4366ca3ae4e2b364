//! Rows of numbers as points: x, y, z, and a confidence if there is a fourth; x, y, z, something, confidence if there is a fifth.

use std::path::Path;

use glam::DVec3;
use xavatar_formats::{ArrayFile, Error, Result};

use super::file::{Found, Track, TrackFrame};
use super::names;

/// The point of a row; none where it was not found: not finite, or without confidence.
pub fn of_row(row: &[f64]) -> Found {
    let confidence = match row.len() {
        3 => 1.0,
        4 => row[3],
        _ => row[4],
    };
    let place = DVec3::from_slice(row);
    (place.is_finite() && confidence.is_finite() && confidence > 0.0).then_some((place, confidence.min(1.0)))
}

/// Frames of so many points each, whose number says what they are.
pub fn of_rows(path: &Path, frames: Vec<Vec<Found>>) -> Result<Track> {
    let count = frames.first().map_or(0, Vec::len);
    let names = names::of_count(count).ok_or_else(|| refused(path, count))?;
    if let Some(other) = frames.iter().find(|frame| frame.len() != count) {
        return Err(refused(path, other.len()));
    }
    let frame = |points| TrackFrame { name: String::new(), points };
    Ok(Track { names, frames: frames.into_iter().map(frame).collect() })
}

/// The array of a npy or npz file: (T, points, 3, 4 or 5), or of one frame.
pub fn of_arrays(path: &Path) -> Result<Track> {
    let unknown = |found: String| Error::Mismatch {
        path: path.into(),
        found,
        expected: "an array of frames, points, and x, y, z with a confidence".into(),
        remedy: "docs/registration.md has the files of landmarks that are read".into(),
    };
    let file = ArrayFile::read(path)?.ok_or_else(|| unknown("no file of landmarks".into()))?;
    let array =
        file.arrays.values().find(|array| matches!(array.shape[..], [.., 3..=5])).or(file.arrays.values().next());
    let array = array.ok_or_else(|| unknown("no array".into()))?;
    let (points, width) = match array.shape[..] {
        [_, points, width @ 3..=5] | [points, width @ 3..=5] => (points, width),
        [_, points, 2] | [points, 2] => return Err(in_pictures(path, points)),
        _ => return Err(unknown(array.description())),
    };
    let values = array.to_f64().ok_or_else(|| unknown(array.description()))?;
    let frames = values.chunks_exact((points * width).max(1));
    of_rows(path, frames.map(|frame| frame.chunks_exact(width).map(of_row).collect()).collect())
}

/// What is said of points in pictures.
pub fn in_pictures(path: &Path, points: usize) -> Error {
    Error::Mismatch {
        path: path.into(),
        found: format!("{points} points in pictures (x and y)"),
        expected: "points in the scans' coordinates (x, y and z)".into(),
        remedy: "triangulate them first; points of pictures are not read".into(),
    }
}

fn refused(path: &Path, count: usize) -> Error {
    let is_mediapipe = matches!(count, 33 | 543 | 553);
    Error::Mismatch {
        path: path.into(),
        found: format!("{count} points"),
        expected: "17, 25, 67, 118, 133, 135, 136 or 137, or landmarks with names".into(),
        remedy: match is_mediapipe {
            true => "MediaPipe's are not in the scans' coordinates; triangulate its points of several pictures",
            false => "write them as landmarks.json, with names",
        }
        .into(),
    }
}
