//! What the ground does to soft feet in made-up people (METHOD-BODY section 16): known, so that what is learned of it can be measured.
//!
//! A foot's vertices below the ground are on it, and the volume that they lose, sum_v a_v d_v of areas and depths, is spread over what is within 2 cm of them,
//! sideways: by s r_v h_v, r_v the less the farther, h_v the normal's horizontal part, s such that sum_v a_v s r_v |h_v|^2 is the volume. F vertices of the feet; metres, Y up.

use glam::{DVec3, Vec3};
use xavatar_body::BodyModel;
use xavatar_formats::Result;

use super::foot::SIDES;

/// How wide the ring is that the lost volume goes to.
const RING: f64 = 0.02;
/// How far it is moved at most.
const MOST: f64 = 0.006;

/// The plane y = 0 under a body's feet.
#[derive(Clone, Debug)]
pub struct SoftGround {
    /// Vertices of each foot.
    feet: [Vec<usize>; 2],
    faces: Vec<[u32; 3]>,
}

impl SoftGround {
    /// Under the feet of a body.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) if the body has no joints of the names of SMPL's ankles.
    pub fn of(model: &BodyModel) -> Result<Self> {
        let [left, right] = SIDES.map(|(_, joint)| model.vertices_from(joint));
        Ok(Self { feet: [left?, right?], faces: model.faces().to_vec() })
    }

    /// How far a body (V) is to be lifted so that its lowest foot is `depth` below the ground.
    pub(crate) fn lift(&self, vertices: &[Vec3], depth: f64) -> f32 {
        let heights = self.feet.iter().flatten().map(|vertex| vertices[*vertex].y);
        -(depth as f32) - heights.fold(f32::INFINITY, f32::min)
    }

    /// Presses the feet of a body (V).
    pub fn press(&self, vertices: &mut [Vec3]) {
        let mut pressed: Vec<DVec3> = vertices.iter().map(|vertex| vertex.as_dvec3()).collect();
        self.press_exactly(&mut pressed);
        vertices.iter_mut().zip(pressed).for_each(|(vertex, pressed)| *vertex = pressed.as_vec3());
    }

    fn press_exactly(&self, vertices: &mut [DVec3]) {
        let (areas, normals) = self.areas_and_normals(vertices);
        for foot in &self.feet {
            let (below, above): (Vec<usize>, Vec<usize>) = foot.iter().partition(|vertex| vertices[**vertex].y < 0.0);
            let lost: f64 = below.iter().map(|vertex| -vertices[*vertex].y * areas[*vertex]).sum();
            below.iter().for_each(|vertex| vertices[*vertex].y = 0.0);
            let nearness = |vertex: &usize| {
                let distances = below.iter().map(|pressed| vertices[*pressed].distance(vertices[*vertex]));
                (1.0 - distances.fold(RING, f64::min) / RING).max(0.0)
            };
            let ring: Vec<(usize, f64)> = above.iter().map(|vertex| (*vertex, nearness(vertex))).collect();
            let sideways = |vertex: usize| DVec3::new(normals[vertex].x, 0.0, normals[vertex].z);
            let room =
                |(vertex, nearness): &(usize, f64)| areas[*vertex] * nearness * sideways(*vertex).length_squared();
            let room: f64 = ring.iter().map(room).sum();
            if room <= 0.0 {
                continue;
            }
            let most = (lost / room).min(MOST);
            for (vertex, nearness) in ring {
                vertices[vertex] += sideways(vertex) * (most * nearness);
            }
        }
    }

    /// Of each vertex a third of its faces' areas, and its normal (V).
    fn areas_and_normals(&self, vertices: &[DVec3]) -> (Vec<f64>, Vec<DVec3>) {
        let mut sums = vec![DVec3::ZERO; vertices.len()];
        let mut areas = vec![0.0; vertices.len()];
        for face in &self.faces {
            let [a, b, c] = face.map(|corner| vertices[corner as usize]);
            let doubled = (b - a).cross(c - a);
            for corner in face {
                sums[*corner as usize] += doubled;
                areas[*corner as usize] += doubled.length() / 6.0;
            }
        }
        (areas, sums.into_iter().map(DVec3::normalize_or_zero).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An upright cylinder of 6 cm, in rings of 24 vertices from the middle of its bottom to that of its top.
    fn cylinder() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let around = 24;
        let bottom = [0.001, 0.01, 0.02, 0.03].map(|radius| (radius, 0.0));
        let sides = (1..=15).map(|ring| (0.03, 0.004 * f64::from(ring)));
        let rings: Vec<(f64, f64)> = bottom.into_iter().chain(sides).chain([(0.001, 0.06)]).collect();
        let place = |vertex: usize| {
            let (radius, height) = rings[vertex / around];
            let (sine, cosine) = (std::f64::consts::TAU * (vertex % around) as f64 / around as f64).sin_cos();
            DVec3::new(radius * sine, height, radius * cosine)
        };
        let at = |ring: usize, side: usize| (ring * around + side % around) as u32;
        let quads = (1..rings.len()).flat_map(|ring| (0..around).map(move |side| (ring - 1, side)));
        let faces = quads.flat_map(|(ring, side)| {
            let [a, b, c, d] = [at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side)];
            [[a, b, c], [a, c, d]]
        });
        ((0..rings.len() * around).map(place).collect(), faces.collect())
    }

    // What is below the ground is on it, nothing far away moves, and the volume is nearly what it was.
    #[test]
    fn what_the_ground_takes_goes_to_the_ring() {
        let (vertices, faces) = cylinder();
        let ground = SoftGround { feet: [(0..vertices.len()).collect(), Vec::new()], faces: faces.clone() };
        let volume = |vertices: &[DVec3]| -> f64 {
            let of_face = |face: &[u32; 3]| {
                let [a, b, c] = face.map(|corner| vertices[corner as usize]);
                a.dot(b.cross(c)) / 6.0
            };
            faces.iter().map(of_face).sum()
        };
        let sunk: Vec<DVec3> = vertices.iter().map(|vertex| *vertex - DVec3::Y * 0.001).collect();
        let mut pressed = sunk.clone();
        ground.press_exactly(&mut pressed);
        let mut cut = sunk.clone();
        cut.iter_mut().for_each(|vertex| vertex.y = vertex.y.max(0.0));
        let lost = volume(&sunk) - volume(&cut);
        assert!(pressed.iter().all(|vertex| vertex.y >= 0.0));
        assert!(
            lost > 0.0 && (volume(&pressed) - volume(&sunk)).abs() < 0.3 * lost,
            "{lost} {}",
            volume(&pressed) - volume(&sunk)
        );
        let moved = |(before, after): (&DVec3, &DVec3)| before.y < 0.025 || before == after;
        assert!(sunk.iter().zip(&pressed).all(moved));
    }
}
