//! Named f32 tensors with text beside them, as one safetensors file: what checkpoints and avatars are stored in.
//!
//! Equal contents are equal bytes: everything is in the order of its name. Beside the text stands [`CHECKSUM`], the CRC-32 of all that
//! the file says, which is compared when it is read; a file of another program has none.

use std::collections::{BTreeMap, HashMap};
use std::io::{self, Write};
use std::path::Path;

use safetensors::{Dtype, SafeTensors};
use serde_json::json;

use crate::atomic_file::write_atomically;
use crate::budget::Budget;
use crate::fault::Fault;
use crate::input_file::read_bytes;
use crate::{Error, Result};

/// The text entry that holds the checksum, eight hexadecimal digits.
const CHECKSUM: &str = "crc32";
/// Headers are filled up so that entries can be mapped into memory.
const ALIGNMENT: usize = 8;
const FORMAT: &str = "safetensors file";

/// Tensors by name: shape and row-major entries.
pub type NamedTensors = HashMap<String, (Vec<usize>, Vec<f32>)>;

/// The contents of one file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TensorFile {
    /// Text by name.
    pub text: HashMap<String, String>,
    /// Tensors by name.
    pub tensors: NamedTensors,
}

impl TensorFile {
    /// Writes the whole file or nothing.
    ///
    /// # Errors
    /// [`Error::Value`] if a tensor's entries do not fill its shape; [`Error::Io`] if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let unfilled = self.tensors.iter().find(|(_, (shape, values))| shape.iter().product::<usize>() != values.len());
        if let Some((name, (shape, values))) = unfilled {
            return Err(Error::Value {
                name: format!("tensor `{name}` of {}", path.display()),
                found: format!("{} entries of shape {shape:?}", values.len()),
                expected: "as many as fill the shape".into(),
            });
        }
        write_atomically(path, |file| self.write_to(file))
    }

    /// Writes what a file holds, whose tensors' entries must fill their shapes.
    ///
    /// # Errors
    /// Those of `to`.
    pub fn write_to(&self, to: &mut impl Write) -> io::Result<()> {
        let header = self.header()?;
        to.write_all(&(header.len() as u64).to_le_bytes())?;
        to.write_all(header.as_bytes())?;
        self.sorted_tensors().values().try_for_each(|(_, values)| write_values(to, values))
    }

    /// Reads a file; its tensors must all be f32.
    ///
    /// # Errors
    /// [`Error::Malformed`] if it is cut short, was changed since it was written, or holds other numbers; [`Error::Io`].
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&read_bytes(path)?).map_err(|fault| fault.in_file(path, FORMAT))
    }

    /// What the bytes of a file hold; its tensors must all be f32.
    ///
    /// # Errors
    /// [`Fault::Malformed`] if they are cut short, were changed since they were written, or are other numbers.
    pub fn parse(bytes: &[u8]) -> std::result::Result<Self, Fault> {
        let broken = |error: safetensors::SafeTensorError| {
            Fault::malformed("the header", error, "a header that describes the whole file")
        };
        let budget = Budget::of_file(bytes.len());
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(broken)?;
        let mut text = metadata.metadata().clone().unwrap_or_default();
        let mut tensors = NamedTensors::new();
        for (name, view) in SafeTensors::deserialize(bytes).map_err(broken)?.iter() {
            if view.dtype() != Dtype::F32 {
                return Err(Fault::malformed(name, format_args!("{:?}", view.dtype()), "F32"));
            }
            let (stored, _) = view.data().as_chunks();
            let mut values = budget.vector(stored.len(), "a tensor")?;
            values.extend(stored.iter().map(|bytes| f32::from_le_bytes(*bytes)));
            tensors.insert(name.to_owned(), (view.shape().to_vec(), values));
        }
        let stored = text.remove(CHECKSUM);
        let file = Self { text, tensors };
        match stored.map(|stored| (file.checksum(), stored)) {
            Some((found, stored)) if found != stored => Err(Fault::malformed(
                "the checksum of what it holds",
                found,
                format_args!("{stored} as when it was written; it is damaged: take another copy"),
            )),
            _ => Ok(file),
        }
    }

    /// The header, filled up to whole words.
    fn header(&self) -> serde_json::Result<String> {
        let mut text: BTreeMap<&str, &str> =
            self.text.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect();
        let checksum = self.checksum();
        text.insert(CHECKSUM, &checksum);
        let mut entries = BTreeMap::from([("__metadata__", json!(text))]);
        let mut end = 0;
        for (name, (shape, values)) in self.sorted_tensors() {
            let begin = end;
            end += size_of_val(values.as_slice());
            entries.insert(name, json!({ "dtype": "F32", "shape": shape, "data_offsets": [begin, end] }));
        }
        let mut header = serde_json::to_string(&entries)?;
        let length = header.len().next_multiple_of(ALIGNMENT);
        header.extend(std::iter::repeat_n(' ', length - header.len()));
        Ok(header)
    }

    fn sorted_tensors(&self) -> BTreeMap<&str, &(Vec<usize>, Vec<f32>)> {
        self.tensors.iter().map(|(name, tensor)| (name.as_str(), tensor)).collect()
    }

    /// The CRC-32 of text, names, shapes and entries, in the order of the names.
    fn checksum(&self) -> String {
        let mut hasher = crc32fast::Hasher::new();
        let text: BTreeMap<_, _> = self.text.iter().collect();
        for word in text.iter().flat_map(|(key, value)| [key, value]) {
            hasher.update(word.as_bytes());
            hasher.update(&[0]);
        }
        for (name, (shape, values)) in self.sorted_tensors() {
            hasher.update(name.as_bytes());
            hasher.update(&[0]);
            shape.iter().for_each(|extent| hasher.update(&(*extent as u64).to_le_bytes()));
            // Writing to a checksum does not fail.
            let _ = write_values(&mut Checked(&mut hasher), values);
        }
        format!("{:08x}", hasher.finalize())
    }

    /// A text entry.
    ///
    /// # Errors
    /// [`Error::Mismatch`] if there is none of that key; `path` is named.
    pub fn text(&self, path: &Path, key: &str) -> Result<&str> {
        self.text.get(key).map(String::as_str).ok_or_else(|| Error::Mismatch {
            path: path.into(),
            found: format!("a safetensors file without `{key}`"),
            expected: "one that this program wrote".into(),
            remedy: "pass a run folder, its avatar.safetensors or one of its checkpoints".into(),
        })
    }

    /// A text entry, parsed.
    ///
    /// # Errors
    /// As [`text`](Self::text), and [`Error::Malformed`] for one that cannot be parsed.
    pub fn parsed<V: std::str::FromStr>(&self, path: &Path, key: &str) -> Result<V> {
        let text = self.text(path, key)?;
        text.parse().map_err(|_| Error::Malformed {
            path: path.into(),
            format: FORMAT,
            place: format!("metadata `{key}`"),
            found: format!("`{text}`"),
            expected: "a number".into(),
        })
    }
}

