//! Pictures: read without trust, the size known and bounded before anything is decoded; written as a whole.
//!
//! Every decoder runs in [`guarded`]: they are others' code on others' bytes, and one that fails must not end the program.

use std::io::{self, Cursor};
use std::panic::{AssertUnwindSafe, catch_unwind};
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
/// What is decoded.
pub const PICTURE_FORMATS: &str = "a whole PNG, JPEG, TIFF, BMP or TGA";

/// Decodes the picture at `path`, recognised by its content, or by its name where the format has no signature (TGA).
///
/// # Errors
/// [`Error::Io`] if it cannot be opened; [`Error::Malformed`] if it is no whole picture of a known format, or larger than the
/// bounds.
pub fn read_picture(path: &Path) -> Result<DynamicImage> {
    let bytes = read_bytes(path)?;
    decode_picture(&bytes, ImageFormat::from_path(path).ok()).map_err(|found| Error::Malformed {
        path: path.into(),
        format: "image",
        place: "the file".into(),
        found,
        expected: PICTURE_FORMATS.into(),
    })
}

/// Decodes a picture in memory, in the format of its content, else in the `named` one; or says what is wrong with it.
///
/// # Errors
/// What is wrong.
pub fn decode_picture(bytes: &[u8], named: Option<ImageFormat>) -> std::result::Result<DynamicImage, String> {
    check_palette(bytes)?;
    let format = image::guess_format(bytes).ok().or(named).ok_or("in no known format")?;
    if format == ImageFormat::Jpeg && !is_whole_jpeg(bytes) {
        return Err("cut short".into());
    }
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST_SIDE);
    limits.max_image_height = Some(LARGEST_SIDE);
    limits.max_alloc = Some(LARGEST_ALLOCATION);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    guarded(|| reader.decode().map_err(|error| error.to_string())).unwrap_or_else(|| Err("broken".into()))
}

/// What a decoder returns; `None` if it panics, of which it says a line on stderr.
pub fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    catch_unwind(AssertUnwindSafe(decode)).ok()
}

/// Refuses a PNG whose palette is no list of colours, over which its decoder panics (png 0.18.1).
fn check_palette(bytes: &[u8]) -> std::result::Result<(), String> {
    const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
    let mut rest = bytes.strip_prefix(SIGNATURE).unwrap_or_default();
    // Chunks: length, name, data, checksum.
    while let Some((length, after)) = rest.split_first_chunk::<4>()
        && let Some((name, _)) = after.split_first_chunk::<4>()
        && name != b"IDAT"
    {
        let length = u32::from_be_bytes(*length) as usize;
        if name == b"PLTE" && !length.is_multiple_of(3) {
            return Err(format!("a palette of {length} bytes, no multiple of 3"));
        }
        rest = rest.get(length.saturating_add(12)..).unwrap_or_default();
    }
    Ok(())
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

#[cfg(test)]
mod tests {
    use image::Rgb;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const FORMATS: [ImageFormat; 5] =
        [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Tiff, ImageFormat::Bmp, ImageFormat::Tga];

    /// A 6 x 4 picture of one colour.
    fn encoded(format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        RgbImage::from_pixel(6, 4, Rgb([200, 60, 20])).write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn every_format_is_read_by_its_content_or_else_its_name() {
        let folder = tempfile::tempdir().unwrap();
        for format in FORMATS {
            let name = if format == ImageFormat::Tga { "skin.TGA" } else { "skin" };
            std::fs::write(folder.path().join(name), encoded(format)).unwrap();
            let picture = read_picture(&folder.path().join(name)).unwrap().into_rgb8();
            let found = picture.get_pixel(3, 2).0;
            assert!(found.iter().zip([200u8, 60, 20]).all(|(a, b)| a.abs_diff(b) < 4), "{format:?}: {found:?}");
        }
    }

    #[test]
    fn damaged_pictures_are_errors_and_never_panics() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for format in FORMATS {
            let whole = encoded(format);
            for length in 0..whole.len() / 2 {
                assert!(decode_picture(&whole[..length], Some(format)).is_err(), "{format:?} cut at {length}");
            }
            for _ in 0..2000 {
                let mut bytes = whole.clone();
                let place = random.random_range(0..bytes.len());
                bytes[place] = random.random();
                let _either = decode_picture(&bytes, Some(format));
            }
        }
    }

    #[test]
    fn a_palette_that_is_no_list_of_colours_is_named() {
        // One pixel with a palette of five bytes; all checksums are right.
        let bytes = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x01\0\0\0\x01\x08\x03\0\0\0\x28\xcb\x34\xbb\
            \0\0\0\x05PLTE\x01\x02\x03\x04\x05\xe3\x4f\xba\xe8\
            \0\0\0\x0aIDAT\x78\x9c\x63\x60\0\0\0\x02\0\x01\x48\xaf\xa4\x71\0\0\0\0IEND\xae\x42\x60\x82";
        assert!(decode_picture(bytes, None).unwrap_err().contains("palette of 5 bytes"));
    }

    #[test]
    fn a_decoder_that_panics_is_an_error() {
        assert_eq!(guarded(|| 7), Some(7));
        assert_eq!(guarded(|| -> u8 { panic!("a decoder's bug") }), None);
    }

    #[test]
    fn formats_that_are_not_decoded_are_named() {
        let webp = [&b"RIFF\x04\0\0\0WEBP"[..], &[0; 20]].concat();
        assert!(decode_picture(&webp, None).unwrap_err().contains("WebP"));
        assert!(decode_picture(b"no picture", None).unwrap_err().contains("no known format"));
    }
}
