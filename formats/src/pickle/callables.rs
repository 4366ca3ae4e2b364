//! The allow-list: what may be called, and how an object takes its state.
//!
//! Each entry re-does in Rust what the Python function of that name would do with plain data (numpy's
//! `_reconstruct`, `_frombuffer`, `scalar` and `dtype`; `_codecs.encode`, by which protocol 2 spells bytes;
//! `OrderedDict`, `defaultdict`; `copyreg._reconstructor`; PyTorch's `_rebuild_tensor_v2` and `_load_from_bytes`, and what TorchScript
//! wraps typed lists and dicts in).

use std::borrow::Cow;
use std::sync::Arc;

use super::machine::{Machine, Outside};
use super::node::{Node, NodeId, Object};
use super::object::{is_inline_array, is_known_class, is_scripted};
use super::tensors::is_passed_over;
use crate::element::{ElementKind, ElementType, element_count};
use crate::fault::{Fault, excerpt};

impl<'a> Machine<'a> {
    /// What calling `callable`, a global, with `arguments` gives.
    pub(super) fn call(&mut self, callable: NodeId, arguments: &[NodeId]) -> Result<Node<'a>, Fault> {
        let Node::Global(name) = &self.nodes[callable as usize] else {
            return Err(self.broken(self.nodes[callable as usize].kind(), "a function or class to call"));
        };
        match (name.as_ref(), arguments) {
            // Subclasses of ndarray, such as trimesh's, hold their array the same way: the class is not looked at.
            ("numpy.core.multiarray._reconstruct" | "numpy._core.multiarray._reconstruct", _) => Ok(Node::EmptyArray),
            ("numpy.core.numeric._frombuffer" | "numpy._core.numeric._frombuffer", &[data, element, shape, order]) => {
                let fortran_order = matches!(&self.nodes[order as usize], Node::Text(order) if order == "F");
                self.array(shape, element, fortran_order, data)
            }
            ("numpy.core.multiarray.scalar" | "numpy._core.multiarray.scalar", &[element, data]) => {
                let element = self.element_type(element)?;
                self.array_of(Vec::new(), element, false, data)
            }
            ("numpy.dtype", &[notation, ..]) => match &self.nodes[notation as usize] {
                Node::Text(notation) => Ok(Node::ElementType(ElementType::parse(notation)?)),
                other => Err(self.broken(other.kind(), "an element type as text")),
            },
            ("_codecs.encode", &[text, encoding]) => self.encode(text, encoding),
            ("__builtin__.bytearray" | "builtins.bytearray", &[text, encoding]) => self.encode(text, encoding),
            ("__builtin__.bytearray" | "builtins.bytearray", &[data]) => {
                let bytes = self.bytes(data)?;
                let mut copied = self.budget.vector(bytes.len(), "bytes")?;
                copied.extend_from_slice(bytes);
                Ok(Node::Bytes(Cow::Owned(copied)))
            }
            ("__builtin__.bytes" | "builtins.bytes" | "__builtin__.bytearray" | "builtins.bytearray", &[]) => {
                Ok(Node::Bytes(Cow::Borrowed(&[])))
            }
            ("collections.OrderedDict", &[]) => Ok(Node::Dict(Vec::new())),
            // The argument makes missing entries; there are none to make.
            ("collections.defaultdict", &[] | &[_]) => Ok(Node::Dict(Vec::new())),
            ("torch._utils._rebuild_tensor_v2", &[storage, offset, size, stride, ..]) => {
                self.tensor(storage, offset, size, stride)
            }
            ("torch.storage._load_from_bytes", &[bytes]) => self.packed_storage(bytes),
            ("torch._utils._rebuild_parameter", &[tensor, ..]) => match &self.nodes[tensor as usize] {
                Node::Array(array) => Ok(Node::Array(Arc::clone(array))),
                other => Err(self.broken(other.kind(), "a tensor")),
            },
            ("collections.OrderedDict", &[pairs]) => self.dict_of_pairs(pairs),
            ("copy_reg._reconstructor" | "copyreg._reconstructor", &[class, ..]) => match &self.nodes[class as usize] {
                Node::Global(class) if is_known_class(class) => Ok(instance(class)),
                Node::Global(class) if self.passes_over(class) => Ok(Node::PassedOver),
                Node::Global(class) => Err(Fault::refused(format_args!("`{}`", excerpt_name(class)))),
                other => Err(self.broken(other.kind(), "a class")),
            },
            (
                "torch.jit._pickle.build_intlist"
                | "torch.jit._pickle.build_doublelist"
                | "torch.jit._pickle.build_boollist"
                | "torch.jit._pickle.build_tensorlist",
                &[list],
            ) => self.typed(list),
            ("torch.jit._pickle.restore_type_tag", &[container, _type]) => self.typed(container),
            (class, &[]) if is_known_class(class) || self.is_beside_tensors() && is_scripted(class) => {
                Ok(instance(class))
            }
            (class, _) if self.passes_over(class) => Ok(Node::PassedOver),
            (name, _) => Err(Fault::refused(format_args!("`{}`", excerpt_name(name)))),
        }
    }

    /// Gives the object `target` its state (Python's `__setstate__`).
    pub(super) fn set_state(&mut self, target: NodeId, state: NodeId) -> Result<(), Fault> {
        let updated = match &self.nodes[target as usize] {
            // Attributes of a dict, such as a state dict's `_metadata`, are no entries of it.
            Node::Dict(_) | Node::PassedOver => return Ok(()),
            &Node::ElementType(element) => Node::ElementType(self.element_type_with_state(element, state)?),
            Node::EmptyArray => match self.tuple_items(state)?[..] {
                [_version, shape, element, fortran_order, data] => {
                    let fortran_order = match self.nodes[fortran_order as usize] {
                        Node::Bool(value) => value,
                        Node::Int(value) => value != 0,
                        ref other => return Err(self.broken(other.kind(), "whether the array is in Fortran order")),
                    };
                    self.array(shape, element, fortran_order, data)?
                }
                ref other => return Err(self.broken(format_args!("{} items", other.len()), "an array's 5 items")),
            },
            Node::Object(object) if object.state.is_none() && is_inline_array(&object.class) => {
                self.inline_array(state)?
            }
            Node::Object(object) if object.state.is_none() => {
                Node::Object(Box::new(Object { class: object.class.clone(), state: Some(state) }))
            }
            other => return Err(self.broken(other.kind(), "an object that takes a state")),
        };
        self.nodes[target as usize] = updated;
        Ok(())
    }

    fn array(&mut self, shape: NodeId, element: NodeId, fortran_order: bool, data: NodeId) -> Result<Node<'a>, Fault> {
        let (element, shape) = (self.element_type(element)?, self.extents(shape)?);
        self.array_of(shape, element, fortran_order, data)
    }

    fn extents(&self, shape: NodeId) -> Result<Vec<usize>, Fault> {
        let extent = |&extent: &NodeId| match self.nodes[extent as usize] {
            Node::Int(extent) => usize::try_from(extent).ok(),
            _ => None,
        };
        let shape: Option<Vec<usize>> = self.tuple_items(shape)?.iter().map(extent).collect();
        shape.ok_or_else(|| self.broken("something else", "non-negative extents"))
    }

    /// An array as joblib stores it: its shape and type are an object's state, its bytes follow right there, after padding.
    fn inline_array(&mut self, state: NodeId) -> Result<Node<'a>, Fault> {
        let Node::Dict(entries) = &self.nodes[state as usize] else {
            return Err(self.broken(self.nodes[state as usize].kind(), "the state of a joblib array"));
        };
        let entry = |name: &str| {
            let named =
                |(key, _): &&(NodeId, NodeId)| matches!(&self.nodes[*key as usize], Node::Text(key) if key == name);
            entries.iter().rev().find(named).map(|(_, value)| *value)
        };
        let (Some(shape), Some(element), Some(order)) = (entry("shape"), entry("dtype"), entry("order")) else {
            return Err(self.broken("an incomplete state", "shape, dtype and order of a joblib array"));
        };
        let is_padded =
            entry("numpy_array_alignment_bytes").is_some_and(|id| !matches!(self.nodes[id as usize], Node::None));
        let fortran_order = matches!(&self.nodes[order as usize], Node::Text(order) if order == "F");
        let (element_type, shape) = (self.element_type(element)?, self.extents(shape)?);
        if element_type.kind == ElementKind::Object {
            return Err(Fault::refused("a joblib array of Python objects"));
        }
        if is_padded {
            let padding = self.cursor.byte()?.into();
            self.cursor.take(padding)?;
        }
        let bytes = element_count(&shape)?.saturating_mul(element_type.size);
        let bytes = self.cursor.take(bytes)?;
        let data = self.add(Node::Bytes(Cow::Borrowed(bytes)))?;
        self.array_of(shape, element_type, fortran_order, data)
    }

    fn array_of(
        &mut self,
        shape: Vec<usize>,
        element: ElementType,
        fortran_order: bool,
        data: NodeId,
    ) -> Result<Node<'a>, Fault> {
        if element.kind == ElementKind::Object {
            return self.objects(data);
        }
        if element.is_text() {
            return self.strings(element, data);
        }
        let array = element.array(shape, fortran_order, self.bytes(data)?, self.budget)?;
        Ok(Node::Array(Arc::new(array)))
    }

    /// An array of strings: the string itself if it is a single one, otherwise a flat list.
    fn strings(&mut self, element: ElementType, data: NodeId) -> Result<Node<'a>, Fault> {
        let mut strings = element.strings(self.bytes(data)?, self.budget)?;
        if strings.len() == 1 {
            return Ok(Node::Text(Cow::Owned(strings.remove(0))));
        }
        let mut items = self.budget.vector(strings.len(), "a list")?;
        for text in strings {
            items.push(self.add(Node::Text(Cow::Owned(text)))?);
        }
        Ok(Node::List(items))
    }

    /// An array of Python objects, as a flat list.
    fn objects(&mut self, data: NodeId) -> Result<Node<'a>, Fault> {
        match &self.nodes[data as usize] {
            Node::List(items) => {
                let mut copied = self.budget.vector(items.len(), "a list")?;
                copied.extend_from_slice(items);
                Ok(Node::List(copied))
            }
            other => Err(self.broken(other.kind(), "the list of an object array")),
        }
    }

    fn element_type(&self, id: NodeId) -> Result<ElementType, Fault> {
        match &self.nodes[id as usize] {
            &Node::ElementType(element) => Ok(element),
            other => Err(self.broken(other.kind(), "a numpy element type")),
        }
    }

    /// The state `(version, byte order, subarray, names, fields, size, alignment, flags)` of a numpy dtype.
    fn element_type_with_state(&self, element: ElementType, state: NodeId) -> Result<ElementType, Fault> {
        let &[_version, order, subarray, names, fields, size, ..] = self.tuple_items(state)? else {
            return Err(self.broken("fewer items", "the state of a numpy element type"));
        };
        if [subarray, names, fields].iter().any(|&part| !matches!(self.nodes[part as usize], Node::None)) {
            return Err(self.broken("a record type", "one element type"));
        }
        let big_endian = matches!(&self.nodes[order as usize], Node::Text(order) if order == ">");
        let size = match self.nodes[size as usize] {
            Node::Int(size) if element.is_text() => {
                let whole = usize::try_from(size).ok();
                let whole = whole.filter(|size| element.kind != ElementKind::Unicode || size % 4 == 0);
                whole.ok_or_else(|| self.broken(size, "the size of a string"))?
            }
            _ => element.size,
        };
        Ok(ElementType { size, big_endian, ..element })
    }

    fn encode(&mut self, text: NodeId, encoding: NodeId) -> Result<Node<'a>, Fault> {
        let (Node::Text(text), Node::Text(encoding)) = (&self.nodes[text as usize], &self.nodes[encoding as usize])
        else {
            return Err(self.broken("something else", "text and the name of an encoding"));
        };
        if !matches!(encoding.as_ref(), "latin1" | "latin-1") {
            return Err(self.broken(excerpt(encoding), "latin1"));
        }
        let beyond = |_| self.broken("a character above 255", "bytes as Latin-1 text");
        let bytes = text.chars().map(|character| u8::try_from(character).map_err(beyond));
        Ok(Node::Bytes(Cow::Owned(self.budget.collect(text.len(), "bytes", bytes)?)))
    }

    fn dict_of_pairs(&mut self, pairs: NodeId) -> Result<Node<'a>, Fault> {
        let Node::List(pairs) = &self.nodes[pairs as usize] else {
            return Err(self.broken(self.nodes[pairs as usize].kind(), "a list of pairs"));
        };
        let invalid = || self.broken("something else", "a list of pairs");
        let pair = |&pair: &NodeId| match &self.nodes[pair as usize] {
            Node::List(pair) | Node::Tuple(pair) => match pair[..] {
                [key, value] => Ok((key, value)),
                _ => Err(invalid()),
            },
            _ => Err(invalid()),
        };
        Ok(Node::Dict(self.budget.collect(pairs.len(), "a dict", pairs.iter().map(pair))?))
    }

    /// A list or dict whose items are of one type.
    fn typed(&mut self, container: NodeId) -> Result<Node<'a>, Fault> {
        match &self.nodes[container as usize] {
            Node::List(items) => {
                Ok(Node::List(self.budget.collect(items.len(), "a list", items.iter().copied().map(Ok))?))
            }
            Node::Dict(entries) => {
                Ok(Node::Dict(self.budget.collect(entries.len(), "a dict", entries.iter().copied().map(Ok))?))
            }
            other => Err(self.broken(other.kind(), "a list or a dict")),
        }
    }

    /// Whether the pickle is that of an archive with tensors.
    fn is_beside_tensors(&self) -> bool {
        matches!(self.outside, Outside::Members(_))
    }

    /// Whether objects of the class are passed over: only beside tensors.
    pub(super) fn passes_over(&self, class: &str) -> bool {
        self.is_beside_tensors() && is_passed_over(class)
    }

    pub(super) fn tuple_items(&self, id: NodeId) -> Result<&[NodeId], Fault> {
        match &self.nodes[id as usize] {
            Node::Tuple(items) => Ok(items),
            other => Err(self.broken(other.kind(), "a tuple")),
        }
    }

    fn bytes(&self, id: NodeId) -> Result<&[u8], Fault> {
        let node = &self.nodes[id as usize];
        node.bytes().ok_or_else(|| self.broken(node.kind(), "bytes"))
    }
}

fn instance<'a>(class: &str) -> Node<'a> {
    Node::Object(Box::new(Object { class: class.into(), state: None }))
}

/// A name as a message shows it: an honest one whole, an absurdly long one cut.
fn excerpt_name(name: &str) -> String {
    excerpt(name).trim_matches('"').to_owned()
}
