//! The loss terms and their gradients at known canonical points (thesis ch. 4.3.1, METHOD section 5).
//!
//! L = occupancy BCE(P_off), or distance |f - d| (P_off, P_on), and normal ||n_d - n||^2, colour ||c - c_gt||_1 (P_on),
//! bone BCE(points on bones are inside), joint, surface and volume ||w - w_gt||^2, eikonal (|grad f| - 1)^2, free space (f within
//! bounds); each times its weight.
//! Means over points, sums over components. Where an off-surface point was found by the search, its cotangent goes on to the
//! skinning field by the implicit function theorem.
//!
//! Each thread takes every T-th block of rows into gradients of its own, which are summed in thread order: the result
//! depends on the number of threads T and on nothing else.

mod free_space;

use std::collections::BTreeMap;
use std::ops::Range;

use rayon::prelude::*;
use xavatar_deformer::{
    BoneTransform, Jacobian, blend_transforms, deform_backward, deformed_normals, deformed_normals_backward,
    jacobians_backward, root_cotangents, skinning_jacobians,
};
use xavatar_network::{
    Backward, Mlp, MlpGradient, Real, Representation, SkinningTrace, SkinningWeights, SummedGradient, TextureField,
    Trace,
};

use crate::Result;
use crate::config::LossSettings;
use crate::fields::{Fields, Skinning};

/// Rows of a block: its activations stay in the cache from the first sweep to the last.
const BLOCK_ROWS: usize = 256;

/// What one frame's losses are computed from, in canonical space.
#[derive(Clone, Debug, Default)]
pub struct CanonicalBatch<T> {
    /// c = [theta_b / pi, psi].
    pub condition: Vec<T>,
    /// Bone transforms, canonical to posed (J).
    pub bones: Vec<BoneTransform<T>>,
    /// P_off: canonical points.
    pub off_points: Vec<[T; 3]>,
    /// Of each: 1 inside and 0 outside for occupancy; else the signed distance, metres.
    pub off_targets: Vec<T>,
    /// Canonical points that are far from the surface whatever the frame, on a side that is known.
    pub far_points: Vec<[T; 3]>,
    /// Of each: what `off_targets` holds.
    pub far_targets: Vec<T>,
    /// P_on: canonical points.
    pub on_points: Vec<[T; 3]>,
    /// Of each: the unit normal of the deformed surface.
    pub on_normals: Vec<[T; 3]>,
    /// Of each: the colour in [0, 1].
    pub on_colours: Vec<[T; 3]>,
    /// Canonical points on bones, all inside.
    pub bone_points: Vec<[T; 3]>,
    /// Canonical joints, and the weights they should have (., J).
    pub joint_weights: WeightTargets<T>,
    /// Canonical vertices of hands and face, and the weights they should have (., J).
    pub surface_weights: WeightTargets<T>,
    /// Canonical points around and inside the body, and the weights of the nearest place on its surface (., J).
    pub volume_weights: WeightTargets<T>,
    /// Canonical points where the field should be a distance.
    pub eikonal_points: Vec<[T; 3]>,
    /// Canonical points of the air.
    pub free_points: Vec<[T; 3]>,
    /// Of each: the least and the greatest distance that the surface may have from it, metres.
    pub free_bounds: Vec<[T; 2]>,
    /// Whether the off-surface cotangents reach the skinning field.
    pub implicit_gradient: bool,
}

/// Canonical points and the skinning weights they should have.
#[derive(Clone, Debug, Default)]
pub struct WeightTargets<T> {
    /// Canonical points (N).
    pub points: Vec<[T; 3]>,
    /// Weights (N, J).
    pub weights: Vec<T>,
}

/// The unweighted loss terms by name, and their weighted sum as `total`.
pub type LossTerms = BTreeMap<&'static str, f64>;

#[derive(Clone, Debug)]
enum Block {
    Off(Range<usize>),
    Far(Range<usize>),
    On(Range<usize>),
    Bone(Range<usize>),
    Joint(Range<usize>),
    Surface(Range<usize>),
    Volume(Range<usize>),
    Eikonal(Range<usize>),
    FreeSpace(Range<usize>),
}

