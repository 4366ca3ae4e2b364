//! The subject's canonical body: what stage 0 fits, and what holds the fields later where no frame does (thesis ch. 4.3.2).
//!
//! Each step of stage 0 draws a random pose and one of a few random expressions; the condition says so, the target is the canonical
//! body of that expression. Supervised there directly, no search is needed: bone transforms are the identity.

use std::sync::Arc;

use glam::Vec3;
use rand::Rng;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use xavatar_deformer::BoneTransform;
use xavatar_network::Representation;

use super::uniform::{UNIFORM_POINTS, uniform_points};
use super::{Curve, DistanceGrid};
use crate::Result;
use crate::body::{BodyModel, PartLabels, Role, Skeleton};
use crate::config::Config;
use crate::fields::{CERTAINLY_OUTSIDE, Condition, canonical_box};
use crate::mesh::{SolidIndex, SurfaceSampler, TriangleMesh};
use crate::train::losses::{Anchors, CanonicalBatch, WeightTargets};

/// Expressions whose canonical bodies are kept ready.
const EXPRESSIONS: usize = 8;
/// Points on each bone that are inside (thesis A.3.3).
const POINTS_A_BONE: usize = 5;
/// Spread of the random joint angles, as the condition holds them (angle / pi).
const POSE_SPREAD: f32 = 0.1;
/// Vertices of the whole body whose weights are supervised at each step of stage 0, beside as many of hands and face.
const PRETRAINING_WEIGHT_POINTS: usize = 2048;
/// Vertices of hands and face whose weights are supervised at each step.
const WEIGHT_POINTS: usize = 1024;
/// Spread of the Eikonal points around canonical vertices, metres (METHOD section 5).
const EIKONAL_SPREAD: f32 = 0.05;
/// Spread of the points around the body whose weights are supervised, metres.
const VOLUME_SPREAD: f32 = 0.06;
/// How far below the surface weights are supervised, metres.
const VOLUME_DEPTH: f32 = 0.12;

/// Spread of the far points around the body, metres.
const FAR_SPREAD: f32 = 0.15;
/// Half the edge of the cube around a deep place in which points are drawn, metres.
const DEEP_SPREAD: f32 = 0.0125;
/// Depth in the unclothed body from which a point is inside, metres.
const CERTAINLY_INSIDE: f32 = 0.03;

const IDENTITY: BoneTransform<f32> = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// The body of a subject's shape in its canonical pose, ready to draw from.
pub(in crate::train) struct CanonicalBody<'a> {
    weights: &'a [f32],
    vertices: Vec<[f32; 3]>,
    skeleton: &'a Skeleton,
    condition: Condition,
    joints: Vec<Vec3>,
    bone_points: Vec<[f32; 3]>,
    /// Vertices of hands and face (or whatever is finer than the body).
    fine: Vec<usize>,
    expressions: Vec<ExpressiveBody>,
    /// Of the body without expression.
    distances: Arc<DistanceGrid>,
    /// Places that are inside for certain, evenly spread.
    deep_places: Vec<Vec3>,
    /// Draws the surface that no frame shows, of the body without expression; none if all of it is shown.
    unseen: Option<SurfaceSampler>,
}

/// The canonical body of one expression.
struct ExpressiveBody {
    expression: Vec<f32>,
    mesh: TriangleMesh,
    solid: SolidIndex,
    sampler: SurfaceSampler,
}

impl<'a> CanonicalBody<'a> {
    pub fn new(body: &'a BodyModel, labels: &PartLabels, betas: &[f32], config: &Config) -> Result<Self> {
        let (skeleton, joints) = (body.skeleton(), body.canonical_joints(betas)?);
        let condition = Condition::new(skeleton, body.expression_coefficients());
        let mut random = ChaCha8Rng::seed_from_u64(config.seed);
        let count = if condition.expressions() > 0 { EXPRESSIONS } else { 1 };
        let mut expression = vec![0.0; condition.expressions()];
        let mut expressions = Vec::with_capacity(count);
        for _ in 0..count {
            let mut mesh = body.mesh(body.canonical_vertices(betas, &expression)?);
            mesh.normals = Some(mesh.vertex_normals());
            let (solid, sampler) = (SolidIndex::new(&mesh)?, SurfaceSampler::new(&mesh, None)?);
            let next = expression.iter().map(|_| random.sample::<f32, _>(StandardNormal)).collect();
            let expression = std::mem::replace(&mut expression, next);
            expressions.push(ExpressiveBody { expression, mesh, solid, sampler });
        }
        let (low, high) = canonical_box(body.skeleton(), &expressions[0].mesh.vertices);
        let distances = DistanceGrid::new(&expressions[0].solid, low, high);
        Ok(Self {
            weights: body.skinning_weights(),
            vertices: expressions[0].mesh.vertices.iter().map(Vec3::to_array).collect(),
            bone_points: skeleton
                .bones(&joints)
                .iter()
                .flat_map(|bone| bone.points(POINTS_A_BONE))
                .map(|p| p.to_array())
                .collect(),
            fine: (0..labels.parts.len()).filter(|vertex| skeleton.role(labels.parts[*vertex]) != Role::Body).collect(),
            deep_places: match distances.nodes_below(-CERTAINLY_INSIDE) {
                deep if deep.is_empty() => joints.clone(),
                deep => deep,
            },
            skeleton,
            condition,
            joints,
            distances: Arc::new(distances),
            expressions,
            unseen: None,
        })
    }

