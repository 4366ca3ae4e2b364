//! The closest point of a mesh's surface, exactly, through a bounding volume hierarchy.
//!
//! N query points; metres. Faces of no area are edges or points.

use glam::Vec3;
use rayon::prelude::*;
use smallvec::{SmallVec, smallvec};
use xavatar_vector::vectorised;

use super::TriangleMesh;
use super::hierarchy::{Child, Hierarchy, LANES, Lanes, Packet, of_lane};
use super::surface::SurfacePoint;
use xavatar_formats::Result;

/// A place on the surface, and how far it is from the point that was asked about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// The face it lies on.
    pub face: u32,
    /// Weights of the face's three vertices, at least 0, of sum 1.
    pub barycentric: [f32; 3],
    /// The place, metres.
    pub position: Vec3,
    /// From the query point, metres; NaN or infinite if that was.
    pub distance: f32,
}

impl ClosestPoint {
    /// The place as face and weights, for normals and colours.
    #[must_use]
    pub fn surface_point(&self) -> SurfacePoint {
        SurfacePoint { face: self.face, barycentric: self.barycentric }
    }
}

/// A mesh's surface, prepared for closest-point queries. Independent of the mesh once built.
pub struct SurfaceIndex {
    pub(super) hierarchy: Hierarchy,
}

impl SurfaceIndex {
    /// Prepares a mesh; about 1 us a face.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) for a mesh without faces or one that [`TriangleMesh::check`] refuses.
    pub fn new(mesh: &TriangleMesh) -> Result<Self> {
        Ok(Self { hierarchy: Hierarchy::new(mesh)? })
    }

    /// The closest point of the surface.
    #[must_use]
    pub fn closest(&self, point: Vec3) -> ClosestPoint {
        self.closest_within(point, f32::INFINITY).unwrap_or_else(|| {
            // Only a point that is not finite, or whose squared distance is not, comes here.
            let Packet { corner, faces, .. } = &self.hierarchy.packets[0];
            let position = of_lane(corner, 0);
            ClosestPoint { face: faces[0], barycentric: [1.0, 0.0, 0.0], position, distance: point.distance(position) }
        })
    }

    /// The closest point of the surface if it is nearer than `radius`; the smaller the radius, the faster.
    #[must_use]
    pub fn closest_within(&self, point: Vec3, radius: f32) -> Option<ClosestPoint> {
        vectorised(
            #[inline(always)]
            || self.nearest_within(point, radius),
        )
    }

    #[inline(always)]
    fn nearest_within(&self, point: Vec3, radius: f32) -> Option<ClosestPoint> {
        if !point.is_finite() {
            return None;
        }
        let Hierarchy { nodes, packets } = &self.hierarchy;
        let mut nearest = radius * radius;
        let mut best = None;
        // The nearest box on top.
        let mut waiting: SmallVec<[(f32, Child); 64]> = smallvec![(0.0, Child::Node(0))];
        while let Some((distance, child)) = waiting.pop() {
            if distance >= nearest {
                continue;
            }
            match child {
                Child::Nothing => {}
                Child::Node(index) => {
                    let node = &nodes[index as usize];
                    let distances = node.distances_squared(point);
                    let first = waiting.len();
                    for lane in lanes_below(&distances, nearest) {
                        let mut place = waiting.len();
                        waiting.push((distances[lane], node.children[lane]));
                        while place > first && waiting[place - 1].0 < distances[lane] {
                            waiting.swap(place - 1, place);
                            place -= 1;
                        }
                    }
                }
                Child::Packet(index) => {
                    let packet = &packets[index as usize];
                    let closest = closest_of_each(packet, point);
                    for lane in lanes_below(&closest.distances_squared, nearest) {
                        if closest.distances_squared[lane] < nearest {
                            nearest = closest.distances_squared[lane];
                            best = Some((packet, lane, closest.weights[0][lane], closest.weights[1][lane]));
                        }
                    }
                }
            }
        }
        best.map(|(packet, lane, v, w)| {
            let [ab, ac] = [&packet.sides[0], &packet.sides[1]].map(|side| of_lane(side, lane));
            ClosestPoint {
                face: packet.faces[lane],
                barycentric: [(1.0 - v - w).max(0.0), v, w],
                position: of_lane(&packet.corner, lane) + ab * v + ac * w,
                distance: nearest.sqrt(),
            }
        })
    }

    /// The closest points (N) of many points (N), in parallel.
    #[must_use]
    pub fn closest_to_each(&self, points: &[Vec3]) -> Vec<ClosestPoint> {
        points.par_iter().map(|&point| self.closest(point)).collect()
    }
}

/// The closest point of each triangle of a packet.
struct ClosestOfEach {
    /// Barycentric weights of the second and the third corner.
    weights: [Lanes; 2],
    distances_squared: Lanes,
}

/// The nearest of four places: the closest of each side, and the projection to the plane if that is in the triangle.
#[inline(always)]
fn closest_of_each(packet: &Packet, point: Vec3) -> ClosestOfEach {
    /// Height over longest side below which rounding would decide on which side of an edge a point is.
    const SLIMMEST: f32 = 1e-3;
    let Packet { corner, sides: [ab, ac], .. } = packet;
    let mut result = ClosestOfEach { weights: [[0.0; LANES]; 2], distances_squared: [0.0; LANES] };
    for lane in 0..LANES {
        let (ab, ac, ap) = (of_lane(ab, lane), of_lane(ac, lane), point - of_lane(corner, lane));
        let [(on_ab, of_ab), (on_ac, of_ac), (on_bc, of_bc)] = [along(ap, ab), along(ap, ac), along(ap - ab, ac - ab)];
        let normal = ab.cross(ac);
        let of_normal = normal.length_squared();
        let longest = larger(larger(of_ab, of_ac), of_bc);
        let [v, w] = [normal.dot(ap.cross(ac)) / of_normal, normal.dot(ab.cross(ap)) / of_normal];
        let is_sliver = of_normal <= SLIMMEST * SLIMMEST * longest * longest;
        let on_plane = if !is_sliver && v > 0.0 && w > 0.0 && v + w < 1.0 { [v, w] } else { [0.0; 2] };
        let mut best = ([0.0; 2], f32::INFINITY);
        for weights in [on_plane, [on_ab, 0.0], [0.0, on_ac], [1.0 - on_bc, on_bc]] {
            let distance = (ab * weights[0] + ac * weights[1] - ap).length_squared();
            best = if distance < best.1 { (weights, distance) } else { best };
        }
        let (weights, distance) = best;
        result.weights[0][lane] = weights[0];
        result.weights[1][lane] = weights[1];
        result.distances_squared[lane] = distance;
    }
    result
}

