//! The auto-decoder of BLSM's flesh (METHOD-BODY 9.4 and 10): shapes of codes, where the codes of the shapes to learn are learned with the network.
//!
//! D(z) = mean + sum_k z_k C_k + s N(z), C the principal components of the shapes, s the deviation of each coordinate. N: linear, then on each level, the coarsest
//! first, a convolution of one ring (48, 32, 32, 16 channels), ELU, un-pooling; a last convolution to the three coordinates, which begins as nothing. So training begins with the
//! principal components and the shapes' coefficients, and what N learns is how shapes bend. Nothing is normalised over a batch: a shape would
//! depend on those beside it. Loss: mean |D(z_i) - x_i|; Adam. When it is trained, codes are turned and scaled so that those of the people
//! have unit variance and no correlation. K codes, V vertices; metres.

use candle_core::{DType, Device, Tensor};
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use xavatar_formats::{Error, Result};

use super::layers::{Convolution, Unpooling, apply_all};
use super::{Layer, Level, Standard, along, convolution};
use crate::core::{Identity, shapes_of};
use crate::descent::{Learner, Parameters, Rate, keeping_variance, of_tensors};

/// Channels of the convolutions, the coarsest first.
const CHANNELS: [usize; 4] = [48, 32, 32, 16];
/// The parameter that holds the codes of the shapes that are learned.
const CODES: &str = "codes";
/// Of Adam's steps: of the network, and of codes, which have unit variance.
const RATES: [f64; 2] = [2e-3, 1e-3];
/// Steps of Gauss and Newton to the code of a shape.
const STEPS: usize = 12;
/// A step that lowers the sum by a smaller share is the last.
const CONVERGED: f64 = 1e-4;
/// Such a share of the largest, and a direction of codes is rounding.
const NOTHING: f64 = 1e-6;

/// Shapes of codes.
#[derive(Debug)]
pub struct Autodecoder {
    pub(super) levels: Vec<Level>,
    layers: Vec<Layer>,
    pub(super) parameters: Parameters,
    pub(super) standard: Standard,
    /// C (Z, V).
    pub(super) components: Vec<Vec<DVec3>>,
    /// C as the network has it, standardised (Z, 3 V).
    linear: Tensor,
    pub(super) codes: Codes,
}

/// What a user's code is to the network: z = origin + axes c.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Codes {
    pub(super) origin: DVector<f64>,
    pub(super) axes: DMatrix<f64>,
}

/// A shape, and what each code does to it.
#[derive(Clone, Debug)]
pub struct Decoded {
    /// (V).
    pub shape: Vec<DVec3>,
    /// (K, V).
    pub directions: Vec<Vec<DVec3>>,
}

/// An auto-decoder that learns.
#[derive(Debug)]
pub struct AutodecoderTraining {
    decoder: Autodecoder,
    codes: Tensor,
    shapes: Tensor,
    /// How much a coordinate counts: its deviation beside the mean of all (1, V, 3).
    counts: Tensor,
}

impl AutodecoderTraining {
    /// For shapes (N, V) of a mesh with these levels, the finest first, at most five, and at most so many codes: there are no more than directions in which the shapes
    /// differ. Begun from a seed.
    ///
    /// # Errors
    /// [`Error::Value`] if the shapes are not of the mesh, do not differ, or no code is asked for.
    pub fn new(levels: Vec<Level>, shapes: &[Vec<DVec3>], codes: usize, seed: u64) -> Result<Self> {
        let value = |name: &str, found: String, expected: &str| Error::Value {
            name: name.into(),
            found,
            expected: expected.into(),
        };
        if codes == 0 {
            return Err(value("codes", codes.to_string(), "at least one"));
        }
        let standard = Standard::of(shapes, levels.first().map_or(0, |level| level.points.len()))?;
        let people: Vec<Identity> =
            shapes.iter().map(|shape| Identity { template: shape.clone(), joints: Vec::new() }).collect();
        let space = shapes_of(&people, codes);
        if standard.is_still() || space.directions.is_empty() {
            let found = format!("{} without a difference", shapes.len());
            return Err(value("shapes", found, "at least two that differ"));
        }
        let mut decoder = Autodecoder::new(levels, standard, space.directions, seed)?;
        let tensors = || -> candle_core::Result<_> {
            let start = Tensor::new(space.coefficients, &Device::Cpu)?.to_dtype(DType::F32)?;
            let [_, deviation] = decoder.standard.tensors(DType::F32)?;
            let counts = deviation.broadcast_div(&deviation.mean_all()?)?;
            let shapes = decoder.standard.tensor_of(shapes, DType::F32)?;
            Ok((decoder.parameters.given(CODES, &start)?, shapes, counts))
        };
        let (codes, shapes, counts) = { tensors }().map_err(of_tensors)?;
        Ok(Self { decoder, codes, shapes, counts })
    }

