//! Terms of points beside the surface: occupancy or distance, and what they tell the skinning field; points on bones.

use std::ops::Range;

use xavatar_network::{Backward, Real, Representation};

use super::pointwise::{cross_entropy, sign, truncated_error};
use super::{Frame, Worker};
use crate::Result;

impl<T: Real> Worker<T> {
    /// The loss of a block of points. Where they are roots of the search, of which the first is number `first_root`, their cotangents
    /// go on to the skinning field.
    pub(super) fn off_surface(
        &mut self,
        frame: &Frame<T>,
        points: &[[T; 3]],
        targets: &[T],
        first_root: Option<usize>,
    ) -> Result<()> {
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
        if first_root.is_none() && self.buffers.values.iter().all(|cotangent| *cotangent == T::zero()) {
            // Beyond the truncation on the right side, as far points soon are.
            return Ok(());
        }
        let wanted = if first_root.is_some() { Backward::ParametersAndPoints } else { Backward::Parameters };
        let Self { geometry, gradients, buffers, .. } = self;
        let on_embedded =
            fields.geometry.mlp.backward(geometry, &buffers.values, None, wanted, &mut gradients.geometry);
        self.add_embedded(&on_embedded);
        let Some(first) = first_root else { return Ok(()) };
        let Self { geometry, skinning, gradients, .. } = self;
        let cotangents = geometry.point_cotangent().as_chunks().0;
        fields.skinning.roots_backward(skinning, &batch.bones, (first, points), cotangents, &mut gradients.skinning)
    }

    pub(super) fn bone(&mut self, frame: &Frame<T>, rows: Range<usize>) {
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
        let on_embedded =
            network.backward(geometry, &buffers.values, None, Backward::Parameters, &mut gradients.geometry);
        self.add_embedded(&on_embedded);
        self.add_term("bone", sum, total);
    }
}
