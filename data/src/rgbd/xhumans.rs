//! The RGB-D frames of the X-Humans layout: the scans, rendered by a virtual camera.
//!
//! ```text
//! <subject>/{train,test}/<sequence>/SMPLX/mesh-fXXXXX_smplx.pkl
//!                                   render/image/color_XXXXXX.png, render/depth/depth_XXXXXX.tiff, render/cameras.npz
//! ```
//! Pictures count from 1 in the order of the scans, whatever their numbers: of n matrices in `cameras.npz` and n parameter
//! files, picture k belongs to the k-th file; if there are not as many, one of them was removed, and numbers are taken as they
//! are. Depth is z in metres with the far plane, 1000, as background. Picture coordinates start at the corner.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::RgbdSubject;
use super::cameras::{CameraTable, PixelOrigin};
use super::subject::{RegistrationFile, RgbdFiles};
use crate::FrameId;
use crate::xhumans::{Common, numbered_files, parameter_files, parameters_path, sequences_of};
use xavatar_formats::Result;

const PICTURES: &str = "render";
pub(super) const COLOUR: &str = "render/image";
pub(super) const DEPTH: &str = "render/depth";
pub(super) const CAMERAS: &str = "render/cameras.npz";

/// Whether a sequence of the subject has rendered pictures.
pub(super) fn has_pictures(folder: &Path) -> bool {
    let rendered = |split: &str| {
        let sequences = sequences_of(folder, split).unwrap_or_default();
        sequences.iter().any(|(_, sequence)| sequence.join(PICTURES).is_dir())
    };
    rendered("train") || rendered("test")
}

/// Whether a sequence with rendered pictures has parameter files.
pub(super) fn has_bodies(folder: &Path) -> bool {
    let registered = |split: &str| {
        let has_bodies = |sequence: &Path| parameter_files(sequence).is_ok_and(|files| !files.is_empty());
        let sequences = sequences_of(folder, split).unwrap_or_default();
        sequences.iter().any(|(_, sequence)| sequence.join(PICTURES).is_dir() && has_bodies(sequence))
    };
    registered("train") || registered("test")
}

pub(super) fn open(folder: &Path) -> Result<RgbdSubject> {
    let Common { gender, betas } = Common::read(folder)?;
    let [train, test] = frames(folder)?;
    Ok(RgbdSubject { folder: folder.into(), gender, betas, train, test })
}

/// The frames for training and for tests.
pub(super) fn frames(folder: &Path) -> Result<[Vec<RgbdFiles>; 2]> {
    let of_split = |split: &str| {
        let mut frames = Vec::new();
        for (name, sequence) in sequences_of(folder, split)? {
            if sequence.join(PICTURES).is_dir() {
                frames.extend(frames_of_sequence(&sequence, split, &name)?);
            }
        }
        Ok::<_, xavatar_formats::Error>(frames)
    };
    Ok([of_split("train")?, of_split("test")?])
}

fn frames_of_sequence(sequence: &Path, split: &str, name: &str) -> Result<Vec<RgbdFiles>> {
    let colour = numbered_files(&sequence.join(COLOUR), "color_", ".png")?;
    let depth = numbered_files(&sequence.join(DEPTH), "depth_", ".tiff")?;
    let parameters = parameter_files(sequence)?;
    let cameras = sequence.join(CAMERAS);
    let pictures: BTreeSet<u32> = colour.keys().chain(depth.keys()).copied().collect();
    // A table that cannot be read is the frames' error, not that of opening the subject.
    let count = CameraTable::read(&cameras, PixelOrigin::Corner, None).map_or(0, |table| table.poses());
    let in_order: BTreeMap<u32, u32> = match parameters.len() == count {
        true => (1..).zip(parameters.keys().copied()).collect(),
        false => BTreeMap::new(),
    };
    let frame = |picture: u32| {
        let number = in_order.get(&picture).copied().unwrap_or(picture);
        let file = |files: &BTreeMap<u32, std::path::PathBuf>, folder: &str, name: String| {
            files.get(&picture).cloned().unwrap_or_else(|| sequence.join(folder).join(name))
        };
        RgbdFiles {
            id: FrameId { split: split.into(), sequence: name.into(), number },
            colour: file(&colour, COLOUR, picture_name("color", picture, "png")),
            depth: file(&depth, DEPTH, picture_name("depth", picture, "tiff")),
            mask: None,
            cameras: cameras.clone(),
            metres_per_unit: 1.0,
            camera_row: (picture as usize).checked_sub(1),
            pixel_origin: PixelOrigin::Corner,
            intrinsics: None,
            registration: Some(RegistrationFile::XHumans(
                parameters.get(&number).cloned().unwrap_or_else(|| parameters_path(sequence, number)),
            )),
        }
    };
    Ok(pictures.into_iter().map(frame).collect())
}

/// `color_000001.png` of picture 1.
pub(super) fn picture_name(kind: &str, picture: u32, extension: &str) -> String {
    format!("{kind}_{picture:06}.{extension}")
}
