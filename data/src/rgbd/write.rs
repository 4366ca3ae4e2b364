//! Writing RGB-D frames as a subject's folder, in either layout that is read.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::RgbdFrame;
use super::cameras::PixelOrigin;
use super::depth_write::{DepthFormat, write_depth};
use super::layout::{DepthUnit, Layout, Sequence, Shape};
use super::xhumans::{CAMERAS, COLOUR, DEPTH, picture_name};
use image::{Rgb, RgbImage};

use crate::xhumans::{create_folder, write_common, write_parameters};
use crate::{FrameId, Split};
use crate::{Motion, write_motion};
use xavatar_body::Gender;
use xavatar_formats::{Array, ArrayMap, Error, Result, write_atomically, write_npz, write_picture};
use xavatar_mesh::camera::PinholeCamera;

/// The bodies of a sequence in a plain folder.
const BODIES: &str = "bodies.npz";
/// Its folders of pictures.
const PLAIN_COLOUR: &str = "colour";
const PLAIN_DEPTH: &str = "depth";
const PLAIN_MASK: &str = "mask";

/// How a folder of RGB-D frames is laid out (docs/rgbd.md).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RgbdLayout {
    /// X-Humans' `render` folders: TIFF depth in metres.
    XHumans,
    /// A plain folder with a `rgbd.toml`.
    Plain(DepthFormat),
}

/// What is written when a sequence's frames are known: their cameras and, in a plain folder, bodies.
#[derive(Default)]
struct Written {
    cameras: Vec<PinholeCamera>,
    motion: Motion,
    has_masks: bool,
}

/// Writes a subject's folder: pictures, cameras and registered bodies of each frame. X-Humans' layout has no masks.
///
/// Frames are taken one at a time, so that they need not be in memory together; each goes where its id says. Those of one
/// sequence come in the order of their numbers.
///
/// # Errors
/// [`Error::Value`] if hand poses have a convention that the layout does not know, or a frame's split is neither `train` nor
/// `test`; [`Error::Io`]; the first error that `frames` gives.
pub fn write_rgbd_subject(
    folder: impl AsRef<Path>,
    layout: RgbdLayout,
    gender: Gender,
    betas: &[f32],
    frames: impl IntoIterator<Item = Result<RgbdFrame>>,
) -> Result<()> {
    let folder = folder.as_ref();
    create_folder(folder)?;
    let mut sequences: BTreeMap<(String, String), Written> = BTreeMap::new();
    for frame in frames {
        let frame = frame?;
        let written = sequences.entry((frame.id.split.clone(), frame.id.sequence.clone())).or_default();
        let place = written.cameras.len() as u32 + 1;
        write_frame(folder, layout, &frame, place).map_err(|error| error.in_frame(frame.id.to_string()))?;
        written.has_masks |= frame.mask.is_some();
        written.cameras.push(frame.camera);
        written.motion.frames.push(frame.parameters.smplx()?.clone());
    }
    for ((split, sequence), written) in &sequences {
        let sequence = folder.join(split).join(sequence);
        match layout {
            RgbdLayout::XHumans => write_npz(sequence.join(CAMERAS), &camera_arrays(&written.cameras))?,
            RgbdLayout::Plain(_) => {
                write_npz(sequence.join("cameras.npz"), &camera_arrays(&written.cameras))?;
                write_motion(sequence.join(BODIES), &written.motion)?;
            }
        }
    }
    match layout {
        RgbdLayout::XHumans => write_common(folder, gender, betas),
        RgbdLayout::Plain(format) => write_layout(folder, format, gender, betas, &sequences),
    }
}

/// The pictures of the frame that is number `place` of its sequence, from 1.
fn write_frame(subject: &Path, layout: RgbdLayout, frame: &RgbdFrame, place: u32) -> Result<()> {
    let sequence = subject.join(&frame.id.split).join(&frame.id.sequence);
    let (colour, depth, number, format) = match layout {
        RgbdLayout::XHumans => (COLOUR, DEPTH, place, DepthFormat::Tiff),
        RgbdLayout::Plain(format) => (PLAIN_COLOUR, PLAIN_DEPTH, frame.id.number, format),
    };
    let (colour, depth) = (sequence.join(colour), sequence.join(depth));
    create_folder(&colour)?;
    create_folder(&depth)?;
    write_picture(&colour.join(picture_name("color", number, "png")), &frame.colour)?;
    let size = [frame.camera.width, frame.camera.height];
    write_depth(depth.join(picture_name("depth", number, format.extension())), &frame.depth, size, format)?;
    match layout {
        RgbdLayout::XHumans => write_parameters(&sequence, frame.id.number, &frame.parameters),
        RgbdLayout::Plain(_) => match &frame.mask {
            Some(mask) => write_mask(&sequence.join(PLAIN_MASK), number, mask, size),
            None => Ok(()),
        },
    }
}

