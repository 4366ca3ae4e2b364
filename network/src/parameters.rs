//! Where each named parameter of a network stands in its flat vector.
//!
//! Names are those of the released checkpoints (METHOD section 9): `lin{l}.weight_v` (out, in), `lin{l}.weight_g` (out, 1),
//! `lin{l}.bias` (out), `lin_p0.weight` and `lin_p0.bias` for the condition's embedding.

use std::collections::HashMap;
use std::ops::Range;

use crate::{Error, Real, Result};

/// One named parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParameterEntry {
    /// Its name.
    pub name: String,
    /// Its extents, outermost first.
    pub shape: Vec<usize>,
    /// Its entries in the flat vector, row-major.
    pub range: Range<usize>,
}

/// The named parameters of a network, in the order in which its flat vector holds them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ParameterLayout {
    entries: Vec<ParameterEntry>,
}

impl ParameterLayout {
    /// Appends a parameter and returns its place.
    pub(crate) fn push(&mut self, name: String, shape: Vec<usize>) -> Range<usize> {
        let start = self.len();
        let range = start..start + shape.iter().product::<usize>();
        self.entries.push(ParameterEntry { name, shape, range: range.clone() });
        range
    }

    /// The parameters, in order.
    pub fn entries(&self) -> &[ParameterEntry] {
        &self.entries
    }

    /// Length of the flat vector.
    pub fn len(&self) -> usize {
        self.entries.last().map_or(0, |entry| entry.range.end)
    }

    /// Whether there is no parameter at all.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Gathers a flat vector from named arrays of (shape, entries).
    ///
    /// # Errors
    /// [`Error::Parameter`] names the parameter that is absent, misshapen or not finite.
    pub fn gather<T: Real>(&self, named: &HashMap<String, (Vec<usize>, Vec<T>)>) -> Result<Vec<T>> {
        let mut flat = Vec::with_capacity(self.len());
        for ParameterEntry { name, shape, range } in &self.entries {
            let refuse = |found: String| Error::Parameter { name: name.clone(), found, expected: format!("{shape:?}") };
            let (found_shape, values) = named.get(name).ok_or_else(|| refuse("absent".into()))?;
            if values.len() != range.len() || found_shape != shape {
                return Err(refuse(format!("{found_shape:?} with {} entries", values.len())));
            }
            if values.iter().any(|value| !value.is_finite()) {
                return Err(refuse("not finite".into()));
            }
            flat.extend_from_slice(values);
        }
        Ok(flat)
    }
}
