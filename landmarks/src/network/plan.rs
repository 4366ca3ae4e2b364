//! What of a graph has to run for the outputs that are wanted, with every shape worked out and every constant read beforehand.

use xavatar_formats::Fault;

use super::activation::Activation;
use super::convolution::{Convolution, Depthwise, Kernel};
use super::file::{Graph, Node};
use super::flatbuffer::Table;
use super::pictures::{Corners, MaxPool, Padding, Resize, logistic, mean, prelu, sum};
use super::shape::{Shape, Walk};

/// Most multiplications of one run: a hundred times those of the largest network that is meant.
const MOST_WORK: usize = 1 << 37;

/// Most numbers that all steps of a run make together: 512 MiB of them.
const MOST_ROOM: usize = 1 << 27;

/// Operators by their numbers in the schema.
mod code {
    pub const ADD: i32 = 0;
    pub const CONV_2D: i32 = 3;
    pub const DEPTHWISE_CONV_2D: i32 = 4;
    pub const DEQUANTIZE: i32 = 6;
    pub const FULLY_CONNECTED: i32 = 9;
    pub const LOGISTIC: i32 = 14;
    pub const MAX_POOL_2D: i32 = 17;
    pub const RESHAPE: i32 = 22;
    pub const RESIZE_BILINEAR: i32 = 23;
    pub const PAD: i32 = 34;
    pub const MEAN: i32 = 40;
    pub const PRELU: i32 = 54;
}

/// What a step computes.
pub(super) enum Operator {
    Add(Activation),
    Convolution(Convolution),
    Depthwise(Depthwise),
    Logistic,
    MaxPool(MaxPool),
    Mean,
    Padding(Padding),
    Prelu(Vec<f32>),
    /// The same numbers in another shape.
    Reshape,
    Resize(Resize),
}

/// One operator of a run.
pub(super) struct Step {
    pub operator: Operator,
    pub inputs: Vec<usize>,
    pub output: usize,
    /// Tensors that no later step takes and that are not wanted.
    pub last_use_of: Vec<usize>,
}

/// The steps to some outputs, and the shapes of what they pass on, by tensor.
pub(super) fn steps(
    graph: &Graph,
    input: usize,
    outputs: &[usize],
    file_bytes: usize,
) -> Result<(Vec<Step>, Vec<Option<Shape>>), Fault> {
    let mut planner =
        Planner { graph, shapes: vec![None; graph.tensors.len()], constants: file_bytes, work: MOST_WORK };
    planner.shapes[input] = Some(Shape::of(&graph.tensors[input].shape)?);
    let (mut steps, mut room) = (Vec::new(), MOST_ROOM);
    for node in needed(graph, outputs) {
        if node.code == code::DEQUANTIZE {
            continue;
        }
        if planner.shapes[node.output].is_some() {
            return Err(Fault::malformed("an operator's output", "made before", "made once"));
        }
        let (operator, inputs, shape) = planner.operator(node)?;
        room = room.saturating_sub(shape.len());
        if room == 0 {
            return Err(Fault::malformed("the network", "endless room", "what a landmark network takes"));
        }
        planner.shapes[node.output] = Some(shape);
        steps.push(Step { operator, inputs, output: node.output, last_use_of: Vec::new() });
    }
    if let Some(output) = outputs.iter().find(|output| planner.shapes[**output].is_none()) {
        return Err(Fault::malformed(
            format_args!("tensor {output}"),
            "an output that nothing makes",
            "an operator for it",
        ));
    }
    let mut is_needed = vec![false; graph.tensors.len()];
    outputs.iter().for_each(|output| is_needed[*output] = true);
    for step in steps.iter_mut().rev() {
        for tensor in step.inputs.iter().copied().chain([step.output]) {
            if !std::mem::replace(&mut is_needed[tensor], true) {
                step.last_use_of.push(tensor);
            }
        }
    }
    Ok((steps, planner.shapes))
}

