//! What colours mean, written into a picture's lower edge.

use image::RgbImage;

use super::colour_map::ColourMap;
use super::text::{Size, blend, draw_text};

const INK: [u8; 3] = [55; 3];
/// Height of the bar and of swatches, pixels.
const BAR: i64 = 12;
/// Room around it, pixels.
const GAP: i64 = 6;
/// Share of the picture's width that a bar takes.
const BAR_SHARE: f32 = 0.7;

/// Draws a scale from 0 to `largest` in the middle of the lower edge, with numbers in `unit` at its ends and its middle.
pub fn draw_scale(picture: &mut RgbImage, map: ColourMap, largest: f32, unit: &str) {
    let (width, height) = (i64::from(picture.width()), i64::from(picture.height()));
    let length = (width as f32 * BAR_SHARE) as i64;
    let (left, top) = ((width - length) / 2, height - GAP - BAR - i64::from(Size::Small.height()));
    for x in 0..length {
        let colour = map.colour(x as f32 / (length - 1).max(1) as f32);
        (0..BAR).for_each(|y| blend(picture, [left + x, top + y], colour, 1.0));
    }
    for (x, y) in
        (0..length).flat_map(|x| [(x, 0), (x, BAR - 1)]).chain((0..BAR).flat_map(|y| [(0, y), (length - 1, y)]))
    {
        blend(picture, [left + x, top + y], INK, 0.5);
    }
    for (share, text) in [(0.0, "0".into()), (0.5, format!("{}", largest / 2.0)), (1.0, format!("{largest} {unit}"))] {
        let text_width = i64::from(Size::Small.width(&text));
        let middle = left + (share * length as f32) as i64;
        let place = [(middle - text_width / 2).clamp(0, (width - text_width).max(0)), top + BAR + 1];
        draw_text(picture, &text, place, Size::Small, INK);
    }
}

/// Draws names with their colours from the lower left corner, as many a line as fit.
pub fn draw_names(picture: &mut RgbImage, names: &[(&str, [u8; 3])]) {
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
    let top = i64::from(picture.height()) - GAP - (lines + 1) * line;
    for ((name, colour), (left, number)) in names.iter().zip(places) {
        let top = top + number * line;
        let inset = (line - BAR) / 2;
        for (x, y) in (0..BAR).flat_map(|y| (0..BAR).map(move |x| (x, y))) {
            blend(picture, [left + x, top + inset + y], *colour, 1.0);
        }
        draw_text(picture, name, [left + BAR + GAP, top], Size::Small, INK);
    }
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    #[test]
    fn a_scale_shows_its_colours_from_left_to_right() {
        let mut picture = RgbImage::from_pixel(200, 100, Rgb([255; 3]));
        draw_scale(&mut picture, ColourMap::Heat, 10.0, "mm");
        let row = 100 - GAP as u32 - Size::Small.height() - BAR as u32 / 2;
        assert_eq!(picture.get_pixel(100, row).0, ColourMap::Heat.colour(70.0 / 139.0));
        assert!(picture.rows().take(60).flatten().all(|pixel| pixel.0 == [255; 3]), "only the lower edge");
    }

    #[test]
    fn names_wrap_and_small_pictures_are_no_failure() {
        let names = [("left hand", [1, 2, 3]), ("right hand", [4, 5, 6])];
        let mut picture = RgbImage::from_pixel(130, 80, Rgb([255; 3]));
        draw_names(&mut picture, &names);
        let lowest = |colour: [u8; 3]| picture.enumerate_pixels().filter(|p| p.2.0 == colour).map(|p| p.1).max();
        assert!(lowest([4, 5, 6]) > lowest([1, 2, 3]));
        let mut speck = RgbImage::new(1, 1);
        draw_names(&mut speck, &names);
        draw_scale(&mut speck, ColourMap::Viridis, 1.0, "m");
    }
}