/// Computes losses and gradients; keeps the memory of its threads between calls.
#[derive(Debug)]
pub struct LossEvaluator<T> {
    workers: Vec<Worker<T>>,
}

/// One thread's activations, gradients and sums.
#[derive(Debug)]
struct Worker<T> {
    /// Of each network.
    gradients: Vec<MlpGradient<T>>,
    /// Of the off-surface points that the search found: the first one's index, and their cotangents.
    root_cotangents: Vec<(usize, Vec<[T; 3]>)>,
    terms: LossTerms,
    embedded_cotangent: Vec<T>,
    geometry: Trace<T>,
    texture: Trace<T>,
    skinning: SkinningTrace<T>,
    buffers: Buffers<T>,
}

/// Row buffers of one block.
#[derive(Debug, Default)]
struct Buffers<T> {
    weights: Vec<T>,
    weight_gradients: Vec<T>,
    weight_cotangents: Vec<T>,
    weight_gradient_cotangents: Vec<T>,
    transforms: Vec<BoneTransform<T>>,
    jacobians: Vec<Jacobian<T>>,
    jacobian_cotangents: Vec<Jacobian<T>>,
    normals: Vec<[T; 3]>,
    normal_cotangents: Vec<[T; 3]>,
    gradient_cotangents: Vec<[T; 3]>,
    point_cotangents: Vec<[T; 3]>,
    values: Vec<T>,
    texture_points: Vec<T>,
    features: Vec<T>,
    colours: Vec<T>,
}

impl<T: Real> LossEvaluator<T> {
    /// An evaluator for `fields` that runs on `threads` threads.
    pub fn new(fields: &Fields<T>, threads: usize) -> Self {
        let worker = || Worker {
            gradients: fields.networks().into_iter().map(Mlp::zero_gradient).collect(),
            root_cotangents: Vec::new(),
            terms: LossTerms::new(),
            embedded_cotangent: Vec::new(),
            geometry: Trace::default(),
            texture: Trace::default(),
            skinning: SkinningTrace::default(),
            buffers: Buffers::default(),
        };
        Self { workers: (0..threads.max(1)).map(|_| worker()).collect() }
    }

    /// Adds `share` times the gradient of the weighted losses of `batch`; returns the loss terms.
    ///
    /// # Errors
    /// If the batch's arrays disagree about the skeleton.
    pub fn accumulate(
        &mut self,
        fields: &Fields<T>,
        batch: &CanonicalBatch<T>,
        losses: &LossSettings,
        share: f64,
    ) -> Result<LossTerms> {
        let embedded = fields.geometry.mlp.embed(&batch.condition);
        let frame = Frame { fields, batch, losses, share, embedded: &embedded };
        let blocks = frame.blocks();
        let threads = self.workers.len();
        self.workers.par_iter_mut().enumerate().try_for_each(|(thread, worker)| {
            worker.terms.clear();
            worker.root_cotangents.clear();
            worker.embedded_cotangent.clear();
            worker.embedded_cotangent.resize(embedded.len(), T::zero());
            blocks.iter().skip(thread).step_by(threads).try_for_each(|block| worker.run(&frame, block))
        })?;
        let mut terms = LossTerms::new();
        for worker in &mut self.workers {
            let Worker { gradients, embedded_cotangent, .. } = worker;
            fields.geometry.mlp.embed_backward(&batch.condition, embedded_cotangent, &mut gradients[0]);
            for (name, value) in &worker.terms {
                *terms.entry(name).or_default() += value;
            }
        }
        let total = terms.iter().map(|(name, value)| weight_of(losses, name) * value).sum();
        terms.insert("total", total);
        Ok(terms)
    }

    /// The cotangents of the last batch's off-surface points, in their order, for a skinning field on a grid.
    pub fn root_cotangents(&self, points: usize) -> Vec<[T; 3]> {
        let mut cotangents = vec![[T::zero(); 3]; points];
        for (first, values) in self.workers.iter().flat_map(|worker| &worker.root_cotangents) {
            cotangents[*first..first + values.len()].copy_from_slice(values);
        }
        cotangents
    }

