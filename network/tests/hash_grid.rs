//! The hash-grid encoding inside a network: derivatives against central differences in f64, and the sparse optimiser.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use xavatar_network::{
    Adam, AdamSettings, Backward, Bounds, EncodingShape, GeometryField, GeometryShape, HashGridShape, Mlp, MlpShape,
    NetworkUpdate, ParameterGroup, Representation, TextureField, TextureShape, Trace,
};

const STEP: f64 = 1e-5;
const BOUNDS: Bounds = Bounds { lowest: [-1.1, -1.3, -0.3], highest: [1.05, 0.7, 0.4] };
/// Two dense levels, then hashed ones with collisions.
const GRID: HashGridShape = HashGridShape { levels: 4, coarsest: 3, finest: 17, log2_entries: 7, features: 2 };

fn normal(random: &mut ChaCha8Rng, count: usize, scale: f64) -> Vec<f64> {
    (0..count).map(|_| scale * random.sample::<f64, _>(rand_distr::StandardNormal)).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

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

/// Points in the box, the last one outside it along y: random numbers this far from a cell's face in every level.
fn points(random: &mut ChaCha8Rng, rows: usize, dimensions: usize) -> Vec<f64> {
    let mut points = normal(random, rows * dimensions, 1.0);
    let longest = f64::from(BOUNDS.highest[0]) - f64::from(BOUNDS.lowest[0]);
    let away = |offset: f64| {
        (0..GRID.levels).all(|level| {
            let cells = (3.0 * (17.0f64 / 3.0).powf(level as f64 / 3.0)).round();
            let place = offset * cells / longest;
            (place - place.round()).abs() > 0.01
        })
    };
    for point in points.chunks_exact_mut(dimensions) {
        for (axis, coordinate) in point[..3].iter_mut().enumerate() {
            let (low, high) = (f64::from(BOUNDS.lowest[axis]), f64::from(BOUNDS.highest[axis]));
            *coordinate = loop {
                let x = random.random_range(low..high);
                if away(x - low) {
                    break x;
                }
            };
        }
    }
    points[(rows - 1) * dimensions + 1] = 0.9;
    points
}

fn network(random: &mut ChaCha8Rng, inputs: usize, features: usize, skip: Option<usize>) -> Mlp<f64> {
    let shape = MlpShape {
        inputs,
        encoding: EncodingShape::HashGrid { grid: HashGridShape { features, ..GRID }, bounds: BOUNDS },
        condition: 3,
        embedded: 2,
        row_condition: 1,
        depth: 3,
        width: 30,
        skip,
        outputs: 2,
    };
    let mut mlp = Mlp::new(shape).unwrap();
    mlp.initialise_uniform(random);
    let noise = normal(random, mlp.layout().len(), 0.05);
    mlp.update(|parameters| parameters.iter_mut().zip(&noise).for_each(|(p, n)| *p += n));
    mlp
}

// L = a . f + b . d(seed . f)/dx over a batch, with respect to points and every parameter, with and without skip and normal.
#[test]
fn value_and_gradient_cotangents_reach_points_and_table() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for (inputs, features, skip) in [(3, 2, None), (6, 2, Some(2)), (3, 1, Some(1)), (4, 4, None)] {
        let mut mlp = network(&mut random, inputs, features, skip);
        let rows = 6;
        let mut points = points(&mut random, rows, inputs);
        let own = normal(&mut random, rows, 1.0);
        let on_value = normal(&mut random, rows * 2, 1.0);
        let on_gradient = normal(&mut random, rows * inputs, 1.0);
        let seed = normal(&mut random, rows * 2, 1.0);
        let shared = mlp.embed(&[0.3, -0.2, 0.5]);
        let loss = |mlp: &Mlp<f64>, points: &[f64]| {
            let mut trace = Trace::default();
            mlp.forward(&mut trace, points, &shared, &own);
            let value = dot(trace.output(), &on_value);
            mlp.input_gradient(&mut trace, &seed);
            value + dot(trace.gradient(), &on_gradient)
        };
        let mut gradient = mlp.zero_gradient();
        let mut trace = Trace::default();
        mlp.forward(&mut trace, &points, &shared, &own);
        mlp.input_gradient(&mut trace, &seed);
        mlp.backward(&mut trace, &on_value, Some(&on_gradient), Backward::ParametersAndPoints, &mut gradient);
        let on_points = trace.point_cotangent().to_vec();
        for (index, found) in on_points.iter().enumerate() {
            assert_near("point", index, *found, difference(&mut points, index, |points| loss(&mlp, points)));
        }
        let mut on_parameters = vec![0.0; mlp.layout().len()];
        mlp.parameter_gradient(&gradient, &mut on_parameters);
        check_parameters(&mut mlp, &on_parameters, |mlp| loss(mlp, &points));
    }
}

