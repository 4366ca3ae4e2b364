//! What was captured at one moment: a scan, or a picture of an RGB-D camera with the points that it shows.

use crate::body::{BodyModel, BodyParameters, Gender};
use crate::config::Config;
use crate::data::{FrameId, FrameSource, PointCloud, RgbdFrame, RgbdSource, ScanFrame};
use crate::mesh::Note;
use crate::{Error, InputError, Result};

/// Room around the subject that is kept of a picture, metres at the subject's distance.
const MARGIN: f32 = 0.2;

/// The frames that a run learns from, read on demand.
#[derive(Clone, Copy)]
pub enum TrainingFrames<'s> {
    /// Scans; for a configuration without `rgbd`.
    Scans(&'s dyn FrameSource),
    /// Pictures of an RGB-D camera; for a configuration with `rgbd`.
    Rgbd(&'s dyn RgbdSource),
}

impl TrainingFrames<'_> {
    pub(super) fn ids(&self) -> &[FrameId] {
        match self {
            Self::Scans(source) => source.ids(),
            Self::Rgbd(source) => source.ids(),
        }
    }

    pub(super) fn betas(&self) -> &[f32] {
        match self {
            Self::Scans(source) => source.betas(),
            Self::Rgbd(source) => source.betas(),
        }
    }

    pub(super) fn gender(&self) -> Gender {
        match self {
            Self::Scans(source) => source.gender(),
            Self::Rgbd(source) => source.gender(),
        }
    }

    pub(super) fn read(&self, index: usize) -> Result<CapturedFrame> {
        Ok(match self {
            Self::Scans(source) => CapturedFrame::Scan(Box::new(source.read(index)?)),
            Self::Rgbd(source) => CapturedFrame::Rgbd(Box::new(RgbdCapture::of(source.read(index)?)?)),
        })
    }

    /// Refuses a configuration that is for the other kind of frames.
    pub(super) fn check(&self, config: &Config) -> Result<()> {
        let (found, expected) = match (self, &config.rgbd) {
            (Self::Scans(_), None) | (Self::Rgbd(_), Some(_)) => return Ok(()),
            (Self::Scans(_), Some(_)) => ("RGB-D frames", "one for scans: fast, demo or paper-scan"),
            (Self::Rgbd(_), None) => ("scans", "one for RGB-D frames: fast-rgbd, demo-rgbd or paper-rgbd"),
        };
        Err(Error::from(InputError::Value {
            name: "preset".into(),
            found: format!("`{}`, which is for {found}", config.preset),
            expected: expected.into(),
        }))
    }
}

/// A frame as it was captured.
#[derive(Clone)]
pub(super) enum CapturedFrame {
    Scan(Box<ScanFrame>),
    Rgbd(Box<RgbdCapture>),
}

impl CapturedFrame {
    pub fn id(&self) -> &FrameId {
        match self {
            Self::Scan(frame) => &frame.id,
            Self::Rgbd(capture) => &capture.frame.id,
        }
    }

    /// What reading the frame's files lost.
    pub fn notes(&self) -> &[Note] {
        match self {
            Self::Scan(frame) => &frame.notes,
            Self::Rgbd(_) => &[],
        }
    }

    pub fn parameters(&self) -> &BodyParameters {
        match self {
            Self::Scan(frame) => &frame.parameters,
            Self::Rgbd(capture) => &capture.frame.parameters,
        }
    }

    /// The frame with the pose that its parameters mean on `body`.
    pub fn resolved(mut self, body: &BodyModel) -> Result<Self> {
        let pose = body.resolve(self.parameters())?;
        match &mut self {
            Self::Scan(frame) => frame.parameters = pose.into(),
            Self::Rgbd(capture) => capture.frame.parameters = pose.into(),
        }
        Ok(self)
    }
}

/// The part of a picture around the subject, and its points.
#[derive(Clone, Debug)]
pub(super) struct RgbdCapture {
    pub frame: RgbdFrame,
    /// Its `pixels` are those of `frame`.
    pub cloud: PointCloud,
}

impl RgbdCapture {
    /// Finds the points of a picture, and cuts away what is far from them.
    pub fn of(frame: RgbdFrame) -> Result<Self> {
        let cloud = PointCloud::of(&frame)?;
        Ok(Self::cropped(frame, cloud))
    }

    fn cropped(frame: RgbdFrame, mut cloud: PointCloud) -> Self {
        let camera = frame.camera;
        let place = |pixel: u32| [pixel % camera.width, pixel / camera.width];
        let nearest = cloud.pixels.iter().map(|pixel| frame.depth[*pixel as usize]).fold(f32::INFINITY, f32::min);
        let margin = [camera.fx, camera.fy].map(|focal_length| (MARGIN * focal_length / nearest).ceil() as u32);
        let (mut low, mut high) = ([camera.width, camera.height], [0, 0]);
        for axis in 0..2 {
            let along = cloud.pixels.iter().map(|pixel| place(*pixel)[axis]);
            let (first, last) = along.fold((low[axis], 0), |(first, last), at| (first.min(at), last.max(at + 1)));
            low[axis] = first.saturating_sub(margin[axis]);
            high[axis] = last.saturating_add(margin[axis]).min([camera.width, camera.height][axis]);
        }
        let [width, height] = [high[0] - low[0], high[1] - low[1]];
        let kept = |row: u32| {
            let first = ((row + low[1]) * camera.width + low[0]) as usize;
            first..first + width as usize
        };
        cloud.pixels.iter_mut().for_each(|pixel| {
            let [column, row] = place(*pixel);
            *pixel = (row - low[1]) * width + column - low[0];
        });
        let cropped = RgbdFrame {
            depth: (0..height).flat_map(|row| frame.depth[kept(row)].iter().copied()).collect(),
            mask: frame.mask.map(|mask| (0..height).flat_map(|row| mask[kept(row)].to_vec()).collect()),
            colour: image::imageops::crop_imm(&frame.colour, low[0], low[1], width, height).to_image(),
            camera: crate::mesh::camera::PinholeCamera {
                width,
                height,
                cx: camera.cx - low[0] as f32,
                cy: camera.cy - low[1] as f32,
                ..camera
            },
            id: frame.id,
            parameters: frame.parameters,
        };
        Self { frame: cropped, cloud }
    }
}
