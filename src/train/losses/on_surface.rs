//! Points on the surface: distance, normal and colour.

use std::ops::Range;

use xavatar_deformer::{deformed_normals, deformed_normals_backward};
use xavatar_network::{Backward, Real, Representation, TextureField};

use super::kernel::{Kernel, Term};
use super::off_surface::DISTANCE;
use super::pointwise::{clear, sign};
use super::worker::{Frame, Worker};
use crate::Result;

const NORMAL: Term = Term { name: "normal", weight: |losses| losses.normal };
const COLOUR: Term = Term { name: "colour", weight: |losses| losses.colour };

pub(super) fn kernel<T: Real>() -> Kernel<T> {
    Kernel { terms: &[NORMAL, COLOUR, DISTANCE], points: |batch| batch.on_points.len(), run: on_surface }
}

fn on_surface<T: Real>(worker: &mut Worker<T>, frame: &Frame<T>, rows: Range<usize>) -> Result<()> {
    let points = &frame.batch.on_points[rows.clone()];
    let fields = frame.fields;
    fields.geometry.mlp.forward(&mut worker.geometry, points.as_flattened(), frame.embedded, &[]);
    if frame.wants(&NORMAL) || frame.wants(&COLOUR) && fields.texture.sees_normals() {
        return on_surface_with_normals(worker, frame, rows);
    }
    if frame.wants(&COLOUR) {
        colour(worker, frame, points, &frame.batch.on_colours[rows]);
    }
    distance(worker, frame);
    let Worker { geometry, gradients, buffers, .. } = worker;
    let network = &fields.geometry.mlp;
    let on_embedded = network.backward(geometry, &buffers.values, None, Backward::Parameters, &mut gradients.geometry);
    worker.add_embedded(&on_embedded);
    Ok(())
}

/// The loss |f| of the block in the geometry's trace, a term of signed distances only; leaves its cotangents.
fn distance<T: Real>(worker: &mut Worker<T>, frame: &Frame<T>) {
    let total = frame.batch.on_points.len();
    let is_distance = frame.fields.geometry.representation == Representation::SignedDistance;
    let factor = if is_distance { frame.factor(&DISTANCE, total) } else { T::zero() };
    let outputs = worker.geometry.output();
    worker.buffers.values.clear();
    worker.buffers.values.extend(outputs.iter().map(|value| factor * sign(*value)));
    if is_distance {
        let sum = outputs.iter().map(|value| value.abs().wide()).sum();
        worker.add_term(&DISTANCE, sum, total);
    }
}

fn on_surface_with_normals<T: Real>(worker: &mut Worker<T>, frame: &Frame<T>, rows: Range<usize>) -> Result<()> {
    let Frame { fields, batch, .. } = frame;
    let points = &batch.on_points[rows.clone()];
    let total = batch.on_points.len();
    let side = fields.gradient_side();
    clear(&mut worker.buffers.values, points.len(), T::one());
    fields.geometry.mlp.input_gradient(&mut worker.geometry, &worker.buffers.values);
    fields.skinning.blend(&mut worker.skinning, &batch.bones, points)?;
    let gradients = worker.geometry.gradient().as_chunks().0;
    let buffers = &mut worker.buffers;
    clear(&mut buffers.normals, points.len(), [T::zero(); 3]);
    deformed_normals(gradients, worker.skinning.jacobians(), side, &mut buffers.normals)?;

    let factor = frame.factor(&NORMAL, total);
    let mut sum = 0.0;
    buffers.normal_cotangents.clear();
    for (normal, target) in buffers.normals.iter().zip(&batch.on_normals[rows.clone()]) {
        let difference: [T; 3] = std::array::from_fn(|axis| normal[axis] - target[axis]);
        sum += difference.iter().map(|d| (*d * *d).wide()).sum::<f64>();
        buffers.normal_cotangents.push(difference.map(|d| T::of(2.0) * factor * d));
    }
    worker.add_term(&NORMAL, sum, total);
    if frame.wants(&COLOUR) {
        colour(worker, frame, points, &batch.on_colours[rows]);
    }

    distance(worker, frame);
    let Worker { geometry, skinning, gradients: sums, buffers, .. } = worker;
    let gradients = geometry.gradient().as_chunks().0;
    clear(&mut buffers.gradient_cotangents, points.len(), [T::zero(); 3]);
    clear(&mut buffers.jacobian_cotangents, points.len(), [[T::zero(); 3]; 3]);
    deformed_normals_backward(
        gradients,
        skinning.jacobians(),
        side,
        &buffers.normal_cotangents,
        &mut buffers.gradient_cotangents,
        &mut buffers.jacobian_cotangents,
    )?;
    let on_gradient = Some(buffers.gradient_cotangents.as_flattened());
    let network = &fields.geometry.mlp;
    let on_embedded =
        network.backward(geometry, &buffers.values, on_gradient, Backward::Parameters, &mut sums.geometry);
    let cotangents = &buffers.jacobian_cotangents;
    fields.skinning.jacobians_backward(skinning, &batch.bones, points, cotangents, &mut sums.skinning)?;
    worker.add_embedded(&on_embedded);
    Ok(())
}

/// The colour loss of a block; adds what reaches the normals to their cotangents.
fn colour<T: Real>(worker: &mut Worker<T>, frame: &Frame<T>, points: &[[T; 3]], targets: &[[T; 3]]) {
    let Worker { geometry, texture, gradients, buffers, .. } = worker;
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
    buffers.features.extend_from_slice(frame.fields.texture.seen(geometry.features(&frame.fields.geometry.mlp)));
    network.forward(texture, &buffers.texture_points, frame.embedded, &buffers.features);
    clear(&mut buffers.colours, 3 * points.len(), T::zero());
    TextureField::colours(texture.output(), &mut buffers.colours);

    let total = frame.batch.on_points.len();
    let factor = frame.factor(&COLOUR, total);
    let mut sum = 0.0;
    let mut cotangent: Vec<T> = Vec::with_capacity(buffers.colours.len());
    for (colour, target) in buffers.colours.iter().zip(targets.as_flattened()) {
        let error = *colour - *target;
        sum += error.abs().wide();
        cotangent.push(factor * sign(error));
    }
    TextureField::colours_backward(&buffers.colours, &mut cotangent);
    let wanted = if sees_normals { Backward::ParametersAndPoints } else { Backward::Parameters };
    let on_embedded = network.backward(texture, &cotangent, None, wanted, &mut gradients.texture);
    let on_points = if sees_normals { texture.point_cotangent() } else { &[] };
    for (cotangent, point) in buffers.normal_cotangents.iter_mut().zip(on_points.chunks_exact(6)) {
        for axis in 0..3 {
            cotangent[axis] += point[3 + axis];
        }
    }
    worker.add_embedded(&on_embedded);
    worker.add_term(&COLOUR, sum, total);
}
