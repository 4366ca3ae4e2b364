//! A made-up population whose truth is known, to try every training on (METHOD-BODY section 16).
//!
//! Subjects have random shapes of a body, poses turn its joints at random, and skinning is corrected by sparse quaternion blocks of two joints a
//! vertex that vary smoothly over the surface. Where people stand on the ground their legs turn less, their feet lie nearly flat, and the ground presses them. Registrations are such bodies with noise. The truth is a body file, and what is a subject's own.

use glam::{DVec3, Quat, Vec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use xavatar_body::{BodyModel, Pose, PoseAxisAngle, Skeleton};
use xavatar_formats::Result;

use crate::core::{Identity, shaped, weight_rows, with_identity, with_skin};
use crate::feet::SoftGround;
use crate::sparse::SparseCorrectives;

/// Shape coefficients that subjects differ in at most.
const SHAPES: usize = 10;
/// Corrective blocks of a vertex.
const BLOCKS: usize = 2;
/// How a block's directions vary: waves of about this length, metres.
const WAVE: f64 = 0.25;
/// What a block of waves of height one does to a vertex in the poses, root mean square, by which blocks are as large as their effect is wanted.
const TYPICAL: f64 = 0.29;
/// Deviation of a joint's turn, radians: of the trunk, of limbs, of fingers, of the eyes and the jaw.
const TURNS: [f32; 4] = [0.15, 0.4, 0.3, 0.1];
/// Of the root's, about the vertical.
const YAW: f32 = 0.6;
/// What a leg's turns are multiplied by where people stand.
const STANDING: f32 = 0.4;
/// Deviation of a standing foot's turn from lying flat, radians: heel to toe, about the vertical, to its sides.
const TILT: Vec3 = Vec3::new(0.12, 0.1, 0.06);
/// How deep the lowest foot sinks into the ground at most, metres.
const DEPTH: f64 = 0.008;

/// How a population is made.
#[derive(Clone, Copy, Debug)]
pub struct Population {
    /// How many people.
    pub subjects: usize,
    /// Registrations of each.
    pub poses: usize,
    /// Of every coordinate of a registration, metres.
    pub noise: f64,
    /// What correctives do to a vertex of a body with SMPL's joints on average, metres.
    pub effect: f64,
    /// Whether people stand on the ground, y = 0, which presses their feet.
    pub ground: bool,
    /// Of everything random.
    pub seed: u64,
}

impl Default for Population {
    fn default() -> Self {
        Self { subjects: 20, poses: 50, noise: 2e-3, effect: 12e-3, ground: false, seed: 0 }
    }
}

/// The truth of a population.
pub struct Truth {
    /// The body, with its shapes and correctives.
    pub model: BodyModel,
    /// The subjects at rest.
    pub subjects: Vec<Identity>,
    /// The poses of each.
    pub poses: Vec<Vec<Pose>>,
    /// What they stand on.
    pub ground: Option<SoftGround>,
}

impl Population {
    /// The truth of people like `start`, which gives skeleton, weights and shapes; what corrects it is replaced.
    ///
    /// # Errors
    /// Those of [`BodyModel::assemble`]; those of [`SoftGround::of`] where people stand.
    pub fn truth(&self, start: &BodyModel) -> Result<Truth> {
        let joints = start.skeleton().joints.len();
        let correctives = self.correctives(start).to_body(joints);
        let model = with_skin(start, &weight_rows(start), correctives)?;
        let identity = |subject: usize| {
            let mut random = self.random(subject, 0);
            let coefficients = model.shape_coefficients().min(SHAPES);
            let shape: Vec<f64> = (0..coefficients).map(|_| StandardNormal.sample(&mut random)).collect();
            shaped(&model, &shape)
        };
        let poses = |subject: usize| (0..self.poses).map(|frame| self.pose(start, subject, frame)).collect();
        let mut truth = Truth {
            subjects: (0..self.subjects).map(identity).collect(),
            poses: (0..self.subjects).map(poses).collect(),
            ground: if self.ground { Some(SoftGround::of(&model)?) } else { None },
            model,
        };
        self.stand(&mut truth)?;
        Ok(truth)
    }

    /// Puts people on the ground, where there is any.
    fn stand(&self, truth: &mut Truth) -> Result<()> {
        let Some(ground) = &truth.ground else { return Ok(()) };
        for (subject, (identity, poses)) in truth.subjects.iter().zip(&mut truth.poses).enumerate() {
            let body = with_identity(&truth.model, identity)?;
            for (frame, pose) in poses.iter_mut().enumerate() {
                let depth = DEPTH * self.random(subject, 2_000_000 + frame).random::<f64>();
                pose.translation.y += ground.lift(&body.pose(pose)?.vertices, depth);
            }
        }
        Ok(())
    }

    /// The vertices of a registration, noise and all.
    ///
    /// # Errors
    /// Those of posing.
    pub fn registration(&self, truth: &Truth, subject: usize, frame: usize) -> Result<Vec<Vec3>> {
        let body = with_identity(&truth.model, &truth.subjects[subject])?;
        self.registrations_of(truth, &body, subject, frame)
    }

    /// As [`registration`](Self::registration), of the subject's own body, which takes a while to make.
    ///
    /// # Errors
    /// Those of posing.
    pub fn registrations_of(&self, truth: &Truth, body: &BodyModel, subject: usize, frame: usize) -> Result<Vec<Vec3>> {
        let mut random = self.random(subject, 1_000_000 + frame);
        let mut vertices = body.pose(&truth.poses[subject][frame])?.vertices;
        if let Some(ground) = &truth.ground {
            ground.press(&mut vertices);
        }
        for vertex in &mut vertices {
            let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
            *vertex += (DVec3::new(noise(), noise(), noise()) * self.noise).as_vec3();
        }
        Ok(vertices)
    }

    /// Blocks of the two joints that each vertex follows most, the root left out; where it follows fewer, of those nearest to it.
    fn correctives(&self, model: &BodyModel) -> SparseCorrectives {
        let rest = Identity::of(model);
        let mut random = self.random(0, usize::MAX);
        let scale = self.effect / (TYPICAL * (BLOCKS as f64).sqrt());
        // A wave for every joint, feature and axis.
        let mut wave = || {
            let direction = DVec3::new(
                StandardNormal.sample(&mut random),
                StandardNormal.sample(&mut random),
                StandardNormal.sample(&mut random),
            );
            (
                direction * std::f64::consts::TAU / WAVE / 3.0_f64.sqrt() * 0.5,
                random.random::<f64>() * std::f64::consts::TAU,
            )
        };
        let joints = rest.joints.len();
        let waves: Vec<[[(DVec3, f64); 3]; 4]> =
            (0..joints).map(|_| std::array::from_fn(|_| std::array::from_fn(|_| wave()))).collect();
        let block = |joint: usize, place: DVec3| {
            waves[joint].map(|of_feature| {
                DVec3::from_array(of_feature.map(|(direction, phase)| (direction.dot(place) + phase).sin() * scale))
            })
        };
        let blocks = |(vertex, row): (usize, &Vec<(usize, f64)>)| {
            let place = rest.template[vertex];
            let rank = |joint: &usize| {
                let weight = row.iter().find(|(of, _)| of == joint).map_or(0.0, |(_, weight)| *weight);
                (-weight, rest.joints[*joint].distance_squared(place))
            };
            let mut order: Vec<usize> = (1..joints).collect();
            order.sort_by(|one, other| {
                let (one, other) = (rank(one), rank(other));
                one.0.total_cmp(&other.0).then(one.1.total_cmp(&other.1))
            });
            order.truncate(BLOCKS);
            order.sort_unstable();
            order.into_iter().map(|joint| (joint - 1, block(joint, place))).collect()
        };
        SparseCorrectives { vertices: weight_rows(model).iter().enumerate().map(blocks).collect() }
    }

    fn pose(&self, model: &BodyModel, subject: usize, frame: usize) -> Pose {
        let mut random = self.random(subject, 1 + frame);
        let mut normal = || -> f32 { StandardNormal.sample(&mut random) };
        let rotations = model.skeleton().joints.iter().enumerate().map(|(joint, name)| {
            let is_standing_leg = self.ground && ["hip", "knee", "ankle"].iter().any(|part| name.contains(part));
            let deviation = TURNS[kind_of(name)] * if is_standing_leg { STANDING } else { 1.0 };
            let turn = Vec3::new(normal(), normal(), normal()).clamp(Vec3::splat(-2.5), Vec3::splat(2.5));
            PoseAxisAngle(if joint == 0 { Vec3::new(0.1, YAW, 0.1) * turn } else { turn * deviation })
        });
        let mut rotations: Vec<PoseAxisAngle> = rotations.collect();
        if self.ground {
            let mut tilt = || Vec3::new(normal(), normal(), normal()) * TILT;
            ["left_ankle", "right_ankle"].into_iter().filter_map(|name| model.skeleton().joint(name)).for_each(
                |ankle| {
                    rotations[ankle] = flat(model.skeleton(), &rotations, ankle, tilt());
                },
            );
        }
        Pose { rotations, translation: Vec3::new(normal(), 0.2 * normal(), normal()) * 0.3, ..Pose::default() }
    }

    /// A generator of its own for each purpose.
    fn random(&self, subject: usize, purpose: usize) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(((subject as u64) << 32) ^ purpose as u64);
        random
    }
}

/// How an ankle turns so that its foot lies flat but for a tilt, with the heading of its shin.
fn flat(skeleton: &Skeleton, rotations: &[PoseAxisAngle], ankle: usize, tilt: Vec3) -> PoseAxisAngle {
    let above = std::iter::successors(skeleton.parents[ankle], |joint| skeleton.parents[*joint]);
    let shin = above.fold(Quat::IDENTITY, |turn, joint| Quat::from_scaled_axis(rotations[joint].0) * turn);
    let heading = Quat::from_xyzw(0.0, shin.y, 0.0, shin.w).normalize();
    PoseAxisAngle((shin.inverse() * heading * Quat::from_scaled_axis(tilt)).to_scaled_axis())
}

/// The place of a joint's deviation in [`TURNS`], by its name.
fn kind_of(joint: &str) -> usize {
    let is = |words: &[&str]| words.iter().any(|word| joint.contains(word));
    if is(&["eye", "jaw"]) {
        3
    } else if is(&["index", "middle", "pinky", "ring", "thumb"]) {
        2
    } else if is(&["spine", "neck", "head", "collar", "pelvis", "foot"]) {
        0
    } else {
        1
    }
}