/// Every touched entry of the table and some other parameters; the embedding's stay out, the losses hold its output fixed.
fn check_parameters(mlp: &mut Mlp<f64>, found: &[f64], loss: impl Fn(&Mlp<f64>) -> f64) {
    let mut parameters = mlp.parameters().to_vec();
    let entries = mlp.layout().entries().to_vec();
    assert_eq!(entries[0].name, "grid.table");
    let mut touched = 0;
    for entry in entries.iter().filter(|entry| !entry.name.starts_with("lin_p0")) {
        for index in entry.range.clone().step_by(if entry.name == "grid.table" { 1 } else { 11 }) {
            if entry.name == "grid.table" && found[index] == 0.0 && index % 16 != 0 {
                continue;
            }
            touched += usize::from(found[index] != 0.0);
            let expected = difference(&mut parameters, index, |changed| {
                mlp.update(|parameters| parameters.copy_from_slice(changed));
                loss(mlp)
            });
            assert_near(&entry.name, index, found[index], expected);
        }
    }
    mlp.update(|target| target.copy_from_slice(&parameters));
    assert!(touched > 100, "only {touched} parameters have a gradient");
}

// The tangents below the output against differences, and a loss on them with respect to points and parameters.
#[test]
fn tangents_and_their_cotangents_are_exact() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut mlp = network(&mut random, 3, 2, Some(2));
    let rows = 5;
    let mut points = points(&mut random, rows, 3);
    let own = normal(&mut random, rows, 1.0);
    let shared = mlp.embed(&[0.1, 0.2, 0.3]);
    let forward = |mlp: &Mlp<f64>, points: &[f64]| {
        let mut trace = Trace::default();
        mlp.forward_with_tangents(&mut trace, points, &shared, &own);
        trace
    };
    let mut trace = forward(&mlp, &points);
    let output = trace.output().to_vec();
    for row in 0..rows {
        for axis in 0..3 {
            let expected =
                difference(&mut points, row * 3 + axis, |points| forward(&mlp, points).output()[row * 2 + 1]);
            assert_near("tangent", row, output[((1 + axis) * rows + row) * 2 + 1], expected);
        }
    }
    let on_output = normal(&mut random, output.len(), 1.0);
    let mut gradient = mlp.zero_gradient();
    mlp.backward(&mut trace, &on_output, None, Backward::ParametersAndPoints, &mut gradient);
    let on_points = trace.point_cotangent().to_vec();
    for (index, found) in on_points.iter().enumerate() {
        let expected = difference(&mut points, index, |points| dot(forward(&mlp, points).output(), &on_output));
        assert_near("point", index, *found, expected);
    }
    let mut on_parameters = vec![0.0; mlp.layout().len()];
    mlp.parameter_gradient(&gradient, &mut on_parameters);
    check_parameters(&mut mlp, &on_parameters, |mlp| dot(forward(mlp, &points).output(), &on_output));
}

fn group(rate: f64) -> ParameterGroup {
    ParameterGroup { settings: AdamSettings::default(), rate }
}

