//! What the machine builds: nodes in one flat list, referring to each other by index.
//!
//! A pickle may make a list contain itself. Indices make that harmless: nodes are mutated in place, shared without
//! copies and dropped without recursion. Only [`super::value`] follows the references, to a bounded depth.

use std::borrow::Cow;
use std::sync::Arc;

use super::tensors::Storage;
use crate::Array;
use crate::element::ElementType;

/// The index of a node.
pub(super) type NodeId = u32;

/// A Python object in the making; text and bytes borrow from the file.
pub(super) enum Node<'a> {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(Cow<'a, str>),
    Bytes(Cow<'a, [u8]>),
    List(Vec<NodeId>),
    Tuple(Vec<NodeId>),
    Dict(Vec<(NodeId, NodeId)>),
    /// A function or class by its dotted name, not called yet.
    Global(Box<str>),
    ElementType(ElementType),
    /// An array made by `_reconstruct`, waiting for its state.
    EmptyArray,
    Array(Arc<Array>),
    /// An instance of a class that [`super::object`] knows, with its state once set.
    Object(Box<Object>),
    /// The numbers of tensors.
    Storage(Storage<'a>),
    /// What stands in the place of an object that is passed over.
    PassedOver,
}

/// An instance of an allow-listed Python class.
pub(super) struct Object {
    pub(super) class: Box<str>,
    pub(super) state: Option<NodeId>,
}

impl Node<'_> {
    /// What the node is, for messages.
    pub(super) fn kind(&self) -> &'static str {
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
            Self::Global(_) => "a function or class",
            Self::ElementType(_) => "a numpy element type",
            Self::EmptyArray | Self::Array(_) => "an array",
            Self::Object(_) | Self::PassedOver => "an object",
            Self::Storage(_) => "a storage",
        }
    }

    /// The raw bytes of a byte string, or of a Python 2 string that happened to be valid text.
    pub(super) fn bytes(&self) -> Option<&[u8]> {
        match self {
            Self::Bytes(bytes) => Some(bytes),
            Self::Text(text) => Some(text.as_bytes()),
            _ => None,
        }
    }
}
