//! One picture of an RGB-D camera, with the body registered to it.

use image::RgbImage;

use crate::FrameId;
use xavatar_body::BodyParameters;
use xavatar_formats::{Error, Result};
use xavatar_mesh::camera::PinholeCamera;

/// What is farther from the camera is background, metres (thesis 4.4).
pub const FARTHEST_DEPTH: f32 = 10.0;

/// Depth of a pixel that measured nothing, so that neither a surface nor free space is known along its ray.
pub const NO_MEASUREMENT: f32 = 0.0;

/// Depth of a pixel whose ray meets nothing before [`FARTHEST_DEPTH`].
pub const BACKGROUND: f32 = f32::INFINITY;

/// An aligned pair of colour and depth pictures.
///
/// Images are row by row from the top left, `camera.height` x `camera.width`, all of the one camera.
#[derive(Clone, Debug)]
pub struct RgbdFrame {
    /// Which frame.
    pub id: FrameId,
    /// The camera of both pictures, in the world of `parameters`.
    pub camera: PinholeCamera,
    /// sRGB.
    pub colour: RgbImage,
    /// z in camera space (not the length of the ray), metres: [`NO_MEASUREMENT`], [`BACKGROUND`], or above 0 and up to
    /// [`FARTHEST_DEPTH`]. Never negative, never NaN.
    pub depth: Vec<f32>,
    /// Which pixels show the subject; without a mask, all that have a depth.
    pub mask: Option<Vec<bool>>,
    /// The registered body; its shape is the subject's mean shape.
    pub parameters: BodyParameters,
}

impl RgbdFrame {
    /// The depth of the subject's surface at a pixel, if the pixel shows it, metres.
    pub fn surface_depth(&self, pixel: usize) -> Option<f32> {
        let shows_subject = self.mask.as_ref().is_none_or(|mask| mask[pixel]);
        let depth = self.depth[pixel];
        (shows_subject && depth > NO_MEASUREMENT && depth.is_finite()).then_some(depth)
    }

    /// The depth up to which the ray through a pixel's centre is known to be empty, metres: that of the first surface,
    /// the subject's or another; infinite for background. `None` if nothing was measured.
    pub fn free_until(&self, pixel: usize) -> Option<f32> {
        Some(self.depth[pixel]).filter(|&depth| depth > NO_MEASUREMENT)
    }

    /// Checks what every algorithm here relies on: a possible camera, pictures of its size, depths as documented, and at
    /// least one pixel that shows the subject.
    ///
    /// # Errors
    /// [`Error::Frame`] naming the frame, around an [`Error::Value`].
    pub fn check(&self) -> Result<()> {
        self.check_parts().map_err(|error| error.in_frame(self.id.to_string()))
    }

    fn check_parts(&self) -> Result<()> {
        self.camera.check()?;
        let (width, height) = (self.camera.width, self.camera.height);
        let wrong = |name: &str, found: String, expected: String| Error::Value { name: name.into(), found, expected };
        if self.colour.dimensions() != (width, height) {
            let found = format!("{} x {} pixels", self.colour.width(), self.colour.height());
            return Err(wrong("colour picture", found, format!("the camera's {width} x {height}")));
        }
        let pixels = width as usize * height as usize;
        for (name, length) in [("depth", Some(self.depth.len())), ("mask", self.mask.as_ref().map(Vec::len))] {
            if let Some(length) = length.filter(|length| *length != pixels) {
                return Err(wrong(name, format!("{length} pixels"), format!("the camera's {width} x {height}")));
            }
        }
        let possible = |depth: &f32| *depth == BACKGROUND || (NO_MEASUREMENT..=FARTHEST_DEPTH).contains(depth);
        if let Some(place) = self.depth.iter().position(|depth| !possible(depth)) {
            let (column, row) = (place % width as usize, place / width as usize);
            let expected = format!("0 (no measurement), up to {FARTHEST_DEPTH}, or infinity (background)");
            return Err(wrong(&format!("depth at ({column}, {row})"), format!("{} m", self.depth[place]), expected));
        }
        if (0..pixels).all(|pixel| self.surface_depth(pixel).is_none()) {
            let measured = self.depth.iter().filter(|depth| **depth > NO_MEASUREMENT).count();
            let found = format!("no pixel of the subject ({measured} of {pixels} pixels have a depth)");
            return Err(wrong("depth picture", found, "a subject within 10 m, in the unit that is declared".into()));
        }
        Ok(())
    }
}