/// Bytes that are only added up.
struct Checked<'a>(&'a mut crc32fast::Hasher);

impl Write for Checked<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes values as little-endian bytes, many at a time.
fn write_values(to: &mut impl Write, values: &[f32]) -> io::Result<()> {
    const BLOCK: usize = 1024;
    let mut block = [0; 4 * BLOCK];
    for values in values.chunks(BLOCK) {
        let bytes = &mut block[..4 * values.len()];
        for (bytes, value) in bytes.as_chunks_mut().0.iter_mut().zip(values) {
            *bytes = value.to_le_bytes();
        }
        to.write_all(bytes)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> TensorFile {
        TensorFile {
            text: HashMap::from([("step".into(), "12".into())]),
            tensors: HashMap::from([
                ("a".into(), (vec![2, 3], vec![0.5, -1.0, f32::MIN_POSITIVE, 3.0, 4.0, 5.0])),
                ("b".into(), (vec![0], vec![])),
            ]),
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.safetensors");
        sample().write(&path).unwrap();
        let read = TensorFile::read(&path).unwrap();
        assert_eq!(read, sample());
        assert_eq!(read.parsed::<u64>(&path, "step").unwrap(), 12);
        assert!(matches!(read.text(&path, "stage"), Err(Error::Mismatch { .. })));
    }

    #[test]
    fn equal_contents_are_equal_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let written = |name: &str| {
            let mut file = sample();
            // Hash tables of other keys, and with other keys' order.
            file.text.extend((0..50).map(|key| (format!("key {key}"), key.to_string())));
            file.tensors.extend((0..50).map(|key| (format!("tensor {key}"), (vec![1], vec![key as f32]))));
            let path = folder.path().join(name);
            file.write(&path).unwrap();
            std::fs::read(path).unwrap()
        };
        assert_eq!(written("first"), written("second"));
    }

    // Every truncation and every changed byte is an error; but for those by which the checksum is found.
    #[test]
    fn damaged_files_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.safetensors");
        sample().write(&path).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            assert!(TensorFile::parse(&whole[..length]).is_err(), "{length} of {} bytes", whole.len());
        }
        let key = whole.windows(CHECKSUM.len()).position(|window| window == CHECKSUM.as_bytes()).unwrap();
        for index in (0..whole.len()).filter(|index| !(key..key + CHECKSUM.len()).contains(index)) {
            let mut bytes = whole.clone();
            bytes[index] ^= 0x55;
            assert!(TensorFile::parse(&bytes).is_err(), "byte {index}");
        }
        let mut bytes = whole;
        *bytes.last_mut().unwrap() ^= 1;
        std::fs::write(&path, &bytes).unwrap();
        let message = TensorFile::read(&path).unwrap_err().to_string();
        assert!(message.contains("x.safetensors") && message.contains("damaged"), "{message}");
    }

    #[test]
    fn files_of_other_programs_need_no_checksum() {
        let view = safetensors::tensor::TensorView::new(Dtype::F32, vec![1], &[0, 0, 0, 64]).unwrap();
        let bytes = safetensors::serialize([("a", view)], None).unwrap();
        assert_eq!(TensorFile::parse(&bytes).unwrap().tensors["a"], (vec![1], vec![2.0]));
    }

    #[test]
    fn what_is_written_is_read_by_the_reference_implementation() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.safetensors");
        sample().write(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let tensors = SafeTensors::deserialize(&bytes).unwrap();
        assert_eq!(tensors.tensor("a").unwrap().shape(), [2, 3]);
        assert_eq!(&tensors.tensor("a").unwrap().data()[..4], 0.5f32.to_le_bytes());
    }
}
