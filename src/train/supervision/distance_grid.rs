//! Signed distance to the canonical body, sampled on a grid and interpolated trilinearly: a prior that costs nothing to ask.

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use crate::mesh::SolidIndex;

/// Distance between nodes, metres.
const SPACING: f32 = 0.025;

/// How much of the distance to the body counts where something is worn.
const ORDER: f32 = 0.05;

/// A field of distances on a regular grid.
#[derive(Debug)]
pub struct DistanceGrid {
    low: Vec3,
    nodes: UVec3,
    values: Vec<f32>,
}

impl DistanceGrid {
    /// Samples the distance to `solid` in the box from `low` to `high`.
    pub fn new(solid: &SolidIndex, low: Vec3, high: Vec3) -> Self {
        let nodes = ((high - low) / SPACING).ceil().as_uvec3() + 2;
        let mut grid = Self { low, nodes, values: Vec::new() };
        let count = nodes.x * nodes.y * nodes.z;
        grid.values = (0..count).into_par_iter().map(|index| solid.signed_distance(grid.position(index)).0).collect();
        grid
    }

    /// Takes the nodes outside the body that something is worn near for as far as they are from that; of those in what is worn, the ones
    /// nearer to the body are still deeper.
    pub fn wear(&mut self, worn: impl Fn(Vec3) -> Option<f32> + Sync) {
        let positions: Vec<Vec3> = (0..self.values.len()).map(|index| self.position(index as u32)).collect();
        self.values.par_iter_mut().zip(positions).filter(|(value, _)| **value > 0.0).for_each(|(value, at)| {
            if let Some(distance) = worn(at) {
                *value = value.min(distance.max(0.0) + ORDER * *value);
            }
        });
    }

    /// The nodes whose distance is below `level`.
    pub fn nodes_below(&self, level: f32) -> Vec<Vec3> {
        let below = self.values.iter().enumerate().filter(|(_, value)| **value < level);
        below.map(|(index, _)| self.position(index as u32)).collect()
    }

    fn position(&self, index: u32) -> Vec3 {
        let UVec3 { x, y, .. } = self.nodes;
        self.low + SPACING * UVec3::new(index % x, index / x % y, index / x / y).as_vec3()
    }

    /// The distance at a point, negative inside; of the nearest place in the box for a point beyond it.
    pub fn at(&self, point: [f32; 3]) -> f32 {
        let last = (self.nodes - 2).as_vec3();
        let place = ((Vec3::from_array(point) - self.low) / SPACING).clamp(Vec3::ZERO, last);
        let cell = place.floor().as_uvec3();
        let share = place - cell.as_vec3();
        let value = |x: u32, y: u32, z: u32| {
            let node = cell + UVec3::new(x, y, z);
            self.values[(node.x + self.nodes.x * (node.y + self.nodes.y * node.z)) as usize]
        };
        let along = |from: f32, to: f32, share: f32| from + share * (to - from);
        let row = |y: u32, z: u32| along(value(0, y, z), value(1, y, z), share.x);
        let plane = |z: u32| along(row(0, z), row(1, z), share.y);
        along(plane(0), plane(1), share.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{ExtractionGrid, Sign, extract};

    #[test]
    fn interpolated_distances_are_close_to_exact_ones() {
        let field = |points: &[Vec3], values: &mut [f32]| {
            points.iter().zip(values).for_each(|(point, value)| *value = point.length() - 0.3);
        };
        let bounds = (Vec3::splat(-0.5), Vec3::splat(0.5));
        let grid = ExtractionGrid {
            minimum: bounds.0,
            maximum: bounds.1,
            resolution: 64,
            level: 0.0,
            inside_is: Sign::Negative,
        };
        let solid = SolidIndex::new(&extract(&field, grid).unwrap().mesh).unwrap();
        let distances = DistanceGrid::new(&solid, bounds.0, bounds.1);
        for step in 0..200 {
            let point = [0.002 * step as f32, 0.3 - 0.001 * step as f32, -0.1];
            let exact = Vec3::from_array(point).length() - 0.3;
            assert!((distances.at(point) - exact).abs() < 2e-3, "{point:?}");
        }
        assert!(distances.at([5.0, 0.0, 0.0]) > 0.1);
    }

    #[test]
    fn what_is_worn_brings_places_off_the_body_near_and_leaves_those_in_it() {
        let mut grid = DistanceGrid {
            low: Vec3::ZERO,
            nodes: UVec3::splat(2),
            values: vec![-0.1, 0.1, 0.2, 0.3, 0.1, 0.1, 0.1, 0.1],
        };
        grid.wear(|at| (at.z == 0.0).then_some(if at.y == 0.0 { 0.01 } else { -0.02 }));
        let expected = [-0.1, 0.015, 0.01, 0.015, 0.1, 0.1, 0.1, 0.1];
        assert!(
            grid.values.iter().zip(expected).all(|(value, wanted)| (value - wanted).abs() < 1e-6),
            "{:?}",
            grid.values
        );
    }
}
