//! A plain folder of RGB-D pictures: what its `rgbd.toml` says (docs/rgbd.md).
//!
//! Pictures of one frame have the same number at the end of their names: `color_0007.jpg`, `depth0007.exr`, `7.png`. The rows of
//! camera files and motions follow the frames of a sequence in the order of these numbers.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::RgbdSubject;
use super::cameras::Intrinsics;
use super::layout::{Layout, Sequence, Shape, Split};
use super::subject::{RegistrationFile, RgbdFiles};
use crate::xhumans::{file_names, mean_shape};
use crate::{FrameId, read_motion};
use xavatar_formats::{Error, Result, excerpt};

const FORMAT: &str = "RGB-D folder";
/// Looked for in this order where `cameras` is not given.
const CAMERA_FILES: [&str; 3] = ["cameras.npz", "cameras.toml", "cameras.json"];

pub(super) fn open(folder: &Path) -> Result<RgbdSubject> {
    let layout = Layout::read(folder)?;
    let betas = match &layout.betas {
        Shape::Numbers(betas) => *betas,
        Shape::File(file) => mean_shape(&folder.join(file))?,
    };
    let mut subject =
        RgbdSubject { folder: folder.into(), gender: layout.gender, betas, train: Vec::new(), test: Vec::new() };
    for sequence in &layout.sequences {
        let frames = frames_of_sequence(folder, &layout, sequence)?;
        match sequence.split {
            Split::Train => subject.train.extend(frames),
            Split::Test => subject.test.extend(frames),
        }
    }
    for frames in [&mut subject.train, &mut subject.test] {
        frames.sort_by(|one, other| one.id.cmp(&other.id));
        if let Some(pair) = frames.windows(2).find(|pair| pair[0].id == pair[1].id) {
            let path = folder.join(Layout::FILE);
            return Err(malformed(&path, "`name`", format!("{} twice", pair[0].id), "another name for each sequence"));
        }
    }
    Ok(subject)
}

fn frames_of_sequence(subject: &Path, layout: &Layout, sequence: &Sequence) -> Result<Vec<RgbdFiles>> {
    let folder = subject.join(&sequence.folder);
    let pictures = |name: &Path| {
        let folder = folder.join(name);
        if folder.is_dir() { numbered_pictures(&folder) } else { Err(missing(folder, "a folder of pictures")) }
    };
    let (colour, depth) = (pictures(&sequence.colour)?, pictures(&sequence.depth)?);
    let masks = sequence.mask.as_deref().map(pictures).transpose()?;
    let cameras = match &sequence.cameras {
        Some(file) => folder.join(file),
        None => {
            let mut candidates = CAMERA_FILES.iter().map(|name| folder.join(name));
            candidates.find(|file| file.is_file()).unwrap_or_else(|| folder.join(CAMERA_FILES[0]))
        }
    };
    let numbers: BTreeSet<u32> = colour.keys().chain(depth.keys()).copied().collect();
    let motion = read_motion(folder.join(&sequence.bodies))?;
    if motion.frames.len() != numbers.len() {
        return Err(Error::Mismatch {
            path: folder.join(&sequence.bodies),
            found: format!("{} registered bodies", motion.frames.len()),
            expected: format!("one for each of the {} frames in {}", numbers.len(), folder.display()),
            remedy: "register every frame, or remove the pictures of the others".into(),
        });
    }
    let name = sequence.name.clone().or_else(|| Some(sequence.folder.file_name()?.to_string_lossy().into_owned()));
    let intrinsics = layout
        .intrinsics
        .as_ref()
        .map(|known| Intrinsics::new([known.fx, known.fy, known.cx, known.cy], layout.pixel_origin));
    let frame = |((row, number), parameters): ((usize, u32), _)| {
        let file = |files: &BTreeMap<u32, PathBuf>, folder_name: &Path| {
            files.get(&number).cloned().unwrap_or_else(|| folder.join(folder_name).join(number.to_string()))
        };
        RgbdFiles {
            id: FrameId { split: sequence.split.name().into(), sequence: name.clone().unwrap_or_default(), number },
            colour: file(&colour, &sequence.colour),
            depth: file(&depth, &sequence.depth),
            mask: masks.as_ref().zip(sequence.mask.as_ref()).map(|(masks, folder)| file(masks, folder)),
            cameras: cameras.clone(),
            metres_per_unit: layout.metres_per_unit(),
            camera_row: row,
            pixel_origin: layout.pixel_origin,
            intrinsics,
            registration: RegistrationFile::Read(Box::new(parameters)),
        }
    };
    Ok(numbers.into_iter().enumerate().zip(motion.frames).map(frame).collect())
}

/// The pictures of a folder by the number at the end of their names; other files are left out.
fn numbered_pictures(folder: &Path) -> Result<BTreeMap<u32, PathBuf>> {
    let mut pictures = BTreeMap::new();
    for name in file_names(folder)? {
        let path = folder.join(&name);
        let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
        if !matches!(extension.as_deref(), Some("png" | "jpg" | "jpeg" | "tif" | "tiff" | "exr")) {
            continue;
        }
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        let digits = &stem[stem.trim_end_matches(|letter: char| letter.is_ascii_digit()).len()..];
        let Ok(number) = digits.parse() else {
            return Err(malformed(&path, "the name", excerpt(stem), "the frame's number at its end"));
        };
        if let Some(other) = pictures.insert(number, path.clone()) {
            return Err(Error::Mismatch {
                path,
                found: format!("frame {number} again"),
                expected: format!("one picture a frame, which is {}", other.display()),
                remedy: "keep colour, depth and masks in folders of their own".into(),
            });
        }
    }
    Ok(pictures)
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