/// The operators that some outputs need, in the file's order.
fn needed<'a, 'b>(graph: &'b Graph<'a>, outputs: &[usize]) -> Vec<&'b Node<'a>> {
    let mut wanted = vec![false; graph.tensors.len()];
    outputs.iter().for_each(|output| wanted[*output] = true);
    let mut nodes = Vec::new();
    for node in graph.nodes.iter().rev() {
        if wanted[node.output] {
            node.inputs.iter().flatten().for_each(|input| wanted[*input] = true);
            nodes.push(node);
        }
    }
    nodes.reverse();
    nodes
}

struct Planner<'a, 'b> {
    graph: &'b Graph<'a>,
    shapes: Vec<Option<Shape>>,
    /// Bytes of constants that may still be read: tensors may share bytes in a file, and each reading takes memory.
    constants: usize,
    work: usize,
}

impl Planner<'_, '_> {
    fn operator(&mut self, node: &Node) -> Result<(Operator, Vec<usize>, Shape), Fault> {
        let input = self.computed(node, 0)?;
        let shape = self.shape(input)?;
        let options = Options(node.options);
        let one = |operator: Operator, output: Shape| Ok((operator, vec![input], output));
        match node.code {
            code::ADD => {
                let other = self.computed(node, 1)?;
                if self.shape(other)? != shape {
                    return Err(Fault::malformed("a sum", "of tensors of two shapes", "one shape"));
                }
                Ok((Operator::Add(options.activation(0)?), vec![input, other], shape))
            }
            code::CONV_2D => {
                let kernel = self.kernel(node, options.strides()?, options, 3)?;
                options.without_dilation(4)?;
                let depth = kernel.weights.len();
                let (convolution, output) = Convolution::new(kernel, shape)?;
                self.spend(output.places(), depth)?;
                one(Operator::Convolution(convolution), output)
            }
            code::DEPTHWISE_CONV_2D => {
                let kernel = self.kernel(node, options.strides()?, options, 4)?;
                options.without_dilation(5)?;
                let depth = kernel.weights.len();
                let (depthwise, output) = Depthwise::new(kernel, shape)?;
                self.spend(output.places(), depth)?;
                one(Operator::Depthwise(depthwise), output)
            }
            code::FULLY_CONNECTED => {
                let weights = self.constant(node, 1)?;
                let bias = self.optional(node, 2)?;
                let input_count = shape.len();
                let count = weights.len() / input_count;
                // A vector is a picture of one pixel.
                let whole = Shape::new(1, 1, input_count)?;
                if count == 0 || count * input_count != weights.len() {
                    let found = format_args!("{} numbers", weights.len()).to_string();
                    return Err(Fault::malformed(
                        "a layer's weights",
                        found,
                        format_args!("some for each of {input_count}"),
                    ));
                }
                let kernel = Kernel {
                    weights,
                    extents: [count, 1, 1, input_count],
                    bias,
                    strides: [1, 1],
                    padded: false,
                    activation: options.activation(0)?,
                };
                let (convolution, output) = Convolution::new(kernel, whole)?;
                one(Operator::Convolution(convolution), output)
            }
            code::LOGISTIC => one(Operator::Logistic, shape),
            code::MAX_POOL_2D => {
                let [down, across] = options.strides()?;
                let padded = options.padded()?;
                let rows = Walk::over(shape.rows, options.extent(4)?, down, padded)?;
                let columns = Walk::over(shape.columns, options.extent(3)?, across, padded)?;
                let (pool, output) = MaxPool::new(rows, columns, options.activation(5)?, shape)?;
                self.spend(output.len(), rows.extent.saturating_mul(columns.extent))?;
                one(Operator::MaxPool(pool), output)
            }
            code::MEAN => {
                let axes = self.integers(node, 1)?;
                if axes != [1, 2] {
                    return Err(Fault::malformed(
                        "a mean",
                        format_args!("over axes {axes:?}"),
                        "over rows and columns",
                    ));
                }
                one(Operator::Mean, Shape::new(1, 1, shape.channels)?)
            }
            code::PAD => {
                let (padding, output) = Padding::new(&self.integers(node, 1)?, shape)?;
                one(Operator::Padding(padding), output)
            }
            code::PRELU => {
                let slopes = self.constant(node, 1)?;
                if slopes.len() != shape.channels {
                    let expected = format_args!("{}, one a channel", shape.channels).to_string();
                    return Err(Fault::malformed("slopes", slopes.len(), expected));
                }
                one(Operator::Prelu(slopes), shape)
            }
            code::RESHAPE => {
                let output = Shape::of(&self.graph.tensors[node.output].shape)?;
                if output.len() != shape.len() {
                    return Err(Fault::malformed("a new shape", output.len(), format_args!("{} numbers", shape.len())));
                }
                one(Operator::Reshape, output)
            }
            code::RESIZE_BILINEAR => {
                let size = self.integers(node, 1)?;
                let sizes = size.iter().map(|size| usize::try_from(*size).unwrap_or(0)).collect::<Vec<_>>();
                let [rows, columns] = sizes[..] else {
                    return Err(Fault::malformed("a new size", format_args!("{size:?}"), "rows and columns"));
                };
                let corners = match (options.byte(2)? != 0, options.byte(3)? != 0) {
                    (true, _) => Corners::Middles,
                    (false, true) => Corners::OfPixels,
                    (false, false) => Corners::First,
                };
                let (resize, output) = Resize::new(corners, [rows, columns], shape)?;
                one(Operator::Resize(resize), output)
            }
            other => Err(Fault::malformed("an operator", format_args!("number {other}"), "one of landmark networks")),
        }
    }

