//! Contact sheets: rows of labelled pictures side by side on white.

use image::{Rgb, RgbImage, imageops};

use super::text::{Size, draw_text};
use xavatar_formats::{Error, Result};

/// Between pictures and around them, pixels.
const GAP: u32 = 8;
/// Of the labels, pixels.
const TEXT: Size = Size::Large;
const INK: [u8; 3] = [55; 3];
/// Longest side of a sheet, pixels.
const LARGEST_SIDE: u64 = 32_768;

/// A picture and what stands under it; an empty label takes no room unless a neighbour in the row has one.
#[derive(Clone, Debug)]
pub struct Tile {
    /// The picture.
    pub picture: RgbImage,
    /// One line of text, in the middle, in smaller letters if it is long. It is cut where the picture ends; characters beyond ASCII show as `?`.
    pub label: String,
}

impl Tile {
    /// A picture with a label.
    pub fn new(picture: RgbImage, label: impl Into<String>) -> Self {
        Self { picture, label: label.into() }
    }
}

/// Puts rows of pictures on one sheet, left-aligned, each row as high as its highest picture.
///
/// # Errors
/// [`Error::Value`] if there is no picture, or if the sheet would exceed 32,768 pixels on a side.
pub fn contact_sheet(rows: &[Vec<Tile>]) -> Result<RgbImage> {
    let gap = u64::from(GAP);
    let width = rows.iter().map(|row| row.iter().map(|tile| u64::from(tile.picture.width()) + gap).sum()).max();
    let height: u64 = rows.iter().map(|row| u64::from(picture_height(row)) + u64::from(label_height(row)) + gap).sum();
    let width: u64 = width.unwrap_or(0);
    if width == 0 || width.max(height) + gap > LARGEST_SIDE {
        return Err(Error::Value {
            name: "contact sheet".into(),
            found: format!("{width} x {height} pixels"),
            expected: format!("at least one picture, and at most {LARGEST_SIDE} pixels a side"),
        });
    }
    let mut sheet = RgbImage::from_pixel((width + gap) as u32, (height + gap) as u32, Rgb([255; 3]));
    let mut top = GAP;
    for row in rows {
        let mut left = GAP;
        for tile in row {
            imageops::replace(&mut sheet, &tile.picture, i64::from(left), i64::from(top));
            let width = tile.picture.width();
            let size = if TEXT.width(&tile.label) > width { Size::Small } else { TEXT };
            let label: String = tile.label.chars().take((width / size.advance()) as usize).collect();
            let indent = (width - size.width(&label)) / 2;
            let place = [i64::from(left + indent), i64::from(top + picture_height(row))];
            draw_text(&mut sheet, &label, place, size, INK);
            left += tile.picture.width() + GAP;
        }
        top += picture_height(row) + label_height(row) + GAP;
    }
    Ok(sheet)
}

fn picture_height(row: &[Tile]) -> u32 {
    row.iter().map(|tile| tile.picture.height()).max().unwrap_or(0)
}

fn label_height(row: &[Tile]) -> u32 {
    if row.iter().all(|tile| tile.label.is_empty()) { 0 } else { TEXT.height() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(width: u32, height: u32, value: u8, label: &str) -> Tile {
        Tile::new(RgbImage::from_pixel(width, height, Rgb([value; 3])), label)
    }

    #[test]
    fn pictures_keep_their_pixels_and_labels_their_place() {
        let rows = [vec![tile(60, 40, 10, "left"), tile(30, 50, 20, "")], vec![tile(20, 10, 30, "")]];
        let sheet = contact_sheet(&rows).unwrap();
        assert_eq!(sheet.dimensions(), (GAP * 3 + 90, GAP * 3 + 50 + 20 + 10));
        let count = |value: u8| sheet.pixels().filter(|pixel| pixel.0 == [value; 3]).count();
        assert_eq!(count(20), 30 * 50, "a picture without a label is untouched");
        assert_eq!(count(30), 20 * 10);
        let ink = |x0: u32, x1: u32| (x0..x1).any(|x| (GAP + 50..GAP + 70).any(|y| sheet.get_pixel(x, y).0[0] < 128));
        assert!(ink(GAP, GAP + 60), "the label is written under its picture");
        assert!(!ink(GAP + 60, sheet.width()), "and nowhere else");
    }

    #[test]
    fn long_and_foreign_labels_are_cut_not_fatal() {
        assert!(contact_sheet(&[vec![tile(15, 4, 0, "a long label \u{1F600} \u{e9}")]]).is_ok());
        assert!(contact_sheet(&[vec![tile(0, 0, 0, "text")]]).is_ok());
    }

    #[test]
    fn a_sheet_without_pictures_is_an_error() {
        assert!(contact_sheet(&[]).is_err());
        assert!(contact_sheet(&[vec![]]).is_err());
    }
}
