//! Texture images: bilinear look-up, and the files that OBJ and PLY refer to.
//!
//! In memory row 0 is v = 0, as in X-Humans atlases. Image files of OBJ and PLY have v = 0 at the bottom, so reading and
//! writing them flips rows.

use std::io::Cursor;
use std::path::{Component, Path, PathBuf};

use glam::{Vec2, Vec3};
use image::{ImageFormat, RgbImage};

use xavatar_formats::read_picture;
use xavatar_formats::write_atomically;
use xavatar_formats::{Error, Result};

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

/// Reads the PNG or JPEG `name` that stands beside `referrer`; row 0 of the result is v = 0.
///
/// `place` says where `referrer` names it. Only plain relative paths are followed: a mesh cannot make us open files
/// outside its folder.
pub(super) fn read_referenced_texture(
    referrer: &Path,
    format: &'static str,
    place: String,
    name: &str,
) -> Result<RgbImage> {
    let path = referenced_file(referrer, format, place, name)?;
    if !path.exists() {
        return Err(Error::Missing {
            what: "texture image".into(),
            remedy: format!("{} refers to it; put it there", referrer.display()),
            path,
        });
    }
    let image = read_picture(&path)?;
    Ok(image::imageops::flip_vertical(&image.into_rgb8()))
}

/// The path of the file `name` that stands beside `referrer`.
pub(super) fn referenced_file(referrer: &Path, format: &'static str, place: String, name: &str) -> Result<PathBuf> {
    let relative = Path::new(name);
    let plain = relative.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    if !plain || name.is_empty() {
        return Err(Error::Malformed {
            path: referrer.into(),
            format,
            place,
            found: format!("the path {name:?}"),
            expected: "a file in the same folder or below it".into(),
        });
    }
    Ok(referrer.parent().unwrap_or(Path::new("")).join(relative))
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
    fn paths_that_leave_the_folder_are_refused() {
        for name in ["/etc/passwd", "../secret.png", "a/../../b.png", ""] {
            assert!(referenced_file(Path::new("scan.obj"), "OBJ", "line 1".into(), name).is_err(), "{name}");
        }
        let ok = referenced_file(Path::new("in/scan.obj"), "OBJ", "line 1".into(), "maps/a b.png").unwrap();
        assert_eq!(ok, Path::new("in/maps/a b.png"));
    }
}