    fn spend(&mut self, places: usize, each: usize) -> Result<(), Fault> {
        let left = places.checked_mul(each).and_then(|work| self.work.checked_sub(work));
        self.work =
            left.ok_or_else(|| Fault::malformed("the network", "endless work", "what a landmark network takes"))?;
        Ok(())
    }

    fn kernel(
        &mut self,
        node: &Node,
        strides: [usize; 2],
        options: Options,
        activation: usize,
    ) -> Result<Kernel, Fault> {
        let tensor = self.source(node.inputs.get(1).copied().flatten(), "weights")?;
        let extents = self.graph.tensors[tensor].shape.as_slice();
        let extents =
            extents.try_into().map_err(|_| Fault::malformed("weights", format_args!("{extents:?}"), "4 axes"))?;
        Ok(Kernel {
            weights: self.floats(tensor)?,
            extents,
            bias: self.optional(node, 2)?,
            strides,
            padded: options.padded()?,
            activation: options.activation(activation)?,
        })
    }

    /// The tensor of an operand that is computed before.
    fn computed(&self, node: &Node, operand: usize) -> Result<usize, Fault> {
        let tensor = node.inputs.get(operand).copied().flatten();
        tensor.ok_or_else(|| Fault::malformed("an operator", format_args!("without operand {operand}"), "one"))
    }

    fn shape(&self, tensor: usize) -> Result<Shape, Fault> {
        self.shapes[tensor]
            .ok_or_else(|| Fault::malformed(format_args!("tensor {tensor}"), "used before it is made", "made before"))
    }

    /// The constant that an operand is, seen through the operator that widens halves.
    fn source(&self, tensor: Option<usize>, what: &str) -> Result<usize, Fault> {
        let tensor =
            tensor.ok_or_else(|| Fault::malformed("an operator", format_args!("without {what}"), "a constant"))?;
        let widened = self.graph.nodes.iter().find(|node| node.output == tensor && node.code == code::DEQUANTIZE);
        Ok(widened.and_then(|node| node.inputs.first().copied().flatten()).unwrap_or(tensor))
    }

    fn constant(&mut self, node: &Node, operand: usize) -> Result<Vec<f32>, Fault> {
        let tensor = self.source(node.inputs.get(operand).copied().flatten(), "numbers")?;
        self.floats(tensor)
    }

