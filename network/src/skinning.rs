//! Skinning weights as a field over canonical space: an [`Mlp`] whose logits, times a blend factor, pass the tree softmax
//! (thesis ch. 4.2.2, eq. 4.3).
//!
//! N points, J joints. Weights (N, J); their derivatives along x, y and z (N, 3, J).

use rand::Rng;

use crate::encoding::EncodingShape;
use crate::mlp::{Backward, Mlp, MlpGradient, MlpShape, Trace};
use crate::tree_softmax::{Dual, Flow, KinematicTree, LANES, Lanes, Scalar};
use crate::{Error, Real, Result};
use xavatar_vector::vectorised;

/// Anything that gives every canonical point a convex combination of J bones.
///
/// Implementations are shared between threads; each thread brings its own workspace.
pub trait SkinningWeights<T: Real>: Sync {
    /// Scratch memory of one thread, kept between calls so that none of them allocates.
    type Workspace: Default + Send;

    /// J.
    fn joints(&self) -> usize;

    /// Writes the weights w(x) of each point, (N, J).
    fn weights(&self, workspace: &mut Self::Workspace, points: &[[T; 3]], weights: &mut [T]);

    /// Writes the weights (N, J) and their derivatives along x, y and z (N, 3, J).
    fn weights_and_gradients(
        &self,
        workspace: &mut Self::Workspace,
        points: &[[T; 3]],
        weights: &mut [T],
        gradients: &mut [T],
    );
}

/// The learned skinning field.
#[derive(Clone, Debug)]
pub struct SkinningField<T> {
    mlp: Mlp<T>,
    tree: KinematicTree,
    blend: T,
}

/// Scratch memory of a [`SkinningField`]: one block's activations and softmax.
#[derive(Clone, Debug)]
pub struct SkinningTrace<T> {
    mlp: Trace<T>,
    lanes: LaneBuffers<Lanes<T>>,
    duals: LaneBuffers<Dual<Lanes<T>>>,
    output_cotangent: Vec<T>,
}

#[derive(Clone, Debug)]
struct LaneBuffers<S> {
    logits: Vec<S>,
    weights: Vec<S>,
    flow: Flow<S>,
}

impl<S: Scalar> LaneBuffers<S> {
    fn resize(&mut self, tree: &KinematicTree) {
        self.logits.resize(tree.logits(), S::zero());
        self.weights.resize(tree.joints(), S::zero());
    }
}

impl<T: Real> Default for SkinningTrace<T> {
    fn default() -> Self {
        Self {
            mlp: Trace::default(),
            lanes: LaneBuffers { logits: Vec::new(), weights: Vec::new(), flow: Flow::default() },
            duals: LaneBuffers { logits: Vec::new(), weights: Vec::new(), flow: Flow::default() },
            output_cotangent: Vec::new(),
        }
    }
}

impl<T: Real> SkinningTrace<T> {
    /// The cotangent of the points of the last call to [`SkinningField::backward`], (N, 3).
    pub fn point_cotangent(&self) -> &[[T; 3]] {
        self.mlp.point_cotangent().as_chunks().0
    }
}

impl<T: Real> SkinningField<T> {
    /// A field over `tree` with `depth` hidden layers of `width`; logits are multiplied by `blend` (20 in the thesis).
    ///
    /// # Errors
    /// [`Error::Shape`] names the extent that is out of range.
    pub fn new(tree: KinematicTree, depth: usize, width: usize, frequencies: usize, blend: f64) -> Result<Self> {
        if !(blend.is_finite() && blend > 0.0) {
            return Err(Error::Shape { name: "blend", found: blend.to_string(), expected: "a positive number".into() });
        }
        let shape = MlpShape {
            inputs: 3,
            encoding: EncodingShape::Frequencies(frequencies),
            condition: 0,
            embedded: 0,
            row_condition: 0,
            depth,
            width,
            skip: None,
            outputs: tree.logits(),
        };
        Ok(Self { mlp: Mlp::new(shape)?, tree, blend: T::of(blend) })
    }

    /// Draws the parameters as PyTorch's `Linear` does.
    pub fn initialise(&mut self, random: &mut impl Rng) {
        self.mlp.initialise_uniform(random);
    }

    /// The network below the softmax.
    pub fn mlp(&self) -> &Mlp<T> {
        &self.mlp
    }

    /// The network below the softmax, to update its parameters.
    pub fn mlp_mut(&mut self) -> &mut Mlp<T> {
        &mut self.mlp
    }