/// Where along a side, in [0, 1], the place closest to the point at `way` from its start is; and the side's squared length.
#[inline(always)]
fn along(way: Vec3, side: Vec3) -> (f32, f32) {
    let square = side.length_squared();
    let share = way.dot(side) / square;
    // Comparisons: `clamp` would look for NaN, which a side without length becomes 0 by.
    let share = if share > 0.0 { share } else { 0.0 };
    (if share < 1.0 { share } else { 1.0 }, square)
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The lanes whose number is below a bound, one after the other.
#[inline(always)]
fn lanes_below(numbers: &Lanes, bound: f32) -> impl Iterator<Item = usize> {
    let mut below = 0_u32;
    for (lane, number) in numbers.iter().enumerate() {
        below |= u32::from(*number < bound) << lane;
    }
    std::iter::from_fn(move || {
        let lane = below.trailing_zeros();
        below &= below.wrapping_sub(1);
        (lane < u32::BITS).then_some(lane as usize)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{bumpy_sphere, random_points};
    use glam::DVec3;
    use proptest::prelude::*;

    /// In f64, without cases: the projection if it is inside, else the best of the three sides.
    fn reference_distance(corners: [Vec3; 3], point: Vec3) -> f64 {
        let [a, b, c] = corners.map(|v| v.as_dvec3());
        let p = point.as_dvec3();
        let to_side = |a: DVec3, b: DVec3| {
            let along = if a == b { 0.0 } else { ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0) };
            p.distance(a + (b - a) * along)
        };
        let normal = (b - a).cross(c - a);
        let on_inner_side = |a: DVec3, b: DVec3| normal.cross(b - a).dot(p - a) >= 0.0;
        let is_above = normal != DVec3::ZERO && on_inner_side(a, b) && on_inner_side(b, c) && on_inner_side(c, a);
        let to_plane = if is_above { (p - a).dot(normal).abs() / normal.length() } else { f64::INFINITY };
        to_side(a, b).min(to_side(b, c)).min(to_side(c, a)).min(to_plane)
    }

    #[test]
    fn hierarchy_and_exhaustive_search_agree() {
        let mesh = bumpy_sphere(24);
        let index = SurfaceIndex::new(&mesh).unwrap();
        for point in random_points(300, 1.5, 7) {
            let found = index.closest(point);
            let exact = (0..mesh.faces.len() as u32)
                .map(|f| reference_distance(mesh.corners(f), point))
                .fold(f64::INFINITY, f64::min);
            assert!((f64::from(found.distance) - exact).abs() < 1e-6);
            assert!((found.position.distance(point) - found.distance).abs() < 1e-6);
            assert!(mesh.position_at(&found.surface_point()).distance(found.position) < 1e-6);
            assert!((found.barycentric.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn a_radius_bounds_the_search_without_changing_it() {
        let index = SurfaceIndex::new(&bumpy_sphere(24)).unwrap();
        for point in random_points(200, 1.2, 3) {
            let free = index.closest(point);
            assert_eq!(index.closest_within(point, free.distance * 1.001 + 1e-6), Some(free));
            assert_eq!(index.closest_within(point, free.distance * 0.999), None);
        }
    }

    #[test]
    fn many_points_at_once_are_the_same_as_one_by_one() {
        let index = SurfaceIndex::new(&bumpy_sphere(16)).unwrap();
        let points = random_points(500, 1.5, 5);
        let each: Vec<ClosestPoint> = points.iter().map(|&p| index.closest(p)).collect();
        assert_eq!(index.closest_to_each(&points), each);
    }

    #[test]
    fn points_that_are_not_finite_are_far_from_everything() {
        let index = SurfaceIndex::new(&bumpy_sphere(8)).unwrap();
        assert!(index.closest(Vec3::NAN).distance.is_nan());
        assert_eq!(index.closest(Vec3::INFINITY).distance, f32::INFINITY);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(4096) })]

        // Coordinates on a coarse grid make many triangles without area.
        #[test]
        fn any_triangle_is_as_far_as_in_double_precision(grid in proptest::array::uniform12(-2i8..=2), shift in 0f32..0.01) {
            let [ax, ay, az, bx, by, bz, cx, cy, cz, px, py, pz] = grid.map(f32::from);
            let corners = [Vec3::new(ax, ay, az), Vec3::new(bx, by, bz), Vec3::new(cx, cy, cz)];
            let point = Vec3::new(px, py, pz) + shift;
            let mesh = TriangleMesh { vertices: corners.to_vec(), faces: vec![[0, 1, 2]], ..TriangleMesh::default() };
            let found = SurfaceIndex::new(&mesh).unwrap().closest(point);
            let exact = reference_distance(corners, point);
            prop_assert!((f64::from(found.distance) - exact).abs() < 1e-5, "{} {exact}", found.distance);
        }
    }
}
