//! Terms that ask nothing of a scan: skinning weights near those of the body, and the length of the field's gradient.

use std::ops::Range;

use xavatar_network::{Backward, Real};

use super::pointwise::clear;
use super::{Frame, WeightTargets, Worker};

impl<T: Real> Worker<T> {
    pub(super) fn weights(
        &mut self,
        name: &'static str,
        frame: &Frame<T>,
        targets: &WeightTargets<T>,
        weight: f64,
        rows: Range<usize>,
    ) {
        let field = &frame.fields.skinning;
        let Self { skinning, gradients, buffers, .. } = self;
        let Some(weights) = field.followed_weights(skinning, &targets.points[rows.clone()]) else { return };
        let (total, joints) = (targets.points.len(), field.joints());
        let factor = T::of(2.0) * frame.factor(weight, total);
        let wanted = &targets.weights[rows.start * joints..rows.end * joints];
        let mut sum = 0.0;
        buffers.weight_cotangents.clear();
        buffers.weight_cotangents.extend(weights.iter().zip(wanted).map(|(weight, target)| {
            let error = *weight - *target;
            sum += (error * error).wide();
            factor * error
        }));
        field.weights_backward(skinning, &buffers.weight_cotangents, &mut gradients.skinning);
        self.add_term(name, sum, total);
    }

    pub(super) fn eikonal(&mut self, frame: &Frame<T>, rows: Range<usize>) {
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
            network.backward(geometry, &buffers.values, on_gradient, Backward::Parameters, &mut gradients.geometry);
        self.add_embedded(&on_embedded);
        self.add_term("eikonal", sum, total);
    }
}
