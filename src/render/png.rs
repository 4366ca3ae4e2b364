//! PNG files that are either complete or not there.

use std::io;
use std::path::Path;

use image::{ExtendedColorType, ImageEncoder, RgbImage, codecs::png::PngEncoder};

use crate::Result;
use crate::atomic_file::write_atomically;

/// Writes a picture to `path`; what stood there before stays until the new one is complete.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) if the folder does not exist or the disk is full.
pub fn write_png(path: impl AsRef<Path>, picture: &RgbImage) -> Result<()> {
    write_atomically(path.as_ref(), |writer| {
        PngEncoder::new(writer)
            .write_image(picture.as_raw(), picture.width(), picture.height(), ExtendedColorType::Rgb8)
            .map_err(io::Error::other)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_survive_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        let picture = RgbImage::from_fn(17, 5, |x, y| image::Rgb([x as u8 * 3, y as u8 * 40, 7]));
        write_png(&path, &RgbImage::new(3, 3)).unwrap();
        write_png(&path, &picture).unwrap();
        assert_eq!(image::open(&path).unwrap().to_rgb8(), picture);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays");
    }

    #[test]
    fn a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = write_png(folder.path().join("absent/picture.png"), &RgbImage::new(1, 1)).unwrap_err();
        assert!(error.to_string().contains("absent/picture.png"), "{error}");
    }
}
