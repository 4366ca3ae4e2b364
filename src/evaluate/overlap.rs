//! Intersection over union: exactly for bounding boxes, by uniform points for the volumes inside them.
//!
//! Axis-aligned boxes; metres and cubic metres, summed in f64.

use std::ops::Add;

use glam::Vec3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BoundingBox {
    minimum: Vec3,
    maximum: Vec3,
}

/// Volumes that two bodies share and cover together, cubic metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Overlap {
    pub intersection: f64,
    pub union: f64,
}

impl BoundingBox {
    /// The smallest box around the points; none without points.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Option<Self> {
        let point = |minimum| Self { minimum, maximum: minimum };
        points.into_iter().map(point).reduce(Self::joined)
    }

    /// The smallest box around both.
    pub fn joined(self, other: Self) -> Self {
        Self { minimum: self.minimum.min(other.minimum), maximum: self.maximum.max(other.maximum) }
    }

    fn volume(self) -> f64 {
        (self.maximum - self.minimum).max(Vec3::ZERO).as_dvec3().element_product()
    }

    /// What two boxes share.
    pub fn overlap(self, other: Self) -> Overlap {
        let shared = Self { minimum: self.minimum.max(other.minimum), maximum: self.maximum.min(other.maximum) };
        let intersection = shared.volume();
        Overlap { intersection, union: self.volume() + other.volume() - intersection }
    }

    /// What two bodies share within this box, estimated from `samples` points; `inside` says which of the two hold a point.
    pub fn sampled_overlap(
        self,
        samples: usize,
        random: &mut ChaCha8Rng,
        inside: impl Fn(Vec3) -> [bool; 2] + Sync,
    ) -> Overlap {
        let extent = self.maximum - self.minimum;
        let points: Vec<Vec3> =
            (0..samples).map(|_| self.minimum + extent * Vec3::from_array(random.random())).collect();
        let hits = |point: &Vec3| inside(*point).map(usize::from);
        let counts = points.par_iter().map(hits).map(|[a, b]| [a & b, a | b]);
        let [both, any] = counts.reduce(|| [0; 2], |[a, b], [c, d]| [a + c, b + d]);
        let volume = self.volume() / samples as f64;
        Overlap { intersection: both as f64 * volume, union: any as f64 * volume }
    }
}

impl Overlap {
    /// Intersection over union; none where there is no volume at all.
    pub fn ratio(self) -> Option<f64> {
        (self.union > 0.0).then(|| self.intersection / self.union)
    }
}

impl Add for Overlap {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { intersection: self.intersection + other.intersection, union: self.union + other.union }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    fn cube(minimum: f32, maximum: f32) -> BoundingBox {
        BoundingBox::around([Vec3::splat(maximum), Vec3::splat(minimum)]).unwrap()
    }

    #[test]
    fn boxes_overlap_by_their_volumes() {
        let ratio = |a: BoundingBox, b: BoundingBox| a.overlap(b).ratio();
        assert_eq!(ratio(cube(0.0, 2.0), cube(1.0, 3.0)), Some(1.0 / 15.0));
        assert_eq!(ratio(cube(0.0, 2.0), cube(0.0, 2.0)), Some(1.0));
        assert_eq!(ratio(cube(0.0, 1.0), cube(2.0, 3.0)), Some(0.0), "boxes apart on all axes share nothing");
        assert_eq!(ratio(cube(1.0, 1.0), cube(1.0, 1.0)), None, "no volume, no score");
        assert_eq!(BoundingBox::around([]), None);
    }

    #[test]
    fn sampled_volumes_are_those_of_the_bodies() {
        let ball = |point: Vec3, x: f32| (point - Vec3::X * x).length() < 1.0;
        let bounds = cube(-1.5, 1.5);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let overlap = bounds.sampled_overlap(100_000, &mut random, |point| [ball(point, -0.25), ball(point, 0.25)]);
        // Two unit balls at distance d share pi (4 + d) (2 - d)^2 / 12.
        let shared = std::f64::consts::PI * 4.5 * 1.5 * 1.5 / 12.0;
        let together = 8.0 / 3.0 * std::f64::consts::PI - shared;
        assert!((overlap.intersection / shared - 1.0).abs() < 0.03, "{overlap:?}, expected {shared}");
        assert!((overlap.union / together - 1.0).abs() < 0.03, "{overlap:?}, expected {together}");
    }
}
