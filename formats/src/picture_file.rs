//! PNG and JPEG pictures: read without trust, the size known and bounded before anything is decoded; written as a whole.

use std::io;
use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{DynamicImage, ExtendedColorType, ImageEncoder, ImageReader, Limits, RgbImage};

use crate::atomic_file::write_atomically;
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
    let mut reader =
        ImageReader::open(path).map_err(Error::io(path))?.with_guessed_format().map_err(Error::io(path))?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST_SIDE);
    limits.max_image_height = Some(LARGEST_SIDE);
    limits.max_alloc = Some(LARGEST_ALLOCATION);
    reader.limits(limits);
    reader.decode().map_err(|error| Error::Malformed {
        path: path.into(),
        format: "image",
        place: "the file".into(),
        found: error.to_string(),
        expected: "a PNG or JPEG".into(),
    })
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