fn write_mask(folder: &Path, number: u32, mask: &[bool], [width, height]: [u32; 2]) -> Result<()> {
    create_folder(folder)?;
    let shown = |column: u32, row: u32| {
        let value = if mask[(row * width + column) as usize] { u8::MAX } else { 0 };
        Rgb([value; 3])
    };
    write_picture(&folder.join(picture_name("mask", number, "png")), &RgbImage::from_fn(width, height, shown))
}

/// Removes the pictures of a frame from a plain folder that [`write_rgbd_subject`] wrote, if they are there.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_rgbd_frame(folder: &Path, format: DepthFormat, id: &FrameId) -> Result<()> {
    let sequence = folder.join(&id.split).join(&id.sequence);
    let pictures =
        [(PLAIN_COLOUR, "color", "png"), (PLAIN_DEPTH, "depth", format.extension()), (PLAIN_MASK, "mask", "png")];
    pictures.into_iter().try_for_each(|(inside, kind, extension)| {
        let path = sequence.join(inside).join(picture_name(kind, id.number, extension));
        if path.exists() { std::fs::remove_file(&path).map_err(Error::io(&path)) } else { Ok(()) }
    })
}

/// The arrays of a camera file; picture coordinates start at the corner.
fn camera_arrays(cameras: &[PinholeCamera]) -> ArrayMap {
    let intrinsic = |camera: &PinholeCamera| {
        let PinholeCamera { fx, fy, cx, cy, .. } = *camera;
        [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    };
    let extrinsics = cameras.iter().flat_map(|camera| camera.extrinsic().transpose().to_cols_array()).collect();
    let each: Vec<[f32; 9]> = cameras.iter().map(intrinsic).collect();
    // X-Humans has one for all frames.
    let intrinsics = match each.iter().all(|matrix| *matrix == each[0]) {
        true => Array::from_f32(&[3, 3], each.first().map(|matrix| matrix.to_vec()).unwrap_or_default()),
        false => Array::from_f32(&[each.len(), 3, 3], each.concat()),
    };
    [("intrinsic".into(), intrinsics), ("extrinsic".into(), Array::from_f32(&[cameras.len(), 4, 4], extrinsics))].into()
}

fn write_layout(
    folder: &Path,
    format: DepthFormat,
    gender: Gender,
    betas: &[f32],
    sequences: &BTreeMap<(String, String), Written>,
) -> Result<()> {
    let sequence = |((split, name), written): (&(String, String), &Written)| {
        let split = [Split::Train, Split::Test].into_iter().find(|known| known.name() == split).ok_or_else(|| {
            Error::Value { name: "split".into(), found: split.clone(), expected: "train or test".into() }
        })?;
        Ok(Sequence {
            split,
            folder: PathBuf::from(split.name()).join(name),
            name: None,
            colour: PLAIN_COLOUR.into(),
            depth: PLAIN_DEPTH.into(),
            mask: written.has_masks.then(|| PLAIN_MASK.into()),
            cameras: Some("cameras.npz".into()),
            bodies: BODIES.into(),
        })
    };
    let layout = Layout {
        gender: Some(gender),
        betas: Some(Shape::Numbers(betas.to_vec())),
        depth_unit: DepthUnit::Metres(format.metres_per_unit()),
        pixel_origin: PixelOrigin::Corner,
        intrinsics: None,
        sequences: sequences.iter().map(sequence).collect::<Result<_>>()?,
    };
    let path = folder.join(Layout::FILE);
    let text = toml::to_string(&layout).map_err(|error| Error::io(&path)(std::io::Error::other(error)))?;
    write_atomically(&path, |writer| std::io::Write::write_all(writer, text.as_bytes()))
}
