//! Inside or outside, for scans with small holes: the generalised winding number (Jacobson et al. 2013), with distant
//! groups of faces as dipoles (Barill et al. 2018).
//!
//! w(q) = sum over faces of their solid angle / 4 pi: 1 inside and 0 outside of a closed mesh, smooth across its holes.
//! Inside is w > 1/2. The dipoles change w by 0.006 typically, 0.08 at worst (measured): never the side of a point off the surface of a
//! closed mesh. An inside-out mesh has no inside.

use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;

use super::TriangleMesh;
use super::closest::{ClosestPoint, SurfaceIndex};
use super::hierarchy::{Contents, DEEPEST, Hierarchy, Triangle};
use crate::Result;

/// A group of faces is a dipole from this many radii on (Barill et al. use 2: half the error, half as fast).
const FAR: f32 = 1.5;

/// A mesh's solid, prepared for inside tests and signed distances. Independent of the mesh once built.
pub struct SolidIndex {
    surface: SurfaceIndex,
    /// Of each node's faces.
    dipoles: Vec<Dipole>,
    /// Of each face of the mesh.
    face_normals: Vec<Vec3>,
}

/// A closest point whose least barycentric weight is above this is within a face, not on an edge, whatever the rounding.
const FACE_INTERIOR: f32 = 1e-4;

#[derive(Clone, Copy, Debug)]
struct Dipole {
    /// The faces' centre, weighted by area.
    centre: Vec3,
    /// Square of the distance from which the faces are seen as one.
    far_squared: f32,
    /// The sum of normals times areas, divided by 4 pi.
    moment: Vec3,
    area: f32,
}

impl SolidIndex {
    /// Prepares a mesh.
    ///
    /// # Errors
    /// [`Error::Value`](crate::Error::Value) for a mesh without faces or one that [`TriangleMesh::check`] refuses.
    pub fn new(mesh: &TriangleMesh) -> Result<Self> {
        let surface = SurfaceIndex::new(mesh)?;
        let dipoles = dipoles(&surface.hierarchy);
        let face_normals = (0..mesh.faces.len() as u32).map(|face| mesh.face_normal(face)).collect();
        Ok(Self { surface, dipoles, face_normals })
    }

    /// The solid's surface.
    #[must_use]
    pub fn surface(&self) -> &SurfaceIndex {
        &self.surface
    }

    /// The generalised winding number.
    #[must_use]
    pub fn winding_number(&self, point: Vec3) -> f32 {
        let Hierarchy { nodes, triangles } = &self.surface.hierarchy;
        let mut winding = 0.0;
        let mut stack = [0u32; DEEPEST];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let index = stack[waiting] as usize;
            let dipole = &self.dipoles[index];
            let to_centre = dipole.centre - point;
            let distance_squared = to_centre.length_squared();
            if distance_squared > dipole.far_squared {
                winding += dipole.moment.dot(to_centre) / (distance_squared * distance_squared.sqrt());
                continue;
            }
            match nodes[index].contents(index) {
                Contents::Children(children) => {
                    stack[waiting] = children[1] as u32;
                    stack[waiting + 1] = children[0] as u32;
                    waiting += 2;
                }
                Contents::Leaf(range) => {
                    winding += triangles[range].iter().map(|t| solid_angle(t, point)).sum::<f32>() / (4.0 * PI);
                }
            }
        }
        winding
    }

    /// Whether a point is inside: its winding number is above one half.
    #[must_use]
    pub fn is_inside(&self, point: Vec3) -> bool {
        self.winding_number(point) > 0.5
    }

    /// Whether each of N points is inside, in parallel.
    #[must_use]
    pub fn are_inside(&self, points: &[Vec3]) -> Vec<bool> {
        points.par_iter().map(|&point| self.is_inside(point)).collect()
    }

    /// The distance to the surface, metres, negative inside; and where on the surface that is.
    #[must_use]
    pub fn signed_distance(&self, point: Vec3) -> (f32, ClosestPoint) {
        let closest = self.surface.closest(point);
        (if self.is_inside(point) { -closest.distance } else { closest.distance }, closest)
    }

    /// The distance to the surface if it is less than `radius`, metres, negative inside; the smaller the radius, the faster.
    ///
    /// Where the closest point is inside a face, that face tells the side, elsewhere the winding number.
    #[must_use]
    pub fn signed_distance_within(&self, point: Vec3, radius: f32) -> Option<f32> {
        let closest = self.surface.closest_within(point, radius)?;
        let within_face = closest.barycentric.iter().all(|share| *share > FACE_INTERIOR);
        let is_inside = match within_face {
            true => (point - closest.position).dot(self.face_normals[closest.face as usize]) < 0.0,
            false => self.is_inside(point),
        };
        Some(if is_inside { -closest.distance } else { closest.distance })
    }

    /// Signed distances (N) and closest points (N) of many points (N), in parallel.
    #[must_use]
    pub fn signed_distances(&self, points: &[Vec3]) -> Vec<(f32, ClosestPoint)> {
        points.par_iter().map(|&point| self.signed_distance(point)).collect()
    }
}

