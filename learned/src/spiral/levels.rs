//! A mesh at several resolutions, and the maps between them (METHOD-BODY section 10): pooling keeps vertices, un-pooling brings the others back.
//!
//! Each level is the one before with a share of its faces, by collapsing edges to one of their ends, so that a coarse vertex is a fine one. Up again, a vertex
//! that was kept is itself, and one that was not is the mean of the corners of the nearest coarse face by its barycentrics there. V vertices.

use glam::DVec3;
use xavatar_formats::Result;
use xavatar_mesh::{SurfaceIndex, TriangleMesh, decimated};

/// How many times fewer vertices each level has than the one before, in Wang's networks.
pub const FACTORS: [usize; 4] = [4, 2, 2, 2];

/// A level with fewer faces is not made.
const FEWEST: usize = 16;

/// A mesh at one resolution.
#[derive(Clone, Debug)]
pub struct Level {
    /// Its vertices (V), metres.
    pub points: Vec<DVec3>,
    /// Corners of faces.
    pub faces: Vec<[u32; 3]>,
    /// How it hangs together with the next finer level; the finest has none.
    pub from_finer: Option<Pooling>,
}

/// The maps between a fine level and a coarse one.
#[derive(Clone, Debug)]
pub struct Pooling {
    /// The fine vertex that each coarse one is (V of the coarse level).
    pub kept: Vec<u32>,
    /// Coarse vertices that each fine one is a mean of (V of the fine level).
    pub corners: Vec<[u32; 3]>,
    /// Their weights, of sum 1.
    pub weights: Vec<[f64; 3]>,
}

/// The levels of a mesh, the finest first, as many as leave something of it. Folds of the reference are kept best where they are deep: a body's limbs had better be bent.
///
/// # Errors
/// [`Error::Value`](xavatar_formats::Error::Value) for a mesh without faces, or with numbers that are not finite.
pub fn levels(reference: &TriangleMesh, factors: &[usize]) -> Result<Vec<Level>> {
    let mut fine = TriangleMesh {
        vertices: reference.vertices.clone(),
        faces: reference.faces.clone(),
        ..TriangleMesh::default()
    };
    let mut levels = vec![Level { points: points(&fine), faces: fine.faces.clone(), from_finer: None }];
    for factor in factors {
        let faces = fine.faces.len() / factor;
        if faces < FEWEST {
            break;
        }
        let coarse = decimated(&fine, faces);
        let pooling = Pooling::new(&points(&fine), coarse.sources, &coarse.mesh)?;
        levels.push(Level {
            points: points(&coarse.mesh),
            faces: coarse.mesh.faces.clone(),
            from_finer: Some(pooling),
        });
        fine = coarse.mesh;
    }
    Ok(levels)
}

impl Pooling {
    /// Between these fine vertices and a coarse mesh of those that were kept.
    ///
    /// # Errors
    /// As [`levels()`].
    pub fn new(fine: &[DVec3], kept: Vec<u32>, coarse: &TriangleMesh) -> Result<Self> {
        let index = SurfaceIndex::new(coarse)?;
        let mut pooling = Self { kept, corners: Vec::new(), weights: Vec::new() };
        for point in fine {
            let nearest = index.closest(point.as_vec3());
            let weights = nearest.barycentric.map(f64::from);
            let sum: f64 = weights.iter().sum();
            pooling.corners.push(coarse.faces[nearest.face as usize]);
            pooling.weights.push(weights.map(|weight| weight / sum));
        }
        for (coarse, fine) in pooling.kept.iter().enumerate() {
            pooling.corners[*fine as usize] = [coarse as u32; 3];
            pooling.weights[*fine as usize] = [1.0, 0.0, 0.0];
        }
        Ok(pooling)
    }
}

fn points(mesh: &TriangleMesh) -> Vec<DVec3> {
    mesh.vertices.iter().map(|vertex| vertex.as_dvec3()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{faces, reference, vectors};

    fn mesh(points: &[DVec3], faces: Vec<[u32; 3]>) -> TriangleMesh {
        let vertices = points.iter().map(|point| point.as_vec3()).collect();
        TriangleMesh { vertices, faces, ..TriangleMesh::default() }
    }

    #[test]
    fn unpooling_is_the_references() {
        let golden = reference("spiral_autoencoder");
        let (fine, coarse) = (vectors(&golden["points"]), vectors(&golden["coarse_points"]));
        let kept: Vec<u32> = golden["down"]
            .chunks_exact(fine.len())
            .map(|row| row.iter().position(|entry| *entry == 1.0).unwrap() as u32)
            .collect();
        let pooling = Pooling::new(&fine, kept, &mesh(&coarse, faces(&golden["coarse_faces"]))).unwrap();
        for (vertex, row) in golden["up"].chunks_exact(coarse.len()).enumerate() {
            let mut found = vec![0.0; coarse.len()];
            for (corner, weight) in pooling.corners[vertex].iter().zip(pooling.weights[vertex]) {
                found[*corner as usize] += weight;
            }
            // Closest points are found in single precision.
            let difference = crate::reference::largest_difference(&found, row);
            assert!(difference < 1e-6, "vertex {vertex}: {difference}");
        }
    }

    #[test]
    fn coarse_vertices_are_fine_ones_and_come_back_as_themselves() {
        let golden = reference("spiral_convolution");
        let fine = mesh(&vectors(&golden["points"]), faces(&golden["faces"]));
        let levels = levels(&fine, &[2, 2]).unwrap();
        assert_eq!(levels.len(), 3);
        for pair in levels.windows(2) {
            let pooling = pair[1].from_finer.as_ref().unwrap();
            assert!(pair[1].points.len() < pair[0].points.len());
            for (coarse, kept) in pooling.kept.iter().enumerate() {
                assert_eq!(pair[1].points[coarse], pair[0].points[*kept as usize]);
            }
            for (vertex, point) in pair[0].points.iter().enumerate() {
                let corners = pooling.corners[vertex].iter().zip(pooling.weights[vertex]);
                let back: DVec3 = corners.map(|(corner, weight)| pair[1].points[*corner as usize] * weight).sum();
                let way = back.distance(*point);
                match pooling.kept.contains(&(vertex as u32)) {
                    true => assert_eq!(way, 0.0),
                    false => assert!(way < 0.6, "{way}"),
                }
            }
        }
    }
}
