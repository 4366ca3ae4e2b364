//! A subject filmed by RGB-D cameras, on disk: which frames there are, and reading one.

use std::path::{Path, PathBuf};

use super::cameras::{CameraTable, Intrinsics, PixelOrigin};
use super::depth_file::{DepthPicture, read_depth};
use super::frame::{BACKGROUND, FARTHEST_DEPTH, NO_MEASUREMENT, RgbdFrame};
use super::layout::Layout;
use super::pictures::no_frame_in;
use super::{plain, recordings, xhumans};
use crate::xhumans::parameters_of;
use crate::{Capture, CaptureKind, FrameId, RgbdCapture, Source};
use xavatar_body::{Gender, smplx};
use xavatar_formats::{Choice, Error, Remedy, Result, read_pickle_arrays, read_picture};

/// A mask's pixel shows the subject from this value on.
const MASK_THRESHOLD: u8 = 128;

/// A subject on disk: what is common to its frames, and which frames there are.
#[derive(Clone, Debug)]
pub struct RgbdSubject {
    /// The subject's folder.
    pub folder: PathBuf,
    /// Which body model fits the subject.
    pub gender: Gender,
    /// Shape coefficients beta, common to all frames.
    pub betas: Vec<f32>,
    /// Training frames, by sequence and number.
    pub train: Vec<RgbdFiles>,
    /// Test frames, by sequence and number.
    pub test: Vec<RgbdFiles>,
}

/// A frame that exists on disk but is not read yet.
#[derive(Clone, Debug)]
pub struct RgbdFiles {
    /// Which frame.
    pub id: FrameId,
    /// A PNG or JPEG.
    pub colour: PathBuf,
    /// A 16-bit PNG, a TIFF or an OpenEXR of the same size.
    pub depth: PathBuf,
    /// A PNG of the same size, light where the subject is.
    pub mask: Option<PathBuf>,
    /// The sequence's calibration.
    pub cameras: PathBuf,
    /// Metres in one unit of the depth picture.
    pub metres_per_unit: f32,
    /// None if no pose is of the picture's moment.
    pub(super) camera_row: Option<usize>,
    pub(super) pixel_origin: PixelOrigin,
    pub(super) intrinsics: Option<Intrinsics>,
    /// None of pictures that no body is registered to.
    pub(super) registration: Option<RegistrationFile>,
}

/// Where a frame's parameters are.
#[derive(Clone, Debug)]
pub(super) enum RegistrationFile {
    /// An X-Humans parameter file, which may be missing.
    XHumans(PathBuf),
    /// Read already, with those of the whole sequence.
    Read(Box<smplx::Parameters>),
}

impl RgbdSubject {
    /// The file that says how a plain folder is laid out (docs/rgbd.md).
    pub const LAYOUT_FILE: &str = Layout::FILE;

    /// Finds the frames of the subject in `folder`, without reading pictures: a plain folder with a `rgbd.toml`, or the
    /// X-Humans layout with `render` folders.
    ///
    /// A frame of which one file is there counts, so that [`read`](RgbdFiles::read) can say what it lacks.
    ///
    /// # Errors
    /// [`Error::Missing`] if the folder is in neither layout; [`Error::Mismatch`] for a recording of a sensor, or pictures of a
    /// benchmark, that need a `rgbd.toml`; what is wrong with its `rgbd.toml`, gender or shape.
    pub fn open(folder: impl AsRef<Path>) -> Result<Self> {
        let folder = folder.as_ref();
        recordings::refuse(folder)?;
        let subject =
            if folder.join(Self::LAYOUT_FILE).is_file() { plain::open(folder) } else { xhumans::open(folder) }?;
        if subject.train.is_empty() && subject.test.is_empty() {
            return Err(no_frame_in(folder));
        }
        Ok(subject)
    }

    /// Whether a folder has RGB-D frames in a known layout, or a sensor's recording that [`open`](Self::open) knows by name. Reads
    /// the layout only.
    pub fn is_in(folder: &Path) -> bool {
        folder.join(Self::LAYOUT_FILE).is_file() || xhumans::has_pictures(folder) || recordings::refuse(folder).is_err()
    }