    /// The kinematic tree of the softmax.
    pub fn tree(&self) -> &KinematicTree {
        &self.tree
    }

    /// [`SkinningWeights::weights`] that [`SkinningField::backward`] may follow.
    pub fn forward(&self, trace: &mut SkinningTrace<T>, points: &[[T; 3]], weights: &mut [T]) {
        if !points.is_empty() {
            self.mlp.forward(&mut trace.mlp, points.as_flattened(), &[], &[]);
            self.softmax(trace, points.len(), weights);
        }
    }

    /// The weights (N, J) of the logits in `trace`.
    fn softmax(&self, trace: &mut SkinningTrace<T>, rows: usize, weights: &mut [T]) {
        let SkinningTrace { mlp, lanes, .. } = trace;
        lanes.resize(&self.tree);
        let (output, joints) = (mlp.output(), self.tree.joints());
        vectorised(
            #[inline(always)]
            || {
                for first in (0..rows).step_by(LANES) {
                    self.gather_logits(output, 0, first, rows, &mut lanes.logits);
                    self.tree.weights(&lanes.logits, &mut lanes.flow, &mut lanes.weights);
                    scatter(&lanes.weights, joints, first, rows, weights);
                }
            },
        );
    }

    /// Adds the parameters' gradient for cotangents of the weights (N, J) and, after
    /// [`SkinningWeights::weights_and_gradients`], of their derivatives (N, 3, J). Follows that or [`SkinningField::forward`].
    pub fn backward(
        &self,
        trace: &mut SkinningTrace<T>,
        weight_cotangent: &[T],
        gradient_cotangent: Option<&[T]>,
        wanted: Backward,
        gradient: &mut MlpGradient<T>,
    ) {
        let (joints, logits) = (self.tree.joints(), self.tree.logits());
        let rows = weight_cotangent.len() / joints;
        let SkinningTrace { mlp, lanes, duals, output_cotangent } = trace;
        lanes.resize(&self.tree);
        duals.resize(&self.tree);
        output_cotangent.resize(mlp.output().len(), T::zero());
        output_cotangent.fill(T::zero());
        let output = mlp.output();
        vectorised(
            #[inline(always)]
            || {
                for first in (0..rows).step_by(LANES) {
                    self.gather_logits(output, 0, first, rows, &mut lanes.logits);
                    self.tree.weights(&lanes.logits, &mut lanes.flow, &mut lanes.weights);
                    gather(weight_cotangent, joints, 0, first, rows, &mut lanes.weights);
                    self.tree.backward(&lanes.flow, &mut lanes.weights, &mut lanes.logits);
                    scatter_add(&lanes.logits, self.blend, logits, 0, first, rows, output_cotangent);
                    let Some(gradient_cotangent) = gradient_cotangent else { continue };
                    for axis in 0..3 {
                        self.gather_dual_logits(output, axis, first, rows, lanes, duals);
                        self.tree.weights(&duals.logits, &mut duals.flow, &mut duals.weights);
                        for (joint, cotangent) in duals.weights.iter_mut().enumerate() {
                            let mut values = [T::zero(); LANES];
                            for (lane, value) in values.iter_mut().enumerate().take(rows - first) {
                                *value = gradient_cotangent[((first + lane) * 3 + axis) * joints + joint];
                            }
                            *cotangent = Dual { value: Lanes(values), along: Scalar::zero() };
                        }
                        self.tree.backward(&duals.flow, &mut duals.weights, &mut duals.logits);
                        // d/d(logit) of w_dot_bar . (J logit_dot) is the derivative of J^T w_dot_bar along logit_dot;
                        // d/d(logit_dot) is J^T w_dot_bar itself.
                        for (target, dual) in lanes.logits.iter_mut().zip(&duals.logits) {
                            *target = dual.along;
                        }
                        scatter_add(&lanes.logits, self.blend, logits, 0, first, rows, output_cotangent);
                        for (target, dual) in lanes.logits.iter_mut().zip(&duals.logits) {
                            *target = dual.value;
                        }
                        scatter_add(
                            &lanes.logits,
                            self.blend,
                            logits,
                            (1 + axis) * rows,
                            first,
                            rows,
                            output_cotangent,
                        );
                    }
                }
            },
        );
        self.mlp.backward(mlp, output_cotangent, None, wanted, gradient);
    }