    /// The auto-decoder, and the codes of the shapes (N, K), of unit variance.
    ///
    /// # Errors
    /// candle's.
    pub fn finished(mut self) -> Result<(Autodecoder, Vec<Vec<f64>>)> {
        let rows = self.codes.to_dtype(DType::F64).and_then(|codes| codes.to_vec2::<f64>()).map_err(of_tensors)?;
        self.decoder.parameters.forget(CODES);
        let (codes, people) = Codes::of(&rows);
        self.decoder.codes = codes;
        Ok((self.decoder, people))
    }
}

impl Learner for AutodecoderTraining {
    const BATCH: usize = 16;
    const FALLS: f64 = 0.97;

    fn parameters(&self) -> &Parameters {
        &self.decoder.parameters
    }

    fn rate_of(name: &str) -> Rate {
        Rate { rate: RATES[usize::from(name == CODES)], decay: 0.0 }
    }

    fn examples(&self) -> usize {
        self.shapes.dims()[0]
    }

    fn loss(&self, batch: &Tensor) -> candle_core::Result<Tensor> {
        let made = self.decoder.of_network(&self.codes.index_select(batch, 0)?)?;
        (made - self.shapes.index_select(batch, 0)?)?.abs()?.broadcast_mul(&self.counts)?.mean_all()
    }
}

impl Codes {
    /// Of the network's codes of people (N, K); theirs then.
    fn of(rows: &[Vec<f64>]) -> (Self, Vec<Vec<f64>>) {
        let (count, width) = (rows.len(), rows.first().map_or(0, Vec::len));
        let all = DMatrix::from_fn(count, width, |row, column| rows[row][column]);
        let origin = all.row_mean().transpose();
        let scale = 1.0 / (count.saturating_sub(1).max(1) as f64).sqrt();
        let centred = DMatrix::from_fn(count, width, |row, column| (all[(row, column)] - origin[column]) * scale);
        let decomposed = centred.svd(true, true);
        let (Some(left), Some(right)) = (decomposed.u, decomposed.v_t) else {
            return (Self::plain(width), rows.to_vec());
        };
        let values = decomposed.singular_values;
        let kept: Vec<usize> = (0..values.len()).filter(|at| values[*at] > NOTHING * values[0]).collect();
        let axes = DMatrix::from_fn(width, kept.len(), |row, column| right[(kept[column], row)] * values[kept[column]]);
        let people = (0..count).map(|row| kept.iter().map(|column| left[(row, *column)] / scale).collect());
        (Self { origin, axes }, people.collect())
    }

    /// Codes as the network has them.
    pub(super) fn plain(width: usize) -> Self {
        Self { origin: DVector::zeros(width), axes: DMatrix::identity(width, width) }
    }
}

impl Autodecoder {
    pub(super) fn new(levels: Vec<Level>, standard: Standard, components: Vec<Vec<DVec3>>, seed: u64) -> Result<Self> {
        let codes = components.len();
        let mut parameters = Parameters::new(seed, DType::F32);
        let layers = layers(&mut parameters, &levels, codes).map_err(of_tensors)?;
        let linear = standard.directions_as_rows(&components, DType::F32).map_err(of_tensors)?;
        Ok(Self { levels, layers, parameters, standard, components, linear, codes: Codes::plain(codes) })
    }

    /// The shape of the weights of the network's first layer, the largest.
    pub(super) fn first_weights(levels: &[Level], codes: usize) -> [usize; 2] {
        let (coarsest, first) = start(levels);
        [coarsest * CHANNELS[first], codes]
    }

