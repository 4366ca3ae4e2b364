//! Normals of a point cloud: the direction in which a point's neighbours vary least.
//!
//! n minimises sum_i (n . (p_i - mean))^2 over unit vectors, p_i the point and its nearest neighbours (thesis 4.4: up to 30
//! within 10 cm). It is turned towards the camera. Exact on planes; near the rim of a curved surface, where all neighbours lie
//! on one side, it leans inward by about the neighbourhood's radius over that of the curvature.

use std::num::NonZero;

use glam::{DMat3, DVec3, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use xavatar_formats::{Error, Result};

/// Neighbours that a plane is fitted to, the point itself among them.
const NEIGHBOURS: NonZero<usize> = NonZero::new(30).unwrap();
/// How far a neighbour may be, metres.
const REACH: f32 = 0.1;
/// Ratio of the two larger variances below which neighbours are on a line: a strip a thousand times as long as wide. The
/// eigenvalue is only known to eight digits there.
const THINNEST: f64 = 1e-6;
/// Points that a plane is fitted to, at least.
const FEWEST: usize = 3;

/// The unit normal at each point (N), towards `camera`; `None` where neighbours are missing or lie on a line.
///
/// # Errors
/// [`Error::Value`] if there are more points than a k-d tree can index.
pub(super) fn normals_towards(points: &[Vec3], camera: Vec3) -> Result<Vec<Option<Vec3>>> {
    if points.is_empty() {
        return Ok(Vec::new());
    }
    let rows: Vec<[f32; 3]> = points.iter().map(Vec3::to_array).collect();
    let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&rows).map_err(|failure| Error::Value {
        name: "point cloud".into(),
        found: format!("{} points ({failure})", points.len()),
        expected: "at most 2^32".into(),
    })?;
    let normal = |point: &Vec3| {
        let centre = point.to_array();
        let nearest = tree.query(&centre).nearest_n::<SquaredEuclidean<f32>>(NEIGHBOURS);
        let found = nearest.within(REACH * REACH).execute();
        let offsets = found.iter().map(|neighbour| (points[neighbour.item as usize] - *point).as_dvec3());
        let normal = flattest_direction(offsets)?.as_vec3();
        Some(if normal.dot(camera - *point) < 0.0 { -normal } else { normal })
    };
    Ok(points.par_iter().with_min_len(256).map(normal).collect())
}

/// The unit vector along which points vary least; `None` of fewer than three, or if they all lie on a line.
fn flattest_direction(points: impl ExactSizeIterator<Item = DVec3> + Clone) -> Option<DVec3> {
    if points.len() < FEWEST {
        return None;
    }
    let mean = points.clone().sum::<DVec3>() / points.len() as f64;
    let mut covariance = DMat3::ZERO;
    for point in points {
        let offset = point - mean;
        covariance += DMat3::from_cols(offset * offset.x, offset * offset.y, offset * offset.z);
    }
    let shifted = covariance - DMat3::from_diagonal(DVec3::splat(smallest_eigenvalue(&covariance)));
    // The columns span the plane, and the longest of their products is the least rounded.
    let [a, b, c] = [shifted.x_axis, shifted.y_axis, shifted.z_axis];
    let products = [a.cross(b), b.cross(c), c.cross(a)];
    let longest = products.into_iter().max_by(|one, other| one.length_squared().total_cmp(&other.length_squared()))?;
    let trace = covariance.x_axis.x + covariance.y_axis.y + covariance.z_axis.z;
    (longest.length() > THINNEST * trace * trace).then(|| longest.normalize())
}

/// The smallest eigenvalue of a symmetric matrix, by the trigonometric solution of its characteristic cubic (Smith 1961).
fn smallest_eigenvalue(matrix: &DMat3) -> f64 {
    let mean = (matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z) / 3.0;
    let deviator = *matrix - DMat3::from_diagonal(DVec3::splat(mean));
    let squares: f64 = deviator.to_cols_array().iter().map(|entry| entry * entry).sum();
    let spread = (squares / 6.0).sqrt();
    if spread == 0.0 {
        return mean;
    }
    let angle = ((deviator * (1.0 / spread)).determinant() / 2.0).clamp(-1.0, 1.0).acos() / 3.0;
    mean + 2.0 * spread * (angle + std::f64::consts::TAU / 3.0).cos()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn a_plane_has_one_normal_and_it_faces_the_camera() {
        let mut random = ChaCha8Rng::seed_from_u64(9);
        for _ in 0..20 {
            let mut direction = || Vec3::from(random.random::<[f32; 3]>()) - 0.5;
            let (normal, along) = (direction().normalize(), direction());
            let (u, v) = (normal.cross(along).normalize(), normal.cross(normal.cross(along)).normalize());
            let points: Vec<Vec3> =
                (0..100).map(|i| (i % 10) as f32 * 0.003 * u + (i / 10) as f32 * 0.005 * v + along).collect();
            let camera = along + normal * 2.0 + u;
            for found in normals_towards(&points, camera).unwrap() {
                assert!(found.unwrap().dot(normal) > 0.99999, "{found:?} is not {normal}");
            }
        }
    }

    #[test]
    fn lines_pairs_and_lonely_points_have_none() {
        let line: Vec<Vec3> = (0..20).map(|i| Vec3::new(1.0, 0.5, 0.2) * (i as f32 * 0.001)).collect();
        let apart: Vec<Vec3> = (0..20).map(|i| Vec3::new(i as f32, (i * i) as f32, 0.0)).collect();
        for points in [line, apart, vec![Vec3::ONE; 40], vec![Vec3::ZERO, Vec3::X * 0.01], vec![]] {
            assert!(normals_towards(&points, Vec3::Z * 3.0).unwrap().iter().all(Option::is_none), "{points:?}");
        }
    }

    #[test]
    fn the_eigenvalue_is_the_smallest() {
        let turn = DMat3::from_quat(glam::DQuat::from_scaled_axis(DVec3::new(0.3, -1.1, 0.7)));
        for values in [[3.0, 2.0, 1.0], [5.0, 5.0, 1e-6], [1.0, 1e-9, 1e-9], [2.0, 2.0, 2.0]] {
            let matrix = turn * DMat3::from_diagonal(DVec3::from(values)) * turn.transpose();
            assert!((smallest_eigenvalue(&matrix) - values[2]).abs() < 1e-7, "{values:?}");
        }
    }
}