    #[inline(always)]
    fn gather_logits(&self, output: &[T], offset: usize, first: usize, rows: usize, target: &mut [Lanes<T>]) {
        gather(output, self.tree.logits(), offset, first, rows, target);
        let blend = Lanes([self.blend; LANES]);
        target.iter_mut().for_each(|value| *value = *value * blend);
    }

    #[inline(always)]
    fn gather_dual_logits(
        &self,
        output: &[T],
        axis: usize,
        first: usize,
        rows: usize,
        lanes: &mut LaneBuffers<Lanes<T>>,
        duals: &mut LaneBuffers<Dual<Lanes<T>>>,
    ) {
        self.gather_logits(output, 0, first, rows, &mut lanes.logits);
        for (dual, value) in duals.logits.iter_mut().zip(&lanes.logits) {
            dual.value = *value;
        }
        self.gather_logits(output, (1 + axis) * rows, first, rows, &mut lanes.logits);
        for (dual, along) in duals.logits.iter_mut().zip(&lanes.logits) {
            dual.along = *along;
        }
    }
}

impl<T: Real> SkinningWeights<T> for SkinningField<T> {
    type Workspace = SkinningTrace<T>;

    fn joints(&self) -> usize {
        self.tree.joints()
    }

    fn weights(&self, trace: &mut SkinningTrace<T>, points: &[[T; 3]], weights: &mut [T]) {
        if !points.is_empty() {
            self.mlp.evaluate(&mut trace.mlp, points.as_flattened(), &[], &[]);
            self.softmax(trace, points.len(), weights);
        }
    }

    fn weights_and_gradients(
        &self,
        trace: &mut SkinningTrace<T>,
        points: &[[T; 3]],
        weights: &mut [T],
        gradients: &mut [T],
    ) {
        if points.is_empty() {
            return;
        }
        self.mlp.forward_with_tangents(&mut trace.mlp, points.as_flattened(), &[], &[]);
        let SkinningTrace { mlp, lanes, duals, .. } = trace;
        lanes.resize(&self.tree);
        duals.resize(&self.tree);
        let (output, joints, rows) = (mlp.output(), self.tree.joints(), points.len());
        vectorised(
            #[inline(always)]
            || {
                for first in (0..rows).step_by(LANES) {
                    for axis in 0..3 {
                        self.gather_dual_logits(output, axis, first, rows, lanes, duals);
                        self.tree.weights(&duals.logits, &mut duals.flow, &mut duals.weights);
                        for (joint, dual) in duals.weights.iter().enumerate() {
                            lanes.weights[joint] = dual.value;
                            for lane in 0..LANES.min(rows - first) {
                                gradients[((first + lane) * 3 + axis) * joints + joint] = dual.along.0[lane];
                            }
                        }
                    }
                    scatter(&lanes.weights, joints, first, rows, weights);
                }
            },
        );
    }
}

/// Transposes up to sixteen rows, from row `offset + first` of `source` (., width) on, into one lane vector a column.
#[inline(always)]
fn gather<T: Real>(source: &[T], width: usize, offset: usize, first: usize, rows: usize, target: &mut [Lanes<T>]) {
    let count = LANES.min(rows - first);
    for lane in 0..LANES {
        // Lanes past the last row repeat it: finite numbers that nothing reads.
        let start = (offset + first + lane.min(count - 1)) * width;
        for (value, target) in source[start..start + width].iter().zip(target.iter_mut()) {
            target.0[lane] = *value;
        }
    }
}

/// The reverse of [`gather`].
#[inline(always)]
fn scatter<T: Real>(source: &[Lanes<T>], width: usize, first: usize, rows: usize, target: &mut [T]) {
    for lane in 0..LANES.min(rows - first) {
        let start = (first + lane) * width;
        for (value, target) in source.iter().zip(&mut target[start..start + width]) {
            *target = value.0[lane];
        }
    }
}

/// Adds `factor` times each lane to its row of `target`, from row `offset + first` on.
#[inline(always)]
fn scatter_add<T: Real>(
    source: &[Lanes<T>],
    factor: T,
    width: usize,
    offset: usize,
    first: usize,
    rows: usize,
    target: &mut [T],
) {
    for lane in 0..LANES.min(rows - first) {
        let start = (offset + first + lane) * width;
        for (value, target) in source.iter().zip(&mut target[start..start + width]) {
            *target += factor * value.0[lane];
        }
    }
}