    /// K.
    pub fn code_count(&self) -> usize {
        self.codes.axes.ncols()
    }

    /// What it standardises by.
    pub(crate) fn standard(&self) -> &Standard {
        &self.standard
    }

    /// Standardised meshes (B, V, 3) of codes (B, K).
    pub(crate) fn of_codes(&self, codes: &Tensor) -> candle_core::Result<Tensor> {
        let Codes { origin, axes } = &self.codes;
        let kind = self.parameters.kind();
        let axes = Tensor::from_slice(axes.as_slice(), (axes.ncols(), axes.nrows()), &Device::Cpu)?.to_dtype(kind)?;
        let origin = Tensor::from_slice(origin.as_slice(), (1, origin.len()), &Device::Cpu)?.to_dtype(kind)?;
        self.of_network(&codes.matmul(&axes)?.broadcast_add(&origin)?)
    }

    /// Standardised meshes (B, V, 3) of the network's codes (B, Z).
    fn of_network(&self, codes: &Tensor) -> candle_core::Result<Tensor> {
        let bent = apply_all(&self.layers, codes)?;
        &bent + codes.matmul(&self.linear)?.reshape(bent.shape())?
    }

    /// The shape of a code (K), and its derivatives.
    ///
    /// # Errors
    /// [`Error::Value`] if there are not K numbers.
    pub fn decoded(&self, code: &[f64]) -> Result<Decoded> {
        if code.len() != self.code_count() {
            return Err(Error::Value {
                name: "code".into(),
                found: format!("{} numbers", code.len()),
                expected: format!("{}", self.code_count()),
            });
        }
        self.through(code).map_err(of_tensors)
    }

    fn through(&self, code: &[f64]) -> candle_core::Result<Decoded> {
        let Codes { origin, axes } = &self.codes;
        let value = origin + axes * DVector::from_column_slice(code);
        let (width, kind) = (value.len(), self.parameters.kind());
        let straight = |of: &[f64], to: &mut [DVec3]| {
            for (component, share) in self.components.iter().zip(of) {
                to.iter_mut().zip(component).for_each(|(place, offset)| *place += *offset * *share);
            }
        };
        let code = value.clone();
        let value = Tensor::from_slice(value.as_slice(), (1, width), &Device::Cpu)?.to_dtype(kind)?;
        // Columns one after the other are the tangents' rows.
        let tangents = Tensor::from_slice(axes.as_slice(), (axes.ncols(), width), &Device::Cpu)?.to_dtype(kind)?;
        let start = (value, tangents);
        let (value, tangents) = self
            .layers
            .iter()
            .try_fold(start, |(value, tangents), layer| layer.apply_with_tangents(&value, &tangents))?;
        let mut shape = self.standard.shapes_of(&value)?.pop().unwrap_or_default();
        let mut directions = self.standard.directions_of(&tangents)?;
        straight(code.as_slice(), &mut shape);
        directions.iter_mut().zip(axes.column_iter()).for_each(|(to, axis)| straight(axis.as_slice(), to));
        Ok(Decoded { shape, directions })
    }

