//! Whether a scan is a surface at all, whatever body it should be of.

use glam::{DMat3, DVec3};

use super::surface_points::area_vector;
use xavatar_mesh::TriangleMesh;

/// A body in fewer faces has no limbs.
const FEWEST_FACES: usize = 200;
/// A body is at least this thick by its longest extent, as standard deviations of its vertices.
const THINNEST: f64 = 0.01;
/// Surface by the square of the longest extent: 0.6 of a person, more in a wide dress, thousands of faces put together at random.
const LARGEST_AREA: f64 = 8.0;
/// The sum of a surface's normals by its area, above which it is too open to have a volume.
const OPENNESS: f64 = 0.05;
/// Edges that two faces share, of all edges that a face has.
const FEWEST_SHARED: f32 = 0.5;

/// What a scan is as a mesh.
pub(super) struct Soundness {
    /// Why it is no surface of a body.
    pub fault: Option<String>,
    /// The volume that it encloses, cubic units; negative if it is seen from inside. None if it is too open to enclose one.
    pub volume: Option<f64>,
}

impl Soundness {
    /// Looks at a scan that [`TriangleMesh::check`] accepts; `shared` is the share of its edges that two faces have, if known.
    pub fn of(scan: &TriangleMesh, shared: Option<f32>) -> Self {
        let (low, high) = scan.vertices.iter().fold((DVec3::MAX, DVec3::MIN), |(low, high), vertex| {
            let vertex = vertex.as_dvec3();
            (low.min(vertex), high.max(vertex))
        });
        let middle = (low + high) / 2.0;
        let (mut area, mut volume, mut with_area, mut whole) = (0.0, 0.0, 0, DVec3::ZERO);
        for face in 0..scan.faces.len() {
            let twice = area_vector(scan, face);
            area += twice.length() / 2.0;
            whole += twice / 2.0;
            volume += (scan.corners(face as u32)[0].as_dvec3() - middle).dot(twice) / 6.0;
            with_area += usize::from(twice != DVec3::ZERO);
        }
        let extent = (high - low).max_element();
        let fault = if with_area < FEWEST_FACES {
            Some(format!("{with_area} faces with an area, a body has thousands"))
        } else if !(extent > f64::from(f32::MIN_POSITIVE) && area > 0.0) {
            Some(format!("{extent:.1e} m large, with {area:.1e} square metres of surface"))
        } else if let Some(thickness) = Some(thinness(scan, middle)).filter(|thinness| *thinness < THINNEST) {
            Some(format!("flat: {:.1} % as thick as long", 100.0 * thickness))
        } else if area / (extent * extent) > LARGEST_AREA {
            let times = area / (extent * extent) / 0.6;
            Some(format!("{times:.0} times the surface of a body of its size: its faces are not neighbours"))
        } else {
            shared.filter(|shared| *shared < FEWEST_SHARED).map(|shared| {
                format!("only {:.0} % of its edges join two faces: they do not hang together", 100.0 * shared)
            })
        };
        // The normals of a closed surface, each as long as its face is large, sum to nothing.
        Self { fault, volume: Some(volume).filter(|_| whole.length() < OPENNESS * area) }
    }
}

/// The smallest by the largest standard deviation of the vertices along any direction.
fn thinness(scan: &TriangleMesh, middle: DVec3) -> f64 {
    let count = scan.vertices.len() as f64;
    let mean = scan.vertices.iter().map(|vertex| vertex.as_dvec3() - middle).sum::<DVec3>() / count;
    let mut covariance = DMat3::ZERO;
    let scale = scan.vertices.iter().map(|vertex| (vertex.as_dvec3() - middle - mean).length()).fold(0.0, f64::max);
    for vertex in &scan.vertices {
        let from_mean = (vertex.as_dvec3() - middle - mean) / scale;
        covariance += DMat3::from_cols(from_mean * from_mean.x, from_mean * from_mean.y, from_mean * from_mean.z);
    }
    let [smallest, .., largest] = eigenvalues(covariance * (1.0 / count));
    (smallest.max(0.0) / largest).sqrt()
}

