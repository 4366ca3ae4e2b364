//! The numbers of a tensor that `pickle` stored, not `torch.save`: its storage is a byte string in PyTorch's format before 1.6.
//!
//! magic number, version, system: a pickle each -> a pickle that is the persistent id of the storage -> a pickle of the list of keys
//! -> the count, i64 -> the numbers.

use std::borrow::Cow;

use super::machine::{Machine, Outside};
use super::node::{Node, NodeId};
use super::tensors::Storage;
use crate::fault::Fault;
use crate::torch::LEGACY;

impl<'a> Machine<'a> {
    /// `torch.storage._load_from_bytes`: the storage that stands in a byte string of the pickle.
    pub(super) fn packed_storage(&self, bytes: NodeId) -> Result<Node<'a>, Fault> {
        let bytes: &'a [u8] = match &self.nodes[bytes as usize] {
            Node::Bytes(Cow::Borrowed(bytes)) => bytes,
            Node::Bytes(Cow::Owned(_)) => {
                let expected = "protocol 3 or newer, or arrays: tensor.numpy() before saving";
                return Err(self.broken("a tensor in a pickle of protocol 2", expected));
            }
            other => return Err(self.broken(other.kind(), "the bytes of a tensor")),
        };
        let after_magic = bytes.strip_prefix(LEGACY).and_then(|rest| rest.strip_prefix(b"."));
        // One in another is no storage, and might go on for ever.
        let Some(packed) = after_magic.filter(|_| !matches!(self.outside, Outside::Behind)) else {
            return Err(self.broken("another byte string", "a tensor's storage as torch packs it"));
        };
        let mut machine = Machine::new(packed, Outside::Behind, self.budget);
        machine.numbers_behind().map_err(|fault| fault.within("a tensor"))
    }

    /// Executes the pickles of a packed storage, and takes the numbers behind them.
    fn numbers_behind(&mut self) -> Result<Node<'a>, Fault> {
        let [_version, system, id, _keys] =
            [self.run_to_stop()?, self.run_to_stop()?, self.run_to_stop()?, self.run_to_stop()?];
        let storage = self.storage_id(id, self.is_big_endian(system))?;
        let (element, count) = (storage.element, storage.count);
        let counted = i64::from_le_bytes(self.cursor.array()?);
        let length = element.bytes_of(count).filter(|_| counted == count);
        let length = length.ok_or_else(|| self.broken(counted, format_args!("the count of its numbers, {count}")))?;
        Ok(Node::Storage(Storage { bytes: self.cursor.take(length)?, element }))
    }

    /// What the system that wrote a file says of itself.
    fn is_big_endian(&self, system: NodeId) -> bool {
        let Node::Dict(entries) = &self.nodes[system as usize] else { return false };
        entries.iter().any(|(key, value)| {
            matches!(&self.nodes[*key as usize], Node::Text(key) if key == "little_endian")
                && matches!(self.nodes[*value as usize], Node::Bool(false))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::LEGACY;
    use crate::fault::Fault;
    use crate::{Value, parse_pickle};

    /// A storage of `count` f32 as torch packs it.
    fn packed(count: u8, id: &[u8], numbers: &[u8]) -> Vec<u8> {
        let count = i64::from(count).to_le_bytes();
        [LEGACY, b".\x80\x02M\xe9\x03.\x80\x02}.", id, b".\x80\x02].", &count, numbers].concat()
    }

    fn floats(count: u8) -> Vec<u8> {
        [b"\x80\x02(X\x07\0\0\0storagectorch\nFloatStorage\nX\x01\0\0\0aX\x03\0\0\0cpuK", &[count][..], b"NtQ"].concat()
    }

    /// `_load_from_bytes` of a byte string.
    fn loaded(bytes: &[u8]) -> Vec<u8> {
        let length = (bytes.len() as u32).to_le_bytes();
        [b"ctorch.storage\n_load_from_bytes\nB", &length[..], bytes, b"\x85R"].concat()
    }

    /// The pickle of a tensor of two numbers on a storage.
    fn tensor(storage: &[u8]) -> Result<Value, Fault> {
        let pickle =
            [b"\x80\x03ctorch._utils\n_rebuild_tensor_v2\n(", storage, b"K\0K\x02\x85K\x01\x85\x89}tR."].concat();
        parse_pickle(&pickle)
    }

    fn numbers() -> Vec<u8> {
        [1.5f32, -2.0].into_iter().flat_map(f32::to_le_bytes).collect()
    }

    #[test]
    fn a_pickled_tensor_is_an_array() {
        let Value::Array(array) = tensor(&loaded(&packed(2, &floats(2), &numbers()))).unwrap() else { panic!() };
        assert_eq!((array.shape.as_slice(), array.to_f32().unwrap()), (&[2][..], vec![1.5, -2.0]));
    }

    #[test]
    fn what_is_no_storage_of_its_own_is_refused() {
        let whole = packed(2, &floats(2), &numbers());
        for length in 0..whole.len() {
            assert!(tensor(&loaded(&whole[..length])).is_err(), "{length}");
        }
        assert!(tensor(&loaded(&packed(3, &floats(2), &numbers()))).is_err(), "another count");
        assert!(tensor(&loaded(&packed(255, &floats(255), &numbers()))).is_err(), "too few numbers");
        // A storage that would be read out of a storage.
        let inner = [b"\x80\x03", &loaded(&whole)[..]].concat();
        let error = tensor(&loaded(&packed(2, &inner, &numbers()))).unwrap_err();
        assert!(matches!(&error, Fault::Malformed { found, .. } if found == "another byte string"), "{error:?}");
    }

    // Protocol 2 spells bytes as text.
    #[test]
    fn an_old_protocol_is_told_what_to_do() {
        let storage =
            b"ctorch.storage\n_load_from_bytes\nc_codecs\nencode\nX\x02\0\0\0\xc2\x80X\x06\0\0\0latin1\x86R\x85R";
        let error = tensor(storage).unwrap_err();
        assert!(
            matches!(&error, Fault::Malformed { expected, .. } if expected.contains("tensor.numpy()")),
            "{error:?}"
        );
    }
}
