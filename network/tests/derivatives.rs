//! Derivatives that have no golden vector, against central differences in f64.

use rand::Rng;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use xavatar_network::{
    Backward, Bounds, GeometryField, GeometryShape, KinematicTree, Mlp, Representation, SkinningField, SkinningWeights,
    Trace,
};

const STEP: f64 = 1e-5;
/// Only a grid would use it.
const BOUNDS: Bounds = Bounds { lowest: [-1.0; 3], highest: [1.0; 3] };

fn normal(random: &mut ChaCha8Rng, count: usize, scale: f64) -> Vec<f64> {
    (0..count).map(|_| scale * random.sample::<f64, _>(rand_distr::StandardNormal)).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// (f(x + h) - f(x - h)) / 2h for the change of one entry.
fn difference(x: &mut [f64], index: usize, mut f: impl FnMut(&[f64]) -> f64) -> f64 {
    let start = x[index];
    x[index] = start + STEP;
    let above = f(x);
    x[index] = start - STEP;
    let below = f(x);
    x[index] = start;
    (above - below) / (2.0 * STEP)
}

fn assert_near(what: &str, index: usize, found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-5 * (1.0 + expected.abs()), "{what} {index}: {found} instead of {expected}");
}

fn geometry(random: &mut ChaCha8Rng) -> GeometryField<f64> {
    let shape = GeometryShape { depth: 4, width: 40, frequencies: 3, skip: Some(2), embedded: 4, grid: None };
    let mut field = GeometryField::new(&shape, 6, Representation::SignedDistance, BOUNDS).unwrap();
    field.initialise(random);
    let noise = normal(random, field.mlp.layout().len(), 0.05);
    field.mlp.update(|parameters| parameters.iter_mut().zip(&noise).for_each(|(p, n)| *p += n));
    field
}

// L(x, theta, c) = a . f + b . grad f over a batch: with respect to points, every parameter and the condition.
#[test]
fn geometry_value_and_gradient_cotangents_reach_points_parameters_and_condition() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut field = geometry(&mut random);
    let rows = 5;
    let mut points = normal(&mut random, rows * 3, 0.4);
    let mut condition = normal(&mut random, 6, 0.5);
    let on_value = normal(&mut random, rows, 1.0);
    let on_gradient = normal(&mut random, rows * 3, 1.0);
    let ones = vec![1.0; rows];
    let loss = |mlp: &Mlp<f64>, points: &[f64], condition: &[f64]| {
        let mut trace = Trace::default();
        mlp.forward(&mut trace, points, &mlp.embed(condition), &[]);
        let value = dot(trace.output(), &on_value);
        mlp.input_gradient(&mut trace, &ones);
        value + dot(trace.gradient(), &on_gradient)
    };

    let mlp = &field.mlp;
    let mut trace = Trace::default();
    let mut gradient = mlp.zero_gradient();
    let embedded = mlp.embed(&condition);
    mlp.forward(&mut trace, &points, &embedded, &[]);
    mlp.input_gradient(&mut trace, &ones);
    let on_embedded =
        mlp.backward(&mut trace, &on_value, Some(&on_gradient), Backward::ParametersAndPoints, &mut gradient);
    mlp.embed_backward(&condition, &on_embedded, &mut gradient);
    let mut on_parameters = vec![0.0; mlp.layout().len()];
    mlp.parameter_gradient(&gradient, &mut on_parameters);

    let on_points = trace.point_cotangent().to_vec();
    for (index, found) in on_points.iter().enumerate() {
        let expected = difference(&mut points, index, |points| loss(mlp, points, &condition));
        assert_near("point", index, *found, expected);
    }
    // The condition's gradient is the embedding weights' transpose of the embedded cotangent; its parameters are checked below.
    for index in 0..condition.len() {
        let expected = difference(&mut condition, index, |condition| loss(mlp, &points, condition));
        let embedding = mlp.layout().entries().iter().find(|entry| entry.name == "lin_p0.weight").unwrap();
        let weights = &mlp.parameters()[embedding.range.clone()];
        let found: f64 = on_embedded.iter().enumerate().map(|(row, c)| c * weights[row * 6 + index]).sum();
        assert_near("condition", index, found, expected);
    }
    let mut parameters = mlp.parameters().to_vec();
    for index in (0..parameters.len()).step_by(7) {
        let expected = difference(&mut parameters, index, |changed| {
            field.mlp.update(|parameters| parameters.copy_from_slice(changed));
            loss(&field.mlp, &points, &condition)
        });
        assert_near("parameter", index, on_parameters[index], expected);
    }
}

