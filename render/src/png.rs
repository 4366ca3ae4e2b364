//! PNG files that are either complete or not there.

use std::path::Path;

use image::RgbImage;

use xavatar_formats::Result;
use xavatar_formats::write_picture;

/// Writes a picture to `path`; what stood there before stays until the new one is complete.
///
/// # Errors
/// [`Error::Io`](xavatar_formats::Error::Io) if the folder does not exist or the disk is full.
pub fn write_png(path: impl AsRef<Path>, picture: &RgbImage) -> Result<()> {
    write_picture(path.as_ref(), picture)
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