    /// Lets the body stand in for the surface around the vertices (V) that are not in `seen`.
    pub fn stand_in(&mut self, seen: &[bool]) {
        let mesh = &self.expressions[0].mesh;
        let is_unseen = |face: &[u32; 3]| face.iter().all(|vertex| !seen[*vertex as usize]);
        let unseen: Vec<u32> =
            (0..).zip(&mesh.faces).filter(|(_, face)| is_unseen(face)).map(|(index, _)| index).collect();
        // Without area there is nothing to draw.
        self.unseen = SurfaceSampler::new(mesh, Some(&unseen)).ok();
    }

    /// Lets what is worn be as far from the body as it is, given the distance to it where it is near: there, that to the body says nothing
    /// of which side a point is on, or which of its roots is its own.
    pub fn wear(&mut self, worn: impl Fn(Vec3) -> Option<f32> + Sync) {
        if let Some(distances) = Arc::get_mut(&mut self.distances) {
            distances.wear(worn);
        }
    }

    /// What every frame is trained on beside its own points: known weights where the skinning field follows them, and points of the
    /// canonical box whose side is known.
    pub fn anchors(&self, config: &Config, follows_weights: bool, random: &mut ChaCha8Rng) -> Anchors<f32> {
        let mut anchors = self.weights(if follows_weights { WEIGHT_POINTS } else { 0 }, random);
        self.far(config.sampling.far_points, config.fields.representation, random, &mut anchors);
        if let Some(rgbd) = &config.rgbd {
            self.unseen(rgbd.unseen_points, config.sampling.deviation, random, &mut anchors);
        }
        if config.losses.eikonal > 0.0 {
            anchors.eikonal_points = self.around(config.losses.eikonal_points, EIKONAL_SPREAD, random);
        }
        anchors
    }

    /// Adds `count` points around the surface that no frame shows, with their distance to the body.
    fn unseen(&self, count: usize, deviation: f32, random: &mut ChaCha8Rng, anchors: &mut Anchors<f32>) {
        let (Some(sampler), body) = (&self.unseen, &self.expressions[0]) else { return };
        let mut draw = |_| body.mesh.position_at(&sampler.sample(random)) + deviation * normal_vector(random);
        let points: Vec<Vec3> = (0..count).map(&mut draw).collect();
        anchors.far_targets.par_extend(points.par_iter().map(|point| body.solid.signed_distance(*point).0));
        anchors.far_points.extend(points.iter().map(Vec3::to_array));
    }

    /// Points on bones, the weights of joints, and those of `count` vertices of hands and face and of as many points around the body.
    fn weights(&self, count: usize, random: &mut ChaCha8Rng) -> Anchors<f32> {
        let joint_weights = WeightTargets {
            points: self.joints.iter().map(Vec3::to_array).collect(),
            weights: (0..self.joints.len()).flat_map(|joint| self.skeleton.joint_weights(joint)).collect(),
        };
        let mut surface_weights = WeightTargets::default();
        for _ in 0..count.min(self.fine.len()) {
            let vertex = self.fine[random.random_range(0..self.fine.len())];
            self.add_vertex(vertex, &mut surface_weights);
        }
        let volume_weights = self.volume(count, random);
        let bone_points = self.bone_points.clone();
        Anchors { bone_points, joint_weights, surface_weights, volume_weights, ..Anchors::default() }
    }

    fn add_vertex(&self, vertex: usize, targets: &mut WeightTargets<f32>) {
        targets.points.push(self.vertices[vertex]);
        targets.weights.extend_from_slice(self.weights_of(vertex));
    }

    /// Points around the body and below its surface, with the weights of the nearest place on the surface.
    fn volume(&self, count: usize, random: &mut ChaCha8Rng) -> WeightTargets<f32> {
        let body = &self.expressions[0];
        let mut draw = |index: usize| {
            let place = body.sampler.sample(random);
            let position = body.mesh.position_at(&place);
            match index % 2 {
                0 => position + VOLUME_SPREAD * normal_vector(random),
                _ => position - VOLUME_DEPTH * random.random::<f32>() * body.mesh.normal_at(&place),
            }
        };
        let points: Vec<Vec3> = (0..count).map(&mut draw).collect();
        let joints = self.joints.len();
        let weights = body.solid.surface().closest_to_each(&points).into_iter().flat_map(|closest| {
            let corners = body.mesh.faces[closest.face as usize].map(|vertex| vertex as usize * joints);
            (0..joints).map(move |joint| -> f32 {
                corners.iter().zip(closest.barycentric).map(|(start, share)| share * self.weights[start + joint]).sum()
            })
        });
        WeightTargets { weights: weights.collect(), points: points.iter().map(Vec3::to_array).collect() }
    }

