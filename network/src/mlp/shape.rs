//! The extents of a network, and which of them make sense.

use serde::{Deserialize, Serialize};

use crate::encoding::{EncodingShape, MOST_COORDINATES};
use crate::{Error, Result};

/// The extents of an [`Mlp`](super::Mlp).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MlpShape {
    /// D: coordinates of a point (3, or 6 with a normal).
    pub inputs: usize,
    /// How a point is encoded.
    pub encoding: EncodingShape,
    /// Length of the pose-and-expression condition that `embedded` linear outputs are made of; 0 for none.
    pub condition: usize,
    /// Entries of the embedded condition, the first of C.
    pub embedded: usize,
    /// Further condition entries, given for each row; the last of C. No gradient is returned for them.
    pub row_condition: usize,
    /// Hidden layers.
    pub depth: usize,
    /// Units of each hidden layer.
    pub width: usize,
    /// The layer whose input the encoded point is joined to.
    pub skip: Option<usize>,
    /// Entries of the output.
    pub outputs: usize,
}

impl MlpShape {
    /// Checks all but the encoding's own extents; `encoded` is its width.
    pub(super) fn validate(&self, encoded: usize) -> Result<()> {
        let refuse =
            |name, found: usize, expected: String| Err(Error::Shape { name, found: found.to_string(), expected });
        if !(1..=MOST_COORDINATES).contains(&self.inputs) {
            return refuse("inputs", self.inputs, format!("1 to {MOST_COORDINATES}"));
        }
        if !(1..=64).contains(&self.depth) {
            return refuse("depth", self.depth, "1 to 64".into());
        }
        if !(1..=1 << 14).contains(&self.width) {
            return refuse("width", self.width, "1 to 16384".into());
        }
        if !(1..=1 << 14).contains(&self.outputs) {
            return refuse("outputs", self.outputs, "1 to 16384".into());
        }
        if let Some(skip) = self.skip {
            if skip < 1 || skip >= self.depth {
                return refuse("skip", skip, format!("a hidden layer after the first, 1 to {}", self.depth - 1));
            }
            if self.width <= encoded {
                return refuse(
                    "width",
                    self.width,
                    format!("more than the {encoded} entries that skip to layer {skip}"),
                );
            }
        }
        Ok(())
    }
}
