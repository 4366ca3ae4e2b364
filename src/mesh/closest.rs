//! The closest point of a mesh's surface, exactly, through a bounding volume hierarchy.
//!
//! N query points; metres. Faces of no area are edges or points. 1 to 2 us a query near a body scan of 42,000 faces.

use glam::Vec3;
use rayon::prelude::*;

use super::TriangleMesh;
use super::hierarchy::{Contents, DEEPEST, Hierarchy, Triangle};
use super::surface::SurfacePoint;
use crate::Result;

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
    /// [`Error::Value`](crate::Error::Value) for a mesh without faces or one that [`TriangleMesh::check`] refuses.
    pub fn new(mesh: &TriangleMesh) -> Result<Self> {
        Ok(Self { hierarchy: Hierarchy::new(mesh)? })
    }

    /// The closest point of the surface.
    #[must_use]
    pub fn closest(&self, point: Vec3) -> ClosestPoint {
        self.closest_within(point, f32::INFINITY).unwrap_or_else(|| {
            // Only a point that is not finite, or whose squared distance is not, comes here.
            let Triangle { corner, face, .. } = self.hierarchy.triangles[0];
            ClosestPoint { face, barycentric: [1.0, 0.0, 0.0], position: corner, distance: point.distance(corner) }
        })
    }

    /// The closest point of the surface if it is nearer than `radius`; the smaller the radius, the faster.
    #[must_use]
    pub fn closest_within(&self, point: Vec3, radius: f32) -> Option<ClosestPoint> {
        let Hierarchy { nodes, triangles } = &self.hierarchy;
        let mut best = None;
        let mut nearest = radius * radius;
        let mut stack = [(0u32, 0f32); DEEPEST];
        let mut waiting = 0;
        let mut index = 0;
        loop {
            match nodes[index].contents(index) {
                Contents::Children(children) => {
                    let distances = children.map(|child| nodes[child].distance_squared(point));
                    let near = usize::from(distances[1] < distances[0]);
                    if distances[near] < nearest {
                        if distances[1 - near] < nearest {
                            stack[waiting] = (children[1 - near] as u32, distances[1 - near]);
                            waiting += 1;
                        }
                        index = children[near];
                        continue;
                    }
                }
                Contents::Leaf(range) => {
                    for triangle in &triangles[range] {
                        let [v, w] = closest_on_triangle(triangle, point);
                        let position = triangle.corner + triangle.sides[0] * v + triangle.sides[1] * w;
                        let distance = position.distance_squared(point);
                        if distance < nearest {
                            nearest = distance;
                            best = Some((triangle.face, v, w, position));
                        }
                    }
                }
            }
            index = loop {
                if waiting == 0 {
                    return best.map(|(face, v, w, position)| ClosestPoint {
                        face,
                        barycentric: [(1.0 - v - w).max(0.0), v, w],
                        position,
                        distance: nearest.sqrt(),
                    });
                }
                waiting -= 1;
                if stack[waiting].1 < nearest {
                    break stack[waiting].0 as usize;
                }
            };
        }
    }

    /// The closest points (N) of many points (N), in parallel.
    #[must_use]
    pub fn closest_to_each(&self, points: &[Vec3]) -> Vec<ClosestPoint> {
        points.par_iter().map(|&point| self.closest(point)).collect()
    }
}

/// The weights of a triangle's second and third corner at its point closest to `point` (Ericson 2005, ch. 5.1.5).
fn closest_on_triangle(triangle: &Triangle, point: Vec3) -> [f32; 2] {
    let [ab, ac] = triangle.sides;
    let ap = point - triangle.corner;
    if triangle.is_sliver {
        return closest_on_sides(triangle.sides, ap);
    }
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [0.0, 0.0];
    }
    let bp = ap - ab;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [1.0, 0.0];
    }
    let cp = ap - ac;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 1.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return [ratio(d1, d1 - d3), 0.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return [0.0, ratio(d2, d2 - d6)];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = ratio(d4 - d3, (d4 - d3) + (d5 - d6));
        return [1.0 - w, w];
    }
    let sum = va + vb + vc;
    [ratio(vb, sum), ratio(vc, sum)]
}

/// The same on the three sides alone; `ap` leads from the first corner to the point.
fn closest_on_sides([ab, ac]: [Vec3; 2], ap: Vec3) -> [f32; 2] {
    let along = |from: Vec3, side: Vec3| ratio((ap - from).dot(side), side.length_squared());
    let on_bc = along(ab, ac - ab);
    let candidates = [[along(Vec3::ZERO, ab), 0.0], [0.0, along(Vec3::ZERO, ac)], [1.0 - on_bc, on_bc]];
    let distance = |[v, w]: [f32; 2]| (ab * v + ac * w).distance_squared(ap);
    candidates.into_iter().fold(candidates[0], |best, next| if distance(next) < distance(best) { next } else { best })
}

/// part / whole in [0, 1]; 0 of nothing.
fn ratio(part: f32, whole: f32) -> f32 {
    if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::testing::{bumpy_sphere, random_points};
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
