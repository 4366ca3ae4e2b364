//! PNG files that are either complete or not there.

use std::io::BufWriter;
use std::path::Path;

use image::{ExtendedColorType, ImageEncoder, RgbImage, codecs::png::PngEncoder};

use crate::{Error, Result};

/// Writes a picture to `path`: under a temporary name in the same folder first, then renamed.
///
/// # Errors
/// [`Error::Io`] if the folder does not exist or the disk is full; nothing is left behind then.
pub fn write_png(path: impl AsRef<Path>, picture: &RgbImage) -> Result<()> {
    let path = path.as_ref();
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    // Temporary files are private by default; pictures are for everyone the umask allows.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.prefix(".picture-").suffix(".png").tempfile_in(folder).map_err(Error::io(path))?;
    PngEncoder::new(BufWriter::new(&mut file))
        .write_image(picture.as_raw(), picture.width(), picture.height(), ExtendedColorType::Rgb8)
        .map_err(|failure| Error::io(path)(std::io::Error::other(failure)))?;
    file.as_file().sync_all().map_err(Error::io(path))?;
    file.persist(path).map_err(|failure| Error::io(path)(failure.error))?;
    Ok(())
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
