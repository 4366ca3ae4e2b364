//! Skin to skeleton: skinning weights by diffusion, eyeballs, and a regressor that gives the joints back.
//!
//! Each vertex starts with weight 1 for the joint whose solid is nearest; averaging over mesh neighbours spreads that like
//! heat along the surface, so fingers and thighs that are close in space but not on the skin do not pull at each other.

use glam::{DMat4, DVec4, Vec3};
use rayon::prelude::*;

use super::flesh::Flesh;
use super::surface::neighbours;
use crate::body::smplx;
use crate::mesh::TriangleMesh;

/// Weights below are dropped, and the rest scaled to sum to 1.
const SMALLEST_WEIGHT: f32 = 0.01;
/// Vertices that a joint is regressed from.
const REGRESSED_FROM: usize = 64;
/// Rings and sectors of an eyeball.
const EYEBALL: [usize; 2] = [7, 12];

/// One row of J weights a vertex.
pub(super) type WeightRows = Vec<Vec<f32>>;

/// The skinning weights of the skin's vertices.
pub(super) fn skinning_weights(flesh: &Flesh, skin: &TriangleMesh, rounds: usize) -> WeightRows {
    let mut rows: WeightRows = skin.vertices.par_iter().map(|vertex| one_hot(flesh.joint_at(*vertex))).collect();
    let neighbours = neighbours(skin.vertices.len(), &skin.faces);
    for _ in 0..rounds {
        rows = neighbours
            .par_iter()
            .enumerate()
            .map(|(vertex, around)| {
                let share = 1.0 / (around.len() + 1) as f32;
                let mut mean: Vec<f32> = rows[vertex].iter().map(|weight| weight * share).collect();
                for other in around {
                    mean.iter_mut().zip(&rows[*other as usize]).for_each(|(sum, weight)| *sum += weight * share);
                }
                mean
            })
            .collect();
    }
    rows.iter_mut().for_each(|row| normalise(row));
    rows
}

/// All weight on one joint.
pub(super) fn one_hot(joint: usize) -> Vec<f32> {
    let joints = 0..smplx::skeleton().joints.len();
    joints.map(|other| if other == joint { 1.0 } else { 0.0 }).collect()
}

fn normalise(row: &mut [f32]) {
    row.iter_mut().filter(|weight| **weight < SMALLEST_WEIGHT).for_each(|weight| *weight = 0.0);
    let sum: f32 = row.iter().sum();
    row.iter_mut().for_each(|weight| *weight /= sum);
}

/// Adds a closed sphere whose faces look outward; the number of vertices added.
pub(super) fn add_eyeball(mesh: &mut TriangleMesh, centre: Vec3, radius: f32) -> usize {
    let [rings, sectors] = EYEBALL;
    let first = mesh.vertices.len() as u32;
    let at = |ring: usize, sector: usize| match ring {
        0 => first,
        ring if ring > rings => first + 1,
        _ => first + 2 + ((ring - 1) * sectors + sector % sectors) as u32,
    };
    // The pole is the pupil, so that the eye's turn is visible.
    mesh.vertices.extend([centre + Vec3::Z * radius, centre - Vec3::Z * radius]);
    for ring in 1..=rings {
        let (sine, cosine) = (std::f32::consts::PI * ring as f32 / (rings + 1) as f32).sin_cos();
        for sector in 0..sectors {
            let (y, x) = (std::f32::consts::TAU * sector as f32 / sectors as f32).sin_cos();
            mesh.vertices.push(centre + radius * Vec3::new(x * sine, y * sine, cosine));
        }
    }
    for ring in 0..=rings {
        for sector in 0..sectors {
            let [a, b] = [at(ring, sector), at(ring, sector + 1)];
            let [c, d] = [at(ring + 1, sector), at(ring + 1, sector + 1)];
            if ring > 0 {
                mesh.faces.push([a, c, b]);
            }
            if ring < rings {
                mesh.faces.push([b, c, d]);
            }
        }
    }
    2 + rings * sectors
}

/// The row of the joint regressor (V): weights around a Gaussian of the distance, changed as little as gives
/// sum w = 1 and sum w v = joint exactly.
///
/// With D = diag(w0) and A the rows [1 x y z]: w = w0 + D A^T (A D A^T)^-1 (b - A w0).
pub(super) fn regressor_row(joint: usize, place: Vec3, vertices: &[Vec3], weights: &[Vec<f32>]) -> Vec<f64> {
    let parent = smplx::skeleton().parents[joint].unwrap_or(joint);
    let held = |vertex: usize| weights[vertex][joint] + weights[vertex][parent] > 0.2;
    let mut near: Vec<(f32, usize)> = (0..vertices.len())
        .filter(|vertex| held(*vertex))
        .map(|vertex| (vertices[vertex].distance(place), vertex))
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.truncate(REGRESSED_FROM);
    let width = f64::from(near.first().map_or(1.0, |nearest| nearest.0)) + 1e-3;
    let rows: Vec<(usize, DVec4, f64)> = near
        .iter()
        .map(|(distance, vertex)| {
            let offset = vertices[*vertex].as_dvec3() - place.as_dvec3();
            (*vertex, offset.extend(1.0), (-0.5 * (f64::from(*distance) / width).powi(2)).exp())
        })
        .collect();
    let total: f64 = rows.iter().map(|(.., weight)| weight).sum();
    let outer = |row: DVec4| DMat4::from_cols(row * row.x, row * row.y, row * row.z, row * row.w);
    let (mut moments, mut now) = (DMat4::ZERO, DVec4::ZERO);
    for (_, row, weight) in &rows {
        moments += outer(*row) * (weight / total);
        now += *row * (weight / total);
    }
    let correction = moments.inverse() * (DVec4::W - now);
    let mut regressor = vec![0.0; vertices.len()];
    for (vertex, row, weight) in rows {
        regressor[vertex] = weight / total * (1.0 + row.dot(correction));
    }
    regressor
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Topology;

    #[test]
    fn an_eyeball_is_closed_and_outward() {
        let mut mesh = TriangleMesh::default();
        let added = add_eyeball(&mut mesh, Vec3::new(0.3, 0.2, 0.1), 0.5);
        assert_eq!(added, mesh.vertices.len());
        assert!(Topology::of(&mesh).is_watertight());
        let sphere = 4.0 / 3.0 * std::f64::consts::PI * 0.125;
        assert!((0.9..1.0).contains(&(mesh.volume() / sphere)));
    }

    // sum w = 1 and sum w v = joint, also for a joint off the centre of what surrounds it.
    #[test]
    fn a_regressor_row_gives_the_joint_back() {
        let mut mesh = TriangleMesh::default();
        add_eyeball(&mut mesh, Vec3::ZERO, 0.5);
        let weights = vec![one_hot(4); mesh.vertices.len()];
        for place in [Vec3::ZERO, Vec3::new(0.1, -0.2, 0.05)] {
            let row = regressor_row(4, place, &mesh.vertices, &weights);
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let regressed = row.iter().zip(&mesh.vertices).map(|(weight, v)| v.as_dvec3() * *weight);
            assert!((regressed.sum::<glam::DVec3>() - place.as_dvec3()).length() < 1e-12);
        }
    }
}
