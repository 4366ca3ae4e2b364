//! Made-up people who differ in three known modes of bones, to try training on (METHOD-BODY section 16).
//!
//! The modes are size, legs against the trunk, and arms. Flesh has planted shapes and follows the bones by planted correctives, all smooth waves along
//! the normals. Poses are within the atoms' limits; registrations have noise. Metres.

use std::path::Path;

use glam::DVec3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use xavatar_body::BodyModel;
use xavatar_formats::{Result, create_folder, write_npz};
use xavatar_mesh::{TriangleMesh, write_ply};

use super::{BlsmBody, BlsmParameters};
use crate::registrations::TRUTH;

/// Scales of the trunk, the arms and the legs in each mode.
const MODES: [[f64; 3]; 3] = [[0.06, 0.06, 0.06], [-0.04, 0.01, 0.05], [0.01, 0.05, -0.01]];
/// Shapes of the flesh.
const SHAPES: usize = 4;
/// What a shape of 1 does to a vertex at most, and a mode of bones, metres.
const DEPTHS: [f64; 2] = [0.008, 0.004];
/// Of waves, metres.
const WAVE: f64 = 0.3;
/// The share of the way to a limit that poses reach.
const REACH: f64 = 0.5;

/// How people are made.
#[derive(Clone, Copy, Debug)]
pub struct BlsmPopulation {
    /// How many.
    pub subjects: usize,
    /// Registrations of each.
    pub poses: usize,
    /// Of every coordinate of a registration, metres.
    pub noise: f64,
    /// Of everything random.
    pub seed: u64,
}

impl BlsmPopulation {
    /// The body of people like `start`.
    pub fn body(&self, start: &BodyModel) -> BlsmBody {
        let mut body = BlsmBody::of(start);
        let normals = TriangleMesh {
            vertices: body.template.iter().map(|place| place.as_vec3()).collect(),
            faces: body.faces.clone(),
            ..TriangleMesh::default()
        }
        .vertex_normals();
        let mut random = self.random(0, usize::MAX);
        let mut waves = |depth: f64| -> Vec<DVec3> {
            let direction = DVec3::from_array(std::array::from_fn(|_| StandardNormal.sample(&mut random)));
            let (along, phase) =
                (direction.normalize_or(DVec3::Y) * std::f64::consts::TAU / WAVE, random.random::<f64>());
            let height = |place: &DVec3| (along.dot(*place) + std::f64::consts::TAU * phase).sin() * depth;
            body.template.iter().zip(&normals).map(|(place, normal)| normal.as_dvec3() * height(place)).collect()
        };
        let shapes = (0..SHAPES).map(|_| waves(DEPTHS[0])).collect();
        let correctives = (0..MODES.len()).map(|_| waves(DEPTHS[1])).collect();
        let kind = |name: &String| {
            let is_of = |words: &[&str]| words.iter().any(|word| name.contains(word));
            match (
                is_of(&["knee", "ankle", "foot"]),
                is_of(&["elbow", "wrist", "thumb", "index", "middle", "ring", "pinky", "hand"]),
            ) {
                (true, _) => 2,
                (_, true) => 1,
                _ => 0,
            }
        };
        let mode = |scales: [f64; 3]| {
            let of_joint = |(joint, name): (usize, &String)| if joint == 0 { 0.0 } else { scales[kind(name)] };
            body.names.iter().enumerate().map(of_joint).collect()
        };
        (body.bone_basis, body.bone_correctives, body.shape_basis) = (MODES.map(mode).to_vec(), correctives, shapes);
        body
    }

    /// The parameters of a frame of a subject.
    pub fn parameters(&self, body: &BlsmBody, subject: usize, frame: usize) -> BlsmParameters {
        let mut own = self.random(subject, 0);
        let mut normal = |count: usize| -> Vec<f64> { (0..count).map(|_| StandardNormal.sample(&mut own)).collect() };
        let (bones, shape) = (normal(body.bone_basis.len()), normal(body.shape_basis.len()));
        let mut random = self.random(subject, 1 + frame);
        let atom = |atom: &super::Atom| {
            let limit = if random.random::<bool>() { atom.high } else { atom.low };
            atom.coordinate(limit * REACH * random.random::<f64>())
        };
        let atoms = body.atoms.list.iter().map(atom).collect();
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let turn = DVec3::new(0.1 * normal(), 0.6 * normal(), 0.1 * normal());
        let translation = DVec3::new(normal(), 0.2 * normal(), normal()) * 0.3;
        let turn = glam::DMat3::from_quat(glam::DQuat::from_scaled_axis(turn));
        BlsmParameters { turn, translation, atoms, bones, shape }
    }

    /// The vertices of a registration, noise and all.
    pub fn registration(&self, body: &BlsmBody, subject: usize, frame: usize) -> Vec<DVec3> {
        let mut random = self.random(subject, 1_000_000 + frame);
        let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
        let posed = body.posed(&self.parameters(body, subject, frame)).vertices;
        posed.iter().map(|vertex| *vertex + DVec3::new(noise(), noise(), noise()) * self.noise).collect()
    }

    /// Writes registrations of people like `start`, and their body. `progress` is told the share that is done.
    ///
    /// # Errors
    /// If a file cannot be written; what `progress` returns.
    pub fn write(
        &self,
        start: &BodyModel,
        folder: &Path,
        mut progress: impl FnMut(f64) -> Result<()>,
    ) -> Result<BlsmBody> {
        let body = self.body(start);
        create_folder(&folder.join(TRUTH))?;
        write_npz(folder.join(TRUTH).join("blsm.npz"), &body.to_arrays())?;
        for subject in 0..self.subjects {
            progress(subject as f64 / self.subjects as f64)?;
            let own = folder.join(format!("{subject:02}"));
            create_folder(&own)?;
            for frame in 0..self.poses {
                let vertices = self.registration(&body, subject, frame).iter().map(|vertex| vertex.as_vec3()).collect();
                let mesh = TriangleMesh { vertices, faces: body.faces.clone(), ..TriangleMesh::default() };
                write_ply(own.join(format!("{frame:04}.ply")), &mesh)?;
            }
        }
        Ok(body)
    }

    /// A generator of its own for each purpose.
    fn random(&self, subject: usize, purpose: usize) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(((subject as u64) << 32) ^ purpose as u64);
        random
    }
}