    /// Sums each network's gradient since the last call.
    pub fn sum_gradients<'a>(&'a mut self, fields: &Fields<T>) -> Vec<SummedGradient<'a, T>> {
        let mut of_threads: Vec<_> = self.workers.iter_mut().map(|worker| worker.gradients.iter_mut()).collect();
        let networks = fields.networks().into_iter();
        networks.map(|network| network.sum_gradients(of_threads.iter_mut().filter_map(Iterator::next))).collect()
    }

    /// Takes the parameters' gradients of each network since the last call, and sets the sums to zero.
    pub fn take_gradients(&mut self, fields: &Fields<T>) -> Vec<Vec<T>> {
        let networks = fields.networks();
        let mut index = 0;
        let gradient_of = |network: &Mlp<T>| {
            let (first, others) = self.workers.split_at_mut(1);
            let sum = &mut first[0].gradients[index];
            for other in others {
                sum.add(&other.gradients[index]);
                other.gradients[index].clear();
            }
            let mut gradient = vec![T::zero(); network.layout().len()];
            network.parameter_gradient(sum, &mut gradient);
            sum.clear();
            index += 1;
            gradient
        };
        networks.into_iter().map(gradient_of).collect()
    }
}

fn weight_of(losses: &LossSettings, term: &str) -> f64 {
    match term {
        "occupancy" => losses.occupancy,
        "distance" => losses.distance,
        "normal" => losses.normal,
        "colour" => losses.colour,
        "bone" => losses.bone,
        "joint" => losses.joint,
        "surface" => losses.surface,
        "volume" => losses.volume,
        "eikonal" => losses.eikonal,
        "free_space" => losses.free_space,
        _ => 0.0,
    }
}

/// What all blocks of one frame share.
struct Frame<'a, T> {
    fields: &'a Fields<T>,
    batch: &'a CanonicalBatch<T>,
    losses: &'a LossSettings,
    share: f64,
    embedded: &'a [T],
}

impl<T: Real> Frame<'_, T> {
    /// The blocks of every term whose weight is not zero, the dearest first.
    fn blocks(&self) -> Vec<Block> {
        let LossSettings {
            occupancy, distance, normal, colour, bone, joint, surface, volume, eikonal, free_space, ..
        } = *self.losses;
        let batch = self.batch;
        let mut blocks = Vec::new();
        let mut cut = |wanted: bool, rows: usize, block: fn(Range<usize>) -> Block| {
            if wanted {
                blocks.extend((0..rows).step_by(BLOCK_ROWS).map(|first| block(first..rows.min(first + BLOCK_ROWS))));
            }
        };
        cut(normal + colour + distance > 0.0, batch.on_points.len(), Block::On);
        cut(occupancy + distance > 0.0, batch.off_points.len(), Block::Off);
        cut(occupancy + distance > 0.0, batch.far_points.len(), Block::Far);
        cut(eikonal > 0.0, batch.eikonal_points.len(), Block::Eikonal);
        cut(free_space > 0.0, batch.free_points.len(), Block::FreeSpace);
        cut(bone > 0.0, batch.bone_points.len(), Block::Bone);
        cut(surface > 0.0, batch.surface_weights.points.len(), Block::Surface);
        cut(volume > 0.0, batch.volume_weights.points.len(), Block::Volume);
        cut(joint > 0.0, batch.joint_weights.points.len(), Block::Joint);
        blocks
    }

    /// share * weight / N: what a point's unweighted loss is multiplied by.
    fn factor(&self, weight: f64, points: usize) -> T {
        T::of(self.share * weight / points as f64)
    }
}