fn dipoles(hierarchy: &Hierarchy) -> Vec<Dipole> {
    let nothing = Dipole { centre: Vec3::ZERO, far_squared: f32::INFINITY, moment: Vec3::ZERO, area: 0.0 };
    let mut dipoles = vec![nothing; hierarchy.nodes.len()];
    // Children stand after their parent.
    for (index, node) in hierarchy.nodes.iter().enumerate().rev() {
        let (mut moment, mut area, mut weighted_centre) = (Vec3::ZERO, 0.0, Vec3::ZERO);
        let mut add = |part_moment: Vec3, part_area: f32, centre: Vec3| {
            moment += part_moment;
            area += part_area;
            weighted_centre += centre * part_area;
        };
        match node.contents(index) {
            Contents::Children(children) => {
                children.map(|child| &dipoles[child]).into_iter().for_each(|d| add(d.moment, d.area, d.centre));
            }
            Contents::Leaf(range) => {
                for Triangle { corner, sides: [ab, ac], .. } in &hierarchy.triangles[range] {
                    let normal_times_area = ab.cross(*ac) / 2.0;
                    add(normal_times_area / (4.0 * PI), normal_times_area.length(), corner + (ab + ac) / 3.0);
                }
            }
        }
        let middle = node.minimum * 0.5 + node.maximum * 0.5;
        let centre = if area > 0.0 { weighted_centre / area } else { middle };
        let farthest_corner = (centre - node.minimum).max(node.maximum - centre);
        let far_squared = FAR * FAR * farthest_corner.length_squared();
        dipoles[index] = Dipole { centre, far_squared, moment, area };
    }
    dipoles
}

/// The solid angle of a triangle, positive seen from behind (van Oosterom & Strackee 1983); 0 at its own corners.
fn solid_angle(triangle: &Triangle, point: Vec3) -> f32 {
    let a = triangle.corner - point;
    let (b, c) = (a + triangle.sides[0], a + triangle.sides[1]);
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let volume = a.dot(triangle.sides[0].cross(triangle.sides[1]));
    let cosines = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * volume.atan2(cosines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::testing::{bumpy_radius, bumpy_sphere, random_points};

    #[test]
    fn dipoles_change_the_sum_of_solid_angles_little() {
        let solid = SolidIndex::new(&bumpy_sphere(40)).unwrap();
        for point in random_points(400, 1.6, 11) {
            let exact: f32 =
                solid.surface.hierarchy.triangles.iter().map(|t| solid_angle(t, point)).sum::<f32>() / (4.0 * PI);
            assert!((solid.winding_number(point) - exact).abs() < 0.1);
        }
    }

    #[test]
    fn small_holes_do_not_let_the_outside_in() {
        let mut mesh = bumpy_sphere(40);
        // Every 23rd face, and a hole of 20 cm across.
        let mut index = 0;
        let rim = Vec3::new(0.3, 0.8, 0.5).normalize();
        mesh.faces.retain(|face| {
            index += 1;
            index % 23 != 0 && mesh.vertices[face[0] as usize].normalize().distance(rim) > 0.1
        });
        let solid = SolidIndex::new(&mesh).unwrap();
        for point in random_points(3000, 1.6, 13) {
            let beyond = point.length() - bumpy_radius(point);
            let near_the_hole = point.normalize().distance(rim) < 0.25;
            if beyond.abs() > if near_the_hole { 0.1 } else { 0.05 } {
                assert_eq!(solid.is_inside(point), beyond < 0.0, "{point} {beyond}");
            }
        }
    }

    #[test]
    fn signed_distance_is_negative_inside() {
        let mesh = bumpy_sphere(40);
        let solid = SolidIndex::new(&mesh).unwrap();
        let points = random_points(300, 1.6, 17);
        for (point, (distance, closest)) in points.iter().zip(solid.signed_distances(&points)) {
            let beyond = point.length() - bumpy_radius(*point);
            assert!(beyond.abs() < 0.02 || distance.signum() == beyond.signum());
            assert_eq!(closest.distance, distance.abs());
            // The surface lies between: no point can be nearer than a third of its radial distance.
            assert!(distance.abs() > 0.3 * beyond.abs() - 0.02);
        }
    }

    #[test]
    fn inside_does_not_change_when_everything_moves() {
        let mesh = bumpy_sphere(24);
        let shift = Vec3::new(3.0, -7.0, 2.0);
        let turn = glam::Quat::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), 1.0);
        let mut moved = mesh.clone();
        moved.vertices.iter_mut().for_each(|v| *v = turn * *v + shift);
        let (here, there) = (SolidIndex::new(&mesh).unwrap(), SolidIndex::new(&moved).unwrap());
        for point in random_points(500, 1.4, 19) {
            let difference = here.winding_number(point) - there.winding_number(turn * point + shift);
            assert!(difference.abs() < 0.2, "{difference}");
        }
    }

    #[test]
    fn corners_and_points_that_are_not_finite_have_a_side() {
        let mesh = bumpy_sphere(8);
        let solid = SolidIndex::new(&mesh).unwrap();
        assert!(mesh.vertices.iter().all(|&v| solid.winding_number(v).is_finite()));
        assert!(!solid.is_inside(Vec3::NAN));
        assert!(!solid.is_inside(Vec3::INFINITY));
    }
}
