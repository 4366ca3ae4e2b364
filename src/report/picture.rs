//! Pictures inside the page: PNG as data URIs, no larger than they are shown.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, RgbImage, imageops};

use crate::{Error, InputError, Result};

/// The picture as a data URI, scaled down to at most `width` columns.
///
/// # Errors
/// [`InputError::Value`] if it has no pixels.
pub(super) fn data_uri(picture: &RgbImage, width: u32) -> Result<String> {
    let scaled;
    let picture = if picture.width() > width {
        let height = (u64::from(picture.height()) * u64::from(width) / u64::from(picture.width())).max(1);
        scaled = imageops::resize(picture, width, height as u32, imageops::FilterType::CatmullRom);
        &scaled
    } else {
        picture
    };
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive)
        .write_image(picture.as_raw(), picture.width(), picture.height(), ExtendedColorType::Rgb8)
        .map_err(|error| {
            Error::from(InputError::Value {
                name: "a picture of the report".into(),
                found: error.to_string(),
                expected: "a picture with pixels".into(),
            })
        })?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_scaled_down_but_never_up() {
        let size = |picture: &RgbImage| {
            let uri = data_uri(picture, 40).unwrap();
            let bytes = STANDARD.decode(uri.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
            image::load_from_memory(&bytes).unwrap().to_rgb8().dimensions()
        };
        assert_eq!(size(&RgbImage::new(120, 60)), (40, 20));
        assert_eq!(size(&RgbImage::new(12, 60)), (12, 60));
        assert_eq!(size(&RgbImage::new(400, 1)), (40, 1));
    }
}
