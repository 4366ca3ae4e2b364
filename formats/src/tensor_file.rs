//! Named f32 tensors with text beside them, as one safetensors file: what checkpoints and avatars are stored in.

use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};

use crate::atomic_file::write_atomically;
use crate::input_file::read_bytes;
use crate::{Error, Result};

/// Tensors by name: shape and row-major entries.
pub type NamedTensors = HashMap<String, (Vec<usize>, Vec<f32>)>;

/// The contents of one file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TensorFile {
    /// Text entries by key.
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
        let bytes: HashMap<&String, (&Vec<usize>, Vec<u8>)> = self
            .tensors
            .iter()
            .map(|(name, (shape, values))| (name, (shape, values.iter().flat_map(|v| v.to_le_bytes()).collect())))
            .collect();
        let refuse = |error: safetensors::SafeTensorError| Error::Value {
            name: format!("tensor file {}", path.display()),
            found: error.to_string(),
            expected: "tensors whose entries fill their shapes".into(),
        };
        let mut views = Vec::with_capacity(bytes.len());
        for (name, (shape, data)) in &bytes {
            views.push((name, TensorView::new(Dtype::F32, shape.to_vec(), data).map_err(refuse)?));
        }
        let serialised = safetensors::serialize(views, Some(self.text.clone())).map_err(refuse)?;
        write_atomically(path, |file| file.write_all(&serialised))
    }

    /// Reads a file; its tensors must all be f32.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be opened; [`Error::Malformed`] if it is no whole safetensors file of f32.
    pub fn read(path: &Path) -> Result<Self> {
        let malformed = |place: &str, found: String, expected: &str| Error::Malformed {
            path: path.into(),
            format: "safetensors file",
            place: place.into(),
            found,
            expected: expected.into(),
        };
        let bytes = read_bytes(path)?;
        let broken = |error: safetensors::SafeTensorError| {
            malformed("the header", error.to_string(), "a header that describes the whole file")
        };
        let (_, metadata) = SafeTensors::read_metadata(&bytes).map_err(broken)?;
        let text = metadata.metadata().clone().unwrap_or_default();
        let mut tensors = NamedTensors::new();
        for (name, view) in SafeTensors::deserialize(&bytes).map_err(broken)?.iter() {
            if view.dtype() != Dtype::F32 {
                return Err(malformed(name, format!("{:?}", view.dtype()), "F32"));
            }
            let values = view.data().as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
            tensors.insert(name.to_owned(), (view.shape().to_vec(), values));
        }
        Ok(Self { text, tensors })
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
            format: "safetensors file",
            place: format!("metadata `{key}`"),
            found: format!("`{text}`"),
            expected: "a number".into(),
        })
    }
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

    // Every truncation and every flipped byte of the header is an error or a well-formed file, never a panic.
    #[test]
    fn broken_files_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.safetensors");
        sample().write(&path).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(TensorFile::read(&path).is_err(), "{length} of {} bytes", whole.len());
        }
        for index in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[index] ^= 0x55;
            std::fs::write(&path, &bytes).unwrap();
            let _ = TensorFile::read(&path);
        }
    }
}
