//! How far canonical places are from what is worn off the body, as most frames see it.
//!
//! Of a point's roots, the one that frames agree on is where most of them show something: hair that lies on the back in one frame has a
//! root behind the back too, where all the other frames show nothing.

use glam::Vec3;
use rayon::prelude::*;

use super::volume::BAND;
use super::{Places, Row, View};
use crate::fields::CanonicalGrid;

/// The subject is at a place if its surface is no farther than this, metres.
pub(super) const THERE: f32 = 0.025;
/// What is worn is farther from the body than this, and farther by this than from the scan, metres.
const CLEAR: f32 = 0.02;
/// Share of the frames in which a place has to be off the body for anything to be said of it.
pub(super) const FEWEST_OFF_BODY: f32 = 0.4;

/// Distances to what is worn, on a grid of canonical places (R).
pub struct Worn {
    grid: CanonicalGrid,
    distances: Vec<f32>,
}

impl Worn {
    /// The distances at the places of a grid that go with `rows` (R).
    pub(super) fn new(grid: CanonicalGrid, rows: &[Row], views: &[View], places: &Places) -> Self {
        let to_body = grid.distances();
        let distance = |place: usize| {
            let is_asked = places.may_move[place] && to_body[place] > THERE;
            if is_asked { median_distance(place, &rows[place], views) } else { BAND }
        };
        let distances = (0..rows.len()).into_par_iter().with_min_len(256).map(distance).collect();
        Self { grid, distances }
    }

    /// The grid of the places.
    pub(super) fn grid(&self) -> &CanonicalGrid {
        &self.grid
    }

    /// Those at the places, metres; as far as distances are known where nothing is worn.
    pub(super) fn distances(&self) -> &[f32] {
        &self.distances
    }

    /// The distance at a canonical point, metres; none where nothing is worn near it.
    pub fn at(&self, point: Vec3) -> Option<f32> {
        let distance = self.grid.interpolated(&self.distances, point);
        (distance < THERE).then_some(distance)
    }
}

/// The median distance to what is worn at a place, metres, of the frames in which it is off the body.
fn median_distance(place: usize, row: &Row, views: &[View]) -> f32 {
    let fewest = FEWEST_OFF_BODY * views.len() as f32;
    let seen: Vec<f32> = views.iter().map(|view| view.distance(place, row)).collect();
    if (seen.iter().filter(|distance| **distance < THERE).count() as f32) < fewest {
        return BAND;
    }
    let of_view = |(view, distance): (&View, f32)| {
        let is_worn = view.is_worn(view.blended(place, row), distance)?;
        Some(if is_worn { distance } else { BAND })
    };
    let mut worn: Vec<f32> = views.iter().zip(seen).filter_map(of_view).collect();
    worn.sort_by(f32::total_cmp);
    if worn.len() as f32 >= fewest { worn[worn.len() / 2] } else { BAND }
}

impl View<'_> {
    /// Whether something worn is at a point so far from the scan; none if the point is in the registered body or near it.
    pub(super) fn is_worn(&self, point: Vec3, distance: f32) -> Option<bool> {
        let nearest = self.body.surface().closest_within(point, THERE + CLEAR);
        let from_body = nearest.map_or(f32::INFINITY, |nearest| nearest.distance);
        let is_off_body = from_body > CLEAR && !self.body.is_inside(point);
        is_off_body.then_some(distance < THERE && distance < from_body - CLEAR)
    }
}

/// How far beside the block the third bone finds it, metres.
#[cfg(test)]
pub(super) const BESIDE: Vec3 = Vec3::new(0.0, 3.0, 0.0);

/// Frames in which a block far from the body goes with the second of three bones, and with the third [`BESIDE`] it; the first rests.
#[cfg(test)]
pub(super) fn views<'a>(places: &[Vec3], body: &'a crate::mesh::SolidIndex) -> Vec<View<'a>> {
    use super::volume::{DistanceVolume, cuboid};
    let view = |number: usize| {
        let step = Vec3::new(0.0, 0.0, 0.1 * number as f32);
        let mut mesh = cuboid();
        mesh.vertices.iter_mut().for_each(|vertex| *vertex += step + Vec3::Z);
        let volume = DistanceVolume::new(&mesh, &crate::mesh::SolidIndex::new(&mesh).unwrap());
        let bones = [Vec3::ZERO, step, step - BESIDE].map(|translation| (glam::Mat3::IDENTITY, translation)).to_vec();
        View { volume, body, bones, places: places.to_vec() }
    };
    (0..5).map(view).collect()
}

#[cfg(test)]
mod tests {
    use super::super::volume::cuboid;
    use super::*;
    use crate::mesh::SolidIndex;

    #[test]
    fn what_is_worn_is_where_most_frames_show_it() {
        let body = SolidIndex::new(&cuboid()).unwrap();
        let on_block = Vec3::new(0.3, 0.0, 1.0);
        let distance = |bone: usize| median_distance(0, &vec![(bone, 1.0)], &views(&[on_block], &body));
        assert!(distance(1) < THERE, "{}", distance(1));
        assert_eq!(distance(0), BAND, "one frame of five shows it there");
    }

    #[test]
    fn places_in_or_near_the_body_tell_nothing() {
        let body = SolidIndex::new(&cuboid()).unwrap();
        let view = &views(&[Vec3::ZERO], &body)[0];
        let off = |point: Vec3, distance: f32| view.is_worn(point, distance);
        let edge = cuboid().vertices.iter().map(|vertex| vertex.x).fold(0.0, f32::max);
        assert_eq!(off(Vec3::ZERO, -0.1), None);
        assert_eq!(off(Vec3::new(edge + 0.01, 0.0, 0.0), 0.0), None);
        assert_eq!(off(Vec3::new(edge + 0.03, 0.0, 0.0), 0.0), Some(true), "a coat");
        assert_eq!(
            off(Vec3::new(edge + 0.03, 0.0, 0.0), 0.02),
            Some(false),
            "a shirt: the body's own surface is as near"
        );
        assert_eq!(off(Vec3::new(edge + 0.3, 0.0, 0.0), 0.03), Some(false), "nothing is there");
    }
}
