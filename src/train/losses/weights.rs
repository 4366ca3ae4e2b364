//! Skinning weights near those of the body: ||w - w_gt||^2 at joints, at vertices of hands and face, and around and inside the body.
//!
//! Only where the skinning field follows weights: a grid begins with the body's and is pulled back to them instead.

use std::ops::Range;

use xavatar_network::Real;

use super::WeightTargets;
use super::kernel::{Kernel, Term};
use super::worker::{Frame, Worker};

const JOINT: Term = Term { name: "joint", weight: |losses| losses.joint };
const SURFACE: Term = Term { name: "surface", weight: |losses| losses.surface };
const VOLUME: Term = Term { name: "volume", weight: |losses| losses.volume };

pub(super) fn joint<T: Real>() -> Kernel<T> {
    Kernel {
        terms: &[JOINT],
        points: |batch| batch.anchors.joint_weights.points.len(),
        run: |worker, frame, rows| {
            weights(worker, frame, &JOINT, &frame.batch.anchors.joint_weights, rows);
            Ok(())
        },
    }
}

pub(super) fn surface<T: Real>() -> Kernel<T> {
    Kernel {
        terms: &[SURFACE],
        points: |batch| batch.anchors.surface_weights.points.len(),
        run: |worker, frame, rows| {
            weights(worker, frame, &SURFACE, &frame.batch.anchors.surface_weights, rows);
            Ok(())
        },
    }
}

pub(super) fn volume<T: Real>() -> Kernel<T> {
    Kernel {
        terms: &[VOLUME],
        points: |batch| batch.anchors.volume_weights.points.len(),
        run: |worker, frame, rows| {
            weights(worker, frame, &VOLUME, &frame.batch.anchors.volume_weights, rows);
            Ok(())
        },
    }
}

fn weights<T: Real>(
    worker: &mut Worker<T>,
    frame: &Frame<T>,
    term: &Term,
    targets: &WeightTargets<T>,
    rows: Range<usize>,
) {
    let field = &frame.fields.skinning;
    let Worker { skinning, gradients, buffers, .. } = worker;
    let Some(weights) = field.followed_weights(skinning, &targets.points[rows.clone()]) else { return };
    let (total, joints) = (targets.points.len(), field.joints());
    let factor = T::of(2.0) * frame.factor(term, total);
    let wanted = &targets.weights[rows.start * joints..rows.end * joints];
    let mut sum = 0.0;
    buffers.weight_cotangents.clear();
    buffers.weight_cotangents.extend(weights.iter().zip(wanted).map(|(weight, target)| {
        let error = *weight - *target;
        sum += (error * error).wide();
        factor * error
    }));
    field.weights_backward(skinning, &buffers.weight_cotangents, &mut gradients.skinning);
    worker.add_term(term, sum, total);
}
