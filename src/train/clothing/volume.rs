//! Signed distance to a scan on a regular grid: exact near the surface, its side alone farther away. Many look-ups for the price of
//! one query each near the surface.

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use crate::mesh::{SolidIndex, TriangleMesh};

/// Distance between nodes, metres.
const SPACING: f32 = 0.015;
/// Distances are exact up to here, metres; several nodes, so that no row steps over the surface unseen.
pub(super) const BAND: f32 = 0.045;

/// Distances around one scan, between -[`BAND`] and [`BAND`].
pub(super) struct DistanceVolume {
    low: Vec3,
    counts: UVec3,
    values: Vec<f32>,
}

impl DistanceVolume {
    /// The distances to a mesh, whose solid this is.
    pub fn new(mesh: &TriangleMesh, solid: &SolidIndex) -> Self {
        let corner = |fold: fn(Vec3, Vec3) -> Vec3| mesh.vertices.iter().copied().reduce(fold).unwrap_or_default();
        let room = BAND + 2.0 * SPACING;
        let (low, high) = (corner(Vec3::min) - room, corner(Vec3::max) + room);
        let counts = ((high - low) / SPACING).ceil().as_uvec3() + 1;
        let mut volume = Self { low, counts, values: vec![BAND; counts.as_usizevec3().element_product()] };
        let is_near = volume.near(mesh);
        let row = counts.x as usize;
        let mut values = std::mem::take(&mut volume.values);
        values.par_chunks_mut(row).enumerate().for_each(|(number, values)| {
            // A row begins outside; beyond the band the side is that of the node before.
            let mut side = BAND;
            for (place, value) in values.iter_mut().enumerate() {
                let node = number * row + place;
                if is_near[node]
                    && let Some(distance) = solid.signed_distance_within(volume.position(node), BAND)
                {
                    *value = distance;
                    side = BAND.copysign(distance);
                } else {
                    *value = side;
                }
            }
        });
        volume.values = values;
        volume
    }

    fn position(&self, node: usize) -> Vec3 {
        let (x, y) = (self.counts.x as usize, self.counts.y as usize);
        self.low + SPACING * Vec3::new((node % x) as f32, (node / x % y) as f32, (node / (x * y)) as f32)
    }

    /// Whether each node may be within the band: it is in the box around a face, widened by the band.
    fn near(&self, mesh: &TriangleMesh) -> Vec<bool> {
        let mut is_near = vec![false; self.values.len()];
        for face in &mesh.faces {
            let corners = face.map(|vertex| mesh.vertices[vertex as usize]);
            let (low, high) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
            let first = ((low - BAND - self.low) / SPACING).ceil().max(Vec3::ZERO).as_uvec3();
            let last = ((high + BAND - self.low) / SPACING).floor().as_uvec3().min(self.counts - 1);
            for z in first.z..=last.z {
                for y in first.y..=last.y {
                    let row = (self.counts.x * (y + self.counts.y * z)) as usize;
                    is_near[row + first.x as usize..=row + last.x as usize].fill(true);
                }
            }
        }
        is_near
    }

    /// The distance at a point, and its gradient: zero where the distance is not exact.
    pub fn at(&self, point: Vec3) -> (f32, Vec3) {
        let place = (point - self.low) / SPACING;
        let last = (self.counts - 2).as_vec3();
        if !(place.cmpge(Vec3::ZERO).all() && place.cmplt(last + 1.0).all()) {
            return (BAND, Vec3::ZERO);
        }
        let cell = place.floor();
        let share = place - cell;
        let cell = cell.as_uvec3();
        let value = |x: u32, y: u32, z: u32| {
            self.values[(cell.x + x + self.counts.x * (cell.y + y + self.counts.y * (cell.z + z))) as usize]
        };
        let along = |from: f32, to: f32, share: f32| from + share * (to - from);
        let rows = [[0, 1], [2, 3]].map(|pair: [u32; 2]| {
            pair.map(|row| {
                let (a, b) = (value(0, row % 2, row / 2), value(1, row % 2, row / 2));
                (along(a, b, share.x), b - a)
            })
        });
        let planes = rows.map(|[a, b]| (along(a.0, b.0, share.y), along(a.1, b.1, share.y), b.0 - a.0));
        let [a, b] = planes;
        let gradient = Vec3::new(along(a.1, b.1, share.z), along(a.2, b.2, share.z), b.0 - a.0);
        (along(a.0, b.0, share.z), gradient / SPACING)
    }
}

/// A box of half extents 20, 10 and 15 cm around (0.1, 0, 0).
/// A block from (-0.1, -0.1, -0.15) to (0.3, 0.1, 0.15).
#[cfg(test)]
pub(super) fn cuboid() -> TriangleMesh {
    let corner = |index: u32| {
        let sign = |bit: u32| if index >> bit & 1 == 1 { 1.0 } else { -1.0 };
        Vec3::new(0.1 + 0.2 * sign(0), 0.1 * sign(1), 0.15 * sign(2))
    };
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    TriangleMesh {
        vertices: (0..8).map(corner).collect(),
        faces: quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect(),
        ..TriangleMesh::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_the_surfaces_and_sides_are_right_deep_inside() {
        let mesh = cuboid();
        let solid = SolidIndex::new(&mesh).unwrap();
        let volume = DistanceVolume::new(&mesh, &solid);
        let (distance, gradient) = volume.at(Vec3::new(0.1, 0.12, 0.0));
        assert!((distance - 0.02).abs() < 1e-4 && (gradient - Vec3::Y).length() < 1e-3, "{distance} {gradient}");
        let (distance, gradient) = volume.at(Vec3::new(-0.08, 0.02, 0.03));
        assert!((distance + 0.02).abs() < 1e-4 && (gradient + Vec3::X).length() < 1e-3, "{distance} {gradient}");
        assert_eq!(volume.at(Vec3::new(0.1, 0.0, 0.0)), (-BAND, Vec3::ZERO), "deep inside");
        assert_eq!(volume.at(Vec3::new(0.1, 1.0, 0.0)), (BAND, Vec3::ZERO), "far outside");
    }

    // The gradient is the exact derivative of the look-up within a cell.
    #[test]
    fn gradients_match_finite_differences() {
        let mesh = cuboid();
        let volume = DistanceVolume::new(&mesh, &SolidIndex::new(&mesh).unwrap());
        let point = Vec3::new(0.283, 0.108, 0.141);
        let (_, gradient) = volume.at(point);
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            let step = 1e-4;
            let slope = (volume.at(point + step * axis).0 - volume.at(point - step * axis).0) / (2.0 * step);
            assert!((slope - gradient.dot(axis)).abs() < 2e-3, "{slope} {gradient}");
        }
    }
}
