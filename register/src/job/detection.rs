//! Landmarks of every frame, found in pictures of its scan or in its own, a record a frame, so that a run that was stopped goes on.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec3;
use serde::{Deserialize, Serialize};
use xavatar_data::FrameId;
use xavatar_formats::{Error, FolderLock, Result, create_folder, read_bytes, write_atomically};
use xavatar_landmarks::{Landmark, Models, Photograph, find};

use super::coordinates::{FileCoordinates, Up};
use super::recorded::{Recording, picture, scan};
use super::{Observer, RECORDS, Recordings};
use crate::landmarks::{LandmarkFiles, Track, TrackFrame};

/// The landmarks of one frame, in its files' coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Detected {
    landmarks: Vec<(String, [f64; 3], f64)>,
}

/// Finds the landmarks of all frames, keeping records in `out`; none if it was stopped, and the same call goes on.
///
/// # Errors
/// [`Error::Unfit`] if the frames are of no person's size; [`Error::Frame`] for one that cannot be read; [`Error::Io`].
pub fn find_landmarks(
    recordings: &Recordings,
    models: &Models,
    up: Up,
    out: &Path,
    observe: &mut Observer<'_>,
    stop: &AtomicBool,
) -> Result<Option<LandmarkFiles>> {
    let _lock = FolderLock::take(out)?;
    let files = recordings.frames();
    let coordinates = recordings.coordinates(up)?;
    let folder = out.join(RECORDS).join("landmarks");
    create_folder(&folder)?;
    let mut found = Vec::new();
    for (done, one) in files.iter().enumerate() {
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let id = one.id();
        observe("landmarks", done as f64 / files.len() as f64, &id.to_string());
        let path = folder.join(format!("{}-{}-f{:05}.json", id.split, id.sequence, id.number));
        if !path.is_file() {
            let detected = detected(*one, models, coordinates).map_err(|error| error.in_frame(id.to_string()))?;
            write_json(&path, &detected)?;
        }
        found.push(read(&path)?);
    }
    let names: BTreeSet<&String> =
        found.iter().flat_map(|frame| frame.landmarks.iter().map(|(name, ..)| name)).collect();
    let of_frame = |(id, frame): (&FrameId, &Detected)| {
        let point = |name: &&String| {
            let point = frame.landmarks.iter().find(|(own, ..)| own == *name);
            point.map(|(_, place, confidence)| (DVec3::from(*place), *confidence))
        };
        TrackFrame { name: id.to_string(), points: names.iter().map(point).collect() }
    };
    let frames = files.iter().map(Recording::id).zip(&found).map(of_frame).collect();
    Ok(Some(LandmarkFiles::of(Track { names: names.iter().map(|name| (*name).clone()).collect(), frames })))
}

fn detected(recording: Recording<'_>, models: &Models, coordinates: FileCoordinates) -> Result<Detected> {
    let landmarks = match recording {
        Recording::Scan(files) => find(models, &scan(files, coordinates)?.mesh)?,
        Recording::Rgbd(files) => {
            let frame = picture(files, coordinates)?;
            let depth: Vec<Option<f32>> = (0..frame.depth.len()).map(|pixel| frame.surface_depth(pixel)).collect();
            Photograph { colour: &frame.colour, depth: &depth, camera: &frame.camera }.landmarks(models)
        }
    };
    let in_file =
        |landmark: Landmark| (landmark.name, coordinates.place_in_file(landmark.place).to_array(), landmark.confidence);
    Ok(Detected { landmarks: landmarks.into_iter().map(in_file).collect() })
}

fn read(path: &Path) -> Result<Detected> {
    serde_json::from_slice(&read_bytes(path)?).map_err(|error| Error::Malformed {
        path: path.into(),
        format: "record of a frame's landmarks",
        place: "the text".into(),
        found: error.to_string(),
        expected: "what registration writes; remove the file to look at the frame again".into(),
    })
}

fn write_json(path: &PathBuf, content: &impl Serialize) -> Result<()> {
    let text = serde_json::to_vec(content).map_err(|error| Error::io(path)(error.into()))?;
    write_atomically(path, |writer| writer.write_all(&text))
}
