//! One-line labels in a fixed-width face, drawn over pictures.

use image::RgbImage;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

/// How large letters are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Size {
    /// Of scales and legends.
    Small,
    /// Of titles and labels.
    Large,
}

impl Size {
    fn raster(self) -> RasterHeight {
        match self {
            Self::Small => RasterHeight::Size16,
            Self::Large => RasterHeight::Size20,
        }
    }

    /// Of a line, pixels.
    pub fn height(self) -> u32 {
        self.raster().val() as u32
    }

    /// From one letter to the next, pixels.
    pub fn advance(self) -> u32 {
        get_raster_width(FontWeight::Regular, self.raster()) as u32
    }

    /// Of a line of text, pixels.
    pub fn width(self, text: &str) -> u32 {
        text.chars().count() as u32 * self.advance()
    }
}

/// Draws `text` with its box's upper left corner at (`left`, `top`); what is out of the picture is cut, and characters beyond
/// ASCII show as `?`.
pub(super) fn draw_text(picture: &mut RgbImage, text: &str, [left, top]: [i64; 2], size: Size, ink: [u8; 3]) {
    for (index, character) in text.chars().enumerate() {
        let raster = |character| get_raster(character, FontWeight::Regular, size.raster());
        let Some(glyph) = raster(character).or_else(|| raster('?')) else { continue };
        for (y, row) in (top..).zip(glyph.rows()) {
            for (x, intensity) in (left + index as i64 * i64::from(size.advance())..).zip(row) {
                blend(picture, [x, y], ink, f32::from(*intensity) / 255.0);
            }
        }
    }
}

/// Lays `ink` over a pixel, if it is in the picture; `share` is from 0 to 1.
pub(super) fn blend(picture: &mut RgbImage, [x, y]: [i64; 2], ink: [u8; 3], share: f32) {
    let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { return };
    let Some(pixel) = picture.get_pixel_mut_checked(x, y) else { return };
    for (channel, ink) in pixel.0.iter_mut().zip(ink) {
        *channel = (f32::from(*channel) + (f32::from(ink) - f32::from(*channel)) * share).round() as u8;
    }
}
