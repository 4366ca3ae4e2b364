//! A plain folder of RGB-D pictures: what its `rgbd.toml` says (docs/rgbd.md).
//!
//! Pictures of one frame have the same number in their names, or the nearest times. The rows of camera files and motions follow the
//! frames of a sequence in this order; of pictures with times, rows may follow the colour pictures instead, and poses have times of
//! their own.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::RgbdSubject;
use super::association::{self, Folders, Pictures};
use super::cameras::{CameraTable, Intrinsics, POSE_EXTENSIONS, rows_at};
use super::layout::{Calibration, Layout, Sequence, Shape};
use super::numbering::{NumberedFiles, SAME_MOMENT};
use super::subject::{RegistrationFile, RgbdFiles};
use crate::xhumans::mean_shape;
use crate::{FrameId, Motion, read_motion};
use xavatar_body::Gender;
use xavatar_formats::{Error, Result};

const FORMAT: &str = "RGB-D folder";
/// Looked for in this order where `cameras` is not given.
const CAMERA_FILES: [&str; 3] = ["cameras.npz", "cameras.toml", "cameras.json"];

pub(super) fn open(folder: &Path) -> Result<RgbdSubject> {
    let layout = Layout::read(folder)?;
    let required = |name: &str| {
        malformed(
            &folder.join(Layout::FILE),
            name,
            "missing",
            "those of the registered bodies, as registering the pictures writes them (docs/registration.md)",
        )
    };
    let betas = match layout.betas.as_ref().ok_or_else(|| required("`betas`"))? {
        Shape::Numbers(betas) => betas.clone(),
        Shape::File(file) => mean_shape(&folder.join(file))?,
    };
    let gender = layout.gender.ok_or_else(|| required("`gender`"))?;
    let [train, test] = frames(folder, &layout, |bodies| read_motion(bodies).map(Some))?;
    Ok(RgbdSubject { folder: folder.into(), gender, betas, train, test })
}

/// The gender, if it is known, and the frames for training and for tests, before bodies are registered to them.
pub(super) fn pictures(folder: &Path) -> Result<(Option<Gender>, [Vec<RgbdFiles>; 2])> {
    let layout = Layout::read(folder)?;
    Ok((layout.gender, frames(folder, &layout, |_| Ok(None))?))
}

/// Whether a sequence has the file, or folder, of its bodies.
pub(super) fn has_bodies(folder: &Path) -> bool {
    let has_bodies = |sequence: &Sequence| folder.join(&sequence.folder).join(&sequence.bodies).exists();
    Layout::read(folder).is_ok_and(|layout| layout.sequences.iter().any(has_bodies))
}

/// The frames of each split; `read` gives the bodies of a sequence's file.
fn frames(
    folder: &Path,
    layout: &Layout,
    read: impl Fn(&Path) -> Result<Option<Motion>>,
) -> Result<[Vec<RgbdFiles>; 2]> {
    let mut frames = [Vec::new(), Vec::new()];
    for sequence in &layout.sequences {
        frames[sequence.split as usize].extend(frames_of_sequence(folder, layout, sequence, &read)?);
    }
    for frames in &mut frames {
        frames.sort_by(|one: &RgbdFiles, other| one.id.cmp(&other.id));
        if let Some(pair) = frames.windows(2).find(|pair| pair[0].id == pair[1].id) {
            let path = folder.join(Layout::FILE);
            return Err(malformed(&path, "`name`", format!("{} twice", pair[0].id), "another name for each sequence"));
        }
    }
    Ok(frames)
}

fn frames_of_sequence(
    subject: &Path,
    layout: &Layout,
    sequence: &Sequence,
    read: &impl Fn(&Path) -> Result<Option<Motion>>,
) -> Result<Vec<RgbdFiles>> {
    let folder = subject.join(&sequence.folder);
    let pictures = find_pictures(&folder, sequence)?;
    let bodies = folder.join(&sequence.bodies);
    let motion = read(&bodies)?;
    let intrinsics = intrinsics(subject, layout)?;
    let rows = match &motion {
        Some(motion) => rows(&pictures, motion.frames.len()).ok_or_else(|| Error::Mismatch {
            path: bodies,
            found: format!("{} registered bodies", motion.frames.len()),
            expected: format!("one for each of the {} frames in {}", pictures.frames.len(), folder.display()),
            remedy: "register every frame, or remove the pictures of the others".into(),
        })?,
        None => {
            // What is wrong with the file is the frames' error.
            let table = CameraTable::read(&camera_path(&folder, sequence), layout.pixel_origin, intrinsics);
            let rows = table.ok().and_then(|table| rows(&pictures, table.poses()));
            rows.unwrap_or_else(|| (0..pictures.frames.len()).collect())
        }
    };
    let cameras = cameras_of(&folder, sequence, &pictures.frames, &rows)?;
    let name = sequence.name.clone().or_else(|| Some(sequence.folder.file_name()?.to_string_lossy().into_owned()));
    let frame = |((pictures, row), (cameras, camera_row)): ((Pictures, usize), (PathBuf, Option<usize>))| RgbdFiles {
        id: FrameId {
            split: sequence.split.name().into(),
            sequence: name.clone().unwrap_or_default(),
            number: pictures.number,
        },
        colour: pictures.colour,
        depth: pictures.depth,
        mask: pictures.mask,
        cameras,
        metres_per_unit: layout.metres_per_unit(),
        camera_row,
        pixel_origin: layout.pixel_origin,
        intrinsics,
        registration: motion.as_ref().map(|motion| RegistrationFile::Read(Box::new(motion.frames[row].clone()))),
    };
    Ok(pictures.frames.into_iter().zip(rows).zip(cameras).map(frame).collect())
}