fn skinning(random: &mut ChaCha8Rng, frequencies: usize) -> SkinningField<f64> {
    let tree = KinematicTree::new(&[None, Some(0), Some(0), Some(1), Some(1), Some(2), Some(4)]).unwrap();
    let mut field = SkinningField::new(tree, 2, 12, frequencies, 5.0).unwrap();
    field.initialise(random);
    field
}

// dw/dx by tangents against differences of the weights.
#[test]
fn weight_gradients_match_differences() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for frequencies in [0, 2] {
        let field = skinning(&mut random, frequencies);
        let rows = 21;
        let mut points = normal(&mut random, rows * 3, 0.5);
        let joints = field.joints();
        let (mut weights, mut gradients) = (vec![0.0; rows * joints], vec![0.0; rows * 3 * joints]);
        let mut workspace = Default::default();
        field.weights_and_gradients(&mut workspace, points.as_chunks().0, &mut weights, &mut gradients);
        for row in [0, 15, 16, 20] {
            for axis in 0..3 {
                for joint in 0..joints {
                    let expected = difference(&mut points, row * 3 + axis, |points| {
                        let mut weights = vec![0.0; rows * joints];
                        field.weights(&mut Default::default(), points.as_chunks().0, &mut weights);
                        weights[row * joints + joint]
                    });
                    assert_near("dw/dx", row, gradients[(row * 3 + axis) * joints + joint], expected);
                }
            }
        }
    }
}

// L = a . w + b . dw/dx with respect to points and every parameter: the normal loss's way into the skinning field.
#[test]
fn weight_and_gradient_cotangents_reach_points_and_parameters() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for frequencies in [0, 2] {
        let mut field = skinning(&mut random, frequencies);
        let rows = 19;
        let joints = field.joints();
        let mut points = normal(&mut random, rows * 3, 0.5);
        let on_weights = normal(&mut random, rows * joints, 1.0);
        let on_gradients = normal(&mut random, rows * 3 * joints, 1.0);
        let loss = |field: &SkinningField<f64>, points: &[f64]| {
            let (mut weights, mut gradients) = (vec![0.0; rows * joints], vec![0.0; rows * 3 * joints]);
            field.weights_and_gradients(&mut Default::default(), points.as_chunks().0, &mut weights, &mut gradients);
            dot(&weights, &on_weights) + dot(&gradients, &on_gradients)
        };
        let mut trace = Default::default();
        let (mut weights, mut gradients) = (vec![0.0; rows * joints], vec![0.0; rows * 3 * joints]);
        field.weights_and_gradients(&mut trace, points.as_chunks().0, &mut weights, &mut gradients);
        let mut gradient = field.mlp().zero_gradient();
        field.backward(&mut trace, &on_weights, Some(&on_gradients), Backward::ParametersAndPoints, &mut gradient);
        let mut on_parameters = vec![0.0; field.mlp().layout().len()];
        field.mlp().parameter_gradient(&gradient, &mut on_parameters);

        let on_points = trace.point_cotangent().as_flattened().to_vec();
        for (index, found) in on_points.iter().enumerate() {
            let expected = difference(&mut points, index, |points| loss(&field, points));
            assert_near("point", index, *found, expected);
        }
        let mut parameters = field.mlp().parameters().to_vec();
        for (index, found) in on_parameters.iter().enumerate() {
            let expected = difference(&mut parameters, index, |changed| {
                field.mlp_mut().update(|parameters| parameters.copy_from_slice(changed));
                loss(&field, &points)
            });
            assert_near("parameter", index, *found, expected);
        }
    }
}

// A fresh geometry field is close to the signed distance of a sphere of radius 1, or to its negative for occupancy.
#[test]
fn geometry_starts_as_a_sphere() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    for representation in [Representation::SignedDistance, Representation::Occupancy] {
        let shape = GeometryShape { depth: 8, width: 256, frequencies: 4, skip: Some(4), embedded: 16, grid: None };
        let mut field = GeometryField::<f64>::new(&shape, 73, representation, BOUNDS).unwrap();
        field.initialise(&mut random);
        let mut points = normal(&mut random, 300 * 3, 1.0);
        for (row, point) in points.chunks_exact_mut(3).enumerate() {
            let radius = if row % 2 == 0 { 0.4 } else { 1.8 } / dot(point, point).sqrt();
            point.iter_mut().for_each(|x| *x *= radius);
        }
        let mut trace = Trace::default();
        field.mlp.forward(&mut trace, &points, &field.mlp.embed(&[0.0; 73]), &[]);
        for (row, value) in trace.output().iter().enumerate() {
            let outward = value * f64::from(representation.outward());
            assert_eq!(outward > 0.0, row % 2 == 1, "row {row}: {value}");
        }
    }
}
