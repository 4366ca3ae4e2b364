//! TRC, the text files of markers of OpenSim and Pose2Sim: a head, the markers' names, then a line a frame.

use glam::DVec3;
use xavatar_formats::Fault;

use super::file::{Found, Track, TrackFrame};
use super::names;

type Parsed<T> = std::result::Result<T, Fault>;

/// The markers of a TRC file, in metres.
pub(super) fn parse(bytes: &[u8]) -> Parsed<Track> {
    let text = std::str::from_utf8(bytes).map_err(|error| Fault::malformed("the text", error, "UTF-8"))?;
    let mut lines = text.lines();
    lines.next();
    let keys = lines.next().unwrap_or_default().split('\t').map(str::trim);
    let values = lines.next().unwrap_or_default().split('\t').map(str::trim);
    let units = keys.zip(values).find(|(key, _)| *key == "Units").map_or("mm", |(_, value)| value);
    let scale = match units {
        "m" => 1.0,
        "cm" => 0.01,
        "mm" => 0.001,
        other => return Err(Fault::malformed("Units", other, "m, cm or mm")),
    };
    let markers = lines.next().unwrap_or_default().split('\t').skip(2).map(str::trim).filter(|name| !name.is_empty());
    let names: Vec<String> = markers.map(names::of_marker).collect();
    if names.is_empty() {
        return Err(Fault::malformed("line 4", "no marker", "Frame#, Time and the markers' names"));
    }
    // X1 Y1 Z1 ..
    lines.next();
    let mut frames = Vec::new();
    for line in lines.filter(|line| !line.trim().is_empty()) {
        let mut cells = line.split('\t').map(str::trim);
        let number = cells.next().unwrap_or_default();
        if number.parse::<f64>().is_err() {
            return Err(Fault::malformed(format_args!("frame {}", frames.len() + 1), number, "its number"));
        }
        let coordinates: Vec<f64> = cells.skip(1).map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
        let point = |marker: usize| -> Found {
            let place = DVec3::from_slice(coordinates.get(3 * marker..3 * marker + 3)?) * scale;
            (place.is_finite() && place != DVec3::ZERO).then_some((place, 1.0))
        };
        frames.push(TrackFrame { name: String::new(), points: (0..names.len()).map(point).collect() });
    }
    Ok(Track { names, frames })
}