impl<T: Real> Worker<T> {
    fn run(&mut self, frame: &Frame<T>, block: &Block) -> Result<()> {
        match block {
            Block::Off(rows) => {
                let batch = frame.batch;
                let points = &batch.off_points[rows.clone()];
                self.off_surface(frame, points, &batch.off_targets[rows.clone()], batch.implicit_gradient)?;
                if batch.implicit_gradient && frame.fields.skinning.voxels().is_some() {
                    self.root_cotangents.push((rows.start, self.geometry.point_cotangent().as_chunks().0.to_vec()));
                }
                Ok(())
            }
            Block::Far(rows) => {
                let batch = frame.batch;
                self.off_surface(frame, &batch.far_points[rows.clone()], &batch.far_targets[rows.clone()], false)
            }
            Block::On(rows) => self.on_surface(frame, rows.clone()),
            Block::Eikonal(rows) => {
                self.eikonal(frame, rows.clone());
                Ok(())
            }
            Block::FreeSpace(rows) => {
                self.free_space(frame, rows.clone());
                Ok(())
            }
            Block::Bone(rows) => {
                self.bone(frame, rows.clone());
                Ok(())
            }
            Block::Joint(rows) => {
                self.weights("joint", frame, &frame.batch.joint_weights, frame.losses.joint, rows.clone());
                Ok(())
            }
            Block::Surface(rows) => {
                self.weights("surface", frame, &frame.batch.surface_weights, frame.losses.surface, rows.clone());
                Ok(())
            }
            Block::Volume(rows) => {
                self.weights("volume", frame, &frame.batch.volume_weights, frame.losses.volume, rows.clone());
                Ok(())
            }
        }
    }

    fn add_term(&mut self, name: &'static str, sum: f64, points: usize) {
        *self.terms.entry(name).or_default() += sum / points as f64;
    }

    fn add_embedded(&mut self, cotangent: &[T]) {
        for (sum, value) in self.embedded_cotangent.iter_mut().zip(cotangent) {
            *sum += *value;
        }
    }

    fn off_surface(&mut self, frame: &Frame<T>, points: &[[T; 3]], targets: &[T], implicit: bool) -> Result<()> {
        let Frame { fields, batch, losses, .. } = frame;
        let total = batch.off_points.len() + batch.far_points.len();
        fields.geometry.mlp.forward(&mut self.geometry, points.as_flattened(), frame.embedded, &[]);
        self.buffers.values.clear();
        let outputs = self.geometry.output().iter().zip(targets);
        let mut sum = 0.0;
        match fields.geometry.representation {
            Representation::Occupancy => {
                let factor = frame.factor(losses.occupancy, total);
                self.buffers.values.extend(outputs.map(|(logit, target)| {
                    let (loss, slope) = cross_entropy(*logit, *target);
                    sum += loss.wide();
                    factor * slope
                }));
                self.add_term("occupancy", sum, total);
            }
            Representation::SignedDistance => {
                let (factor, truncation) = (frame.factor(losses.distance, total), T::of(losses.truncation));
                self.buffers.values.extend(outputs.map(|(distance, target)| {
                    let error = truncated_error(*distance, *target, truncation);
                    sum += error.abs().wide();
                    factor * sign(error)
                }));
                self.add_term("distance", sum, total);
            }
        }
        let wanted = if implicit { Backward::ParametersAndPoints } else { Backward::Parameters };
        let Self { geometry, gradients, buffers, .. } = self;
        let on_embedded = fields.geometry.mlp.backward(geometry, &buffers.values, None, wanted, &mut gradients[0]);
        self.add_embedded(&on_embedded);
        if implicit { self.implicit_gradient(frame, points) } else { Ok(()) }
    }

    /// Carries the cotangent of roots x_c, left in the geometry's trace, to the skinning network: -J^-T x_c_bar on d_w at fixed x_c.
    fn implicit_gradient(&mut self, frame: &Frame<T>, points: &[[T; 3]]) -> Result<()> {
        let Skinning::Network(field) = &frame.fields.skinning else { return Ok(()) };
        self.skin(frame, points)?;
        let Self { geometry, skinning, gradients, buffers, .. } = self;
        let Buffers { transforms, jacobians, normal_cotangents, point_cotangents, weight_cotangents, .. } = buffers;
        clear(normal_cotangents, points.len(), [T::zero(); 3]);
        root_cotangents(jacobians, geometry.point_cotangent().as_chunks().0, normal_cotangents)?;
        clear(weight_cotangents, points.len() * frame.batch.bones.len(), T::zero());
        clear(point_cotangents, points.len(), [T::zero(); 3]);
        let bones = &frame.batch.bones;
        deform_backward(transforms, bones, points, normal_cotangents, weight_cotangents, point_cotangents)?;
        field.backward(skinning, weight_cotangents, None, Backward::Parameters, &mut gradients[2]);
        Ok(())
    }