/// Extensions of pictures, in lower case.
const PICTURE_EXTENSIONS: [&str; 8] = ["png", "jpg", "jpeg", "tif", "tiff", "bmp", "tga", "exr"];

/// What a picture shows, by its name: asked where one folder has several kinds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Colour,
    Depth,
    Mask,
}

impl Kind {
    fn of(name: &str) -> Self {
        let name = name.to_ascii_lowercase();
        match (name.contains("mask"), name.contains("depth")) {
            (true, _) => Self::Mask,
            (false, true) => Self::Depth,
            (false, false) => Self::Colour,
        }
    }
}

/// The pictures of a sequence.
struct Found {
    frames: Vec<Pictures>,
    /// Colour pictures, with those that have no depth.
    colour: usize,
}

fn find_pictures(folder: &Path, sequence: &Sequence) -> Result<Found> {
    let [colour, depth] = [&sequence.colour, &sequence.depth].map(|name| folder.join(name));
    let mask = sequence.mask.as_ref().map(|name| folder.join(name));
    let read = |kind: Kind, folder: &Path| {
        let kinds = [Some(&colour), Some(&depth), mask.as_ref()];
        let is_shared = kinds.iter().flatten().filter(|other| **other == folder).count() > 1;
        match folder.is_dir() {
            true => NumberedFiles::read(folder, &PICTURE_EXTENSIONS, |name| !is_shared || Kind::of(name) == kind),
            false => Err(missing(folder.into(), "a folder of pictures")),
        }
    };
    let (colour_files, depth_files) = (read(Kind::Colour, &colour)?, read(Kind::Depth, &depth)?);
    let mask_files = mask.as_deref().map(|mask| read(Kind::Mask, mask)).transpose()?;
    let folders = Folders { colour: &colour, depth: &depth, mask: mask.as_deref() };
    let frames = association::frames(&folders, &colour_files, &depth_files, mask_files.as_ref())?;
    let colour = match colour_files {
        NumberedFiles::Times(times) => times.len(),
        NumberedFiles::Numbers(_) => frames.len(),
    };
    Ok(Found { frames, colour })
}

/// The row of each frame among so many: one a frame, or one a colour picture; `None` if there are as many of neither.
fn rows(pictures: &Found, count: usize) -> Option<Vec<usize>> {
    let frames = &pictures.frames;
    if count == frames.len() {
        return Some((0..count).collect());
    }
    if count != pictures.colour {
        return None;
    }
    frames.iter().map(|frame| Some(frame.moment?.place)).collect()
}

/// The camera file of each frame, and the row in it; no row where a file of poses with times has none of that moment.
fn cameras_of(
    folder: &Path,
    sequence: &Sequence,
    frames: &[Pictures],
    rows: &[usize],
) -> Result<Vec<(PathBuf, Option<usize>)>> {
    let path = camera_path(folder, sequence);
    if path.is_dir() {
        let has_number = |name: &str| name.contains(|letter: char| letter.is_ascii_digit());
        let files = NumberedFiles::read(&path, &POSE_EXTENSIONS, has_number)?;
        let by_number = files.of_frames(&frames.iter().map(|frame| frame.number).collect::<BTreeSet<u32>>());
        let file = |frame: &Pictures| {
            let of_time = frame.moment.and_then(|moment| files.at_time(moment.seconds)).map(Path::to_path_buf);
            let found = of_time.or_else(|| by_number.get(&frame.number).cloned());
            (found.unwrap_or_else(|| path.join(format!("{}.txt", frame.number))), Some(0))
        };
        return Ok(frames.iter().map(file).collect());
    }
    let times: Option<Vec<f64>> = frames.iter().map(|frame| Some(frame.moment?.seconds)).collect();
    let at_times = times.map(|times| rows_at(&path, &times, SAME_MOMENT)).transpose()?.flatten();
    let rows = at_times.unwrap_or_else(|| rows.iter().copied().map(Some).collect());
    Ok(rows.into_iter().map(|row| (path.clone(), row)).collect())
}

fn camera_path(folder: &Path, sequence: &Sequence) -> PathBuf {
    if let Some(file) = &sequence.cameras {
        return folder.join(file);
    }
    let mut candidates = CAMERA_FILES.iter().map(|name| folder.join(name));
    candidates.find(|file| file.is_file()).unwrap_or_else(|| folder.join(CAMERA_FILES[0]))
}

fn intrinsics(subject: &Path, layout: &Layout) -> Result<Option<Intrinsics>> {
    Ok(match &layout.intrinsics {
        None => None,
        Some(Calibration::Numbers(known)) => {
            Some(Intrinsics::new([known.fx, known.fy, known.cx, known.cy], layout.pixel_origin))
        }
        Some(Calibration::File(file)) => Some(Intrinsics::read(&subject.join(file), layout.pixel_origin)?),
    })
}

fn missing(path: PathBuf, what: &str) -> Error {
    Error::Missing { path, what: what.into(), remedy: format!("correct {}, which names it", Layout::FILE).into() }
}

fn malformed(path: &Path, place: &str, found: impl ToString, expected: &str) -> Error {
    Error::Malformed {
        path: path.into(),
        format: FORMAT,
        place: place.into(),
        found: found.to_string(),
        expected: expected.into(),
    }
}
