//! Z-order curve through a box: points that are near each other along it are near each other in space, so that what one reads
//! is still in the cache for the next.

use glam::Vec3;

/// Cells along the longest side of the box.
const CELLS: f32 = 1023.0;

pub(in crate::train) struct Curve {
    low: Vec3,
    scale: f32,
}

impl Curve {
    /// The curve through the box from its lowest to its highest corner, metres.
    pub fn over((low, high): (Vec3, Vec3)) -> Self {
        Self { low, scale: CELLS / (high - low).max_element() }
    }

    /// How far along the curve a point is; of the nearest cell for one beyond the box.
    pub fn place(&self, point: Vec3) -> u32 {
        let cell = ((point - self.low) * self.scale).clamp(Vec3::ZERO, Vec3::splat(CELLS)).as_uvec3();
        spread_bits(cell.x) | spread_bits(cell.y) << 1 | spread_bits(cell.z) << 2
    }
}

/// Moves the lowest ten bits of a number to every third place.
fn spread_bits(number: u32) -> u32 {
    let mut bits = number & 0x3ff;
    for (shift, mask) in [(16, 0x0300_00ff), (8, 0x0300_f00f), (4, 0x030c_30c3), (2, 0x0924_9249)] {
        bits = (bits | bits << shift) & mask;
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;

    // The place's bits, from the highest, choose an octant of the box, an octant of that, and so on.
    #[test]
    fn octants_follow_each_other() {
        let curve = Curve::over((Vec3::ZERO, Vec3::ONE));
        let place = |x: f32, y: f32, z: f32| curve.place(Vec3::new(x, y, z));
        let octants = [place(0.1, 0.1, 0.1), place(0.9, 0.1, 0.1), place(0.1, 0.9, 0.1), place(0.1, 0.1, 0.9)];
        assert!(octants.is_sorted(), "{octants:?}");
        assert!(place(0.4, 0.4, 0.4) < place(0.6, 0.1, 0.1));
        assert_eq!(place(-3.0, 0.0, 0.0), place(0.0, 0.0, 0.0));
        assert_eq!(place(1.0, 1.0, 1.0), (1 << 30) - 1);
    }
}
