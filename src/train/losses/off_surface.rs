//! Terms of points beside the surface: occupancy or distance, and what they tell the skinning field; points on bones.

use std::ops::Range;

use xavatar_deformer::{deform_backward, root_cotangents};
use xavatar_network::{Backward, Real, Representation};

use super::pointwise::{clear, cross_entropy, sign, truncated_error};
use super::{Buffers, Frame, Worker};
use crate::Result;
use crate::fields::Skinning;

impl<T: Real> Worker<T> {
    pub(super) fn off_surface(
        &mut self,
        frame: &Frame<T>,
        points: &[[T; 3]],
        targets: &[T],
        implicit: bool,
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
        if !implicit && self.buffers.values.iter().all(|cotangent| *cotangent == T::zero()) {
            // Beyond the truncation on the right side, as far points soon are.
            return Ok(());
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
        let on_embedded = network.backward(geometry, &buffers.values, None, Backward::Parameters, &mut gradients[0]);
        self.add_embedded(&on_embedded);
        self.add_term("bone", sum, total);
    }
}
