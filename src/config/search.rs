//! Where the correspondence search starts, on which field it runs, and which root a training point takes.

use serde::{Deserialize, Serialize};

use super::{positive, within};
use crate::Result;

/// Which bones start the search for a point's correspondences (thesis table 5.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Starts {
    /// Those of the point's part.
    Part,
    /// The body's bones for every point (ablation A1).
    Body,
    /// All bones for every point (ablation A2).
    All,
}

/// The skinning field that the search evaluates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
pub enum SearchedField {
    /// The network itself (thesis).
    Exact,
    /// Its weights on a grid over the canonical box; each root is then polished on the network.
    Baked {
        /// Nodes of the grid along x, y and z.
        nodes: [usize; 3],
        /// Training steps after which the network is sampled anew.
        refresh_steps: u64,
    },
}

/// Which of a training point's candidates is its correspondence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Assignment {
    /// The one that the geometry field itself prefers (thesis).
    Field,
    /// The one deepest in the canonical body, or nearest to what is worn: a hand beside a thigh cannot grow a second hand onto the thigh. Of a
    /// point drawn on the registered body, the one at its own place.
    Body,
}

impl SearchedField {
    pub(super) fn check(&self) -> Result<()> {
        let Self::Baked { nodes, refresh_steps } = *self else { return Ok(()) };
        positive("searched_field.refresh_steps", refresh_steps as f64)?;
        nodes.into_iter().try_for_each(|count| within("searched_field.nodes", count as f64, 512.0))
    }
}
