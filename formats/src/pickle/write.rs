//! Pickles of a flat dict of numpy arrays, as X-Humans stores its frames.

use std::io::Write;
use std::path::Path;

use crate::atomic_file::write_atomically;
use crate::{Array, ArrayData, ArrayMap};
use crate::{Error, Result};

/// The first protocol with an opcode for bytes; Python 3 reads it from 3.0 on.
const PROTOCOL: u8 = 3;

/// Writes a dict of numpy arrays that Python's `pickle.load` returns as such; the file appears whole or not at all.
///
/// # Errors
/// [`Error::Io`] if the file cannot be written; [`Error::Value`] if an array has 4 GiB or more.
pub fn write_pickle(path: impl AsRef<Path>, arrays: &ArrayMap) -> Result<()> {
    let mut pickle = vec![0x80, PROTOCOL, b'}'];
    for (name, array) in arrays {
        text(&mut pickle, name);
        value(&mut pickle, name, array)?;
        pickle.push(b's');
    }
    pickle.push(b'.');
    write_atomically(path.as_ref(), |writer| writer.write_all(&pickle))
}

/// Writes one numpy array, as [`write_pickle`] does several.
///
/// # Errors
/// As [`write_pickle`].
pub fn write_pickle_array(path: impl AsRef<Path>, array: &Array) -> Result<()> {
    let mut pickle = vec![0x80, PROTOCOL];
    value(&mut pickle, "of the file", array)?;
    pickle.push(b'.');
    write_atomically(path.as_ref(), |writer| writer.write_all(&pickle))
}

fn value(pickle: &mut Vec<u8>, name: &str, array: &Array) -> Result<()> {
    if array.data.bytes() > u32::MAX as usize {
        return Err(Error::Value {
            name: format!("array `{name}`"),
            found: format!("{} bytes", array.data.bytes()),
            expected: "less than 4 GiB".into(),
        });
    }
    match &array.data {
        ArrayData::Text(value) => text(pickle, value),
        ArrayData::U8(values) => numpy_array(pickle, &array.shape, "|", "u1", values),
        ArrayData::I64(values) => {
            numpy_array(pickle, &array.shape, "<", "i8", &little_endian(values, |v| v.to_le_bytes()));
        }
        ArrayData::F32(values) => {
            numpy_array(pickle, &array.shape, "<", "f4", &little_endian(values, |v| v.to_le_bytes()));
        }
        ArrayData::F64(values) => {
            numpy_array(pickle, &array.shape, "<", "f8", &little_endian(values, |v| v.to_le_bytes()));
        }
    }
    Ok(())
}

fn little_endian<T: Copy, const SIZE: usize>(values: &[T], bytes: fn(T) -> [u8; SIZE]) -> Vec<u8> {
    values.iter().flat_map(|&value| bytes(value)).collect()
}

/// `_reconstruct(ndarray, (0,), b"b")`, then its state `(1, shape, dtype, False, data)`.
fn numpy_array(pickle: &mut Vec<u8>, shape: &[usize], order: &str, element: &str, data: &[u8]) {
    // The module's old name: numpy 1 and 2 both resolve it.
    pickle.extend_from_slice(b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\0\x85C\x01b\x87R(K\x01(");
    for &extent in shape {
        pickle.push(0x8a);
        // Nine bytes: the highest one keeps extents above 2^63 positive.
        pickle.push(9);
        pickle.extend_from_slice(&(extent as u64).to_le_bytes());
        pickle.push(0);
    }
    pickle.extend_from_slice(b"tcnumpy\ndtype\n");
    text(pickle, element);
    pickle.extend_from_slice(b"\x89\x88\x87R(K\x03");
    text(pickle, order);
    pickle.extend_from_slice(b"NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tb\x89B");
    pickle.extend_from_slice(&(data.len() as u32).to_le_bytes());
    pickle.extend_from_slice(data);
    pickle.extend_from_slice(b"tb");
}

fn text(pickle: &mut Vec<u8>, text: &str) {
    pickle.push(b'X');
    pickle.extend_from_slice(&(text.len() as u32).to_le_bytes());
    pickle.extend_from_slice(text.as_bytes());
}
