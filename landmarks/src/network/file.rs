//! A `.tflite` file as tensors and the operators between them, in the order in which they run (TensorFlow Lite's schema, version 3).

use half::f16;
use xavatar_formats::Fault;

use super::flatbuffer::Table;

/// Axes of a tensor, and tensors of an operator: more than any that is run here has.
const MOST: usize = 8;

/// What a tensor's items are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    F32,
    F16,
    I32,
    Other(u8),
}

/// A tensor; its bytes are empty if it is computed.
pub(super) struct Tensor<'a> {
    pub shape: Vec<usize>,
    pub kind: Kind,
    pub bytes: &'a [u8],
}

/// An operator: its number in the schema, the tensors it takes (none: left out) and makes, and its options.
pub(super) struct Node<'a> {
    pub code: i32,
    pub inputs: Vec<Option<usize>>,
    pub output: usize,
    pub options: Option<Table<'a>>,
}

/// What a file holds.
pub(super) struct Graph<'a> {
    pub tensors: Vec<Tensor<'a>>,
    pub nodes: Vec<Node<'a>>,
    pub inputs: Vec<usize>,
    pub outputs: Vec<usize>,
}

impl<'a> Graph<'a> {
    /// Reads the first graph of a file.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, Fault> {
        if bytes.get(4..8) != Some(b"TFL3") {
            return Err(Fault::malformed("byte 4", "no mark of the format", "TFL3"));
        }
        let model = Table::root(bytes)?;
        let codes = model.tables(1)?.iter().map(code_of).collect::<Result<Vec<i32>, Fault>>()?;
        let buffers = model.tables(4)?;
        let graphs = model.tables(2)?;
        let graph = graphs.first().ok_or_else(|| Fault::malformed("graphs", "none", "one"))?;
        let tensors = graph.tables(0)?;
        let tensors = tensors.iter().map(|tensor| tensor_of(tensor, &buffers)).collect::<Result<Vec<_>, Fault>>()?;
        let nodes = graph.tables(3)?;
        let nodes: Vec<Node> =
            nodes.iter().map(|node| node_of(node, &codes, tensors.len())).collect::<Result<_, Fault>>()?;
        let places = |field: usize| -> Result<Vec<usize>, Fault> {
            graph
                .numbers(field, tensors.len())?
                .into_iter()
                .map(|index| place(index, tensors.len(), "tensors"))
                .collect()
        };
        Ok(Self { inputs: places(1)?, outputs: places(2)?, nodes, tensors })
    }
}

/// Newer files say the number in a field of its own; older ones in a byte.
fn code_of(code: &Table) -> Result<i32, Fault> {
    Ok(code.number(3, 0)?.max(i32::from(code.byte(0)?)))
}

fn tensor_of<'a>(tensor: &Table<'a>, buffers: &[Table<'a>]) -> Result<Tensor<'a>, Fault> {
    let extent =
        |extent: i32| usize::try_from(extent).map_err(|_| Fault::malformed("a tensor's shape", extent, "0 or more"));
    let shape = tensor.numbers(0, MOST)?.into_iter().map(extent).collect::<Result<_, Fault>>()?;
    let kind = match tensor.byte(1)? {
        0 => Kind::F32,
        1 => Kind::F16,
        2 => Kind::I32,
        other => Kind::Other(other),
    };
    let buffer = place(tensor.number(2, 0)?, buffers.len(), "buffers")?;
    Ok(Tensor { shape, kind, bytes: buffers[buffer].bytes(0)? })
}

fn node_of<'a>(node: &Table<'a>, codes: &[i32], tensors: usize) -> Result<Node<'a>, Fault> {
    let input = |index: i32| if index == -1 { Ok(None) } else { place(index, tensors, "tensors").map(Some) };
    let outputs = node.numbers(2, MOST)?;
    let [output] = outputs.as_slice() else {
        return Err(Fault::malformed("an operator", format_args!("{} outputs", outputs.len()), "one"));
    };
    Ok(Node {
        code: codes[place(node.number(0, 0)?, codes.len(), "operators' codes")?],
        inputs: node.numbers(1, MOST)?.into_iter().map(input).collect::<Result<_, Fault>>()?,
        output: place(*output, tensors, "tensors")?,
        options: node.table(4)?,
    })
}

fn place(index: i32, count: usize, what: &str) -> Result<usize, Fault> {
    let place = usize::try_from(index).ok().filter(|place| *place < count);
    place.ok_or_else(|| Fault::malformed(what, format_args!("number {index}"), format_args!("less than {count}")))
}

impl Tensor<'_> {
    /// The numbers of a constant, if it is one and as many as its shape says.
    pub fn floats(&self) -> Option<Vec<f32>> {
        let count = self.shape.iter().try_fold(1, |product: usize, extent| product.checked_mul(*extent))?;
        let values: Vec<f32> = match self.kind {
            Kind::F32 => self.bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
            Kind::F16 => self.bytes.as_chunks().0.iter().map(|bytes| f16::from_le_bytes(*bytes).to_f32()).collect(),
            Kind::I32 | Kind::Other(_) => return None,
        };
        (!self.bytes.is_empty() && values.len() == count).then_some(values)
    }

    /// The whole numbers of a constant, if it is one.
    pub fn integers(&self) -> Option<Vec<i32>> {
        let values = self.bytes.as_chunks().0.iter().map(|bytes| i32::from_le_bytes(*bytes));
        (self.kind == Kind::I32 && !self.bytes.is_empty()).then(|| values.collect())
    }
}
