//! Colours that mean numbers or names, told apart by people with any colour vision.
//!
//! Scales: matplotlib's viridis and inferno (Smith & van der Walt, CC0), which are even in lightness. Names: the palette of Okabe &
//! Ito (2008). Joints: steps of the golden angle in OKLCH, every second joint of a limb lighter. All sRGB.

use glam::Vec3;

use super::light::{decode_srgb, encode_srgb};
use xavatar_formats::{Error, Result};

/// A scale of colours for values from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourMap {
    /// From dark violet over green to yellow.
    Viridis,
    /// From pale yellow over red to nearly black: what is good stays light, what is wrong stands out.
    Heat,
}

/// viridis at 0, 0.1, ... 1.
#[rustfmt::skip]
const VIRIDIS: [[u8; 3]; 11] = [
    [68, 1, 84], [72, 36, 117], [65, 68, 135], [53, 95, 141], [42, 120, 142], [33, 145, 140], [34, 168, 132], [68, 191, 112],
    [122, 209, 81], [189, 223, 38], [253, 231, 37],
];

/// inferno at 1, 0.9, ... 0.
#[rustfmt::skip]
const HEAT: [[u8; 3]; 11] = [
    [252, 255, 164], [246, 215, 70], [252, 165, 10], [243, 120, 25], [221, 81, 58], [188, 55, 84], [147, 38, 103],
    [106, 23, 110], [66, 10, 104], [22, 11, 57], [0, 0, 4],
];

/// Colours for a few things with names: blue, vermilion, green, purple, orange, sky blue, black (Okabe & Ito, without their
/// yellow, which is lost on white).
pub const NAMED_COLOURS: [[u8; 3]; 7] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [230, 159, 0], [86, 180, 233], [0, 0, 0]];

impl ColourMap {
    /// The colour of a value; below 0 and above 1 that of the end, of NaN grey.
    #[must_use]
    pub fn colour(self, value: f32) -> [u8; 3] {
        if value.is_nan() {
            return [128; 3];
        }
        let table = match self {
            Self::Viridis => &VIRIDIS,
            Self::Heat => &HEAT,
        };
        let place = value.clamp(0.0, 1.0) * (table.len() - 1) as f32;
        let first = (place as usize).min(table.len() - 2);
        let [low, high] = [first, first + 1].map(|index| Vec3::from(table[index].map(f32::from)));
        low.lerp(high, place - first as f32).round().to_array().map(|channel| channel as u8)
    }
}

/// The same in linear light.
pub(super) fn linear_colour(map: ColourMap, value: f32) -> Vec3 {
    linear(map.colour(value))
}

/// The colours of the joints of a tree (J), given each joint's parent, far apart between a joint and its parent. Parents come before
/// their children.
#[must_use]
pub fn joint_colours(parents: &[Option<usize>]) -> Vec<[u8; 3]> {
    /// Of the circle, radians.
    const GOLDEN_ANGLE: f32 = 2.399_963;
    let mut depth = vec![0; parents.len()];
    let colour = |(joint, parent): (usize, &Option<usize>)| {
        depth[joint] = parent.map_or(0, |parent| depth[parent] + 1);
        let lightness = if depth[joint] % 2 == 0 { 0.66 } else { 0.80 };
        let (sin, cos) = (joint as f32 * GOLDEN_ANGLE).sin_cos();
        srgb(oklab(lightness, 0.13 * cos, 0.13 * sin))
    };
    parents.iter().enumerate().map(colour).collect()
}

/// Skinning weights (V, J), rows of sum 1, as the joints' colours (J) mixed in linear light (V).
///
/// # Errors
/// [`Error::Value`] if the weights are not rows of J.
pub fn weight_colours(weights: &[f32], joints: &[[u8; 3]]) -> Result<Vec<[u8; 3]>> {
    if joints.is_empty() || !weights.len().is_multiple_of(joints.len()) {
        return Err(Error::Value {
            name: "number of skinning weights".into(),
            found: weights.len().to_string(),
            expected: format!("a multiple of {}, one a joint", joints.len()),
        });
    }
    let colours: Vec<Vec3> = joints.iter().copied().map(linear).collect();
    let mixed = |row: &[f32]| -> Vec3 { row.iter().zip(&colours).map(|(weight, colour)| *colour * *weight).sum() };
    Ok(weights.chunks_exact(joints.len()).map(|row| srgb(mixed(row))).collect())
}

fn linear(colour: [u8; 3]) -> Vec3 {
    Vec3::from(colour.map(|channel| decode_srgb(f32::from(channel) / 255.0)))
}

fn srgb(light: Vec3) -> [u8; 3] {
    light.to_array().map(encode_srgb)
}

/// Linear sRGB of a colour in OKLab (Ottosson 2020).
fn oklab(lightness: f32, a: f32, b: f32) -> Vec3 {
    let cones = Vec3::new(
        lightness + 0.396_337_78 * a + 0.215_803_76 * b,
        lightness - 0.105_561_346 * a - 0.063_854_17 * b,
        lightness - 0.089_484_18 * a - 1.291_485_5 * b,
    );
    let [l, m, s] = (cones * cones * cones).to_array();
    Vec3::new(
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_94 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_4 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance (WCAG 2).
    fn luminance(colour: [u8; 3]) -> f32 {
        linear(colour).dot(Vec3::new(0.2126, 0.7152, 0.0722))
    }

    #[test]
    fn scales_rise_or_fall_in_lightness_and_end_at_their_ends() {
        for (map, sign) in [(ColourMap::Viridis, 1.0), (ColourMap::Heat, -1.0)] {
            let shades: Vec<f32> = (0..=100).map(|step| sign * luminance(map.colour(step as f32 / 100.0))).collect();
            assert!(shades.is_sorted(), "{map:?}");
            assert!((shades[100] - shades[0]) > 0.6, "{map:?} spans light and dark");
            assert_eq!([map.colour(-3.0), map.colour(f32::INFINITY)], [map.colour(0.0), map.colour(1.0)]);
            assert_eq!(map.colour(f32::NAN), [128; 3]);
        }
    }

    // WCAG 2.1 asks for a contrast of 3 of graphics against their ground; the lightest named colours come to 2.2.
    #[test]
    fn named_colours_stand_out_from_white() {
        for colour in NAMED_COLOURS {
            assert!(1.05 / (luminance(colour) + 0.05) > 2.2, "{colour:?}");
        }
    }

    #[test]
    fn joints_differ_from_their_parents_and_weights_mix_them() {
        // A chain of eight, and three more children of its third.
        let parents: Vec<Option<usize>> =
            (0..11usize).map(|joint| if joint < 8 { joint.checked_sub(1) } else { Some(2) }).collect();
        let colours = joint_colours(&parents);
        for (joint, parent) in parents.iter().enumerate().filter_map(|(joint, parent)| Some((joint, (*parent)?))) {
            let [own, parent] = [joint, parent].map(|j| Vec3::from(colours[j].map(f32::from)));
            assert!(own.distance(parent) > 40.0, "joint {joint}: {own} {parent}");
        }
        let mut weights = vec![0.0; 2 * parents.len()];
        (weights[7], weights[11], weights[12]) = (1.0, 0.5, 0.5);
        let mixed = weight_colours(&weights, &colours).unwrap();
        assert_eq!(mixed[0], colours[7]);
        assert_eq!(mixed[1], srgb((linear(colours[0]) + linear(colours[1])) / 2.0));
        assert!(weight_colours(&weights[1..], &colours).is_err());
    }
}
