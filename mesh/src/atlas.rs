//! Several pictures as one, and where each of them lies in it.
//!
//! Pictures stand in rows, each in a frame of its own border texels, so that bilinear look-ups at a picture's edge are those of the
//! picture alone.

use std::sync::Arc;

use glam::Vec2;
use image::RgbImage;
use image::imageops::replace;

/// One picture, and the region of each of those that it was made of.
pub(super) struct Atlas {
    pub(super) image: Arc<RgbImage>,
    regions: Vec<Region>,
}

/// Where a picture lies, in shares of the atlas.
struct Region {
    corner: Vec2,
    size: Vec2,
}

/// Texels around each picture.
const BORDER: u32 = 1;

impl Atlas {
    /// Places pictures, of which there is at least one. One alone stays as it is.
    pub(super) fn of(pictures: &[Arc<RgbImage>]) -> Self {
        if let [picture] = pictures {
            return Self { image: picture.clone(), regions: vec![Region { corner: Vec2::ZERO, size: Vec2::ONE }] };
        }
        let framed = |picture: &RgbImage| [picture.width() + 2 * BORDER, picture.height() + 2 * BORDER];
        let area: f64 = pictures.iter().map(|picture| framed(picture).map(f64::from).iter().product::<f64>()).sum();
        let widest = pictures.iter().map(|picture| framed(picture)[0]).max().unwrap_or(1);
        let width = widest.max(area.sqrt().ceil() as u32);
        let mut order: Vec<usize> = (0..pictures.len()).collect();
        // Rows of pictures of like heights waste little.
        order.sort_by_key(|&index| std::cmp::Reverse(pictures[index].height()));
        let mut corners = vec![[0; 2]; pictures.len()];
        let (mut column, mut row, mut next_row) = (0, 0, 0);
        for index in order {
            let [across, down] = framed(&pictures[index]);
            if column + across > width {
                (column, row) = (0, next_row);
            }
            corners[index] = [column, row];
            column += across;
            next_row = next_row.max(row + down);
        }
        let mut image = RgbImage::new(width, next_row);
        for (picture, corner) in pictures.iter().zip(&corners) {
            place(&mut image, picture, *corner);
        }
        let whole = Vec2::new(width as f32, next_row as f32);
        let region = |(picture, corner): (&Arc<RgbImage>, &[u32; 2])| Region {
            corner: Vec2::from(corner.map(|texels| (texels + BORDER) as f32)) / whole,
            size: Vec2::new(picture.width() as f32, picture.height() as f32) / whole,
        };
        let regions = pictures.iter().zip(&corners).map(region).collect();
        Self { image: Arc::new(image), regions }
    }

    /// The place in the atlas of a place in the picture at `index`, which is clamped to [0, 1]^2 if there are several.
    pub(super) fn uv(&self, index: usize, uv: Vec2) -> Vec2 {
        if self.regions.len() == 1 {
            return uv;
        }
        let Region { corner, size } = self.regions[index];
        corner + uv.clamp(Vec2::ZERO, Vec2::ONE) * size
    }
}

/// Copies a picture with its frame, whose upper left corner is given.
fn place(image: &mut RgbImage, picture: &RgbImage, [column, row]: [u32; 2]) {
    replace(image, picture, i64::from(column + BORDER), i64::from(row + BORDER));
    let [width, height] = [picture.width(), picture.height()];
    let mut copy = |x: u32, y: u32| {
        let source = [x, y].map(|at| at.saturating_sub(BORDER));
        let texel = *picture.get_pixel(source[0].min(width - 1), source[1].min(height - 1));
        image.put_pixel(column + x, row + y, texel);
    };
    for x in 0..width + 2 * BORDER {
        copy(x, 0);
        copy(x, height + BORDER);
    }
    for y in 0..height + 2 * BORDER {
        copy(0, y);
        copy(width + BORDER, y);
    }
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;
    use crate::texture::sample_bilinear;

    #[test]
    fn look_ups_are_those_of_each_picture_alone() {
        let picture = |width: u32, height: u32, blue: u8| {
            Arc::new(RgbImage::from_fn(width, height, |x, y| Rgb([(x * 80) as u8, (y * 60) as u8, blue])))
        };
        let pictures = [picture(3, 2, 10), picture(1, 1, 90), picture(2, 4, 200), picture(3, 3, 250)];
        let atlas = Atlas::of(&pictures);
        for (index, picture) in pictures.iter().enumerate() {
            for step in 0..121 {
                let uv = Vec2::new((step % 11) as f32 / 10.0, (step / 11) as f32 / 10.0);
                let (found, alone) = (sample_bilinear(&atlas.image, atlas.uv(index, uv)), sample_bilinear(picture, uv));
                assert!(found.abs_diff_eq(alone, 1e-4), "{index} at {uv}: {found}, alone {alone}");
            }
        }
    }

    #[test]
    fn one_picture_stays_as_it_is() {
        let picture = Arc::new(RgbImage::new(7, 5));
        let atlas = Atlas::of(std::slice::from_ref(&picture));
        assert!(Arc::ptr_eq(&atlas.image, &picture));
        assert_eq!(atlas.uv(0, Vec2::new(0.3, 0.7)), Vec2::new(0.3, 0.7));
    }
}
