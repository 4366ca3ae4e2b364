//! People that examples make up: a body's mesh with fewer vertices, bones, limbs and two bulges of their own.

use std::path::Path;

use glam::DVec3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use xavatar_body::{BodyModel, Gender};
use xavatar_formats::Result;
use xavatar_learned::blsm::{Atom, BlsmBody, BlsmParameters, BlsmPopulation};
use xavatar_mesh::{TriangleMesh, decimated};

/// Joints that are turned, and the axis: legs forward and back, arms up and down, elbows.
const LIMBS: [(&str, usize); 4] = [("hip", 0), ("knee", 0), ("shoulder", 2), ("elbow", 1)];
/// How wide a bulge is, and how deep at least, metres.
const BULGE: [f64; 2] = [0.06, 0.02];
/// Where bulges sit: heights from the hips, and how far to a side, metres.
const REGION: [f64; 2] = [0.45, 0.15];
const POPULATION: BlsmPopulation = BlsmPopulation { subjects: 0, poses: 1, noise: 0.0, seed: 0 };

/// The body with about so many vertices.
pub fn body(file: &Path, vertices: usize) -> Result<BlsmBody> {
    let start = BodyModel::load(file, Gender::of_file_name(file).unwrap_or_default())?;
    let whole = POPULATION.body(&start);
    let few = decimated(&whole.bent(), 2 * vertices);
    let chosen: Vec<usize> = few.sources.iter().map(|vertex| *vertex as usize).collect();
    Ok(BlsmBody { faces: few.mesh.faces, ..whole.chosen(&chosen) })
}

/// The shape (V) of a person of this number: with bones and limbs of its own, these turned as far as half of their limits, or on the same bones and at rest.
pub fn shape(body: &BlsmBody, person: usize, is_posed: bool) -> Vec<DVec3> {
    let own = POPULATION.parameters(body, person, 0);
    let angles = body.atoms.angles(&own.atoms);
    let is_limb =
        |atom: &Atom| LIMBS.iter().any(|(limb, axis)| body.names[atom.joint].contains(limb) && *axis == atom.axis);
    let turned = |(atom, angle): (&Atom, f64)| atom.coordinate(if is_posed && is_limb(atom) { angle } else { 0.0 });
    let atoms = body.atoms.list.iter().zip(angles).map(turned).collect();
    let bones = if is_posed { own.bones } else { vec![0.0; own.bones.len()] };
    let parameters = BlsmParameters { bones, shape: own.shape, atoms, ..body.rest() };
    bulging(body, person).posed(&parameters).vertices
}

/// The body with a person's bulges.
fn bulging(body: &BlsmBody, person: usize) -> BlsmBody {
    let mut random = ChaCha8Rng::seed_from_u64(77);
    random.set_stream(person as u64);
    let vertices = body.template.iter().map(|place| place.as_vec3()).collect();
    let mesh = TriangleMesh { vertices, faces: body.faces.clone(), ..TriangleMesh::default() };
    let normals = mesh.vertex_normals();
    let mut bulging = body.clone();
    let hips = body.skeleton.rest()[0];
    for side in [-1.0, 1.0] {
        let (up, across) = (REGION[0] * random.random::<f64>(), REGION[1] * random.random::<f64>());
        let deep: f64 = StandardNormal.sample(&mut random);
        let middle = hips + DVec3::new(side * across, up, 0.1 * side);
        for ((place, normal), rest) in bulging.template.iter_mut().zip(&normals).zip(&body.template) {
            let share = (-rest.distance_squared(middle) / (2.0 * BULGE[0] * BULGE[0])).exp();
            *place += normal.as_dvec3() * (BULGE[1] * (1.0 + deep.abs()) * share);
        }
    }
    bulging
}

/// Of a vertex of these from those, metres.
pub fn mean_distance(these: &[Vec<DVec3>], those: &[Vec<DVec3>]) -> f64 {
    let pairs = these.iter().flatten().zip(those.iter().flatten());
    pairs.map(|(one, other)| one.distance(*other)).sum::<f64>() / these.iter().map(Vec::len).sum::<usize>() as f64
}
