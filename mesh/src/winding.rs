//! Inside or outside, for scans with small holes: the generalised winding number (Jacobson et al. 2013), with distant
//! groups of faces as dipoles (Barill et al. 2018).
//!
//! w(q) = sum over faces of their solid angle / 4 pi: 1 inside and 0 outside of a closed mesh, smooth across its holes.
//! Inside is w > 1/2. The dipoles change w by 0.006 typically, 0.08 at worst (measured): never the side of a point off the surface of a
//! closed mesh. An inside-out mesh has no inside.

use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;
use smallvec::{SmallVec, smallvec};
use xavatar_vector::vectorised;

use super::TriangleMesh;
use super::closest::{ClosestPoint, SurfaceIndex};
use super::hierarchy::{Child, Hierarchy, LANES, Lanes, Packet, of_lane};
use xavatar_formats::Result;

/// A group of faces is a dipole from this many radii on (Barill et al. use 2: half the error, half as fast).
const FAR: f32 = 1.5;

/// A mesh's solid, prepared for inside tests and signed distances. Independent of the mesh once built.
pub struct SolidIndex {
    surface: SurfaceIndex,
    /// Of the faces in each node's boxes.
    dipoles: Vec<Dipoles>,
    /// Of each face of the mesh.
    face_normals: Vec<Vec3>,
}

/// A closest point whose least barycentric weight is above this is within a face, not on an edge, whatever the rounding.
const FACE_INTERIOR: f32 = 1e-4;

/// The groups of faces in the boxes of a node.
#[derive(Clone, Debug)]
struct Dipoles {
    /// The faces' centres, weighted by area.
    centre: [Lanes; 3],
    /// Square of the distance from which a group is seen as one; infinite for a group of nothing.
    far_squared: Lanes,
    /// The sum of normals times areas, divided by 4 pi.
    moment: [Lanes; 3],
}

impl SolidIndex {
    /// Prepares a mesh.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) for a mesh without faces or one that [`TriangleMesh::check`] refuses.
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
        vectorised(
            #[inline(always)]
            || self.winding(point),
        )
    }

    #[inline(always)]
    fn winding(&self, point: Vec3) -> f32 {
        let Hierarchy { nodes, packets } = &self.surface.hierarchy;
        let (mut of_groups, mut half_angles) = ([0.0; LANES], 0.0);
        let mut waiting: SmallVec<[u32; 64]> = smallvec![0];
        while let Some(index) = waiting.pop() {
            let is_near = self.dipoles[index as usize].add_far(point, &mut of_groups);
            for (child, is_near) in nodes[index as usize].children.into_iter().zip(is_near) {
                match child {
                    Child::Node(child) if is_near => waiting.push(child),
                    Child::Packet(packet) if is_near => {
                        half_angles += half_solid_angles(&packets[packet as usize], point)
                    }
                    _ => {}
                }
            }
        }
        of_groups.iter().sum::<f32>() + half_angles / (2.0 * PI)
    }

    /// Whether a point is inside: its winding number is above one half.
    #[must_use]
    pub fn is_inside(&self, point: Vec3) -> bool {
        self.winding_number(point) > 0.5
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

impl Dipoles {
    const NOTHING: Self =
        Self { centre: [[0.0; LANES]; 3], far_squared: [f32::INFINITY; LANES], moment: [[0.0; LANES]; 3] };

    /// Adds the winding numbers of the groups that are far from a point; returns which are not.
    #[inline(always)]
    fn add_far(&self, point: Vec3, winding: &mut Lanes) -> [bool; LANES] {
        let mut is_near = [false; LANES];
        for lane in 0..LANES {
            let to_centre = of_lane(&self.centre, lane) - point;
            let distance_squared = to_centre.length_squared();
            is_near[lane] = distance_squared <= self.far_squared[lane];
            let seen_as_one = of_lane(&self.moment, lane).dot(to_centre) / (distance_squared * distance_squared.sqrt());
            winding[lane] += if is_near[lane] { 0.0 } else { seen_as_one };
        }
        is_near
    }
}

/// A group of faces while its dipole is summed.
#[derive(Clone, Copy, Default)]
struct Group {
    /// The sum of normals times areas, square metres.
    moment: Vec3,
    area: f32,
    /// The sum of centres times areas.
    weighted_centre: Vec3,
}

impl Group {
    fn and(self, other: Self) -> Self {
        Self {
            moment: self.moment + other.moment,
            area: self.area + other.area,
            weighted_centre: self.weighted_centre + other.weighted_centre,
        }
    }

    fn of_packet(packet: &Packet) -> Self {
        let of_triangle = |lane: usize| {
            let [ab, ac] = [&packet.sides[0], &packet.sides[1]].map(|side| of_lane(side, lane));
            let moment = ab.cross(ac) / 2.0;
            let (area, centre) = (moment.length(), of_lane(&packet.corner, lane) + (ab + ac) / 3.0);
            Self { moment, area, weighted_centre: centre * area }
        };
        (0..LANES).map(of_triangle).fold(Self::default(), Self::and)
    }
}

fn dipoles(hierarchy: &Hierarchy) -> Vec<Dipoles> {
    let mut dipoles = vec![Dipoles::NOTHING; hierarchy.nodes.len()];
    let mut groups = vec![Group::default(); hierarchy.nodes.len()];
    // Children stand after their parent.
    for (index, node) in hierarchy.nodes.iter().enumerate().rev() {
        for (lane, child) in node.children.iter().enumerate() {
            let group = match child {
                Child::Nothing => continue,
                Child::Node(child) => groups[*child as usize],
                Child::Packet(packet) => Group::of_packet(&hierarchy.packets[*packet as usize]),
            };
            groups[index] = groups[index].and(group);
            let [low, high] = node.bounds(lane);
            let centre = if group.area > 0.0 { group.weighted_centre / group.area } else { low * 0.5 + high * 0.5 };
            let farthest_corner = (centre - low).max(high - centre);
            let of_node = &mut dipoles[index];
            of_node.far_squared[lane] = FAR * FAR * farthest_corner.length_squared();
            for axis in 0..3 {
                of_node.centre[axis][lane] = centre[axis];
                of_node.moment[axis][lane] = group.moment[axis] / (4.0 * PI);
            }
        }
    }
    dipoles
}

/// Half the sum of a packet's solid angles, positive seen from behind (van Oosterom & Strackee 1983); 0 of triangles whose
/// corner the point is.
#[inline(always)]
fn half_solid_angles(packet: &Packet, point: Vec3) -> f32 {
    let (mut volumes, mut cosines) = ([0.0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        let [ab, ac] = [of_lane(&packet.sides[0], lane), of_lane(&packet.sides[1], lane)];
        let a = of_lane(&packet.corner, lane) - point;
        let (b, c) = (a + ab, a + ac);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        volumes[lane] = a.dot(ab.cross(ac));
        cosines[lane] = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    }
    volumes.iter().zip(cosines).map(|(volume, cosine)| volume.atan2(cosine)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{bumpy_radius, bumpy_sphere, random_points};

    #[test]
    fn dipoles_change_the_sum_of_solid_angles_little() {
        let solid = SolidIndex::new(&bumpy_sphere(40)).unwrap();
        for point in random_points(400, 1.6, 11) {
            let packets = solid.surface.hierarchy.packets.iter();
            let exact = packets.map(|packet| half_solid_angles(packet, point)).sum::<f32>() / (2.0 * PI);
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
