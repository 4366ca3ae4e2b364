//! Operators that mix no channels: edges, maxima over windows, other sizes, means, and functions of single numbers.

use xavatar_formats::Fault;
use xavatar_vector::vectorised;

use super::activation::Activation;
use super::shape::{Shape, Walk};

/// Zeros around a picture: before and after its rows, columns and channels.
pub(super) struct Padding {
    before: [usize; 3],
}

impl Padding {
    /// As a file says it: before and after, of each of four axes.
    pub fn new(amounts: &[i32], input: Shape) -> Result<(Self, Shape), Fault> {
        let bad =
            || Fault::malformed("a padding", format_args!("{amounts:?}"), "0 or more before and after each of 4 axes");
        let amounts: Vec<usize> =
            amounts.iter().map(|amount| usize::try_from(*amount)).collect::<Result<_, _>>().map_err(|_| bad())?;
        let [0, 0, above, below, left, right, front, back] = amounts[..] else { return Err(bad()) };
        let shape = Shape::new(
            input.rows.saturating_add(above).saturating_add(below),
            input.columns.saturating_add(left).saturating_add(right),
            input.channels.saturating_add(front).saturating_add(back),
        )?;
        Ok((Self { before: [above, left, front] }, shape))
    }

    /// Computes `output`, of the shape `padded`, of `input`.
    pub fn run(&self, input: &[f32], shape: Shape, output: &mut [f32], padded: Shape) {
        output.fill(0.0);
        let [above, left, front] = self.before;
        for (place, pixel) in input.chunks_exact(shape.channels).enumerate() {
            let (row, column) = (place / shape.columns + above, place % shape.columns + left);
            let at = (row * padded.columns + column) * padded.channels + front;
            output[at..at + shape.channels].copy_from_slice(pixel);
        }
    }
}

/// The largest number of each channel in a window.
pub(super) struct MaxPool {
    rows: Walk,
    columns: Walk,
    activation: Activation,
}

impl MaxPool {
    /// Of pictures of this shape; with the shape of what comes out.
    pub fn new(rows: Walk, columns: Walk, activation: Activation, input: Shape) -> Result<(Self, Shape), Fault> {
        let shape = Shape::new(rows.steps, columns.steps, input.channels)?;
        Ok((Self { rows, columns, activation }, shape))
    }

    /// Computes `output` of `input`.
    pub fn run(&self, input: &[f32], shape: Shape, output: &mut [f32]) {
        let channels = shape.channels;
        output.fill(f32::NEG_INFINITY);
        for (place, pixel) in output.chunks_exact_mut(channels).enumerate() {
            let (first_row, rows) = self.rows.window(place / self.columns.steps, shape.rows);
            let (first_column, columns) = self.columns.window(place % self.columns.steps, shape.columns);
            for row in first_row..first_row + rows.len() {
                let from = (row * shape.columns + first_column) * channels;
                for other in input[from..from + columns.len() * channels].chunks_exact(channels) {
                    pixel.iter_mut().zip(other).for_each(|(most, value)| *most = most.max(*value));
                }
            }
        }
        self.activation.apply(output);
    }
}

/// Another size, linear between pixels.
pub(super) struct Resize {
    rows: Vec<(usize, usize, f32)>,
    columns: Vec<(usize, usize, f32)>,
}

/// Where a picture's corners are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Corners {
    /// At the corners of its corner pixels.
    OfPixels,
    /// At the middles of its corner pixels.
    Middles,
    /// The first at its pixel's middle, the last beyond.
    First,
}

impl Resize {
    /// From a shape to another.
    pub fn new(corners: Corners, [rows, columns]: [usize; 2], input: Shape) -> Result<(Self, Shape), Fault> {
        let shape = Shape::new(rows, columns, input.channels)?;
        Ok((
            Self { rows: neighbours(input.rows, rows, corners), columns: neighbours(input.columns, columns, corners) },
            shape,
        ))
    }

    /// Computes `output` of `input`.
    pub fn run(&self, input: &[f32], shape: Shape, output: &mut [f32]) {
        vectorised(
            #[inline(always)]
            || self.interpolate(input, shape, output),
        );
    }

    #[inline(always)]
    fn interpolate(&self, input: &[f32], shape: Shape, output: &mut [f32]) {
        let channels = shape.channels;
        let pixel = |row: usize, column: usize| {
            let at = (row * shape.columns + column) * channels;
            &input[at..at + channels]
        };
        let places = self.rows.iter().flat_map(|row| self.columns.iter().map(move |column| (row, column)));
        for (&(&(above, below, down), &(left, right, across)), to) in
            places.collect::<Vec<_>>().iter().zip(output.chunks_exact_mut(channels))
        {
            let corners = [pixel(above, left), pixel(above, right), pixel(below, left), pixel(below, right)];
            for (channel, value) in to.iter_mut().enumerate() {
                let [a, b, c, d] = corners.map(|corner| corner[channel]);
                let (upper, lower) = (a + (b - a) * across, c + (d - c) * across);
                *value = upper + (lower - upper) * down;
            }
        }
    }
}

/// For each of `count` pixels: the two of `size` that it lies between, and how far from the first.
fn neighbours(size: usize, count: usize, corners: Corners) -> Vec<(usize, usize, f32)> {
    let scale = match corners {
        Corners::Middles if count > 1 => (size - 1) as f32 / (count - 1) as f32,
        _ => size as f32 / count as f32,
    };
    let place = |index: usize| match corners {
        Corners::OfPixels => (index as f32 + 0.5) * scale - 0.5,
        Corners::Middles | Corners::First => index as f32 * scale,
    };
    let between = |index: usize| {
        let place = place(index).clamp(0.0, (size - 1) as f32);
        let first = place.floor();
        (first as usize, (first as usize + 1).min(size - 1), place - first)
    };
    (0..count).map(between).collect()
}

/// The mean of each channel over all places.
pub(super) fn mean(input: &[f32], output: &mut [f32]) {
    output.fill(0.0);
    let channels = output.len();
    for pixel in input.chunks_exact(channels) {
        output.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += value);
    }
    let count = (input.len() / channels) as f32;
    output.iter_mut().for_each(|sum| *sum /= count);
}

/// x where it is positive, else x times its channel's slope.
pub(super) fn prelu(input: &[f32], slopes: &[f32], output: &mut [f32]) {
    vectorised(
        #[inline(always)]
        || {
            let pixels = input.chunks_exact(slopes.len()).zip(output.chunks_exact_mut(slopes.len()));
            for (from, to) in pixels {
                for ((value, slope), to) in from.iter().zip(slopes).zip(to) {
                    *to = value.max(0.0) + slope * value.min(0.0);
                }
            }
        },
    );
}

/// The sum of two.
pub(super) fn sum(one: &[f32], other: &[f32], activation: Activation, output: &mut [f32]) {
    vectorised(
        #[inline(always)]
        || {
            one.iter().zip(other).zip(&mut *output).for_each(|((one, other), sum)| *sum = one + other);
            activation.apply_inline(output);
        },
    );
}

/// 1 / (1 + e^-x).
pub(super) fn logistic(value: f32) -> f32 {
    1.0 / (1.0 + (-value).exp())
}
