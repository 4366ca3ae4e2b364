//! A surface as points, evenly spread by area, for distances that need not be exact: to half the points' spacing.
//!
//! Points are taken at even steps of area along the faces, so that nothing is drawn and a dense mesh costs no more than a
//! coarse one. N points; metres.

use std::f32::consts::PI;

use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::alignment::Similarity;
use xavatar_formats::{Error, Result};
use xavatar_mesh::TriangleMesh;

/// Steps of the sequence that spreads points over the unit square (Roberts 2018): powers of the plastic number's inverse.
const SPREAD: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3];
/// A dipole nearer than this many spacings is softened: the sum over points is no integral there.
const SOFTENING: f32 = 0.5;

/// Points of a surface (N) with the normals and the numbers of their faces.
pub(super) struct SurfacePoints {
    pub points: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub faces: Vec<u32>,
    /// Of the whole surface, square metres.
    pub area: f32,
    tree: ImmutableKdTree<f32, 3>,
}

impl SurfacePoints {
    /// About `count` points of a mesh.
    ///
    /// # Errors
    /// [`Error::Value`] for a mesh without area.
    pub fn new(mesh: &TriangleMesh, count: usize) -> Result<Self> {
        let areas: Vec<f64> = (0..mesh.faces.len()).map(|face| area_vector(mesh, face).length() / 2.0).collect();
        let area: f64 = areas.iter().sum();
        let without_area =
            |found: String| Error::Value { name: "surface".into(), found, expected: "a finite area above zero".into() };
        if !(area.is_finite() && area > 0.0) {
            return Err(without_area(format!("{} faces of {area} square metres", mesh.faces.len())));
        }
        let step = area / count as f64;
        let (mut points, mut normals, mut faces) = (Vec::new(), Vec::new(), Vec::new());
        let mut passed = 0.5 * step;
        for (face, face_area) in areas.into_iter().enumerate() {
            passed += face_area;
            while passed >= step {
                passed -= step;
                points.push(place_in(mesh.corners(face as u32), points.len()));
                normals.push(area_vector(mesh, face).normalize_or_zero().as_vec3());
                faces.push(face as u32);
            }
        }
        Ok(Self { tree: index(&points)?, points, normals, faces, area: area as f32 })
    }

    /// Turns the surface over.
    pub fn reverse(&mut self) {
        self.normals.iter_mut().for_each(|normal| *normal = -*normal);
    }

    /// The same surface after a placement.
    ///
    /// # Errors
    /// [`Error::Value`] if the points cannot be indexed.
    pub fn placed(&self, placement: &Similarity) -> Result<Self> {
        let points: Vec<Vec3> = self.points.iter().map(|point| placement.of(*point)).collect();
        Ok(Self {
            tree: index(&points)?,
            normals: self.normals.iter().map(|normal| placement.turn * *normal).collect(),
            faces: self.faces.clone(),
            area: self.area * placement.scale * placement.scale,
            points,
        })
    }

    /// The nearest point's number and its distance. `point` has to be finite.
    pub fn nearest(&self, point: Vec3) -> (usize, f32) {
        let found = self.tree.query(&point.to_array()).nearest_one::<SquaredEuclidean<f32>>().execute();
        (found.item as usize, found.distance.sqrt())
    }

    /// The winding number around a point that is farther from the surface than its points are from each other: 1 inside, 0
    /// outside, 2 inside two surfaces.
    pub fn winding_number(&self, point: Vec3) -> f32 {
        let share = self.area / self.points.len() as f32;
        let softening = SOFTENING * SOFTENING * share;
        let sum: f32 = self.points.iter().zip(&self.normals).fold(0.0, |sum, (place, normal)| {
            let to_place = *place - point;
            let squared = to_place.length_squared() + softening;
            sum + normal.dot(to_place) / (squared * squared.sqrt())
        });
        sum * share / (4.0 * PI)
    }
}

fn index(points: &[Vec3]) -> Result<ImmutableKdTree<f32, 3>> {
    let coordinates: Vec<[f32; 3]> = points.iter().map(Vec3::to_array).collect();
    ImmutableKdTree::new_from_slice(&coordinates).map_err(|error| Error::Value {
        name: "points of a surface".into(),
        found: error.to_string(),
        expected: "at least one, at most 2^32".into(),
    })
}

/// Twice the area of a face along its normal; in f64, in which no mesh of finite coordinates overflows.
pub(super) fn area_vector(mesh: &TriangleMesh, face: usize) -> glam::DVec3 {
    let [a, b, c] = mesh.corners(face as u32).map(|corner| corner.as_dvec3());
    (b - a).cross(c - a)
}

/// The `index`-th place of the sequence, folded onto a triangle.
fn place_in([a, b, c]: [Vec3; 3], index: usize) -> Vec3 {
    let [mut v, mut w] = SPREAD.map(|step| (step * (index + 1) as f64).fract() as f32);
    if v + w > 1.0 {
        (v, w) = (1.0 - v, 1.0 - w);
    }
    a + (b - a) * v + (c - a) * w
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::testing::ball;

    #[test]
    fn points_are_as_dense_everywhere_whatever_the_faces() {
        let mut mesh = ball(40);
        let coarse = SurfacePoints::new(&mesh, 4000).unwrap();
        assert!(coarse.points.len().abs_diff(4000) <= 1, "{}", coarse.points.len());
        // Twice as many faces on one side change nothing.
        let doubled: Vec<[u32; 3]> =
            mesh.faces.iter().copied().filter(|face| mesh.vertices[face[0] as usize].x > 0.0).collect();
        mesh.faces.retain(|face| mesh.vertices[face[0] as usize].x <= 0.0);
        for face in doubled {
            let corner = mesh.vertices.len() as u32;
            let middle = face.iter().map(|&vertex| mesh.vertices[vertex as usize]).sum::<Vec3>() / 3.0;
            mesh.vertices.push(middle);
            mesh.faces.extend([[face[0], face[1], corner], [face[1], face[2], corner], [face[2], face[0], corner]]);
        }
        let refined = SurfacePoints::new(&mesh, 4000).unwrap();
        let right = |points: &[Vec3]| points.iter().filter(|point| point.x > 0.0).count();
        assert!(right(&coarse.points).abs_diff(right(&refined.points)) < 40);
    }

    #[test]
    fn sides_and_winding_numbers_are_those_of_the_surface() {
        let surface = SurfacePoints::new(&ball(40), 20_000).unwrap();
        for place in 0..300 {
            let [x, y] = SPREAD.map(|step| (step * f64::from(place)).fract() as f32);
            let point = Vec3::new(x, y, (f64::from(place) * 0.618_034).fract() as f32) * 3.2 - 1.6;
            let beyond = point.length() - 1.0;
            if beyond.abs() > 0.1 {
                let (nearest, _) = surface.nearest(point);
                let above = (point - surface.points[nearest]).dot(surface.normals[nearest]);
                assert_eq!(above > 0.0, beyond > 0.0, "{point}");
                let expected = if beyond > 0.0 { 0.0 } else { 1.0 };
                assert!((surface.winding_number(point) - expected).abs() < 0.1, "{point}");
            }
        }
    }

    #[test]
    fn a_mesh_without_area_has_no_points() {
        let mut mesh = ball(8);
        mesh.faces.iter_mut().for_each(|face| face[1] = face[0]);
        assert!(SurfacePoints::new(&mesh, 100).is_err());
    }
}
