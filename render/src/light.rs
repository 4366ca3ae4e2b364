//! The light: a key, a fill and a soft ambient; and sRGB.
//!
//! Lights are fixed to the camera, so a turntable keeps its look. Light adds up linearly; pictures and colours are sRGB.

use std::sync::LazyLock;

use glam::Vec3;

/// Towards the key light (from the upper left, in front of the subject), camera space, and its strength.
const KEY: (Vec3, f32) = (Vec3::new(-0.56, -0.62, -0.55), 0.92);
/// Towards the fill light (from the right), and its strength.
const FILL: (Vec3, f32) = (Vec3::new(0.86, -0.05, -0.51), 0.16);
/// How far lamps reach around a limb: 0 is Lambert's point light, 0.5 leaves only the opposite point dark.
const WRAP: f32 = 0.25;
/// Share of a lamp's light that a point which sees nothing of the sky loses: lamps are near and large, not the whole sky.
const LAMP_OCCLUSION: f32 = 0.7;
/// Ambient light from below and from above.
const AMBIENT: [f32; 2] = [0.08, 0.24];

/// What lights a scene, fixed to the camera: x right, y down, z away from it. The default is a studio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Towards the key light.
    pub towards: Vec3,
    /// Of the key light: what a white surface that faces it sends to the camera.
    pub strength: f32,
    /// Of the ambient light, of the studio's.
    pub ambient: f32,
    /// Red, green and blue of all light, linear; white is 1.
    pub tint: Vec3,
}

impl Default for Light {
    fn default() -> Self {
        Self { towards: KEY.0, strength: KEY.1, ambient: 1.0, tint: Vec3::ONE }
    }
}

/// Light that a white surface with this unit normal (camera space) sends to the camera; `openness` is the share of the sky that
/// it sees, 0 to 1.
pub(super) fn illumination(light: &Light, normal: Vec3, openness: f32) -> f32 {
    let sky = 0.5 - 0.5 * normal.y;
    let ambient = light.ambient * (AMBIENT[0] + sky * (AMBIENT[1] - AMBIENT[0]));
    // Lambert's law softened: a large lamp still lights what is turned away from its centre.
    let lamp = |(direction, strength): (Vec3, f32)| {
        let facing = (WRAP + (1.0 - WRAP) * normal.dot(direction)).max(0.0);
        strength * facing * facing.sqrt()
    };
    ambient * openness + (lamp((light.towards, light.strength)) + lamp(FILL)) * softly_open(openness, LAMP_OCCLUSION)
}

/// What is left of a light that loses the share `strength` where nothing of the sky is seen.
pub(super) fn softly_open(openness: f32, strength: f32) -> f32 {
    1.0 - strength * (1.0 - openness)
}

/// The linear intensity of an sRGB value, both in [0, 1].
pub(super) fn decode_srgb(value: f32) -> f32 {
    /// Steps of the table: colours are bytes, interpolated.
    const STEPS: f32 = 1023.0;
    static TABLE: LazyLock<Vec<f32>> = LazyLock::new(|| {
        (0..=STEPS as u32)
            .map(|step| {
                let value = step as f32 / STEPS;
                if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
            })
            .collect()
    });
    let place = value.clamp(0.0, 1.0) * STEPS;
    let first = (place as usize).min(STEPS as usize - 1);
    TABLE[first] + (TABLE[first + 1] - TABLE[first]) * (place - first as f32)
}

/// The sRGB byte of a linear intensity; brighter than white is white.
pub(super) fn encode_srgb(intensity: f32) -> u8 {
    /// Steps of the table over the square root of the intensity, in which sRGB is nearly linear.
    const STEPS: usize = 4096;
    const LAST: f32 = (STEPS - 1) as f32;
    static TABLE: LazyLock<[u8; STEPS]> = LazyLock::new(|| {
        std::array::from_fn(|step| {
            let value = (step as f32 / LAST).powi(2);
            let encoded = if value <= 0.0031308 { value * 12.92 } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 };
            (encoded * 255.0).round() as u8
        })
    });
    TABLE[(intensity.clamp(0.0, 1.0).sqrt() * LAST + 0.5) as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_survive_the_way_through_linear_light() {
        for byte in 0..=255 {
            assert_eq!(encode_srgb(decode_srgb(f32::from(byte) / 255.0)), byte);
        }
        assert_eq!([encode_srgb(-1.0), encode_srgb(f32::NAN), encode_srgb(7.0)], [0, 0, 255]);
    }
}
