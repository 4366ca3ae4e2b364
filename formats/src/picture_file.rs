//! PNG and JPEG pictures: read without trust, the size known and bounded before anything is decoded; written as a whole.

use std::io::{self, Cursor};
use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{DynamicImage, ExtendedColorType, ImageEncoder, ImageFormat, ImageReader, Limits, RgbImage};

use crate::atomic_file::write_atomically;
use crate::input_file::read_bytes;
use crate::jpeg::is_whole_jpeg;
use crate::{Error, Result};

/// Longest side read, pixels.
const LARGEST_SIDE: u32 = 16_384;
/// Memory for one picture: a hostile header cannot ask for more, bytes.
const LARGEST_ALLOCATION: u64 = 1 << 30;

/// Decodes the picture at `path`, recognised by its content.
///
/// # Errors
/// [`Error::Io`] if it cannot be opened; [`Error::Malformed`] if it is no whole PNG or JPEG, or larger than the bounds.
pub fn read_picture(path: &Path) -> Result<DynamicImage> {
    let bytes = read_bytes(path)?;
    decode_picture(&bytes).map_err(|found| Error::Malformed {
        path: path.into(),
        format: "image",
        place: "the file".into(),
        found,
        expected: "a PNG or JPEG".into(),
    })
}

/// Decodes a picture in memory, or says what is wrong with it.
fn decode_picture(bytes: &[u8]) -> std::result::Result<DynamicImage, String> {
    let format = image::guess_format(bytes).map_err(|error| error.to_string())?;
    if format == ImageFormat::Jpeg && !is_whole_jpeg(bytes) {
        return Err("cut short".into());
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST_SIDE);
    limits.max_image_height = Some(LARGEST_SIDE);
    limits.max_alloc = Some(LARGEST_ALLOCATION);
    reader.limits(limits);
    reader.decode().map_err(|error| error.to_string())
}

/// Writes a PNG; what stood at `path` before stays until the new one is complete.
///
/// # Errors
/// [`Error::Io`] if the folder does not exist or the disk is full.
pub fn write_picture(path: &Path, picture: &RgbImage) -> Result<()> {
    write_atomically(path, |writer| {
        PngEncoder::new(writer)
            .write_image(picture.as_raw(), picture.width(), picture.height(), ExtendedColorType::Rgb8)
            .map_err(io::Error::other)
    })
}