    /// Points N(0, deviation^2) around random canonical vertices.
    fn around(&self, count: usize, deviation: f32, random: &mut ChaCha8Rng) -> Vec<[f32; 3]> {
        let mut point = || {
            let vertex = self.vertices[random.random_range(0..self.vertices.len())];
            vertex.map(|coordinate| coordinate + deviation * random.sample::<f32, _>(StandardNormal))
        };
        (0..count).map(|_| point()).collect()
    }

    /// Adds points of the canonical box that are outside whatever is worn, or inside for certain: of `count` draws a quarter
    /// anywhere, a quarter around the body and half deep in it.
    fn far(&self, count: usize, representation: Representation, random: &mut ChaCha8Rng, anchors: &mut Anchors<f32>) {
        let body = &self.expressions[0];
        let (low, high) = self.bounds();
        let mut draw = |index: usize| match index % 4 {
            0 => low + (high - low) * Vec3::from_array(random.random()),
            1 => body.mesh.position_at(&body.sampler.sample(random)) + FAR_SPREAD * normal_vector(random),
            _ => {
                let deep = self.deep_places[random.random_range(0..self.deep_places.len())];
                deep + DEEP_SPREAD * Vec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0)))
            }
        };
        let mut points: Vec<Vec3> = (0..count).map(&mut draw).collect();
        let curve = Curve::over((low, high));
        points.sort_by_cached_key(|point| curve.place(*point));
        for point in points {
            let distance = self.distances.at(point.to_array());
            if !(-CERTAINLY_INSIDE..CERTAINLY_OUTSIDE).contains(&distance) {
                anchors.far_points.push(point.to_array());
                anchors.far_targets.push(match representation {
                    Representation::Occupancy => f32::from(distance < 0.0),
                    Representation::SignedDistance => distance,
                });
            }
        }
    }

    /// The batch of one step of stage 0.
    pub fn batch(&self, config: &Config, random: &mut ChaCha8Rng) -> CanonicalBatch<f32> {
        let body = &self.expressions[random.random_range(0..self.expressions.len())];
        let settings = &config.sampling;
        let mut batch = CanonicalBatch { bones: vec![IDENTITY; self.joints.len()], ..CanonicalBatch::default() };
        let angles = self.condition.angles();
        batch.condition.extend((0..angles).map(|_| POSE_SPREAD * random.sample::<f32, _>(StandardNormal)));
        batch.condition.extend(&body.expression);
        batch.anchors = self.weights(PRETRAINING_WEIGHT_POINTS, random);

        let mut off = Vec::with_capacity(settings.points + UNIFORM_POINTS);
        for index in 0..settings.points {
            let place = body.sampler.sample(random);
            let position = body.mesh.position_at(&place);
            // Every other point: half of the samples on the surface is enough for normals.
            if index % 2 == 0 {
                batch.on_points.push(position.to_array());
                batch.on_normals.push(body.mesh.normal_at(&place).to_array());
                batch.on_colours.push([0.5; 3]);
            }
            let wide = index % 4 == 3;
            let deviation = if wide { settings.wide_deviation } else { settings.deviation };
            off.push(position + deviation * normal_vector(random));
        }
        off.extend(uniform_points(random));
        let target = |point: &Vec3| match config.fields.representation {
            Representation::Occupancy => f32::from(body.solid.is_inside(*point)),
            Representation::SignedDistance => body.solid.signed_distance(*point).0,
        };
        batch.off_targets = off.par_iter().map(target).collect();
        batch.off_points = off.iter().map(Vec3::to_array).collect();

        for _ in 0..PRETRAINING_WEIGHT_POINTS {
            let vertex = random.random_range(0..self.vertices.len());
            self.add_vertex(vertex, &mut batch.anchors.surface_weights);
        }
        batch.anchors.eikonal_points = self.around(config.losses.eikonal_points, settings.wide_deviation, random);
        batch
    }

    /// The canonical box: the body and room around it.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        canonical_box(self.skeleton, &self.expressions[0].mesh.vertices)
    }

    /// Signed distance to the body.
    pub fn distances(&self) -> &Arc<DistanceGrid> {
        &self.distances
    }

    /// What the geometry is told of a pose.
    pub fn condition(&self) -> &Condition {
        &self.condition
    }

    /// The skinning weights (J) of a vertex.
    fn weights_of(&self, vertex: usize) -> &[f32] {
        &self.weights[vertex * self.joints.len()..][..self.joints.len()]
    }
}

fn normal_vector(random: &mut ChaCha8Rng) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|_| random.sample(StandardNormal)))
}
