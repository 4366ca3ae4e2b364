//! Landmarks in JSON: our own, OpenPose's, EasyMocap's, or bare rows.

use std::path::Path;

use serde_json::Value;
use xavatar_formats::{Error, Result, excerpt};

use super::file::{Found, Track, TrackFrame};
use super::{names, points};

const FORMAT: &str = "file of landmarks";

/// The landmarks of a JSON file.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Track> {
    let value: Value =
        serde_json::from_slice(bytes).map_err(|error| malformed(path, "the text", &error.to_string(), "JSON"))?;
    if let (Some(names), Some(frames)) = (value.get("names"), value.get("frames")) {
        return own(path, names, frames);
    }
    if let Some(people) = value.get("people").and_then(Value::as_array) {
        return openpose(path, people);
    }
    let person = value.as_array().and_then(|list| list.first()).filter(|first| first.is_object()).unwrap_or(&value);
    let keyed = ["keypoints3d", "keypoints_3d", "keypoints"].iter().find_map(|key| person.get(key));
    let rows = keyed.unwrap_or(&value);
    points::of_rows(path, vec![rows_of(path, "the points", rows)?])
}

fn own(path: &Path, names: &Value, frames: &Value) -> Result<Track> {
    let names = names
        .as_array()
        .and_then(|names| names.iter().map(|name| Some(name.as_str()?.to_owned())).collect::<Option<Vec<_>>>());
    let names = names.ok_or_else(|| malformed(path, "`names`", "no list of texts", "the points' names"))?;
    let frames =
        frames.as_object().ok_or_else(|| malformed(path, "`frames`", "no object", "points by the frames' names"))?;
    let frame = |(name, rows): (&String, &Value)| {
        let points = rows_of(path, name, rows)?;
        if points.len() != names.len() {
            return Err(malformed(
                path,
                name,
                &format!("{} points", points.len()),
                &format!("{}, one a name", names.len()),
            ));
        }
        Ok(TrackFrame { name: name.clone(), points })
    };
    Ok(Track { frames: frames.iter().map(frame).collect::<Result<_>>()?, names })
}

/// The first person: the body's points, then the hands' and the face's if there are any.
fn openpose(path: &Path, people: &[Value]) -> Result<Track> {
    let missing = || Track {
        names: names::of_count(137).unwrap_or_default(),
        frames: vec![TrackFrame { name: String::new(), points: vec![None; 137] }],
    };
    let Some(person) = people.first() else { return Ok(missing()) };
    let numbers = |key: &str| -> Vec<f64> {
        let list = person.get(key).and_then(Value::as_array);
        list.map(|list| list.iter().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect()).unwrap_or_default()
    };
    let rows = |key: &str| -> Vec<Found> { numbers(key).chunks_exact(4).map(points::of_row).collect() };
    let body = rows("pose_keypoints_3d");
    if body.is_empty() {
        return Err(points::in_pictures(path, numbers("pose_keypoints_2d").len() / 3));
    }
    let mut track = missing();
    let all = &mut track.frames[0].points;
    let mut place = |first: usize, rows: Vec<Found>, most: usize| {
        rows.into_iter().take(most).enumerate().for_each(|(index, found)| all[first + index] = found);
    };
    place(0, body, 25);
    place(25, rows("hand_left_keypoints_3d"), 21);
    place(46, rows("hand_right_keypoints_3d"), 21);
    place(67, rows("face_keypoints_3d"), 70);
    Ok(track)
}

fn rows_of(path: &Path, place: &str, value: &Value) -> Result<Vec<Found>> {
    let rows = value.as_array().ok_or_else(|| malformed(path, place, "no list", "a list of points"))?;
    let row = |row: &Value| {
        if row.is_null() {
            return Ok(None);
        }
        let numbers: Option<Vec<f64>> = row.as_array().and_then(|row| row.iter().map(Value::as_f64).collect());
        match numbers {
            Some(numbers) if (3..=5).contains(&numbers.len()) => Ok(points::of_row(&numbers)),
            Some(numbers) if numbers.len() == 2 => Err(points::in_pictures(path, rows.len())),
            _ => Err(malformed(path, place, &excerpt(&row.to_string()), "[x, y, z] or [x, y, z, confidence]")),
        }
    };
    rows.iter().map(row).collect()
}

fn malformed(path: &Path, place: &str, found: &str, expected: &str) -> Error {
    Error::Malformed {
        path: path.into(),
        format: FORMAT,
        place: place.into(),
        found: found.into(),
        expected: expected.into(),
    }
}
