//! Points on bones are inside: BCE of the geometry's sign there.

use std::ops::Range;

use xavatar_network::{Backward, Real};

use super::kernel::{Kernel, Term};
use super::pointwise::cross_entropy;
use super::worker::{Frame, Worker};
use crate::Result;

const BONE: Term = Term { name: "bone", weight: |losses| losses.bone };

pub(super) fn kernel<T: Real>() -> Kernel<T> {
    Kernel { terms: &[BONE], points: |batch| batch.anchors.bone_points.len(), run: bone }
}

fn bone<T: Real>(worker: &mut Worker<T>, frame: &Frame<T>, rows: Range<usize>) -> Result<()> {
    let Frame { fields, batch, .. } = frame;
    let points = &batch.anchors.bone_points;
    let factor = frame.factor(&BONE, points.len());
    let outward = T::of(fields.geometry.representation.outward().into());
    let network = &fields.geometry.mlp;
    network.forward(&mut worker.geometry, points[rows].as_flattened(), frame.embedded, &[]);
    let mut sum = 0.0;
    worker.buffers.values.clear();
    worker.buffers.values.extend(worker.geometry.output().iter().map(|value| {
        let (loss, slope) = cross_entropy(-outward * *value, T::one());
        sum += loss.wide();
        -outward * factor * slope
    }));
    let Worker { geometry, gradients, buffers, .. } = worker;
    let on_embedded = network.backward(geometry, &buffers.values, None, Backward::Parameters, &mut gradients.geometry);
    worker.add_embedded(&on_embedded);
    worker.add_term(&BONE, sum, points.len());
    Ok(())
}
