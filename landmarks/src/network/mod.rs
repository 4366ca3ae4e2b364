//! Networks of `.tflite` files, on the processor: the operators that landmark networks are made of, over this workspace's products.
//!
//! [`Network::parse`] checks a file once (every index, every shape) and lays out what has to run for the outputs that are wanted;
//! [`Network::run`] then cannot fail. Weights may be half precision, sums are single. Pictures go through one at a time: callers are
//! parallel over pictures, so that results do not depend on threads.

mod activation;
mod convolution;
mod file;
mod flatbuffer;
mod pictures;
mod plan;
mod shape;
#[cfg(test)]
mod tests;

use xavatar_formats::Fault;

use self::file::Graph;
use self::plan::{Step, steps};
use self::shape::Shape;

/// A network made ready.
pub struct Network {
    steps: Vec<Step>,
    /// By tensor; none of those that nothing wanted needs.
    shapes: Vec<Option<Shape>>,
    input: usize,
    outputs: Vec<usize>,
}

/// Room that runs of a network reuse, one for each thread.
#[derive(Default)]
pub struct Workspace {
    free: Vec<Vec<f32>>,
    gathered: Vec<f32>,
}

impl Network {
    /// Reads a file; `wanted` are the places of outputs among the file's, in the order in which runs return them.
    ///
    /// # Errors
    /// [`Fault::Malformed`] for what is damaged, has another number of inputs than one, or operators that are not run here.
    pub fn parse(bytes: &[u8], wanted: &[usize]) -> Result<Self, Fault> {
        let graph = Graph::parse(bytes)?;
        let [input] = graph.inputs[..] else {
            return Err(Fault::malformed("the network", format_args!("{} inputs", graph.inputs.len()), "one"));
        };
        let output = |place: &usize| {
            let found = graph.outputs.len();
            graph.outputs.get(*place).copied().ok_or_else(|| {
                Fault::malformed("the network", format_args!("{found} outputs"), format_args!("more than {place}"))
            })
        };
        let outputs = wanted.iter().map(output).collect::<Result<Vec<_>, _>>()?;
        let (steps, shapes) = steps(&graph, input, &outputs, bytes.len())?;
        Ok(Self { steps, shapes, input, outputs })
    }

    /// Rows, columns and channels of the picture that goes in.
    pub fn input_shape(&self) -> [usize; 3] {
        self.shape(self.input)
    }

    /// Rows, columns and channels of each output that is wanted.
    pub fn output_shapes(&self) -> Vec<[usize; 3]> {
        self.outputs.iter().map(|output| self.shape(*output)).collect()
    }

    fn shape(&self, tensor: usize) -> [usize; 3] {
        self.shapes[tensor].map_or([0; 3], |shape| [shape.rows, shape.columns, shape.channels])
    }

    /// What comes out of a picture (rows x columns x channels, row by row).
    ///
    /// # Panics
    /// If the picture is of another size than [`input_shape`](Self::input_shape).
    pub fn run(&self, picture: &[f32], workspace: &mut Workspace) -> Vec<Vec<f32>> {
        assert_eq!(picture.len(), self.input_shape().iter().product::<usize>(), "a picture of the network's size");
        let mut values: Vec<Option<Vec<f32>>> = vec![None; self.shapes.len()];
        let mut first = workspace.room(picture.len());
        first.copy_from_slice(picture);
        values[self.input] = Some(first);
        for step in &self.steps {
            let Some(shape) = self.shapes[step.output] else { continue };
            let mut output = workspace.room(shape.len());
            step.run(&values, &self.shapes, &mut output, shape, &mut workspace.gathered);
            values[step.output] = Some(output);
            for tensor in &step.last_use_of {
                workspace.free.extend(values[*tensor].take());
            }
        }
        let outputs = self.outputs.iter().map(|output| values[*output].clone().unwrap_or_default()).collect();
        workspace.free.extend(values.into_iter().flatten());
        outputs
    }
}

impl Workspace {
    /// A vector of this length, whatever is in it: the smallest free one that is large enough, or the largest grown.
    fn room(&mut self, length: usize) -> Vec<f32> {
        let fits = |room: &Vec<f32>| (room.capacity() < length, room.capacity());
        let best = (0..self.free.len()).min_by_key(|index| fits(&self.free[*index]));
        let mut room = best.map_or_else(Vec::new, |index| self.free.swap_remove(index));
        room.resize(length, 0.0);
        room
    }
}
