//! Where the ground is, and what touches it (METHOD-BODY section 5). Metres, Y up.

use glam::DVec3;

/// A vertex so near to the ground, or below it, touches it.
const NEAR: f64 = 0.005;
/// The ground is within so much of the lowest vertex.
const LOWEST: f64 = 0.02;

/// Whether a place is within 5 mm of the ground at a height, or below it.
pub fn is_in_contact(place: DVec3, ground: f64) -> bool {
    place.y < ground + NEAR
}

/// The height of the ground under feet that stand on it: of all slabs of 5 mm that begin within 2 cm of the lowest place, the mean of the one with the most
/// places. A sole is flat where it is pressed; noise alone would make the lowest place too low. None without places.
pub fn ground_under(places: &[DVec3]) -> Option<f64> {
    let mut heights: Vec<f64> = places.iter().map(|place| place.y).collect();
    heights.sort_by(f64::total_cmp);
    let beginnings = heights.partition_point(|height| *height <= heights[0] + LOWEST);
    let slab = |first: usize| &heights[first..heights.partition_point(|height| *height <= heights[first] + NEAR)];
    // Of slabs with as many places the lowest.
    let fullest = (0..beginnings).rev().map(slab).max_by_key(|slab| slab.len())?;
    Some(fullest.iter().sum::<f64>() / fullest.len() as f64)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    #[test]
    fn the_ground_is_where_the_sole_is_flat_and_not_at_the_lowest_of_noisy_vertices() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
        // A hundred vertices of a sole at 0.3 m, two hundred of the foot above.
        let places: Vec<DVec3> = (0..300)
            .map(|vertex| DVec3::new(0.0, 0.3 + 2e-3 * noise() + 5e-4 * f64::from((vertex - 100).max(0)), 0.0))
            .collect();
        let lowest = places.iter().map(|place| place.y).fold(f64::MAX, f64::min);
        let found = ground_under(&places).unwrap();
        assert!(lowest < 0.296 && (found - 0.3).abs() < 1.5e-3, "{lowest} {found}");
        assert_eq!(ground_under(&[]), None);
        assert!(is_in_contact(DVec3::Y * 0.304, 0.3) && is_in_contact(DVec3::ZERO, 0.3));
        assert!(!is_in_contact(DVec3::Y * 0.306, 0.3));
    }
}