    /// Weights, their gradients, blended transforms and Jacobians at `points`.
    fn skin(&mut self, frame: &Frame<T>, points: &[[T; 3]]) -> Result<()> {
        let bones = &frame.batch.bones;
        let Buffers { weights, weight_gradients, transforms, jacobians, .. } = &mut self.buffers;
        weights.resize(points.len() * bones.len(), T::zero());
        weight_gradients.resize(3 * points.len() * bones.len(), T::zero());
        transforms.resize(points.len(), [T::zero(); 12]);
        jacobians.resize(points.len(), [[T::zero(); 3]; 3]);
        frame.fields.skinning.weights_and_gradients(&mut self.skinning, points, weights, weight_gradients);
        blend_transforms(weights, bones, transforms)?;
        skinning_jacobians(transforms, weight_gradients, bones, points, jacobians)?;
        Ok(())
    }

    fn on_surface(&mut self, frame: &Frame<T>, rows: Range<usize>) -> Result<()> {
        let points = &frame.batch.on_points[rows.clone()];
        let Frame { fields, losses, .. } = frame;
        fields.geometry.mlp.forward(&mut self.geometry, points.as_flattened(), frame.embedded, &[]);
        if losses.normal > 0.0 || losses.colour > 0.0 && fields.texture.sees_normals() {
            return self.on_surface_with_normals(frame, rows);
        }
        if losses.colour > 0.0 {
            self.colour(frame, points, &frame.batch.on_colours[rows]);
        }
        self.surface_distance(frame);
        let Self { geometry, gradients, buffers, .. } = self;
        let network = &fields.geometry.mlp;
        let on_embedded = network.backward(geometry, &buffers.values, None, Backward::Parameters, &mut gradients[0]);
        self.add_embedded(&on_embedded);
        Ok(())
    }

    /// The loss |f| of the on-surface block in the geometry's trace, a term of signed distances only; leaves its cotangents.
    fn surface_distance(&mut self, frame: &Frame<T>) {
        let total = frame.batch.on_points.len();
        let is_distance = frame.fields.geometry.representation == Representation::SignedDistance;
        let factor = if is_distance { frame.factor(frame.losses.distance, total) } else { T::zero() };
        let outputs = self.geometry.output();
        self.buffers.values.clear();
        self.buffers.values.extend(outputs.iter().map(|value| factor * sign(*value)));
        if is_distance {
            let sum = outputs.iter().map(|value| value.abs().wide()).sum();
            self.add_term("distance", sum, total);
        }
    }

    fn on_surface_with_normals(&mut self, frame: &Frame<T>, rows: Range<usize>) -> Result<()> {
        let Frame { fields, batch, losses, .. } = frame;
        let points = &batch.on_points[rows.clone()];
        let total = batch.on_points.len();
        let side = fields.gradient_side();
        clear(&mut self.buffers.values, points.len(), T::one());
        fields.geometry.mlp.input_gradient(&mut self.geometry, &self.buffers.values);
        self.skin(frame, points)?;
        let gradients = self.geometry.gradient().as_chunks().0;
        let buffers = &mut self.buffers;
        clear(&mut buffers.normals, points.len(), [T::zero(); 3]);
        deformed_normals(gradients, &buffers.jacobians, side, &mut buffers.normals)?;

        let factor = frame.factor(losses.normal, total);
        let mut sum = 0.0;
        buffers.normal_cotangents.clear();
        for (normal, target) in buffers.normals.iter().zip(&batch.on_normals[rows.clone()]) {
            let difference: [T; 3] = std::array::from_fn(|axis| normal[axis] - target[axis]);
            sum += difference.iter().map(|d| (*d * *d).wide()).sum::<f64>();
            buffers.normal_cotangents.push(difference.map(|d| T::of(2.0) * factor * d));
        }
        self.add_term("normal", sum, total);
        if losses.colour > 0.0 {
            self.colour(frame, points, &batch.on_colours[rows]);
        }

        self.surface_distance(frame);
        let Self { geometry, skinning, gradients: sums, buffers, .. } = self;
        let gradients = geometry.gradient().as_chunks().0;
        clear(&mut buffers.gradient_cotangents, points.len(), [T::zero(); 3]);
        clear(&mut buffers.jacobian_cotangents, points.len(), [[T::zero(); 3]; 3]);
        deformed_normals_backward(
            gradients,
            &buffers.jacobians,
            side,
            &buffers.normal_cotangents,
            &mut buffers.gradient_cotangents,
            &mut buffers.jacobian_cotangents,
        )?;
        let on_gradient = Some(buffers.gradient_cotangents.as_flattened());
        let network = &fields.geometry.mlp;
        let on_embedded = network.backward(geometry, &buffers.values, on_gradient, Backward::Parameters, &mut sums[0]);
        let Skinning::Network(field) = &fields.skinning else {
            self.add_embedded(&on_embedded);
            return Ok(());
        };
        let bones = &batch.bones;
        clear(&mut buffers.weight_cotangents, points.len() * bones.len(), T::zero());
        clear(&mut buffers.weight_gradient_cotangents, 3 * points.len() * bones.len(), T::zero());
        clear(&mut buffers.point_cotangents, points.len(), [T::zero(); 3]);
        jacobians_backward(
            &buffers.weight_gradients,
            bones,
            points,
            &buffers.jacobian_cotangents,
            &mut buffers.weight_cotangents,
            &mut buffers.weight_gradient_cotangents,
            &mut buffers.point_cotangents,
        )?;
        let on_slopes = Some(buffers.weight_gradient_cotangents.as_slice());
        field.backward(skinning, &buffers.weight_cotangents, on_slopes, Backward::Parameters, &mut sums[2]);
        self.add_embedded(&on_embedded);
        Ok(())
    }

