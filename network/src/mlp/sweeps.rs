//! The sweeps over the layers of one block of rows: forward, down, up, backward (see the module above for the equations).

use std::ops::Range;

use super::{Layer, Mlp, MlpGradient};
use crate::Real;
use crate::activation::{
    add_column_sums, add_curvature, add_scaled, curvature_rows, scale_rows, softplus_rows, softplus_value_rows,
    write_scaled,
};
use crate::encoding::{Cells, Directions};
use xavatar_vector::{Matrix, MatrixMut, Write, product};

/// One block's activations: what the sweeps of an [`Mlp`] leave for each other. One a thread and network.
#[derive(Clone, Debug, Default)]
pub struct Trace<T> {
    rows: usize,
    directions: usize,
    points: Vec<T>,
    /// Where a grid encoding found the points.
    cells: Cells<T>,
    /// a_l of each layer, then the K tangents of every row, or v_l (rows R..).
    inputs: Vec<Vec<T>>,
    slopes: Vec<Vec<T>>,
    /// z_bar_l of each layer for every row of `inputs`, or u_l (rows R..).
    cotangents: Vec<Vec<T>>,
    output: Vec<T>,
    /// W^T of a cotangent, before it is multiplied by the slope.
    carried: Vec<T>,
    /// Cotangent of a_0: the encoded point's entries, then the embedded condition's. (rows, E + embedded)
    input_cotangent: Vec<T>,
    /// e'^T's argument in the input gradient, (R, E).
    encoded_gradient: Vec<T>,
    gradient: Vec<T>,
    point_cotangent: Vec<T>,
}

impl<T: Real> Trace<T> {
    /// z_L of each row (R, outputs); with tangents, their K further blocks of R rows.
    pub fn output(&self) -> &[T] {
        &self.output
    }

    /// The last hidden activations, (R, width).
    pub fn features(&self, mlp: &Mlp<T>) -> &[T] {
        &self.inputs[mlp.shape.depth][..self.rows * mlp.shape.width]
    }

    /// The input gradient of the last call to [`Mlp::input_gradient`], (R, D).
    pub fn gradient(&self) -> &[T] {
        &self.gradient
    }

    /// The cotangent of the points of the last call to [`Mlp::backward`], (R, D).
    pub fn point_cotangent(&self) -> &[T] {
        &self.point_cotangent
    }
}

/// What a backward sweep returns beside the parameters' gradient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backward {
    /// Nothing.
    Parameters,
    /// The cotangent of the points too, see [`Trace::point_cotangent`].
    ParametersAndPoints,
}

/// What a forward sweep leaves for the sweeps after it.
#[derive(Clone, Copy)]
enum Kept {
    Nothing,
    /// The slopes, and that many tangents of every row.
    Slopes {
        directions: usize,
    },
}

