//! Pictures that stand behind people: a user's folder of them, of which each time another cut is taken.

use std::path::{Path, PathBuf};

use image::RgbImage;
use image::imageops::{FilterType, crop_imm, resize};
use rand::Rng;

use crate::Result;
use crate::formats::{Error, read_picture};

const EXTENSIONS: [&str; 7] = ["png", "jpg", "jpeg", "tif", "tiff", "bmp", "tga"];
/// The smallest cut, of the largest that fits.
const SMALLEST_CUT: f32 = 0.6;

/// The pictures of a folder, by name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Backdrops {
    files: Vec<PathBuf>,
}

impl Backdrops {
    /// Those of a folder itself, not of folders in it.
    ///
    /// # Errors
    /// [`Error::Missing`] if there is none.
    pub fn of_folder(folder: &Path) -> Result<Self> {
        let mut files = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
            let path = entry.map_err(Error::io(folder))?.path();
            let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
            if EXTENSIONS.contains(&extension.as_str()) {
                files.push(path);
            }
        }
        if files.is_empty() {
            return Err(Error::Missing {
                path: folder.into(),
                what: format!("a picture ({})", EXTENSIONS.join(", ")),
                remedy: "give a folder with pictures of places without people".into(),
            }
            .into());
        }
        files.sort();
        Ok(Self { files })
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.files.len()
    }

    /// The file's name, without its folder.
    pub fn name(&self, index: usize) -> String {
        self.files[index].file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// A random cut of one of them, of this size.
    ///
    /// # Errors
    /// Those of reading the picture.
    pub(super) fn cut(&self, index: usize, [width, height]: [u32; 2], random: &mut impl Rng) -> Result<RgbImage> {
        let whole = read_picture(&self.files[index])?.into_rgb8();
        let (across, down) = (whole.width() as f32, whole.height() as f32);
        let scale = (across / width as f32).min(down / height as f32) * random.random_range(SMALLEST_CUT..=1.0);
        let sides = [width, height].map(|side| ((side as f32 * scale) as u32).max(1));
        let [left, top] =
            [whole.width() - sides[0], whole.height() - sides[1]].map(|room| random.random_range(0..=room));
        let cut = crop_imm(&whole, left, top, sides[0], sides[1]).to_image();
        Ok(resize(&cut, width, height, FilterType::Triangle))
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::formats::write_picture;

    #[test]
    fn cuts_have_the_size_that_is_asked_for_and_come_from_the_picture() {
        let folder = tempfile::tempdir().unwrap();
        let error = Backdrops::of_folder(folder.path()).unwrap_err().to_string();
        assert!(error.contains("a picture") && error.contains("without people"), "{error}");
        std::fs::write(folder.path().join("notes.txt"), "none").unwrap();
        let ramp = |x: u32, y: u32| image::Rgb([x as u8, y as u8, 77]);
        write_picture(&folder.path().join("b.png"), &RgbImage::from_fn(90, 40, ramp)).unwrap();
        write_picture(&folder.path().join("a.PNG"), &RgbImage::from_pixel(1, 1, image::Rgb([9; 3]))).unwrap();
        let backdrops = Backdrops::of_folder(folder.path()).unwrap();
        assert_eq!((backdrops.count(), backdrops.name(1).as_str()), (2, "b.png"));
        let mut random = ChaCha8Rng::seed_from_u64(5);
        assert_eq!(backdrops.cut(0, [8, 6], &mut random).unwrap(), RgbImage::from_pixel(8, 6, image::Rgb([9; 3])));
        let cut = backdrops.cut(1, [30, 20], &mut random).unwrap();
        assert!(cut.pixels().all(|pixel| pixel.0[2] == 77));
        let across = cut.get_pixel(29, 10).0[0] - cut.get_pixel(0, 10).0[0];
        assert!((30..60).contains(&across), "the cut spans {across} of 90 columns, at most twice its own 30");
    }
}
