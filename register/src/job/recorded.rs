//! What bodies are registered to: scans, or the pictures of one depth camera.

use std::path::Path;

use glam::Vec3;
use xavatar_body::Gender;
use xavatar_data::{
    CaptureKind, FrameFiles, FrameId, RgbdCapture, RgbdFiles, RgbdFrame, RgbdPictures, RgbdSubject, Scans, Split,
    Subject,
};
use xavatar_formats::{Error, Result};
use xavatar_mesh::{Note, ReadMesh};

use super::coordinates::{FileCoordinates, MEASURED, SIZES, Up};
use crate::target::ScanTarget;

/// One person's frames, before bodies are registered to them.
#[derive(Clone, Debug)]
pub enum Recordings {
    /// Scans.
    Scans(Scans),
    /// Pictures of a depth camera.
    Rgbd(RgbdPictures),
}

/// A frame of [`Recordings`].
#[derive(Clone, Copy)]
pub enum Recording<'a> {
    /// A scan.
    Scan(&'a FrameFiles),
    /// A colour and a depth picture.
    Rgbd(&'a RgbdFiles),
}

impl Recordings {
    /// The frames of one kind in a folder where no body is registered to any of them; none where bodies are, or where there is no scan.
    ///
    /// # Errors
    /// Those of [`RgbdPictures::open`].
    pub fn without_bodies(folder: &Path, kind: CaptureKind) -> Result<Option<Self>> {
        match kind {
            CaptureKind::Scans if Subject::has_registrations(folder) => Ok(None),
            // What is wrong with data that are no scans either is for the one who opens them to say.
            CaptureKind::Scans => Ok(Scans::open(folder, &[]).ok().map(Self::Scans)),
            CaptureKind::Rgbd if RgbdSubject::has_registrations(folder) => Ok(None),
            CaptureKind::Rgbd => Ok(Some(Self::Rgbd(RgbdPictures::open(folder)?))),
        }
    }

    /// Their folder.
    pub fn folder(&self) -> &Path {
        match self {
            Self::Scans(scans) => &scans.folder,
            Self::Rgbd(pictures) => &pictures.folder,
        }
    }

    /// Which body model fits the person, if the folder says so.
    pub fn gender(&self) -> Option<Gender> {
        match self {
            Self::Scans(scans) => scans.gender,
            Self::Rgbd(pictures) => pictures.gender,
        }
    }

    /// All frames, those for training first.
    pub fn frames(&self) -> Vec<Recording<'_>> {
        let of_split = |split: Split| -> Vec<Recording<'_>> {
            match self {
                Self::Scans(scans) => scans.files(split).iter().map(Recording::Scan).collect(),
                Self::Rgbd(pictures) => pictures.files(split).iter().map(Recording::Rgbd).collect(),
            }
        };
        [Split::Train, Split::Test].into_iter().flat_map(of_split).collect()
    }

    /// What the numbers in its files mean; a depth camera's reader has metres already.
    ///
    /// # Errors
    /// As [`FileCoordinates::of_scans`]; [`Error::Unfit`] for pictures of something larger or smaller than a person.
    pub fn coordinates(&self, up: Up) -> Result<FileCoordinates> {
        let pictures = match self {
            Self::Scans(scans) => {
                let files: Vec<&FrameFiles> =
                    [Split::Train, Split::Test].into_iter().flat_map(|split| scans.files(split)).collect();
                return FileCoordinates::of_scans(&files, up);
            }
            Self::Rgbd(pictures) => [Split::Train, Split::Test].map(|split| pictures.files(split)).concat(),
        };
        let stride = pictures.len().div_ceil(MEASURED).max(1);
        let mut sizes = Vec::new();
        for files in pictures.iter().step_by(stride) {
            let points = RgbdCapture::of(files.read(&[])?)?.cloud.points;
            let fold = |of: fn(Vec3, Vec3) -> Vec3| points.iter().copied().reduce(of).unwrap_or_default();
            sizes.push(f64::from((fold(Vec3::max) - fold(Vec3::min)).max_element()));
        }
        sizes.sort_by(f64::total_cmp);
        let size = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
        if SIZES.contains(&size) {
            return Ok(FileCoordinates { scale: 1.0, up });
        }
        Err(Error::Unfit {
            message: format!("what the depth pictures show is {size:.3} m tall or wide: no person alone"),
            remedy: "declare depth_unit, and give masks of the person where other things are seen (docs/rgbd.md)"
                .into(),
        })
    }
}

impl Recording<'_> {
    /// Which frame.
    pub fn id(&self) -> &FrameId {
        match self {
            Self::Scan(files) => &files.id,
            Self::Rgbd(files) => &files.id,
        }
    }

    /// What a body is fitted to, metres, Y up, and what was noted as it was read.
    ///
    /// # Errors
    /// [`Error::Frame`] for a file that is missing, broken, or shows no surface.
    pub fn target(&self, coordinates: FileCoordinates) -> Result<(ScanTarget, Vec<Note>)> {
        let target = match self {
            Self::Scan(files) => {
                let ReadMesh { mesh, notes } = scan(files, coordinates)?;
                ScanTarget::of(&mesh).map(|target| (target, notes))
            }
            Self::Rgbd(files) => picture(files, coordinates)
                .and_then(RgbdCapture::of)
                .and_then(|capture| Ok((ScanTarget::seen(&capture)?, Vec::new()))),
        };
        target.map_err(|error| error.in_frame(self.id().to_string()))
    }
}

/// A scan of the person alone, metres, Y up.
pub fn scan(files: &FrameFiles, coordinates: FileCoordinates) -> Result<ReadMesh> {
    let mut scan = files.read_scan()?;
    coordinates.apply(&mut scan.mesh);
    Ok(scan)
}

/// A camera's pictures, in a world that is Y up.
pub fn picture(files: &RgbdFiles, coordinates: FileCoordinates) -> Result<RgbdFrame> {
    let mut frame = files.read(&[])?;
    frame.camera.rotation *= coordinates.turn().transpose().as_mat3();
    Ok(frame)
}
