//! The network of a foot's contact: full connections, features - 256 - 128 - 64 - 32 - 16 - 32 - 64 - 128 - 3 F (METHOD-BODY section 5).
//!
//! x_{l+1} = leaky(W_l x_l + b_l), leaky(x) = max(x, 0.1 x), after every layer but the last; what comes out is in [`UNIT`]s. Loss: the mean distance of a vertex.

use candle_core::{Result, Tensor};
use candle_nn::{Linear, Module, ops};

use crate::descent::Parameters;

/// Numbers between layers.
const WIDTHS: [usize; 8] = [256, 128, 64, 32, 16, 32, 64, 128];
/// Of negative numbers this share is left.
const LEAK: f64 = 0.1;
/// What a number of the network is, metres: offsets are about as large as the numbers that networks begin with.
pub(super) const UNIT: f64 = 1e-3;
/// What is added to the square of a distance, units^2: the derivative of the root of nothing is not finite.
const NOTHING: f64 = 1e-14;

/// Numbers between the layers of the network of a foot, from its features to its offsets.
pub(super) fn widths(features: usize, vertices: usize) -> Vec<usize> {
    [features].into_iter().chain(WIDTHS).chain([3 * vertices]).collect()
}

/// A new network, its parameters named `NAME.0.W` and on. Nine layers would hardly let anything through that began as smaller weights: these keep the variance.
pub(super) fn layers(parameters: &mut Parameters, name: &str, widths: &[usize]) -> Result<Vec<Linear>> {
    let pairs = widths.windows(2).enumerate();
    let most = |inputs: usize| (6.0 / ((1.0 + LEAK * LEAK) * inputs.max(1) as f64)).sqrt();
    let layer = |(number, pair): (usize, &[usize])| {
        parameters.linear_within(&format!("{name}.{number}"), pair[0], pair[1], most(pair[0]))
    };
    pairs.map(layer).collect()
}

/// What layers make of features (N, K): offsets (N, 3 F).
pub(super) fn through(layers: &[Linear], features: &Tensor) -> Result<Tensor> {
    let Some((last, others)) = layers.split_last() else { return Ok(features.clone()) };
    let activated = |values: Tensor, layer: &Linear| ops::leaky_relu(&layer.forward(&values)?, LEAK);
    last.forward(&others.iter().try_fold(features.clone(), activated)?)
}

/// The mean distance of a vertex of offsets from others, both (N, 3 F).
pub(super) fn distance(offsets: &Tensor, targets: &Tensor) -> Result<Tensor> {
    let squares = (offsets - targets)?.sqr()?.reshape(((), 3))?.sum(1)?;
    (squares + NOTHING)?.sqrt()?.mean_all()
}

#[cfg(test)]
mod tests {
    use candle_core::Var;

    use super::*;
    use crate::reference::{largest_difference, reference, tensor};

    const SIZES: [usize; 10] = [46, 32, 20, 12, 8, 4, 8, 12, 20, 72];

    fn numbers(tensor: &Tensor) -> Vec<f64> {
        tensor.flatten_all().unwrap().to_vec1().unwrap()
    }

    /// The reference's weights and offsets of each layer.
    fn variables() -> Vec<[Var; 2]> {
        let golden = reference("foot_network");
        let variable = |name: String, shape: &[usize]| Var::from_tensor(&tensor(&golden[&name], shape)).unwrap();
        let of_layer = |(number, pair): (usize, &[usize])| {
            [variable(format!("W.{number}"), &[pair[1], pair[0]]), variable(format!("b.{number}"), &[pair[1]])]
        };
        SIZES.windows(2).enumerate().map(of_layer).collect()
    }

    fn linear(variables: &[[Var; 2]]) -> Vec<Linear> {
        let layer =
            |[weights, offsets]: &[Var; 2]| Linear::new(weights.as_tensor().clone(), Some(offsets.as_tensor().clone()));
        variables.iter().map(layer).collect()
    }

    #[test]
    fn network_loss_and_derivatives_are_the_references() {
        let golden = reference("foot_network");
        let variables = variables();
        let offsets = through(&linear(&variables), &tensor(&golden["feature"], &[6, 46])).unwrap();
        assert!(largest_difference(&numbers(&offsets), &golden["offsets"]) < 1e-12);
        let loss = distance(&offsets, &tensor(&golden["target"], &[6, 72])).unwrap();
        assert!((loss.to_scalar::<f64>().unwrap() - golden["loss"][0]).abs() < 1e-12);
        let gradients = loss.backward().unwrap();
        for (number, pair) in variables.iter().enumerate() {
            for (variable, kind) in pair.iter().zip(["W", "b"]) {
                let found = numbers(gradients.get(variable).unwrap());
                let difference = largest_difference(&found, &golden[&format!("d_{kind}.{number}")]);
                assert!(difference < 1e-12, "{kind}.{number}: {difference}");
            }
        }
    }

    // (loss(f + h d) - loss(f - h d)) / 2 h = d . grad, in a direction d of the features.
    #[test]
    fn the_derivative_by_features_is_that_of_finite_differences() {
        let golden = reference("foot_network");
        let layers = linear(&variables());
        let direction: Vec<f64> = (0..6 * 46).map(|place| (f64::from(place) * 0.7).sin()).collect();
        let loss_at = |by: f64| {
            let moved: Vec<f64> =
                golden["feature"].iter().zip(&direction).map(|(own, along)| own + by * along).collect();
            let features = Var::from_tensor(&tensor(&moved, &[6, 46])).unwrap();
            let offsets = through(&layers, features.as_tensor()).unwrap();
            (distance(&offsets, &tensor(&golden["target"], &[6, 72])).unwrap(), features)
        };
        let (loss, features) = loss_at(0.0);
        let gradient = numbers(loss.backward().unwrap().get(&features).unwrap());
        let found: f64 = gradient.iter().zip(&direction).map(|(gradient, along)| gradient * along).sum();
        let value = |by: f64| loss_at(by).0.to_scalar::<f64>().unwrap();
        let expected = (value(1e-6) - value(-1e-6)) / 2e-6;
        assert!((found - expected).abs() < 1e-8 * expected.abs().max(1e-2), "{found} {expected}");
        assert!(expected.abs() > 1e-6);
    }
}