    /// The colour loss of an on-surface block; adds what reaches the normals to their cotangents.
    fn colour(&mut self, frame: &Frame<T>, points: &[[T; 3]], targets: &[[T; 3]]) {
        let Self { geometry, texture, gradients, buffers, .. } = self;
        let network = &frame.fields.texture.mlp;
        buffers.texture_points.clear();
        let sees_normals = frame.fields.texture.sees_normals();
        for (index, point) in points.iter().enumerate() {
            buffers.texture_points.extend_from_slice(point);
            if sees_normals {
                buffers.texture_points.extend_from_slice(&buffers.normals[index]);
            }
        }
        buffers.features.clear();
        buffers.features.extend_from_slice(geometry.features(&frame.fields.geometry.mlp));
        network.forward(texture, &buffers.texture_points, frame.embedded, &buffers.features);
        clear(&mut buffers.colours, 3 * points.len(), T::zero());
        TextureField::colours(texture.output(), &mut buffers.colours);

        let total = frame.batch.on_points.len();
        let factor = frame.factor(frame.losses.colour, total);
        let mut sum = 0.0;
        let mut cotangent: Vec<T> = Vec::with_capacity(buffers.colours.len());
        for (colour, target) in buffers.colours.iter().zip(targets.as_flattened()) {
            let error = *colour - *target;
            sum += error.abs().wide();
            cotangent.push(factor * sign(error));
        }
        TextureField::colours_backward(&buffers.colours, &mut cotangent);
        let wanted = if sees_normals { Backward::ParametersAndPoints } else { Backward::Parameters };
        let on_embedded = network.backward(texture, &cotangent, None, wanted, &mut gradients[1]);
        let on_points = if sees_normals { texture.point_cotangent() } else { &[] };
        for (cotangent, point) in buffers.normal_cotangents.iter_mut().zip(on_points.chunks_exact(6)) {
            for axis in 0..3 {
                cotangent[axis] += point[3 + axis];
            }
        }
        self.add_embedded(&on_embedded);
        self.add_term("colour", sum, total);
    }

    fn bone(&mut self, frame: &Frame<T>, rows: Range<usize>) {
        let Frame { fields, batch, losses, .. } = frame;
        let total = batch.bone_points.len();
        let factor = frame.factor(losses.bone, total);
        let outward = T::of(fields.geometry.representation.outward().into());
        let network = &fields.geometry.mlp;
        network.forward(&mut self.geometry, batch.bone_points[rows].as_flattened(), frame.embedded, &[]);
        let mut sum = 0.0;
        self.buffers.values.clear();
        self.buffers.values.extend(self.geometry.output().iter().map(|value| {
            let (loss, slope) = cross_entropy(-outward * *value, T::one());
            sum += loss.wide();
            -outward * factor * slope
        }));
        let Self { geometry, gradients, buffers, .. } = self;
        let on_embedded = network.backward(geometry, &buffers.values, None, Backward::Parameters, &mut gradients[0]);
        self.add_embedded(&on_embedded);
        self.add_term("bone", sum, total);
    }

