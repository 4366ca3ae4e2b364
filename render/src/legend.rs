//! What colours mean, written below a picture.

use image::{Rgb, RgbImage, imageops};

use super::colour_map::ColourMap;
use super::text::{Size, blend, draw_text};

const INK: [u8; 3] = [55; 3];
/// Height of the bar and of swatches, pixels.
const BAR: i64 = 12;
/// Room around it, pixels.
const GAP: i64 = 6;
/// Share of the picture's width that a bar takes.
const BAR_SHARE: f32 = 0.7;

/// The picture with a scale from 0 to `largest` below it, with numbers in `unit` at its ends and its middle.
#[must_use]
pub fn with_scale(picture: &RgbImage, map: ColourMap, largest: f32, unit: &str) -> RgbImage {
    let width = i64::from(picture.width());
    let (mut picture, below) = with_room(picture, BAR + i64::from(Size::Small.height()));
    let length = (width as f32 * BAR_SHARE) as i64;
    let (left, top) = ((width - length) / 2, below);
    for x in 0..length {
        let colour = map.colour(x as f32 / (length - 1).max(1) as f32);
        (0..BAR).for_each(|y| blend(&mut picture, [left + x, top + y], colour, 1.0));
    }
    for (x, y) in
        (0..length).flat_map(|x| [(x, 0), (x, BAR - 1)]).chain((0..BAR).flat_map(|y| [(0, y), (length - 1, y)]))
    {
        blend(&mut picture, [left + x, top + y], INK, 0.5);
    }
    for (share, text) in [(0.0, "0".into()), (0.5, format!("{}", largest / 2.0)), (1.0, format!("{largest} {unit}"))] {
        let text_width = i64::from(Size::Small.width(&text));
        let middle = left + (share * length as f32) as i64;
        let place = [(middle - text_width / 2).clamp(0, (width - text_width).max(0)), top + BAR + 1];
        draw_text(&mut picture, &text, place, Size::Small, INK);
    }
    picture
}

/// The picture with names and their colours below it, as many a line as fit.
#[must_use]
pub fn with_names(picture: &RgbImage, names: &[(String, [u8; 3])]) -> RgbImage {
    let line = i64::from(Size::Small.height());
    let widths = names.iter().map(|(name, _)| i64::from(Size::Small.width(name)) + BAR + 3 * GAP);
    // (column, line) of each.
    let (mut places, mut left, mut lines) = (Vec::new(), GAP, 0);
    for width in widths {
        if left > GAP && left + width > i64::from(picture.width()) {
            (left, lines) = (GAP, lines + 1);
        }
        places.push((left, lines));
        left += width;
    }
    let (mut picture, below) = with_room(picture, (lines + 1) * line);
    for ((name, colour), (left, number)) in names.iter().zip(places) {
        let top = below + number * line;
        let inset = (line - BAR) / 2;
        for (x, y) in (0..BAR).flat_map(|y| (0..BAR).map(move |x| (x, y))) {
            blend(&mut picture, [left + x, top + inset + y], *colour, 1.0);
        }
        draw_text(&mut picture, name, [left + BAR + GAP, top], Size::Small, INK);
    }
    picture
}

/// The picture with this much more white and two gaps below it, and where the white begins after the first.
fn with_room(picture: &RgbImage, rows: i64) -> (RgbImage, i64) {
    let (width, height) = picture.dimensions();
    let mut taller = RgbImage::from_pixel(width, height + (rows + 2 * GAP) as u32, Rgb([255; 3]));
    imageops::replace(&mut taller, picture, 0, 0);
    (taller, i64::from(height) + GAP)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(width: u32, height: u32) -> RgbImage {
        RgbImage::from_pixel(width, height, Rgb([128; 3]))
    }

    fn keeps(picture: &RgbImage, with_legend: &RgbImage) -> bool {
        picture.enumerate_pixels().all(|(x, y, pixel)| with_legend.get_pixel(x, y) == pixel)
    }

    #[test]
    fn a_scale_shows_its_colours_from_left_to_right_below_the_picture() {
        let picture = with_scale(&grey(200, 100), ColourMap::Heat, 10.0, "mm");
        assert_eq!(picture.get_pixel(100, 100 + (GAP + BAR / 2) as u32).0, ColourMap::Heat.colour(70.0 / 139.0));
        assert!(keeps(&grey(200, 100), &picture));
    }

    #[test]
    fn names_wrap_below_the_picture_and_small_ones_are_no_failure() {
        let names = [("left hand", [1, 2, 3]), ("right hand", [4, 5, 6]), ("eyes, mouth", [7, 8, 9])]
            .map(|(name, colour)| (name.to_owned(), colour));
        let picture = with_names(&grey(130, 80), &names);
        let lowest = |colour: [u8; 3]| picture.enumerate_pixels().filter(|p| p.2.0 == colour).map(|p| p.1).max();
        assert!(lowest([4, 5, 6]) > lowest([1, 2, 3]) && lowest([7, 8, 9]) > lowest([4, 5, 6]));
        assert!(keeps(&grey(130, 80), &picture));
        assert!(with_names(&grey(1, 1), &names).height() > 1);
        assert!(with_scale(&grey(1, 1), ColourMap::Viridis, 1.0, "m").height() > 1);
    }
}
