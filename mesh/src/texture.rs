//! Texture images: bilinear look-up, and the files that meshes refer to.
//!
//! In memory row 0 is v = 0, as in X-Humans atlases. Image files of OBJ and PLY have v = 0 at the bottom, so reading and
//! writing them flips rows.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use glam::{Vec2, Vec3};
use image::{ImageFormat, RgbImage};

use xavatar_formats::{Error, Result, read_picture, write_atomically};

/// Texels of all pictures of a mesh: as many as the largest picture has.
const MOST_TEXELS: u64 = 1 << 28;

/// The colour at `uv` (clamped to [0, 1]^2) in [0, 1] per channel, bilinear between texel centres (i + 0.5) / n.
pub(super) fn sample_bilinear(image: &RgbImage, uv: Vec2) -> Vec3 {
    let size = Vec2::new(image.width() as f32, image.height() as f32);
    let at = (uv.clamp(Vec2::ZERO, Vec2::ONE) * size - 0.5).clamp(Vec2::ZERO, size - 1.0);
    let low = at.floor();
    let fraction = at - low;
    let (x0, y0) = (low.x as u32, low.y as u32);
    let (x1, y1) = ((x0 + 1).min(image.width() - 1), (y0 + 1).min(image.height() - 1));
    let texel = |x, y| Vec3::from(image.get_pixel(x, y).0.map(f32::from));
    let top = texel(x0, y0).lerp(texel(x1, y0), fraction.x);
    let bottom = texel(x0, y1).lerp(texel(x1, y1), fraction.x);
    top.lerp(bottom, fraction.y) / 255.0
}

/// The pictures of a mesh, each read once however many materials name it; row 0 is v = 0.
#[derive(Default)]
pub(super) struct Pictures {
    read: Vec<Arc<RgbImage>>,
    place_of: HashMap<PathBuf, u32>,
    texels: u64,
}

impl Pictures {
    /// Reads the image file at `path`, whose last row is v = 0, unless it has been; and says which picture it is.
    pub(super) fn read(&mut self, path: &Path) -> Result<u32> {
        if let Some(place) = self.place_of.get(path) {
            return Ok(*place);
        }
        let image = image::imageops::flip_vertical(&read_picture(path)?.into_rgb8());
        let place = self.add(path, image)?;
        self.place_of.insert(path.into(), place);
        Ok(place)
    }

    /// Adds a picture that was read from the file at `path`, and says which it is.
    pub(super) fn add(&mut self, path: &Path, image: RgbImage) -> Result<u32> {
        self.texels += u64::from(image.width()) * u64::from(image.height());
        if self.texels > MOST_TEXELS {
            return Err(Error::Mismatch {
                path: path.into(),
                found: format!("with the pictures before it, {} million texels", self.texels / 1_000_000),
                expected: format!("at most {} million for one mesh", MOST_TEXELS / 1_000_000),
                remedy: "make its textures smaller".into(),
            });
        }
        self.read.push(Arc::new(image));
        Ok(self.read.len() as u32 - 1)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.read.is_empty()
    }

    /// The pictures in the order of their numbers.
    pub(super) fn into_inner(self) -> Vec<Arc<RgbImage>> {
        self.read
    }
}

/// The file that a mesh file means by `name`, if it is there.
///
/// A relative path below the mesh's folder is followed; of any other, as of the computer where the mesh was made, the last part is
/// looked for beside the mesh: a mesh cannot make us open files outside its folder. Upper and lower case count only where several
/// files differ in nothing else.
pub(super) fn find_referenced(referrer: &Path, name: &str) -> Option<PathBuf> {
    let folder = referrer.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Paths of Windows, whatever system this is.
    let name = name.trim().trim_matches('"').replace('\\', "/");
    let relative = Path::new(&name);
    let is_plain =
        !name.contains(':') && relative.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    let last = Path::new(relative.file_name()?);
    let candidates = [Some(relative).filter(|_| is_plain), Some(last)];
    candidates.into_iter().flatten().find_map(|candidate| existing(&folder.join(candidate)))
}

/// The file at `path`, or the only one beside it whose name differs in case alone.
fn existing(path: &Path) -> Option<PathBuf> {
    if path.is_file() {
        return Some(path.into());
    }
    let name = path.file_name()?.to_str()?.to_lowercase();
    let entries = std::fs::read_dir(path.parent()?).ok()?.flatten();
    let is_alike = |entry: &std::fs::DirEntry| entry.file_name().to_str().is_some_and(|n| n.to_lowercase() == name);
    let mut alike = entries.filter(is_alike).map(|entry| entry.path()).filter(|path| path.is_file());
    alike.next().filter(|_| alike.next().is_none())
}

/// Writes a texture whose row 0 is v = 0 as a PNG for OBJ and PLY.
pub(super) fn write_texture(path: &Path, image: &RgbImage) -> Result<()> {
    let encoded = encode_png(&image::imageops::flip_vertical(image)).map_err(Error::io(path))?;
    write_atomically(path, |writer| std::io::Write::write_all(writer, &encoded))
}

/// The bytes of a PNG file.
pub fn encode_png(image: &RgbImage) -> std::io::Result<Vec<u8>> {
    let mut encoded = Vec::new();
    image.write_to(&mut Cursor::new(&mut encoded), ImageFormat::Png).map_err(std::io::Error::other)?;
    Ok(encoded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn bilinear_is_exact_at_texel_centres_linear_between_and_clamped_outside() {
        let image = RgbImage::from_fn(4, 2, |x, y| Rgb([x as u8 * 51, y as u8 * 255, 0]));
        let centre = |x: f32, y: f32| sample_bilinear(&image, Vec2::new((x + 0.5) / 4.0, (y + 0.5) / 2.0));
        assert_eq!(centre(2.0, 1.0), Vec3::new(0.4, 1.0, 0.0));
        assert!(centre(1.5, 0.25).abs_diff_eq(Vec3::new(0.3, 0.25, 0.0), 1e-6));
        assert_eq!(sample_bilinear(&image, Vec2::new(-3.0, 7.0)), Vec3::new(0.0, 1.0, 0.0));
    }

    #[test]
    fn files_are_found_below_the_folder_and_nowhere_else() {
        let outside = tempfile::tempdir().unwrap();
        let folder = outside.path().join("scans");
        std::fs::create_dir_all(folder.join("maps")).unwrap();
        for file in ["secret.png", "scans/Skin.PNG", "scans/maps/a b.png", "scans/twin.png", "scans/TWIN.png"] {
            std::fs::write(outside.path().join(file), "").unwrap();
        }
        let scan = folder.join("scan.obj");
        let found =
            |name: &str| find_referenced(&scan, name).map(|path| path.strip_prefix(&folder).unwrap().to_owned());
        for (name, file) in [
            ("maps/a b.png", "maps/a b.png"),
            ("./maps\\A B.PNG", "maps/a b.png"),
            ("skin.png", "Skin.PNG"),
            (" \"Skin.PNG\" ", "Skin.PNG"),
            ("C:\\Users\\me\\Skin.PNG", "Skin.PNG"),
            ("/elsewhere/skin.png", "Skin.PNG"),
            ("../other/skin.png", "Skin.PNG"),
            ("twin.png", "twin.png"),
        ] {
            assert_eq!(found(name).as_deref(), Some(Path::new(file)), "{name}");
        }
        for name in ["../secret.png", "/etc/passwd", "maps/../../secret.png", "maps", "", "..", "Twin.png"] {
            assert_eq!(found(name), None, "{name}");
        }
    }
}
