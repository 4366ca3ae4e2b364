//! PyTorch's tensors: views of numbers that are stored outside the pickle, in members of the same archive.
//!
//! A persistent id `("storage", torch.FloatStorage, key, device, count)` names a member; `torch._utils._rebuild_tensor_v2(storage,
//! offset, size, stride, ...)` makes a tensor of it. Tensors become arrays in row-major order, whatever their strides.

use std::collections::HashMap;
use std::sync::Arc;

use super::machine::Machine;
use super::node::{Node, NodeId};
use crate::budget::Budget;
use crate::element::{ElementKind, ElementType, element_count};
use crate::fault::{Fault, excerpt};

/// The numbers of an archive's tensors: the bytes of its members by key.
pub(crate) struct Storages<'a> {
    pub(crate) members: HashMap<String, &'a [u8]>,
    pub(crate) big_endian: bool,
}

/// A storage: numbers in one place.
#[derive(Clone, Copy)]
pub(super) struct Storage<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) element: StorageElement,
}

/// What a persistent id says of a storage.
pub(super) struct StorageId<'a> {
    key: &'a str,
    pub(super) element: StorageElement,
    pub(super) count: i64,
}

/// What a storage's numbers are.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum StorageElement {
    Numpy(ElementType),
    /// The upper half of an f32.
    BrainFloat {
        big_endian: bool,
    },
}

impl StorageElement {
    /// By the name of the class, such as `torch.FloatStorage`.
    fn of_class(class: &str, big_endian: bool) -> Option<Self> {
        let name = class.strip_prefix("torch.")?;
        let (kind, size) = match name.strip_prefix("cuda.").unwrap_or(name).strip_suffix("Storage")? {
            "Double" => (ElementKind::Float, 8),
            "Float" => (ElementKind::Float, 4),
            "Half" => (ElementKind::Float, 2),
            "Long" => (ElementKind::Signed, 8),
            "Int" => (ElementKind::Signed, 4),
            "Short" => (ElementKind::Signed, 2),
            "Char" => (ElementKind::Signed, 1),
            "Byte" => (ElementKind::Unsigned, 1),
            "Bool" => (ElementKind::Boolean, 1),
            "BFloat16" => return Some(Self::BrainFloat { big_endian }),
            _ => return None,
        };
        Some(Self::Numpy(ElementType { kind, size, big_endian }))
    }

    fn size(self) -> usize {
        match self {
            Self::Numpy(element) => element.size,
            Self::BrainFloat { .. } => 2,
        }
    }

    /// The bytes of `count` numbers, if there can be so many.
    pub(super) fn bytes_of(self, count: i64) -> Option<usize> {
        usize::try_from(count).ok()?.checked_mul(self.size())
    }
}

impl<'a> Machine<'a> {
    /// What a persistent id stands for among the members of an archive.
    pub(super) fn stored_in(&self, storages: &Storages<'a>, id: NodeId) -> Result<Node<'a>, Fault> {
        let StorageId { key, element, count } = self.storage_id(id, storages.big_endian)?;
        let member = || format!("storage {}", excerpt(key));
        let bytes = *storages.members.get(key).ok_or_else(|| Fault::malformed(member(), "missing", "a member"))?;
        if element.bytes_of(count) != Some(bytes.len()) {
            let expected = format_args!("{count} elements of {} bytes", element.size()).to_string();
            return Err(Fault::malformed(member(), format_args!("{} bytes", bytes.len()), expected));
        }
        Ok(Node::Storage(Storage { bytes, element }))
    }

    /// What a persistent id says: `("storage", class, key, device, count)`, and of old files that no other storage is a part of it.
    pub(super) fn storage_id(&self, id: NodeId, big_endian: bool) -> Result<StorageId<'_>, Fault> {
        let not_a_storage =
            || self.broken("another persistent id", "(\"storage\", a storage class, a key, a device, a count)");
        let node = |id: NodeId| &self.nodes[id as usize];
        let parts = match *self.tuple_items(id)? {
            [tag, class, key, _device, count] => [tag, class, key, count],
            [tag, class, key, _device, count, view] if matches!(node(view), Node::None) => [tag, class, key, count],
            _ => return Err(not_a_storage()),
        };
        let [Node::Text(tag), Node::Global(class), Node::Text(key), &Node::Int(count)] = parts.map(node) else {
            return Err(not_a_storage());
        };
        if tag != "storage" {
            return Err(not_a_storage());
        }
        let element = StorageElement::of_class(class, big_endian)
            .ok_or_else(|| Fault::refused(format_args!("`{}`", excerpt(class).trim_matches('"'))))?;
        Ok(StorageId { key, element, count })
    }