    /// The code whose shape is nearest to one (V) in the mean of squares, from the mean; a code that is 1 costs `held` square metres.
    ///
    /// # Errors
    /// As [`decoded`](Self::decoded).
    pub fn code_of(&self, shape: &[DVec3], held: f64) -> Result<Vec<f64>> {
        let count = self.code_count();
        let mut code = DVector::zeros(count);
        let cost = |decoded: &Decoded, code: &DVector<f64>| -> f64 {
            let squares = decoded.shape.iter().zip(shape).map(|(own, target)| own.distance_squared(*target));
            squares.sum::<f64>() + held * code.norm_squared()
        };
        let mut at = self.decoded(code.as_slice())?;
        let (mut best, mut damping) = (cost(&at, &code), 1e-3);
        for _ in 0..STEPS {
            let left: Vec<DVec3> = shape.iter().zip(&at.shape).map(|(target, own)| *target - *own).collect();
            let dot = |one: &[DVec3], other: &[DVec3]| one.iter().zip(other).map(|(one, other)| one.dot(*other)).sum();
            let mut matrix =
                DMatrix::from_fn(count, count, |row, column| dot(&at.directions[row], &at.directions[column]));
            let right = DVector::from_fn(count, |row, _| dot(&at.directions[row], &left)) - &code * held;
            for place in 0..count {
                matrix[(place, place)] = matrix[(place, place)] * (1.0 + damping) + held + f64::MIN_POSITIVE;
            }
            let Some(step) = matrix.cholesky().map(|factor| factor.solve(&right)) else { break };
            let next = &code + step;
            let there = self.decoded(next.as_slice())?;
            let found = cost(&there, &next);
            if found < best {
                let gain = best - found;
                (code, at, best, damping) = (next, there, found, damping * 0.1);
                if gain < CONVERGED * best {
                    break;
                }
            } else {
                damping *= 10.0;
            }
        }
        Ok(code.as_slice().to_vec())
    }
}

/// Vertices of the coarsest level, and the place of its channels.
fn start(levels: &[Level]) -> (usize, usize) {
    let first = CHANNELS.len().saturating_sub(levels.len().saturating_sub(1));
    (levels.last().map_or(0, |level| level.points.len()), first.min(CHANNELS.len() - 1))
}