// Two threads' sums and a sparse step against a dense step by the definition, three times, on batches that touch different entries.
#[test]
fn sparse_steps_are_dense_steps_where_the_gradient_is_not_zero() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut mlp = network(&mut random, 3, 2, None);
    let mut dense = mlp.clone();
    let table = mlp.layout().entries()[0].range.clone();
    let (mut adam, mut oracle) = (Adam::new(mlp.layout().len()), Adam::new(mlp.layout().len()));
    let mut threads = [mlp.zero_gradient(), mlp.zero_gradient()];
    for _ in 0..3 {
        for gradient in &mut threads {
            let points = points(&mut random, 3, 3);
            let mut trace = Trace::default();
            mlp.forward(&mut trace, &points, &[0.1, 0.2], &[0.0; 3]);
            mlp.backward(&mut trace, &[1.0, -0.5, 0.3, 0.2, 0.8, 0.1], None, Backward::Parameters, gradient);
        }
        let mut sum = threads[0].clone();
        sum.add(&threads[1]);
        let mut flat = vec![0.0; mlp.layout().len()];
        mlp.parameter_gradient(&sum, &mut flat);

        let summed = mlp.sum_gradients(&mut threads);
        assert!((summed.squared_norm() - dot(&flat, &flat)).abs() < 1e-12 * dot(&flat, &flat));
        let update = NetworkUpdate { network: group(1e-3), grid: group(1e-2), factor: 0.7 };
        adam.step_network(&update, summed, &mut mlp);

        let before = (oracle.clone(), dense.parameters().to_vec());
        let (mut slow, mut fast) = (oracle.clone(), before.1.clone());
        slow.step(AdamSettings::default(), 1e-2, 0.7, &flat, &mut fast);
        dense.update(|parameters| oracle.step(AdamSettings::default(), 1e-3, 0.7, &flat, parameters));
        dense.update(|parameters| {
            for index in table.clone() {
                let touched = flat[index] != 0.0;
                parameters[index] = if touched { fast[index] } else { before.1[index] };
                if !touched {
                    oracle.first_moment[index] = before.0.first_moment[index];
                    oracle.second_moment[index] = before.0.second_moment[index];
                }
            }
        });
        assert!(table.clone().any(|index| flat[index] == 0.0) && table.clone().any(|index| flat[index] != 0.0));
        assert_eq!(mlp.parameters(), dense.parameters());
        assert_eq!(adam, oracle);
        for gradient in &threads {
            mlp.parameter_gradient(gradient, &mut flat);
            assert!(flat.iter().all(|value| *value == 0.0));
        }
    }
}

// A fresh geometry field with a grid and without a condition is still close to a sphere; a texture field may go without normals and
// the geometry's features.
#[test]
fn fields_start_with_a_grid_and_without_condition() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let shape = GeometryShape { depth: 2, width: 64, frequencies: 0, skip: None, embedded: 0, grid: Some(GRID) };
    let mut field = GeometryField::<f64>::new(&shape, 73, Representation::SignedDistance, BOUNDS).unwrap();
    field.initialise(&mut random);
    assert!(field.mlp.embed(&[0.0; 73]).is_empty());
    let mut trace = Trace::default();
    field.mlp.forward(&mut trace, &[0.0, 0.1, 0.0, 0.0, 1.9, 0.3, -1.9, 0.0, 0.0], &[], &[]);
    let values = trace.output();
    assert!(values[0] < 0.0 && values[1] > 0.0 && values[2] > 0.0, "{values:?}");
    let shape = TextureShape {
        depth: 1,
        width: 8,
        frequencies: 0,
        skip: None,
        grid: Some(GRID),
        normal: false,
        features: true,
    };
    let texture = TextureField::<f32>::new(&shape, 0, 64, BOUNDS).unwrap();
    assert_eq!((texture.mlp.shape().inputs, texture.seen(&[0.5; 128])), (3, &[0.5; 128][..]));
    let alone = TextureField::<f32>::new(&TextureShape { features: false, ..shape }, 0, 64, BOUNDS).unwrap();
    assert_eq!((alone.mlp.shape().row_condition, alone.seen(&[0.5; 128])), (0, &[][..]));
}

// Points far outside, infinite or not a number have a finite encoding's table behind them: no entry outside the table is read.
#[test]
fn wild_points_do_not_panic() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mlp = network(&mut random, 3, 2, None);
    let mut trace = Trace::default();
    let wild = [f64::NAN, 0.0, 0.0, 1e300, -1e300, 0.0, f64::INFINITY, f64::NEG_INFINITY, 1.0];
    mlp.forward(&mut trace, &wild, &[0.0; 2], &[0.0; 3]);
}
