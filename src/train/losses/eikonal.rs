//! The geometry's gradient is of unit length: (|grad f| - 1)^2.

use std::ops::Range;

use xavatar_network::{Backward, Real};

use super::kernel::{Kernel, Term};
use super::pointwise::clear;
use super::worker::{Frame, Worker};
use crate::Result;

const EIKONAL: Term = Term { name: "eikonal", weight: |losses| losses.eikonal };

pub(super) fn kernel<T: Real>() -> Kernel<T> {
    Kernel { terms: &[EIKONAL], points: |batch| batch.anchors.eikonal_points.len(), run: eikonal }
}

fn eikonal<T: Real>(worker: &mut Worker<T>, frame: &Frame<T>, rows: Range<usize>) -> Result<()> {
    let points = &frame.batch.anchors.eikonal_points;
    let factor = T::of(2.0) * frame.factor(&EIKONAL, points.len());
    let network = &frame.fields.geometry.mlp;
    network.forward(&mut worker.geometry, points[rows.clone()].as_flattened(), frame.embedded, &[]);
    let Worker { geometry, gradients, buffers, .. } = worker;
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
        network.backward(geometry, &buffers.values, on_gradient, Backward::Parameters, &mut gradients.geometry);
    worker.add_embedded(&on_embedded);
    worker.add_term(&EIKONAL, sum, points.len());
    Ok(())
}