fn layers(parameters: &mut Parameters, levels: &[Level], codes: usize) -> candle_core::Result<Vec<Layer>> {
    let (coarsest, first) = start(levels);
    let mut channels = CHANNELS[first];
    let code = parameters.linear_within("code", codes, coarsest * channels, keeping_variance(codes))?;
    let mut layers = vec![Layer::Dense(code), Layer::Unflatten(coarsest, channels)];
    for (level, wanted) in (1..levels.len()).rev().zip(&CHANNELS[first..]) {
        let name = format!("level.{level}");
        layers.push(convolution(parameters, &name, &levels[level], 1, [channels, *wanted])?);
        layers.push(Layer::Elu);
        if let Some(pooling) = &levels[level].from_finer {
            layers.push(Layer::Unpool(Unpooling::new(pooling, parameters.kind())?));
        }
        channels = *wanted;
    }
    if let Some(finest) = levels.first() {
        let (spirals, length) = along(finest, 1);
        let nothing = parameters.linear_within("last", length * channels, 3, 0.0)?;
        layers.push(Layer::Convolution(Convolution::new(spirals, nothing)?));
    }
    Ok(layers)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::descent::Descent;
    use crate::spiral::autoencoder::tests::{ball, bulges};
    use crate::spiral::levels;

    /// An auto-decoder of bulging balls, after some epochs, with what it learned and the codes.
    pub(in crate::spiral) fn trained(epochs: usize) -> (Autodecoder, Vec<Vec<DVec3>>, Vec<Vec<f64>>) {
        let shapes = bulges(24);
        let levels = levels(&ball(), &[2, 2]).unwrap();
        let training = AutodecoderTraining::new(levels, &shapes, 4, 5).unwrap();
        let mut descent = Descent::new(&training, 1).unwrap();
        (0..epochs).for_each(|_| {
            descent.epoch(&training).unwrap();
        });
        let (decoder, codes) = training.finished().unwrap();
        (decoder, shapes, codes)
    }

    pub(in crate::spiral) fn mean_distance(one: &[DVec3], other: &[DVec3]) -> f64 {
        one.iter().zip(other).map(|(one, other)| one.distance(*other)).sum::<f64>() / one.len() as f64
    }

    #[test]
    fn codes_of_people_have_unit_variance_and_no_correlation() {
        let (_, _, codes) = trained(3);
        for one in 0..codes[0].len() {
            assert!(codes.iter().map(|code| code[one]).sum::<f64>().abs() < 1e-6);
            for other in 0..codes[0].len() {
                let product = codes.iter().map(|code| code[one] * code[other]).sum::<f64>() / 23.0;
                let expected = if one == other { 1.0 } else { 0.0 };
                assert!((product - expected).abs() < 1e-6, "{one} {other}: {product}");
            }
        }
    }

    // (D(c + h e_k) - D(c - h e_k)) / 2 h, in single precision.
    #[test]
    fn derivatives_match_finite_differences() {
        let (decoder, _, _) = trained(3);
        let at = vec![0.4; decoder.code_count()];
        let decoded = decoder.decoded(&at).unwrap();
        for place in 0..at.len() {
            let moved = |by: f64| {
                let mut code = at.clone();
                code[place] += by;
                decoder.decoded(&code).unwrap().shape
            };
            let (ahead, behind) = (moved(1e-2), moved(-1e-2));
            let expected: Vec<DVec3> = ahead.iter().zip(&behind).map(|(one, other)| (*one - *other) / 2e-2).collect();
            let size = mean_distance(&expected, &vec![DVec3::ZERO; expected.len()]);
            assert!(mean_distance(&expected, &decoded.directions[place]) < 5e-3 * size);
        }
    }

    #[test]
    fn the_code_of_a_shape_of_the_decoder_is_found() {
        let (decoder, _, _) = trained(20);
        let planted: Vec<f64> = (0..decoder.code_count()).map(|place| 0.5 - 0.3 * place as f64).collect();
        let shape = decoder.decoded(&planted).unwrap().shape;
        let found = decoder.decoded(&decoder.code_of(&shape, 0.0).unwrap()).unwrap().shape;
        let mean = decoder.decoded(&vec![0.0; planted.len()]).unwrap().shape;
        assert!(mean_distance(&found, &shape) < 1e-2 * mean_distance(&mean, &shape));
    }

    // Before it learns it is the principal components: no code is nearer to a shape than its projection.
    #[test]
    fn training_begins_with_principal_components() {
        let (decoder, shapes, codes) = trained(0);
        let people: Vec<Identity> =
            shapes.iter().map(|shape| Identity { template: shape.clone(), joints: Vec::new() }).collect();
        let space = shapes_of(&people, 4);
        for ((shape, code), own) in shapes.iter().zip(&codes).zip(&space.coefficients) {
            let mut projected = space.mean.clone();
            for (direction, along) in space.directions.iter().zip(own) {
                projected.iter_mut().zip(direction).for_each(|(place, offset)| *place += *offset * *along);
            }
            assert!(mean_distance(&decoder.decoded(code).unwrap().shape, &projected) < 1e-6);
            let found = decoder.code_of(shape, 0.0).unwrap();
            assert!(mean_distance(&decoder.decoded(&found).unwrap().shape, &projected) < 1e-6);
        }
    }

    #[test]
    fn it_learns_what_is_not_linear() {
        let distance = |epochs: usize| {
            let (decoder, shapes, codes) = trained(epochs);
            let apart =
                |(shape, code): (&Vec<DVec3>, &Vec<f64>)| mean_distance(&decoder.decoded(code).unwrap().shape, shape);
            shapes.iter().zip(&codes).map(apart).sum::<f64>()
        };
        let (before, after) = (distance(0), distance(40));
        assert!(after < 0.8 * before, "{after} {before}");
    }

    #[test]
    fn there_are_no_more_codes_than_shapes_differ_in_and_at_least_one() {
        let begun = |shapes: &[Vec<DVec3>], codes: usize| {
            AutodecoderTraining::new(levels(&ball(), &[2]).unwrap(), shapes, codes, 0)
        };
        let (decoder, codes) = begun(&bulges(3), 7).unwrap().finished().unwrap();
        assert_eq!((decoder.code_count(), codes[0].len()), (2, 2));
        let same = vec![bulges(1).remove(0); 5];
        let message = begun(&same, 7).unwrap_err().to_string();
        assert!(message.contains("5 without a difference") && message.contains("two that differ"), "{message}");
        assert!(begun(&bulges(1), 7).unwrap_err().to_string().contains("two that differ"));
        assert!(begun(&bulges(5), 0).unwrap_err().to_string().contains("codes is 0"));
    }

    #[test]
    fn a_code_of_another_length_is_refused() {
        let (decoder, _, _) = trained(1);
        let message = decoder.decoded(&[0.0; 9]).unwrap_err().to_string();
        assert!(message.contains("9 numbers") && message.contains('4'), "{message}");
    }
}
