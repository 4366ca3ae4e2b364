//! Plain Python data, as a tree.

use std::sync::Arc;

use super::machine::Machine;
use super::node::{Node, NodeId};
use super::object::resolve;
use crate::Array;
use crate::fault::{Fault, excerpt};

/// Deeper nesting than any data file has; also what a container that contains itself runs into.
pub(super) const MAX_DEPTH: usize = 64;

/// A Python value without behaviour.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `None`.
    None,
    /// `True` or `False`.
    Bool(bool),
    /// An integer of at most 64 bits.
    Int(i64),
    /// A float.
    Float(f64),
    /// Text; a Python 2 string that is valid UTF-8 too.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
    /// A list; an array of objects or of several strings too, flattened.
    List(Vec<Value>),
    /// A tuple.
    Tuple(Vec<Value>),
    /// A dict, in insertion order; a later entry of the same key wins.
    Dict(Vec<(Value, Value)>),
    /// A numpy array or scalar, a densified sparse matrix, or the array inside a chumpy object.
    Array(Arc<Array>),
}

impl Value {
    /// The entry of a dict under a text key.
    pub fn get(&self, key: &str) -> Option<&Self> {
        let Self::Dict(entries) = self else { return None };
        let entry = entries.iter().rev().find(|(name, _)| matches!(name, Self::Text(name) if name == key));
        entry.map(|(_, value)| value)
    }

    /// What the value is, for messages: `a dict`, `an array`.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::None => "None",
            Self::Bool(_) => "a boolean",
            Self::Int(_) => "an integer",
            Self::Float(_) => "a float",
            Self::Text(_) => "text",
            Self::Bytes(_) => "bytes",
            Self::List(_) => "a list",
            Self::Tuple(_) => "a tuple",
            Self::Dict(_) => "a dict",
            Self::Array(_) => "an array",
        }
    }
}

/// A list may hold another many times: these, not the nodes, are what grows.
const VALUES: &str = "values that refer to each other";

impl Machine<'_> {
    /// The tree under `root`.
    pub(super) fn into_value(mut self, root: NodeId) -> Result<Value, Fault> {
        let nodes = std::mem::take(&mut self.nodes);
        self.value(&nodes, root, MAX_DEPTH)
    }

    fn value(&mut self, nodes: &[Node], id: NodeId, depth: usize) -> Result<Value, Fault> {
        let depth = depth
            .checked_sub(1)
            .ok_or_else(|| Fault::refused(format_args!("data nested more than {MAX_DEPTH} deep, or inside itself")))?;
        Ok(match &nodes[id as usize] {
            Node::None => Value::None,
            &Node::Bool(value) => Value::Bool(value),
            &Node::Int(value) => Value::Int(value),
            &Node::Float(value) => Value::Float(value),
            Node::Text(text) => {
                self.budget.spend(text.len(), "text")?;
                Value::Text(text.clone().into_owned())
            }
            Node::Bytes(bytes) => {
                self.budget.spend(bytes.len(), "bytes")?;
                Value::Bytes(bytes.clone().into_owned())
            }
            Node::List(items) => Value::List(self.values(nodes, items, depth)?),
            Node::Tuple(items) => Value::Tuple(self.values(nodes, items, depth)?),
            Node::Dict(entries) => {
                let budget = self.budget;
                let entry = |&(key, value): &_| Ok((self.value(nodes, key, depth)?, self.value(nodes, value, depth)?));
                Value::Dict(budget.collect(entries.len(), VALUES, entries.iter().map(entry))?)
            }
            Node::Array(array) => Value::Array(Arc::clone(array)),
            Node::Object(object) => {
                let state = object.state.map_or(Ok(Value::None), |state| self.value(nodes, state, depth))?;
                resolve(&object.class, state, self.budget)?
            }
            Node::PassedOver | Node::Storage(_) => Value::None,
            Node::Global(name) if self.passes_over(name) => Value::None,
            Node::Global(name) => {
                return Err(Fault::refused(format_args!("a reference to `{}`", excerpt(name).trim_matches('"'))));
            }
            // Nothing that is read as data keeps a bare element type.
            Node::ElementType(_) => Value::None,
            Node::EmptyArray => {
                return Err(Fault::malformed("array", "no state", "an array's shape and data"));
            }
        })
    }

    fn values(&mut self, nodes: &[Node], items: &[NodeId], depth: usize) -> Result<Vec<Value>, Fault> {
        let budget = self.budget;
        budget.collect(items.len(), VALUES, items.iter().map(|&item| self.value(nodes, item, depth)))
    }
}