    fn optional(&mut self, node: &Node, operand: usize) -> Result<Option<Vec<f32>>, Fault> {
        match node.inputs.get(operand).copied().flatten() {
            None => Ok(None),
            Some(_) => self.constant(node, operand).map(Some),
        }
    }

    fn floats(&mut self, tensor: usize) -> Result<Vec<f32>, Fault> {
        let found = &self.graph.tensors[tensor];
        let left = self.constants.checked_sub(found.bytes.len());
        self.constants =
            left.ok_or_else(|| Fault::malformed("constants", "more than the file has", "bytes of their own"))?;
        found.floats().ok_or_else(|| {
            Fault::malformed(
                format_args!("tensor {tensor}"),
                format_args!("{:?} of {} bytes", found.kind, found.bytes.len()),
                "its numbers",
            )
        })
    }

    fn integers(&self, node: &Node, operand: usize) -> Result<Vec<i32>, Fault> {
        let tensor = self.source(node.inputs.get(operand).copied().flatten(), "whole numbers")?;
        let found = &self.graph.tensors[tensor];
        let few = found.integers().filter(|numbers| numbers.len() <= 8);
        few.ok_or_else(|| Fault::malformed(format_args!("tensor {tensor}"), "something else", "a few whole numbers"))
    }
}

/// Options of an operator; what is not there has its default value.
#[derive(Clone, Copy)]
struct Options<'a>(Option<Table<'a>>);

impl Options<'_> {
    fn byte(&self, field: usize) -> Result<u8, Fault> {
        self.0.map_or(Ok(0), |table| table.byte(field))
    }

    fn extent(&self, field: usize) -> Result<usize, Fault> {
        let value = self.0.map_or(Ok(0), |table| table.number(field, 0))?;
        usize::try_from(value).map_err(|_| Fault::malformed("an operator's option", value, "0 or more"))
    }

    fn activation(&self, field: usize) -> Result<Activation, Fault> {
        Activation::of(self.byte(field)?)
    }

    fn padded(&self) -> Result<bool, Fault> {
        match self.byte(0)? {
            0 => Ok(true),
            1 => Ok(false),
            other => Err(Fault::malformed("an operator's padding", other, "0 or 1")),
        }
    }

    /// Down and across; files have them the other way round.
    fn strides(&self) -> Result<[usize; 2], Fault> {
        Ok([self.extent(2)?, self.extent(1)?])
    }

    fn without_dilation(&self, field: usize) -> Result<(), Fault> {
        for field in [field, field + 1] {
            let dilation = self.0.map_or(Ok(1), |table| table.number(field, 1))?;
            if dilation != 1 {
                return Err(Fault::malformed("a convolution's dilation", dilation, "1"));
            }
        }
        Ok(())
    }
}

impl Step {
    /// Computes the step's output of what is there.
    pub fn run(
        &self,
        values: &[Option<Vec<f32>>],
        shapes: &[Option<Shape>],
        output: &mut [f32],
        shape: Shape,
        gathered: &mut Vec<f32>,
    ) {
        let value = |place: usize| values[self.inputs[place]].as_deref().unwrap_or_default();
        let input = value(0);
        let Some(from) = shapes[self.inputs[0]] else { return };
        match &self.operator {
            Operator::Add(activation) => sum(input, value(1), *activation, output),
            Operator::Convolution(convolution) => convolution.run(input, from, output, gathered),
            Operator::Depthwise(depthwise) => depthwise.run(input, from, output),
            Operator::Logistic => output.iter_mut().zip(input).for_each(|(to, value)| *to = logistic(*value)),
            Operator::MaxPool(pool) => pool.run(input, from, output),
            Operator::Mean => mean(input, output),
            Operator::Padding(padding) => padding.run(input, from, output, shape),
            Operator::Prelu(slopes) => prelu(input, slopes, output),
            Operator::Reshape => output.copy_from_slice(input),
            Operator::Resize(resize) => resize.run(input, from, output),
        }
    }
}
