//! Pictures of an RGB-D camera, reduced to what is around the subject, with the points that they show.

use xavatar_formats::Result;
use xavatar_mesh::camera::PinholeCamera;

use crate::{PointCloud, RgbdFrame};

/// Room around the subject that is kept of a picture, metres at the subject's distance.
const MARGIN: f32 = 0.2;

/// The part of a picture around the subject, and its points.
#[derive(Clone, Debug)]
pub struct RgbdCapture {
    /// The picture.
    pub frame: RgbdFrame,
    /// Its points; their `pixels` are those of `frame`.
    pub cloud: PointCloud,
}

impl RgbdCapture {
    /// Finds the points of a picture, and cuts away what is far from them.
    ///
    /// # Errors
    /// As [`PointCloud::of`].
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
            camera: PinholeCamera {
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
