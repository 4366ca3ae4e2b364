//! The free-space term: how far f(x_c) is outside of bounds [low, high] that it is known to keep, metres.
//!
//! L = mean of max(low - f, 0) + max(f - high, 0). A camera that looks through a point says that it is outside (low = 0), and
//! what it sees nearby that the surface is no farther (high): the distance itself stays open.

use std::ops::Range;

use xavatar_network::{Backward, Real};

use super::{Frame, Worker};

impl<T: Real> Worker<T> {
    pub(super) fn free_space(&mut self, frame: &Frame<T>, rows: Range<usize>) {
        let Frame { fields, batch, losses, .. } = frame;
        let total = batch.free_points.len();
        let factor = frame.factor(losses.free_space, total);
        let network = &fields.geometry.mlp;
        network.forward(&mut self.geometry, batch.free_points[rows.clone()].as_flattened(), frame.embedded, &[]);
        let mut sum = 0.0;
        self.buffers.values.clear();
        self.buffers.values.extend(self.geometry.output().iter().zip(&batch.free_bounds[rows]).map(
            |(value, bounds)| {
                let (loss, slope) = excess(*value, *bounds);
                sum += loss.wide();
                factor * slope
            },
        ));
        let Self { geometry, gradients, buffers, .. } = self;
        let on_embedded =
            network.backward(geometry, &buffers.values, None, Backward::Parameters, &mut gradients.geometry);
        self.add_embedded(&on_embedded);
        self.add_term("free_space", sum, total);
    }
}

/// How far a value is outside of its bounds, and the derivative of that.
fn excess<T: Real>(value: T, [low, high]: [T; 2]) -> (T, T) {
    if value < low {
        (low - value, -T::one())
    } else if value > high {
        (value - high, T::one())
    } else {
        (T::zero(), T::zero())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_values_outside_of_their_bounds_cost() {
        assert_eq!(excess(-0.25, [0.0, 1.0]), (0.25, -1.0));
        assert_eq!(excess(0.5, [0.0, 1.0]), (0.0, 0.0));
        assert_eq!(excess(1.5, [0.0, 1.0]), (0.5, 1.0));
        assert_eq!(excess(1e9, [0.0, f64::INFINITY]), (0.0, 0.0));
    }
}