    /// `torch._utils._rebuild_tensor_v2`: the elements at `offset + sum index * stride` of a storage.
    pub(super) fn tensor(
        &mut self,
        storage: NodeId,
        offset: NodeId,
        size: NodeId,
        stride: NodeId,
    ) -> Result<Node<'a>, Fault> {
        let Node::Storage(storage) = self.nodes[storage as usize] else {
            return Err(self.broken(self.nodes[storage as usize].kind(), "a tensor's storage"));
        };
        let number = |id: &NodeId| match self.nodes[*id as usize] {
            Node::Int(number) => usize::try_from(number).ok(),
            _ => None,
        };
        let numbers = |id: NodeId| -> Result<Option<Vec<usize>>, Fault> {
            Ok(self.tuple_items(id)?.iter().map(number).collect())
        };
        let (Some(offset), Some(size), Some(stride)) = (number(&offset), numbers(size)?, numbers(stride)?) else {
            return Err(self.broken("something else", "a tensor's offset, extents and strides"));
        };
        let count = element_count(&size)?;
        let within = stride.len() == size.len() && {
            let last = size.iter().zip(&stride).try_fold(offset, |last, (extent, stride)| {
                last.checked_add(extent.saturating_sub(1).checked_mul(*stride)?)
            });
            count == 0 || last.is_some_and(|last| last < storage.bytes.len() / storage.element.size())
        };
        if !within {
            return Err(self.broken(
                format_args!("a tensor of {size:?} by {stride:?} from {offset}"),
                format_args!("one within its storage of {} bytes", storage.bytes.len()),
            ));
        }
        let gathered = gather(storage.bytes, storage.element.size(), offset, (&size, &stride, count), self.budget)?;
        let (element, bytes) = match storage.element {
            StorageElement::Numpy(element) => (element, gathered),
            StorageElement::BrainFloat { big_endian } => {
                let element = ElementType { kind: ElementKind::Float, size: 4, big_endian };
                let pairs = gathered.as_chunks::<2>().0.iter();
                let widened = pairs.flat_map(|&[first, second]| match big_endian {
                    true => [first, second, 0, 0],
                    false => [0, 0, first, second],
                });
                let length = 2 * gathered.len();
                (element, self.budget.collect(length, "a tensor", widened.map(Ok))?)
            }
        };
        let array = element.array(size, false, &bytes, self.budget)?;
        self.budget.give_back(bytes.len());
        Ok(Node::Array(Arc::new(array)))
    }
}

/// The elements of `size` bytes of a strided view (extents, strides, their number), in row-major order. It must lie within `bytes`.
fn gather(
    bytes: &[u8],
    size: usize,
    offset: usize,
    (extents, strides, count): (&[usize], &[usize], usize),
    budget: &Budget,
) -> Result<Vec<u8>, Fault> {
    let mut gathered = budget.vector(count.saturating_mul(size), "a tensor")?;
    let mut index = vec![0; extents.len()];
    let mut position = offset;
    for _ in 0..count {
        gathered.extend_from_slice(&bytes[position * size..][..size]);
        for axis in (0..extents.len()).rev() {
            index[axis] += 1;
            position += strides[axis];
            if index[axis] < extents[axis] {
                break;
            }
            position -= strides[axis] * extents[axis];
            index[axis] = 0;
        }
    }
    Ok(gathered)
}

/// Whether objects of this class are passed over, unmade and unread: settings and notes that training frameworks keep beside
/// the tensors. Everything else that is not on the allow-list is refused.
pub(super) fn is_passed_over(class: &str) -> bool {
    const PACKAGES: [&str; 5] = ["omegaconf.", "pytorch_lightning.", "lightning.", "lightning_fabric.", "pathlib."];
    const CLASSES: [&str; 3] = ["argparse.Namespace", "torch.device", "torch.Size"];
    CLASSES.contains(&class) || PACKAGES.iter().any(|package| class.starts_with(package))
}