    /// Whether bodies are registered to frames in a folder, be there what else a subject needs or not.
    #[must_use]
    pub fn has_registrations(folder: &Path) -> bool {
        match folder.join(Self::LAYOUT_FILE).is_file() {
            true => plain::has_bodies(folder),
            false => xhumans::has_bodies(folder),
        }
    }

    /// The training frames as a source.
    pub fn training_frames(&self) -> RgbdFrames {
        self.source(&self.train)
    }

    /// The test frames as a source.
    pub fn test_frames(&self) -> RgbdFrames {
        self.source(&self.test)
    }

    fn source(&self, files: &[RgbdFiles]) -> RgbdFrames {
        RgbdFrames {
            ids: files.iter().map(|files| files.id.clone()).collect(),
            files: files.to_vec(),
            betas: self.betas.clone(),
            gender: self.gender,
        }
    }
}

/// Frames of a subject on disk, read when they are asked for.
#[derive(Clone, Debug)]
pub struct RgbdFrames {
    files: Vec<RgbdFiles>,
    ids: Vec<FrameId>,
    betas: Vec<f32>,
    gender: Gender,
}

impl RgbdFrames {
    /// The whole picture of a frame; it passes [`RgbdFrame::check`].
    ///
    /// # Errors
    /// [`Error::Frame`] naming the frame, if a file is missing or broken, sizes differ or no depth is valid.
    pub fn picture(&self, index: usize) -> Result<RgbdFrame> {
        self.files[index].read(&self.betas)
    }
}

impl Source for RgbdFrames {
    fn kind(&self) -> CaptureKind {
        CaptureKind::Rgbd
    }

    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, index: usize) -> Result<Capture> {
        Ok(Capture::Rgbd(Box::new(RgbdCapture::of(self.picture(index)?)?)))
    }

    fn betas(&self) -> &[f32] {
        &self.betas
    }

    fn gender(&self) -> Gender {
        self.gender
    }
}

/// A frame as its files have it: no depth is cut off yet.
pub(super) struct RawFrame {
    /// As stored, in the file's unit.
    pub depth: DepthPicture,
    /// The frame without depths.
    pub frame: RgbdFrame,
}

impl RgbdFiles {
    /// Reads the frame, with the subject's mean shape `betas`; it passes [`RgbdFrame::check`].
    ///
    /// # Errors
    /// [`Error::Frame`] naming the frame and, inside, the file: missing, damaged, of another size than the colour picture,
    /// without a camera, or without any depth of the subject.
    pub fn read(&self, betas: &[f32]) -> Result<RgbdFrame> {
        let read = self.read_raw(betas).and_then(|raw| self.interpret(raw));
        read.map_err(|error| error.in_frame(self.id.to_string()))
    }

    /// Gives the depths their meaning. Errors do not name the frame.
    pub(super) fn interpret(&self, raw: RawFrame) -> Result<RgbdFrame> {
        let depth = raw.depth.values.iter().map(|&value| classified(value * self.metres_per_unit)).collect();
        let frame = RgbdFrame { depth, ..raw.frame };
        if (0..frame.depth.len()).all(|pixel| frame.surface_depth(pixel).is_none()) {
            return Err(self.without_surface(&raw.depth, frame.mask.as_deref()));
        }
        Ok(frame)
    }

