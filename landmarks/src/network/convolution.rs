//! Convolutions: y(p, o) = b(o) + sum over window places k and channels i of w(o, k, i) x(p + k, i), as products of matrices.
//!
//! Windows of one pixel are one product; others are gathered first, a few rows of the picture at a time. One window for each channel
//! ("depthwise") is a sum over the window of products along the channels.

use xavatar_formats::Fault;
use xavatar_vector::{Matrix, MatrixMut, Write, product, vectorised};

use super::activation::Activation;
use super::shape::{Shape, Walk};

/// Numbers gathered at a time: half a megabyte stays in the cache.
const GATHERED: usize = 1 << 17;

/// A convolution.
pub(super) struct Convolution {
    rows: Walk,
    columns: Walk,
    /// (window rows x window columns x input channels, output channels).
    weights: Vec<f32>,
    bias: Vec<f32>,
    activation: Activation,
}

/// What a convolution is in a file.
pub(super) struct Kernel {
    /// As the file has them: (output channels, window rows, window columns, input channels); depthwise, output channels last.
    pub weights: Vec<f32>,
    pub extents: [usize; 4],
    pub bias: Option<Vec<f32>>,
    pub strides: [usize; 2],
    pub padded: bool,
    pub activation: Activation,
}

impl Kernel {
    fn walks(&self, input: Shape) -> Result<(Walk, Walk), Fault> {
        let [_, rows, columns, _] = self.extents;
        Ok((
            Walk::over(input.rows, rows, self.strides[0], self.padded)?,
            Walk::over(input.columns, columns, self.strides[1], self.padded)?,
        ))
    }

    fn bias(&self, channels: usize) -> Result<Vec<f32>, Fault> {
        let bias = self.bias.clone().unwrap_or_else(|| vec![0.0; channels]);
        if bias.len() != channels {
            return Err(Fault::malformed("a convolution's bias", bias.len(), format_args!("{channels} numbers")));
        }
        Ok(bias)
    }
}

impl Convolution {
    /// Of pictures of this shape; with the shape of what comes out.
    pub fn new(kernel: Kernel, input: Shape) -> Result<(Self, Shape), Fault> {
        let (rows, columns) = kernel.walks(input)?;
        let [channels, .., of_input] = kernel.extents;
        if of_input != input.channels {
            let expected = format_args!("{} channels", input.channels).to_string();
            return Err(Fault::malformed("a convolution's weights", format_args!("of {of_input} channels"), expected));
        }
        let shape = Shape::new(rows.steps, columns.steps, channels)?;
        let depth = kernel.weights.len() / channels;
        let mut weights = vec![0.0; kernel.weights.len()];
        for (output, row) in kernel.weights.chunks_exact(depth).enumerate() {
            row.iter().enumerate().for_each(|(place, weight)| weights[place * channels + output] = *weight);
        }
        let bias = kernel.bias(channels)?;
        Ok((Self { rows, columns, weights, bias, activation: kernel.activation }, shape))
    }

    /// Computes `output` of `input`; `gathered` is room.
    pub fn run(&self, input: &[f32], shape: Shape, output: &mut [f32], gathered: &mut Vec<f32>) {
        let channels = self.bias.len();
        let depth = self.weights.len() / channels;
        let is_plain = [self.rows, self.columns].iter().all(|walk| walk.extent == 1 && walk.stride == 1);
        let weights = Matrix::new(&self.weights, depth, channels, channels);
        if is_plain {
            self.multiply(Matrix::new(input, shape.places(), depth, depth), weights, output);
            return;
        }
        let line = self.columns.steps * depth;
        let lines = (GATHERED / line).clamp(1, self.rows.steps);
        let block = lines * self.columns.steps * channels;
        for (index, output) in output.chunks_mut(block).enumerate() {
            let count = output.len() / (self.columns.steps * channels);
            gathered.clear();
            gathered.resize(count * line, 0.0);
            for (own, line) in gathered.chunks_exact_mut(line).enumerate() {
                self.gather(index * lines + own, input, shape, line);
            }
            let places = count * self.columns.steps;
            self.multiply(Matrix::new(gathered, places, depth, depth), weights, output);
        }
    }

