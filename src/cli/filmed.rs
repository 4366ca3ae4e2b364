//! The built-in subject as an RGB-D camera films it that goes around it.

use std::f32::consts::TAU;

use anyhow::Context;
use glam::Vec3;
use rayon::prelude::*;
use xavatar::body::Gender;
use xavatar::camera::PinholeCamera;
use xavatar::data::{FrameId, FrameSource, RgbdFrame, RgbdSource, ScanFrame};
use xavatar::mannequin::FilmedTake;
use xavatar::render::render_rgbd;

/// The camera's distance from the subject's middle, metres (thesis A.2.2).
const DISTANCE: f32 = 6.0;
/// Its vertical field of view, radians: 30 degrees (thesis A.2.2).
const FIELD_OF_VIEW: f32 = TAU / 12.0;
/// Height of the subject's middle, metres.
const MIDDLE: f32 = 0.9;

/// A take as an RGB-D camera sees it that goes around the subject once: one picture a frame.
pub struct FilmedInDepth {
    pub frames: Vec<RgbdFrame>,
    ids: Vec<FrameId>,
    betas: [f32; 10],
}

impl FilmedInDepth {
    /// Pictures of `size` columns and rows.
    pub fn new(take: &FilmedTake, size: [u32; 2]) -> anyhow::Result<Self> {
        let picture = |(index, scan): (usize, &ScanFrame)| -> xavatar::Result<RgbdFrame> {
            let azimuth = TAU * index as f32 / take.frames().len() as f32;
            let middle = scan.parameters.transl.with_y(MIDDLE);
            let position = middle + DISTANCE * Vec3::new(azimuth.sin(), 0.0, azimuth.cos());
            let camera = PinholeCamera::looking_at(position, middle, FIELD_OF_VIEW, size)?;
            let image = render_rgbd(&scan.scan, &camera)?;
            Ok(RgbdFrame {
                id: scan.id.clone(),
                camera,
                colour: image.colour,
                depth: image.depth,
                mask: None,
                parameters: scan.parameters.clone(),
            })
        };
        let frames: xavatar::Result<Vec<_>> = take.frames().par_iter().enumerate().map(picture).collect();
        let frames = frames.context("filming the built-in subject in depth")?;
        Ok(Self { frames, ids: FrameSource::ids(take).to_vec(), betas: take.betas() })
    }
}

impl RgbdSource for FilmedInDepth {
    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, index: usize) -> xavatar::Result<RgbdFrame> {
        Ok(self.frames[index].clone())
    }

    fn betas(&self) -> [f32; 10] {
        self.betas
    }

    fn gender(&self) -> Gender {
        Gender::Neutral
    }
}
