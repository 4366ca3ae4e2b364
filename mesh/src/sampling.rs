//! Random points of a surface, uniform by area.

use rand::Rng;
use rand::distr::Distribution;
use rand_distr::weighted::WeightedAliasIndex;

use super::{SurfacePoint, TriangleMesh};
use xavatar_formats::{Error, Result};

/// Draws points of a mesh, or of some of its faces. Independent of the mesh once built.
#[derive(Clone, Debug)]
pub struct SurfaceSampler {
    /// The faces that have an area.
    faces: Vec<u32>,
    /// Draws one of them, each as often as it is large, in constant time.
    weighted: WeightedAliasIndex<f64>,
    /// Of all, square metres.
    area: f64,
}

impl SurfaceSampler {
    /// Prepares all faces of a mesh, or the given ones (one that is given twice counts twice).
    ///
    /// # Errors
    /// [`Error::Value`] for a face that the mesh does not have, or if no face has an area.
    pub fn new(mesh: &TriangleMesh, faces: Option<&[u32]>) -> Result<Self> {
        mesh.check()?;
        let all: Vec<u32>;
        let chosen = match faces {
            Some(faces) => faces,
            None => {
                all = (0..mesh.faces.len() as u32).collect();
                &all
            }
        };
        if let Some(face) = chosen.iter().find(|&&face| face as usize >= mesh.faces.len()) {
            return Err(Error::Value {
                name: "face to sample".into(),
                found: face.to_string(),
                expected: format!("less than the {} faces", mesh.faces.len()),
            });
        }
        let (faces, areas): (Vec<u32>, Vec<f64>) =
            chosen.iter().map(|face| (*face, mesh.face_area(*face))).filter(|(_, area)| *area > 0.0).unzip();
        let area = areas.iter().sum();
        let weighted = WeightedAliasIndex::new(areas).map_err(|_| Error::Value {
            name: "surface to sample".into(),
            found: format!("{} faces of {area} square metres", chosen.len()),
            expected: "a finite area above zero".into(),
        })?;
        Ok(Self { faces, weighted, area })
    }

    /// The area that is drawn from, square metres.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.area
    }

    /// One point.
    pub fn sample(&self, rng: &mut impl Rng) -> SurfacePoint {
        let index = self.weighted.sample(rng);
        // The upper half of the unit square, folded onto the lower, is uniform on the triangle.
        let (mut v, mut w) = (rng.random::<f32>(), rng.random::<f32>());
        if v + w > 1.0 {
            (v, w) = (1.0 - v, 1.0 - w);
        }
        SurfacePoint { face: self.faces[index], barycentric: [(1.0 - v - w).max(0.0), v, w] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Two separate triangles of areas 0.5 and 1.5, and one without area between them.
    fn mesh() -> TriangleMesh {
        let z = Vec3::Z;
        TriangleMesh {
            vertices: vec![Vec3::ZERO, Vec3::X, Vec3::Y, z, z + Vec3::X * 3.0, z + Vec3::Y],
            faces: vec![[0, 1, 2], [0, 1, 1], [3, 4, 5]],
            ..TriangleMesh::default()
        }
    }

    #[test]
    fn points_are_uniform_by_area_over_and_within_faces() {
        let (mesh, mut rng) = (mesh(), ChaCha8Rng::seed_from_u64(1));
        let sampler = SurfaceSampler::new(&mesh, None).unwrap();
        assert!((sampler.area() - 2.0).abs() < 1e-12);
        const COUNT: usize = 40_000;
        let points: Vec<SurfacePoint> = (0..COUNT).map(|_| sampler.sample(&mut rng)).collect();
        let share =
            |holds: &dyn Fn(&SurfacePoint) -> bool| points.iter().filter(|p| holds(p)).count() as f64 / COUNT as f64;
        // Five standard deviations of a share are below 0.0125.
        assert!((share(&|p| p.face == 2) - 0.75).abs() < 0.0125);
        assert_eq!(share(&|p| p.face == 1), 0.0);
        // The corner piece where one weight is above one half has a quarter of the area, whichever corner.
        for corner in 0..3 {
            assert!((share(&|p| p.barycentric[corner] > 0.5) - 0.25).abs() < 0.0125);
        }
        assert!(points.iter().all(|p| p.barycentric.iter().all(|&b| b >= 0.0)));
    }

    #[test]
    fn only_the_given_faces_are_drawn_and_a_seed_repeats() {
        let mesh = mesh();
        let sampler = SurfaceSampler::new(&mesh, Some(&[0])).unwrap();
        let draw = || {
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            (0..100).map(|_| sampler.sample(&mut rng)).collect::<Vec<_>>()
        };
        assert!(draw().iter().all(|p| p.face == 0));
        assert_eq!(draw(), draw());
    }

    #[test]
    fn nothing_to_draw_from_is_an_error() {
        for faces in [&[][..], &[1], &[3]] {
            assert!(SurfaceSampler::new(&mesh(), Some(faces)).is_err());
        }
        assert!(SurfaceSampler::new(&TriangleMesh::default(), None).is_err());
    }
}
