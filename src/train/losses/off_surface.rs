//! Points beside the surface: occupancy or distance, and what they tell the skinning field.

use xavatar_network::{Backward, Real, Representation};

use super::kernel::{Kernel, Term};
use super::pointwise::{cross_entropy, sign, truncated_error};
use super::worker::{Frame, Worker};
use crate::Result;

const OCCUPANCY: Term = Term { name: "occupancy", weight: |losses| losses.occupancy };
pub(super) const DISTANCE: Term = Term { name: "distance", weight: |losses| losses.distance };

/// At captured points.
pub(super) fn captured<T: Real>() -> Kernel<T> {
    Kernel {
        terms: &[OCCUPANCY, DISTANCE],
        points: |batch| batch.off_points.len(),
        run: |worker, frame, rows| {
            let batch = frame.batch;
            let (points, targets) = (&batch.off_points[rows.clone()], &batch.off_targets[rows.clone()]);
            off_surface(worker, frame, points, targets, batch.implicit_gradient.then_some(rows.start))
        },
    }
}

/// At points that are far from the surface.
pub(super) fn far<T: Real>() -> Kernel<T> {
    Kernel {
        terms: &[OCCUPANCY, DISTANCE],
        points: |batch| batch.anchors.far_points.len(),
        run: |worker, frame, rows| {
            let anchors = &frame.batch.anchors;
            off_surface(worker, frame, &anchors.far_points[rows.clone()], &anchors.far_targets[rows], None)
        },
    }
}

/// Where the points are roots of the search, of which the first is number `first_root`, their cotangents go on to the skinning field.
fn off_surface<T: Real>(
    worker: &mut Worker<T>,
    frame: &Frame<T>,
    points: &[[T; 3]],
    targets: &[T],
    first_root: Option<usize>,
) -> Result<()> {
    let Frame { fields, batch, losses, .. } = frame;
    let total = batch.off_points.len() + batch.anchors.far_points.len();
    fields.geometry.mlp.forward(&mut worker.geometry, points.as_flattened(), frame.embedded, &[]);
    worker.buffers.values.clear();
    let outputs = worker.geometry.output().iter().zip(targets);
    let mut sum = 0.0;
    match fields.geometry.representation {
        Representation::Occupancy => {
            let factor = frame.factor(&OCCUPANCY, total);
            worker.buffers.values.extend(outputs.map(|(logit, target)| {
                let (loss, slope) = cross_entropy(*logit, *target);
                sum += loss.wide();
                factor * slope
            }));
            worker.add_term(&OCCUPANCY, sum, total);
        }
        Representation::SignedDistance => {
            let (factor, truncation) = (frame.factor(&DISTANCE, total), T::of(losses.truncation));
            worker.buffers.values.extend(outputs.map(|(distance, target)| {
                let error = truncated_error(*distance, *target, truncation);
                sum += error.abs().wide();
                factor * sign(error)
            }));
            worker.add_term(&DISTANCE, sum, total);
        }
    }
    if first_root.is_none() && worker.buffers.values.iter().all(|cotangent| *cotangent == T::zero()) {
        // Beyond the truncation on the right side, as far points soon are.
        return Ok(());
    }
    let wanted = if first_root.is_some() { Backward::ParametersAndPoints } else { Backward::Parameters };
    let Worker { geometry, gradients, buffers, .. } = worker;
    let on_embedded = fields.geometry.mlp.backward(geometry, &buffers.values, None, wanted, &mut gradients.geometry);
    worker.add_embedded(&on_embedded);
    let Some(first) = first_root else { return Ok(()) };
    let Worker { geometry, skinning, gradients, .. } = worker;
    let cotangents = geometry.point_cotangent().as_chunks().0;
    fields.skinning.roots_backward(skinning, &batch.bones, (first, points), cotangents, &mut gradients.skinning)
}