/// The eigenvalues of a symmetric matrix in ascending order (Smith 1961).
fn eigenvalues(matrix: DMat3) -> [f64; 3] {
    let trace = matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z;
    let mean = trace / 3.0;
    let centred = matrix - DMat3::from_diagonal(DVec3::splat(mean));
    let spread = (centred.to_cols_array().iter().map(|entry| entry * entry).sum::<f64>() / 6.0).sqrt();
    if spread == 0.0 {
        return [mean; 3];
    }
    let angle = ((centred * (1.0 / spread)).determinant() / 2.0).clamp(-1.0, 1.0).acos() / 3.0;
    let largest = mean + 2.0 * spread * angle.cos();
    let smallest = mean + 2.0 * spread * (angle + 2.0 * std::f64::consts::FRAC_PI_3).cos();
    [smallest, trace - largest - smallest, largest]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::testing::ball;

    fn fault(change: impl Fn(&mut TriangleMesh)) -> String {
        let mut mesh = ball(40);
        change(&mut mesh);
        Soundness::of(&mesh, None).fault.unwrap_or_default()
    }

    #[test]
    fn a_closed_surface_is_sound_and_encloses_its_volume() {
        let found = Soundness::of(&ball(40), Some(1.0));
        assert_eq!(found.fault, None);
        let volume = found.volume.unwrap();
        assert!((4.0..4.2).contains(&volume), "{volume}");
        let mut inverted = ball(40);
        inverted.faces.iter_mut().for_each(|face| face.swap(0, 1));
        assert!((Soundness::of(&inverted, None).volume.unwrap() + volume).abs() < 1e-9);
        let mut half = ball(40);
        half.faces.retain(|face| half.vertices[face[0] as usize].z > 0.0);
        assert_eq!(Soundness::of(&half, None).volume, None);
    }

    #[test]
    fn what_is_no_surface_is_named() {
        assert!(fault(|mesh| mesh.faces.truncate(1)).contains("1 faces"));
        assert!(fault(|mesh| mesh.faces.iter_mut().for_each(|face| face[1] = face[0])).contains("0 faces"));
        assert!(fault(|mesh| mesh.vertices.iter_mut().for_each(|vertex| vertex.z = 1.0)).contains("flat"));
        assert!(fault(|mesh| mesh.vertices.iter_mut().for_each(|vertex| *vertex = mesh_point())).contains("0 faces"));
        let count = ball(40).vertices.len() as u32;
        let shuffled = fault(|mesh| {
            for (index, face) in mesh.faces.iter_mut().enumerate() {
                *face = [1, 7919, 104_729].map(|prime| (index as u32).wrapping_mul(2 * prime + 1) % count);
            }
        });
        assert!(shuffled.contains("not neighbours"), "{shuffled}");
        let apart = Soundness::of(&ball(40), Some(0.1)).fault.unwrap();
        assert!(apart.contains("10 %"), "{apart}");
    }

    fn mesh_point() -> glam::Vec3 {
        glam::Vec3::new(0.5, 1.0, 0.25)
    }

    // In f32 their areas would overflow or vanish.
    #[test]
    fn sizes_beyond_reason_are_no_fault_of_the_surface() {
        for factor in [1e15, 1e-15] {
            assert_eq!(fault(|mesh| mesh.vertices.iter_mut().for_each(|vertex| *vertex *= factor)), "");
        }
    }

    #[test]
    fn eigenvalues_are_those_of_the_matrix() {
        let turn = DMat3::from_rotation_x(0.3) * DMat3::from_rotation_z(1.1);
        let matrix = turn * DMat3::from_diagonal(DVec3::new(3.0, 1.0, 2.0)) * turn.transpose();
        let found = eigenvalues(matrix);
        assert!(found.iter().zip([1.0, 2.0, 3.0]).all(|(found, wanted)| (found - wanted).abs() < 1e-9), "{found:?}");
    }
}