    /// Everything but the meaning of the depths, with all sizes agreed. Errors do not name the frame.
    pub(super) fn read_raw(&self, betas: &[f32]) -> Result<RawFrame> {
        must_exist(&self.colour, "the frame's colour picture")?;
        must_exist(&self.depth, "the frame's depth picture")?;
        let colour = read_picture(&self.colour)?.into_rgb8();
        let depth = read_depth(&self.depth)?;
        let size = colour.dimensions();
        self.must_match(&self.depth, (depth.width, depth.height), size)?;
        let mask = self.mask.as_ref().map(|path| {
            must_exist(path, "the frame's mask")?;
            let mask = read_picture(path)?.into_luma8();
            self.must_match(path, mask.dimensions(), size)?;
            Ok::<_, Error>(mask.into_raw().into_iter().map(|value| value >= MASK_THRESHOLD).collect())
        });
        let cameras = CameraTable::read(&self.cameras, self.pixel_origin, self.intrinsics)?;
        let camera_row = self.camera_row.ok_or_else(|| Error::Missing {
            path: self.cameras.clone(),
            what: format!("the pose of {}", self.colour.display()),
            remedy: Remedy::choosing(Choice::SkipBadFrames, "leave the frame out"),
        })?;
        let frame = RgbdFrame {
            id: self.id.clone(),
            camera: cameras.camera(camera_row, size.into())?,
            colour,
            depth: Vec::new(),
            mask: mask.transpose()?,
            parameters: smplx::Parameters { betas: betas.to_vec(), ..self.parameters()? }.into(),
        };
        Ok(RawFrame { depth, frame })
    }

    fn parameters(&self) -> Result<smplx::Parameters> {
        match &self.registration {
            None => Ok(smplx::Parameters::default()),
            Some(RegistrationFile::Read(parameters)) => Ok(smplx::Parameters::clone(parameters)),
            Some(RegistrationFile::XHumans(path)) => {
                must_exist(path, "the frame's registration")?;
                parameters_of(path, &read_pickle_arrays(path)?)
            }
        }
    }

    fn must_match(&self, path: &Path, found: (u32, u32), colour: (u32, u32)) -> Result<()> {
        if found == colour {
            return Ok(());
        }
        Err(Error::Mismatch {
            path: path.into(),
            found: format!("{} x {} pixels", found.0, found.1),
            expected: format!("{} x {} as {}", colour.0, colour.1, self.colour.display()),
            remedy: "align colour, depth and mask to one camera".into(),
        })
    }

    /// Why no pixel of the picture can be used.
    fn without_surface(&self, depth: &DepthPicture, mask: Option<&[bool]>) -> Error {
        let shown = |(pixel, value): (usize, &f32)| {
            let metres = value * self.metres_per_unit;
            (metres > 0.0 && metres.is_finite() && mask.is_none_or(|mask| mask[pixel])).then_some(metres)
        };
        let range =
            depth.values.iter().enumerate().filter_map(shown).fold(None, |range: Option<(f32, f32)>, metres| {
                Some(range.map_or((metres, metres), |(low, high)| (low.min(metres), high.max(metres))))
            });
        let (found, remedy) = match range {
            Some((low, high)) => (
                format!(
                    "no depth within {FARTHEST_DEPTH} m: with {} m a unit they are {low} to {high} m",
                    self.metres_per_unit
                ),
                "declare the picture's unit",
            ),
            None => ("no valid depth at any pixel that shows the subject".into(), "leave the frame out"),
        };
        Error::Mismatch {
            path: self.depth.clone(),
            found,
            expected: "the subject's depth".into(),
            remedy: remedy.into(),
        }
    }
}

/// A measured depth, metres, by the conventions of [`RgbdFrame::depth`].
fn classified(metres: f32) -> f32 {
    if metres > FARTHEST_DEPTH {
        BACKGROUND
    } else if metres > 0.0 {
        metres
    } else {
        NO_MEASUREMENT
    }
}

fn must_exist(path: &Path, what: &str) -> Result<()> {
    if path.exists() {
        return Ok(());
    }
    Err(Error::Missing {
        path: path.into(),
        what: what.into(),
        remedy: Remedy::choosing(Choice::SkipBadFrames, "complete the data set, or leave the frame out"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_a_depth_is_no_measurement_and_what_is_far_is_background() {
        for nothing in [0.0, -0.0, -1.0, f32::NAN, f32::NEG_INFINITY] {
            assert_eq!(classified(nothing), NO_MEASUREMENT, "{nothing}");
        }
        for far in [10.001, 1000.0, f32::INFINITY] {
            assert_eq!(classified(far), BACKGROUND, "{far}");
        }
        for near in [1e-3, 5.5, FARTHEST_DEPTH] {
            assert_eq!(classified(near), near);
        }
    }
}