    fn weights(
        &mut self,
        name: &'static str,
        frame: &Frame<T>,
        targets: &WeightTargets<T>,
        weight: f64,
        rows: Range<usize>,
    ) {
        let Skinning::Network(field) = &frame.fields.skinning else { return };
        let total = targets.points.len();
        let factor = T::of(2.0) * frame.factor(weight, total);
        let joints = field.joints();
        let Self { skinning, gradients, buffers, .. } = self;
        buffers.weights.resize(rows.len() * joints, T::zero());
        field.forward(skinning, &targets.points[rows.clone()], &mut buffers.weights);
        let wanted = &targets.weights[rows.start * joints..rows.end * joints];
        let mut sum = 0.0;
        buffers.weight_cotangents.clear();
        buffers.weight_cotangents.extend(buffers.weights.iter().zip(wanted).map(|(weight, target)| {
            let error = *weight - *target;
            sum += (error * error).wide();
            factor * error
        }));
        field.backward(skinning, &buffers.weight_cotangents, None, Backward::Parameters, &mut gradients[2]);
        self.add_term(name, sum, total);
    }

    fn eikonal(&mut self, frame: &Frame<T>, rows: Range<usize>) {
        let Frame { fields, batch, losses, .. } = frame;
        let total = batch.eikonal_points.len();
        let factor = T::of(2.0) * frame.factor(losses.eikonal, total);
        let network = &fields.geometry.mlp;
        network.forward(&mut self.geometry, batch.eikonal_points[rows.clone()].as_flattened(), frame.embedded, &[]);
        let Self { geometry, gradients, buffers, .. } = self;
        clear(&mut buffers.values, rows.len(), T::one());
        network.input_gradient(geometry, &buffers.values);
        let mut sum = 0.0;
        buffers.gradient_cotangents.clear();
        for gradient in geometry.gradient().as_chunks::<3>().0 {
            let length = gradient.iter().map(|g| *g * *g).sum::<T>().sqrt();
            let error = length - T::one();
            sum += (error * error).wide();
            let along = if length > T::zero() { factor * error / length } else { T::zero() };
            buffers.gradient_cotangents.push(gradient.map(|g| along * g));
        }
        buffers.values.fill(T::zero());
        let on_gradient = Some(buffers.gradient_cotangents.as_flattened());
        let on_embedded =
            network.backward(geometry, &buffers.values, on_gradient, Backward::Parameters, &mut gradients[0]);
        self.add_embedded(&on_embedded);
        self.add_term("eikonal", sum, total);
    }
}

fn clear<V: Copy>(values: &mut Vec<V>, length: usize, value: V) {
    values.clear();
    values.resize(length, value);
}

/// Binary cross-entropy of a logit z and a target o, and its derivative: max(z, 0) - z o + ln(1 + e^-|z|), sigma(z) - o.
fn cross_entropy<T: Real>(logit: T, target: T) -> (T, T) {
    let decay = (-logit.abs()).exp();
    let sigmoid = if logit > T::zero() { T::one() } else { decay } / (T::one() + decay);
    (logit.max(T::zero()) - logit * target + decay.ln_1p(), sigmoid - target)
}

/// f - d with d truncated to +-t; zero where both are beyond the same bound.
fn truncated_error<T: Real>(distance: T, target: T, truncation: T) -> T {
    let target = target.max(-truncation).min(truncation);
    let beyond = target.abs() >= truncation && distance.abs() >= truncation && distance * target > T::zero();
    if beyond { T::zero() } else { distance - target }
}

/// -1, 0 or 1. Unlike `signum`, zero at zero.
fn sign<T: Real>(value: T) -> T {
    if value > T::zero() {
        T::one()
    } else if value < T::zero() {
        -T::one()
    } else {
        T::zero()
    }
}
