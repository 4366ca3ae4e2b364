//! Files of landmarks, told by their content: one for many frames, or a folder with one a frame.
//!
//! | content | named by |
//! |---|---|
//! | ours: `{"names": [..], "frames": {"Take1/f00001": [[x, y, z, c], null, ..]}}` | names |
//! | OpenPose: `people[0].pose_keypoints_3d`, `hand_left_keypoints_3d`, .. | order |
//! | EasyMocap: `[{"id": 0, "keypoints3d": [[x, y, z, c], ..]}]` | number of points |
//! | arrays of 17, 25, 67, 118, 133, 135, 136 or 137 points, JSON, npy or npz | number of points |
//! | TRC, C3D | marker names |
//!
//! Coordinates are the scans'. Points in pictures, and MediaPipe's, which are in no scan's coordinates, are refused.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;
use xavatar_data::FrameId;
use xavatar_formats::{Error, Result, read_bytes};

use super::own::NamedPoint;
use super::{c3d, json, points, trc};

/// Extensions of files with landmarks.
const EXTENSIONS: [&str; 5] = ["json", "npy", "npz", "trc", "c3d"];

/// A point that was found, with its confidence; none if it was not.
pub type Found = Option<(DVec3, f64)>;

/// Landmarks of several frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    /// What each point is; empty if it is no place of a body.
    pub names: Vec<String>,
    /// The points of each frame.
    pub frames: Vec<TrackFrame>,
}

/// Landmarks of one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackFrame {
    /// What the file calls the frame: `f00001`, `Take1/f00001`, a number; empty if only the order says which it is.
    pub name: String,
    /// As many as names.
    pub points: Vec<Found>,
}

/// Landmarks of a subject: of every sequence, or of those that are named.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LandmarkFiles {
    tracks: BTreeMap<String, Track>,
    path: PathBuf,
}

impl LandmarkFiles {
    /// Reads a file, a folder with a file a frame, or a folder with either for every sequence.
    ///
    /// # Errors
    /// [`Error::Missing`] if nothing is there; [`Error::Unrecognised`] or [`Error::Mismatch`] for content that is not read;
    /// [`Error::Malformed`] for what is damaged.
    pub fn read(path: &Path) -> Result<Self> {
        let mut tracks = BTreeMap::new();
        if path.is_dir() {
            if let Some(track) = track_of_folder(path)? {
                tracks.insert(String::new(), track);
            }
            for inner in entries(path)?.into_iter().filter(|inner| inner.is_dir()) {
                if let Some(track) = track_of_folder(&inner)? {
                    tracks.insert(stem(&inner), track);
                }
            }
        } else {
            tracks.insert(String::new(), read_track(path)?);
        }
        if tracks.values().all(|track| track.frames.is_empty()) {
            return Err(Error::Missing {
                path: path.into(),
                what: format!("landmarks (.{})", EXTENSIONS.join(", .")),
                remedy: "give a file or a folder of docs/registration.md".into(),
            });
        }
        Ok(Self { tracks, path: path.into() })
    }

    /// Landmarks that no file holds, of frames with names of their own.
    pub fn of(track: Track) -> Self {
        Self { tracks: BTreeMap::from([(String::new(), track)]), path: PathBuf::new() }
    }

    /// The landmarks of a frame, the `place`-th of the `count` of its sequence, by name.
    ///
    /// # Errors
    /// [`Error::Mismatch`] if frames have no names of their own and are not as many as the scans.
    pub fn of_frame(&self, id: &FrameId, place: usize, count: usize) -> Result<Vec<NamedPoint>> {
        let Some(track) = self.tracks.get(&id.sequence).or_else(|| self.tracks.get("")) else { return Ok(Vec::new()) };
        let number = format!("f{:05}", id.number);
        let called = [id.to_string(), format!("{}/{number}", id.sequence), number];
        let named = called.iter().find_map(|name| track.frames.iter().find(|frame| frame.name == *name));
        let by_number = || track.frames.iter().find(|frame| frame.name.parse() == Ok(id.number));
        let found = match named.or_else(by_number) {
            Some(frame) => Some(frame),
            None if track.frames.iter().all(|frame| frame.name.is_empty()) => {
                if track.frames.len() != count {
                    return Err(Error::Mismatch {
                        path: self.path.clone(),
                        found: format!("landmarks of {} frames without names", track.frames.len()),
                        expected: format!("of the {count} scans of {}/{}", id.split, id.sequence),
                        remedy: "give a folder with a file or folder for every sequence".into(),
                    });
                }
                track.frames.get(place)
            }
            None => None,
        };
        let named =
            |(name, found): (&String, &Found)| found.map(|(place, confidence)| (name.clone(), place, confidence));
        let points = found.into_iter().flat_map(|frame| track.names.iter().zip(&frame.points));
        Ok(points.filter(|(name, _)| !name.is_empty()).filter_map(named).collect())
    }
}

/// The files of a folder as one track: the only file, or one frame each, in the order of their names.
fn track_of_folder(folder: &Path) -> Result<Option<Track>> {
    let is_track = |path: &PathBuf| {
        let extension =
            path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_ascii_lowercase();
        path.is_file() && EXTENSIONS.contains(&extension.as_str())
    };
    let files: Vec<PathBuf> = entries(folder)?.into_iter().filter(is_track).collect();
    let mut whole: Option<Track> = None;
    for file in &files {
        let mut track = read_track(file)?;
        if files.len() > 1 && track.frames.len() == 1 {
            track.frames[0].name = number_in(&stem(file)).map_or_else(|| stem(file), |number| number.to_string());
        }
        match &mut whole {
            None => whole = Some(track),
            Some(whole) if whole.names == track.names => whole.frames.extend(track.frames),
            Some(whole) => {
                return Err(Error::Mismatch {
                    path: file.clone(),
                    found: format!("{} points", track.names.len()),
                    expected: format!("the {} of the files before it", whole.names.len()),
                    remedy: "keep the landmarks of one program in a folder".into(),
                });
            }
        }
    }
    Ok(whole)
}

fn read_track(path: &Path) -> Result<Track> {
    match parse_landmarks(path, &read_bytes(path)?)? {
        Some(track) => Ok(track),
        None => points::of_arrays(path),
    }
}

/// The landmarks of a file's bytes, if they are JSON, TRC or C3D; `path` is what messages name.
///
/// # Errors
/// As [`LandmarkFiles::read`].
pub fn parse_landmarks(path: &Path, bytes: &[u8]) -> Result<Option<Track>> {
    let is_text_of = |start: &[u8]| bytes.trim_ascii_start().starts_with(start);
    let track = if c3d::is_c3d(bytes) {
        c3d::parse(bytes).map_err(|fault| fault.in_file(path, "C3D file"))?
    } else if is_text_of(b"PathFileType") {
        trc::parse(bytes).map_err(|fault| fault.in_file(path, "TRC file"))?
    } else if is_text_of(b"{") || is_text_of(b"[") {
        json::parse(path, bytes)?
    } else {
        return Ok(None);
    };
    Ok(Some(track))
}

/// What is in a folder, by name; hidden files are left out.
fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        paths.push(entry.map_err(Error::io(folder))?.path());
    }
    paths.retain(|path| !stem(path).starts_with('.'));
    paths.sort();
    Ok(paths)
}

fn stem(path: &Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The last number in a name: OpenPose's `000000000012_keypoints` is 12.
fn number_in(name: &str) -> Option<u32> {
    name.rsplit(|character: char| !character.is_ascii_digit()).find(|digits| !digits.is_empty())?.parse().ok()
}