    /// The windows of a row of places; what lies outside the picture stays zero.
    fn gather(&self, row: usize, input: &[f32], shape: Shape, line: &mut [f32]) {
        let (across, channels) = (self.columns.extent * shape.channels, shape.channels);
        let (first_row, within) = self.rows.window(row, shape.rows);
        for (column, window) in line.chunks_exact_mut(self.rows.extent * across).enumerate() {
            let (first_column, covered) = self.columns.window(column, shape.columns);
            for (offset, kernel_row) in within.clone().enumerate() {
                let from = ((first_row + offset) * shape.columns + first_column) * channels;
                let to = kernel_row * across + covered.start * channels;
                let count = covered.len() * channels;
                window[to..to + count].copy_from_slice(&input[from..from + count]);
            }
        }
    }

    fn multiply(&self, left: Matrix<f32>, weights: Matrix<f32>, output: &mut [f32]) {
        let channels = self.bias.len();
        output.chunks_exact_mut(channels).for_each(|place| place.copy_from_slice(&self.bias));
        let places = output.len() / channels;
        product(MatrixMut::new(output, places, channels, channels), Write::Add, left, weights);
        self.activation.apply(output);
    }
}

/// A convolution of each channel alone.
pub(super) struct Depthwise {
    rows: Walk,
    columns: Walk,
    /// (window rows, window columns, channels).
    weights: Vec<f32>,
    bias: Vec<f32>,
    activation: Activation,
}

impl Depthwise {
    /// Of pictures of this shape; with the shape of what comes out.
    pub fn new(kernel: Kernel, input: Shape) -> Result<(Self, Shape), Fault> {
        let (rows, columns) = kernel.walks(input)?;
        if kernel.extents[0] != 1 || kernel.extents[3] != input.channels {
            let found = format_args!("{:?}", kernel.extents).to_string();
            let expected = format_args!("one window for each of {} channels", input.channels).to_string();
            return Err(Fault::malformed("a depthwise convolution's weights", found, expected));
        }
        let shape = Shape::new(rows.steps, columns.steps, input.channels)?;
        let bias = kernel.bias(input.channels)?;
        Ok((Self { rows, columns, weights: kernel.weights, bias, activation: kernel.activation }, shape))
    }

    /// Computes `output` of `input`.
    pub fn run(&self, input: &[f32], shape: Shape, output: &mut [f32]) {
        vectorised(
            #[inline(always)]
            || self.sum(input, shape, output),
        );
    }

    #[inline(always)]
    fn sum(&self, input: &[f32], shape: Shape, output: &mut [f32]) {
        let channels = shape.channels;
        for (row, line) in output.chunks_exact_mut(self.columns.steps * channels).enumerate() {
            let (first_row, within) = self.rows.window(row, shape.rows);
            for (column, place) in line.chunks_exact_mut(channels).enumerate() {
                place.copy_from_slice(&self.bias);
                let (first_column, covered) = self.columns.window(column, shape.columns);
                for (offset, kernel_row) in within.clone().enumerate() {
                    let from = ((first_row + offset) * shape.columns + first_column) * channels;
                    let weight = (kernel_row * self.columns.extent + covered.start) * channels;
                    let count = covered.len() * channels;
                    let pixels = input[from..from + count].chunks_exact(channels);
                    let weights = self.weights[weight..weight + count].chunks_exact(channels);
                    for (pixel, weights) in pixels.zip(weights) {
                        for ((sum, value), weight) in place.iter_mut().zip(pixel).zip(weights) {
                            *sum += value * weight;
                        }
                    }
                }
            }
        }
        self.activation.apply_inline(output);
    }
}