impl<T: Real> Mlp<T> {
    /// W^T of a layer, or of its first `inputs` inputs alone.
    fn transposed_weight(&self, layer: &Layer, inputs: usize) -> Matrix<'_, T> {
        Matrix::new(&self.transposed[layer.folded_weight.clone()], inputs, layer.outputs, layer.outputs)
    }

    /// The columns of a layer's weights whose inputs are hidden units, or for the first layer encoded point and embedding.
    fn weight_columns(&self, layer: &Layer, columns: Range<usize>) -> Matrix<'_, T> {
        Matrix::new(
            &self.folded[layer.folded_weight.start + columns.start..layer.folded_weight.end],
            layer.outputs,
            columns.len(),
            layer.inputs,
        )
    }

    /// Hidden units among the inputs of layer `index` > 0; the rest is the encoded point.
    fn hidden_inputs(&self, index: usize) -> usize {
        self.layers[index - 1].outputs
    }

    /// Forward sweep over the R points of `points` (R, D).
    ///
    /// `shared_condition` (embedded) is joined to every row, `row_condition` (R, row_condition) to its own.
    pub fn forward(&self, trace: &mut Trace<T>, points: &[T], shared_condition: &[T], row_condition: &[T]) {
        self.sweep_forward(trace, points, shared_condition, row_condition, Kept::Slopes { directions: 0 });
    }

    /// [`Mlp::forward`] for the outputs alone, a little faster: no other sweep may follow it.
    pub fn evaluate(&self, trace: &mut Trace<T>, points: &[T], shared_condition: &[T], row_condition: &[T]) {
        self.sweep_forward(trace, points, shared_condition, row_condition, Kept::Nothing);
    }

    /// Forward sweep with the D tangents of every row: the output's derivatives along each coordinate, stacked below it.
    pub fn forward_with_tangents(
        &self,
        trace: &mut Trace<T>,
        points: &[T],
        shared_condition: &[T],
        row_condition: &[T],
    ) {
        let kept = Kept::Slopes { directions: self.shape.inputs };
        self.sweep_forward(trace, points, shared_condition, row_condition, kept);
    }

    fn sweep_forward(&self, trace: &mut Trace<T>, points: &[T], shared: &[T], row_condition: &[T], kept: Kept) {
        let shape = &self.shape;
        let directions = match kept {
            Kept::Nothing => 0,
            Kept::Slopes { directions } => directions,
        };
        let rows = points.len() / shape.inputs;
        assert!(rows > 0 && points.len() == rows * shape.inputs, "points come in whole rows, at least one");
        assert_eq!(shared.len(), shape.embedded, "shared condition");
        assert_eq!(row_condition.len(), rows * shape.row_condition, "row condition");
        trace.rows = rows;
        trace.directions = directions;
        let stacked = rows * (1 + directions);
        resize(&mut trace.points, points.len());
        trace.points.copy_from_slice(points);
        trace.inputs.resize_with(shape.depth + 1, Vec::new);
        trace.slopes.resize_with(shape.depth, Vec::new);
        for (index, layer) in self.layers.iter().enumerate() {
            // Room for v_l below a_l, whether or not a loss on the input gradient follows.
            resize(&mut trace.inputs[index], stacked.max(2 * rows) * layer.inputs);
        }
        self.fill_first_inputs(trace, shared, row_condition);

        for (index, layer) in self.layers.iter().enumerate() {
            let (before, after) = trace.inputs.split_at_mut(index + 1);
            let input = Matrix::new(&before[index], stacked, layer.inputs, layer.inputs);
            let weight = self.transposed_weight(layer, layer.inputs);
            let bias = &self.folded[layer.folded_bias.clone()];
            if index == shape.depth {
                resize(&mut trace.output, stacked * layer.outputs);
                product(
                    MatrixMut::new(&mut trace.output, stacked, layer.outputs, layer.outputs),
                    Write::Replace,
                    input,
                    weight,
                );
                for row in trace.output[..rows * layer.outputs].chunks_exact_mut(layer.outputs) {
                    row.iter_mut().zip(bias).for_each(|(value, bias)| *value += *bias);
                }
                break;
            }
            let stride = self.layers[index + 1].inputs;
            let next = &mut after[0];
            product(MatrixMut::new(next, stacked, layer.outputs, stride), Write::Replace, input, weight);
            let slopes = &mut trace.slopes[index];
            let (values, tangents) = next.split_at_mut(rows * stride);
            match kept {
                Kept::Nothing => {
                    // A sweep that needs them fails instead of taking those of other points.
                    slopes.clear();
                    softplus_value_rows(values, stride, bias);
                }
                Kept::Slopes { .. } => {
                    resize(slopes, rows * layer.outputs);
                    softplus_rows(values, stride, bias, slopes);
                }
            }
            for tangent in tangents.chunks_exact_mut(rows * stride).take(directions) {
                scale_rows(tangent, stride, slopes, layer.outputs);
            }
            if shape.skip == Some(index + 1) {
                self.join_encoded(&before[0], next, index + 1, 0..stacked);
            }
        }
    }

    fn fill_first_inputs(&self, trace: &mut Trace<T>, shared: &[T], row_condition: &[T]) {
        let (encoded, stride) = (self.encoding.width(), self.layers[0].inputs);
        let rows = trace.rows;
        let (values, tangents) = trace.inputs[0].split_at_mut(rows * stride);
        self.encoding.encode(self.table(), &trace.points, &mut trace.cells, values, stride);
        for (row, input) in values.chunks_exact_mut(stride).enumerate() {
            let (embedded, own) = input[encoded..].split_at_mut(self.shape.embedded);
            embedded.copy_from_slice(shared);
            own.copy_from_slice(&row_condition[row * own.len()..(row + 1) * own.len()]);
        }
        for (axis, tangents) in tangents.chunks_exact_mut(rows * stride).take(trace.directions).enumerate() {
            let directions = Directions::Axis(axis);
            self.encoding.push_forward(self.table(), &trace.points, &trace.cells, directions, tangents, stride);
            tangents.chunks_exact_mut(stride).for_each(|row| row[encoded..].fill(T::zero()));
        }
    }

    /// Copies the encoded point of `rows` of the first layer's input beside the hidden units of layer `index`'s.
    fn join_encoded(&self, first: &[T], input: &mut [T], index: usize, rows: Range<usize>) {
        let (encoded, first_stride) = (self.encoding.width(), self.layers[0].inputs);
        let (hidden, stride) = (self.hidden_inputs(index), self.layers[index].inputs);
        for row in rows {
            input[row * stride + hidden..(row + 1) * stride]
                .copy_from_slice(&first[row * first_stride..row * first_stride + encoded]);
        }
    }

    /// Down sweep: the gradient of seed . z_L with respect to each point, for `seed` (R, outputs). See [`Trace::gradient`].
    ///
    /// Follows [`Mlp::forward`] on the same trace.
    pub fn input_gradient(&self, trace: &mut Trace<T>, seed: &[T]) {
        let rows = trace.rows;
        assert_eq!(trace.directions, 0, "the input gradient follows a forward sweep without tangents");
        assert_eq!(seed.len(), rows * self.shape.outputs, "seed");
        let encoded = self.encoding.width();
        trace.cotangents.resize_with(self.layers.len(), Vec::new);
        for (cotangents, layer) in trace.cotangents.iter_mut().zip(&self.layers) {
            resize(cotangents, 2 * rows * layer.outputs);
        }
        resize(&mut trace.encoded_gradient, rows * encoded);
        trace.encoded_gradient.fill(T::zero());
        trace.cotangents[self.shape.depth][rows * self.shape.outputs..].copy_from_slice(seed);
        for index in (0..self.layers.len()).rev() {
            let layer = &self.layers[index];
            let (before, after) = trace.cotangents.split_at_mut(index);
            let cotangent = Matrix::new(&after[0][rows * layer.outputs..], rows, layer.outputs, layer.outputs);
            let hidden = if index == 0 { 0 } else { self.hidden_inputs(index) };
            if index > 0 {
                let previous = &mut before[index - 1][rows * hidden..];
                let weight = self.weight_columns(layer, 0..hidden);
                product(MatrixMut::new(previous, rows, hidden, hidden), Write::Replace, cotangent, weight);
                scale_rows(previous, hidden, &trace.slopes[index - 1], hidden);
            }
            if index == 0 || self.shape.skip == Some(index) {
                let weight = self.weight_columns(layer, hidden..hidden + encoded);
                product(
                    MatrixMut::new(&mut trace.encoded_gradient, rows, encoded, encoded),
                    Write::Add,
                    cotangent,
                    weight,
                );
            }
        }
        resize(&mut trace.gradient, rows * self.shape.inputs);
        trace.gradient.fill(T::zero());
        let Trace { points, cells, encoded_gradient, gradient, .. } = trace;
        self.encoding.pull_back(self.table(), points, cells, encoded_gradient, encoded, gradient);
    }

    /// Backward sweep: adds the parameters' gradient for the cotangent of the output, stacked as the output is, and
    /// optionally of the input gradient (R, D), which needs [`Mlp::input_gradient`] to have run.
    ///
    /// Returns the cotangent of the shared condition (embedded), summed over the rows.
    pub fn backward(
        &self,
        trace: &mut Trace<T>,
        output_cotangent: &[T],
        gradient_cotangent: Option<&[T]>,
        wanted: Backward,
        gradient: &mut MlpGradient<T>,
    ) -> Vec<T> {
        let rows = trace.rows;
        let stacked = rows * (1 + trace.directions);
        assert_eq!(output_cotangent.len(), stacked * self.shape.outputs, "output cotangent");
        trace.cotangents.resize_with(self.layers.len(), Vec::new);
        for (cotangents, layer) in trace.cotangents.iter_mut().zip(&self.layers) {
            resize(cotangents, stacked.max(2 * rows) * layer.outputs);
        }
        trace.cotangents[self.shape.depth][..output_cotangent.len()].copy_from_slice(output_cotangent);
        if let Some(cotangent) = gradient_cotangent {
            self.sweep_up(trace, cotangent);
        }
        // Rows of (cotangent, input) pairs that add to dW: with v and u below a and z_bar, or the tangents.
        let paired = if gradient_cotangent.is_some() { 2 * rows } else { stacked };
        let encoded = self.encoding.width();
        let first_width = encoded + self.shape.embedded;
        let encoded_wanted = wanted == Backward::ParametersAndPoints || !self.table.is_empty();
        let first_wanted = if encoded_wanted { 0..first_width } else { encoded..first_width };
        resize(&mut trace.input_cotangent, stacked * first_width);
        trace.input_cotangent.fill(T::zero());

        for index in (0..self.layers.len()).rev() {
            let layer = &self.layers[index];
            let (before, after) = trace.cotangents.split_at_mut(index);
            let current = &after[0];
            product(
                MatrixMut::new(
                    &mut gradient.folded[layer.folded_weight.clone()],
                    layer.outputs,
                    layer.inputs,
                    layer.inputs,
                ),
                Write::Add,
                Matrix::new(current, paired, layer.outputs, layer.outputs).transposed(),
                Matrix::new(&trace.inputs[index], paired, layer.inputs, layer.inputs),
            );
            add_column_sums(&mut gradient.folded[layer.folded_bias.clone()], &current[..rows * layer.outputs]);
            let cotangent = Matrix::new(current, stacked, layer.outputs, layer.outputs);
            if index == 0 {
                if !first_wanted.is_empty() {
                    let target = &mut trace.input_cotangent[first_wanted.start..];
                    let weight = self.weight_columns(layer, first_wanted.clone());
                    product(
                        MatrixMut::new(target, stacked, first_wanted.len(), first_width),
                        Write::Add,
                        cotangent,
                        weight,
                    );
                }
                break;
            }
            let hidden = self.hidden_inputs(index);
            resize(&mut trace.carried, stacked * hidden);
            let weight = self.weight_columns(layer, 0..hidden);
            product(MatrixMut::new(&mut trace.carried, stacked, hidden, hidden), Write::Replace, cotangent, weight);
            if self.shape.skip == Some(index) && encoded_wanted {
                let weight = self.weight_columns(layer, hidden..hidden + encoded);
                let target = MatrixMut::new(&mut trace.input_cotangent, stacked, encoded, first_width);
                product(target, Write::Add, cotangent, weight);
            }
            let block = rows * hidden;
            let slopes = &trace.slopes[index - 1];
            let previous = &mut before[index - 1];
            // After the up sweep `previous` holds what that left on z.
            let pull_back = if gradient_cotangent.is_some() { add_scaled } else { write_scaled };
            for (result, carried) in
                previous[..stacked * hidden].chunks_exact_mut(block).zip(trace.carried.chunks_exact(block))
            {
                pull_back(result, slopes, carried);
            }
            for direction in 1..=trace.directions {
                let tangents = &trace.inputs[index][direction * rows * layer.inputs..];
                let carried = &trace.carried[direction * block..(direction + 1) * block];
                add_curvature(&mut previous[..block], slopes, tangents, layer.inputs, carried, hidden);
            }
        }
        if wanted == Backward::ParametersAndPoints {
            self.finish_point_cotangent(trace, gradient_cotangent);
        }
        self.add_table_gradient(trace, gradient_cotangent, &mut gradient.table);
        let mut condition = vec![T::zero(); self.shape.embedded];
        for row in trace.input_cotangent[..rows * first_width].chunks_exact(first_width) {
            for (sum, value) in condition.iter_mut().zip(&row[encoded..]) {
                *sum += *value;
            }
        }
        condition
    }

    /// Up sweep: v_l into rows R.. of the inputs, and what it leaves on z into rows ..R of the cotangents.
    fn sweep_up(&self, trace: &mut Trace<T>, gradient_cotangent: &[T]) {
        let rows = trace.rows;
        assert_eq!(trace.directions, 0, "a loss on the input gradient needs a forward sweep without tangents");
        assert_eq!(gradient_cotangent.len(), rows * self.shape.inputs, "gradient cotangent");
        let (encoded, stride) = (self.encoding.width(), self.layers[0].inputs);
        let tangents = &mut trace.inputs[0][rows * stride..2 * rows * stride];
        let directions = Directions::Rows(gradient_cotangent);
        self.encoding.push_forward(self.table(), &trace.points, &trace.cells, directions, tangents, stride);
        tangents.chunks_exact_mut(stride).for_each(|row| row[encoded..].fill(T::zero()));
        for index in 0..self.shape.depth {
            let layer = &self.layers[index];
            let stride = self.layers[index + 1].inputs;
            let (before, after) = trace.inputs.split_at_mut(index + 1);
            let carried = if index == 0 { encoded } else { layer.inputs };
            product(
                MatrixMut::new(&mut after[0][rows * stride..], rows, layer.outputs, stride),
                Write::Replace,
                Matrix::new(&before[index][rows * layer.inputs..], rows, carried, layer.inputs),
                self.transposed_weight(layer, carried),
            );
            let (curvature, cotangents) = trace.cotangents[index].split_at_mut(rows * layer.outputs);
            let tangents = &mut after[0][rows * stride..2 * rows * stride];
            curvature_rows(tangents, stride, &trace.slopes[index], cotangents, curvature, layer.outputs);
            if self.shape.skip == Some(index + 1) {
                self.join_encoded(&before[0], &mut after[0], index + 1, rows..2 * rows);
            }
        }
    }

    fn finish_point_cotangent(&self, trace: &mut Trace<T>, gradient_cotangent: Option<&[T]>) {
        let (encoding, table, encoded) = (&self.encoding, self.table(), self.encoding.width());
        let width = encoded + self.shape.embedded;
        let Trace { points, cells, input_cotangent, encoded_gradient, point_cotangent: result, .. } = trace;
        resize(result, points.len());
        result.fill(T::zero());
        encoding.pull_back(table, points, cells, input_cotangent, width, result);
        if let Some(cotangent) = gradient_cotangent {
            let directions = Directions::Rows(cotangent);
            encoding.pull_back_second(table, points, cells, directions, encoded_gradient, encoded, result);
        }
        for axis in 0..trace.directions {
            let along = &input_cotangent[(1 + axis) * trace.rows * width..];
            encoding.pull_back_second(table, points, cells, Directions::Axis(axis), along, width, result);
        }
    }

    /// The encoding's own parameters: what reaches e(x), and e'(x) v where the loss sees derivatives.
    fn add_table_gradient(&self, trace: &Trace<T>, gradient_cotangent: Option<&[T]>, gradient: &mut [T]) {
        let (encoding, encoded) = (&self.encoding, self.encoding.width());
        let width = encoded + self.shape.embedded;
        let Trace { cells, input_cotangent, encoded_gradient, .. } = trace;
        encoding.pull_back_table(cells, input_cotangent, width, gradient);
        if let Some(cotangent) = gradient_cotangent {
            encoding.pull_back_table_along(cells, Directions::Rows(cotangent), encoded_gradient, encoded, gradient);
        }
        for axis in 0..trace.directions {
            let along = &input_cotangent[(1 + axis) * trace.rows * width..];
            encoding.pull_back_table_along(cells, Directions::Axis(axis), along, width, gradient);
        }
    }
}

/// Grows or shrinks without clearing: every entry that is read has been written since.
fn resize<T: Real>(values: &mut Vec<T>, length: usize) {
    values.resize(length, T::zero());
}
