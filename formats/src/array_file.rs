//! Files of arrays of any container, told by what they begin with, not by their names: npz, npy, pickle, PyTorch, JSON, and each but
//! the first compressed by zlib or gzip, as joblib does.

use std::path::Path;

use flate2::read::{GzDecoder, ZlibDecoder};

use crate::budget::Budget;
use crate::fault::Fault;
use crate::file_tree::unpacked;
use crate::input_file::read_bytes;
use crate::npy::NpyFile;
use crate::pickle::{Value, flatten, interpret};
use crate::{Array, ArrayMap, Error, Result, parse_npz, parse_torch, torch};

const ZIP: &[u8] = b"PK";
const NPY: &[u8] = b"\x93NUMPY";
const GZIP: &[u8] = b"\x1f\x8b";

/// How arrays are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Container {
    /// A zip archive of npy files.
    Npz,
    /// One array, or one object, of numpy.
    Npy,
    /// A pickle.
    Pickle,
    /// What `torch.save` writes.
    Torch,
    /// JSON.
    Json,
}

/// A file of arrays.
#[derive(Clone, Debug, PartialEq)]
pub struct ArrayFile {
    /// How they are packed.
    pub container: Container,
    /// The arrays by name, as [`read_pickle_arrays`](crate::read_pickle_arrays) names them. An array that has no name, because the file
    /// is nothing else, is under the empty one.
    pub arrays: ArrayMap,
}

impl ArrayFile {
    /// Reads a file of arrays; `None` if it is none that is known.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for what is known and not read, with the way out; those of the container's reader for what is damaged.
    pub fn read(path: impl AsRef<Path>) -> Result<Option<Self>> {
        let path = path.as_ref();
        Self::parse(path, &read_bytes(path)?)
    }

    /// As [`read`](Self::read), of the content of the file at `path`.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Option<Self>> {
        if let Some((found, remedy)) = not_read(bytes) {
            return Err(Error::Mismatch {
                path: path.into(),
                found: found.into(),
                expected: "arrays in an npz, npy, pickle, PyTorch or JSON file".into(),
                remedy: remedy.into(),
            });
        }
        Self::unpacked(bytes).map_err(|fault| fault.in_file(path, format_of(bytes)))
    }

    /// The only array of a file that has no names.
    pub fn single(&self) -> Option<&Array> {
        self.arrays.get("").filter(|_| self.arrays.len() == 1)
    }

    fn unpacked(bytes: &[u8]) -> std::result::Result<Option<Self>, Fault> {
        let budget = Budget::of_file(bytes.len());
        if bytes.starts_with(ZIP) {
            return Self::of_archive(bytes, &budget).map(Some);
        }
        if bytes.starts_with(GZIP) {
            return Self::of_plain(&unpacked(GzDecoder::new(bytes), &budget)?, &budget);
        }
        if is_zlib(bytes) {
            return Self::of_plain(&unpacked(ZlibDecoder::new(bytes), &budget)?, &budget);
        }
        Self::of_plain(bytes, &budget)
    }

    fn of_archive(bytes: &[u8], budget: &Budget) -> std::result::Result<Self, Fault> {
        if torch::is_archive(bytes) {
            return Ok(Self { container: Container::Torch, arrays: arrays_of(parse_torch(bytes)?, budget)? });
        }
        Ok(Self { container: Container::Npz, arrays: parse_npz(bytes)? })
    }

    /// Of bytes that are not packed.
    fn of_plain(bytes: &[u8], budget: &Budget) -> std::result::Result<Option<Self>, Fault> {
        let start = bytes.trim_ascii_start();
        let (container, arrays) = if bytes.starts_with(NPY) {
            let npy = NpyFile::parse(bytes)?;
            let arrays = match npy.is_objects() {
                true => arrays_of(interpret(npy.data, budget)?, budget)?,
                false => [(String::new(), npy.array(budget)?)].into(),
            };
            (Container::Npy, arrays)
        } else if is_pickle(bytes) {
            (Container::Pickle, arrays_of(interpret(bytes, budget)?, budget)?)
        } else if start.starts_with(b"{") || start.starts_with(b"[") {
            (Container::Json, arrays_of(json(bytes, budget)?, budget)?)
        } else {
            return Ok(None);
        };
        Ok(Some(Self { container, arrays }))
    }
}

/// What bytes are meant to be, for messages.
fn format_of(bytes: &[u8]) -> &'static str {
    match bytes {
        _ if bytes.starts_with(ZIP) => "archive of arrays",
        _ if bytes.starts_with(GZIP) || is_zlib(bytes) => "compressed pickle",
        _ if bytes.starts_with(NPY) => "npy array",
        _ if is_pickle(bytes) => "pickle",
        _ => "JSON file",
    }
}

fn arrays_of(value: Value, budget: &Budget) -> std::result::Result<ArrayMap, Fault> {
    let mut arrays = ArrayMap::new();
    flatten("", value, budget, &mut arrays)?;
    Ok(arrays)
}

fn is_zlib(bytes: &[u8]) -> bool {
    // Deflate with a window of 32 KiB; the two bytes together are a multiple of 31.
    matches!(bytes, [0x78, second, ..] if (0x7800 + u16::from(*second)) % 31 == 0)
}

/// Whether bytes begin like a pickle: with a protocol, or, before there were any, with a container or a name.
fn is_pickle(bytes: &[u8]) -> bool {
    matches!(bytes, [0x80, 0..=5, ..] | [b'(', b'd' | b'l' | b'i' | b'c', ..] | [b'}' | b']', b'q' | b'p', ..])
        || names_what_it_makes(bytes)
}

/// Whether bytes begin with the oldest protocol's name of a type or function, `c`, a line with its module and one with its own name,
/// and end with the mark of a pickle's end.
fn names_what_it_makes(bytes: &[u8]) -> bool {
    let Some(names) = bytes.strip_prefix(b"c").filter(|_| bytes.ends_with(b".")) else { return false };
    let mut lines = names.split(|byte| *byte == b'\n');
    let is_name = |line: &[u8]| !line.is_empty() && !line.iter().any(u8::is_ascii_whitespace);
    // A third line is what follows the two names.
    lines.next().is_some_and(is_name) && lines.next().is_some_and(is_name) && lines.next().is_some()
}

fn json(bytes: &[u8], budget: &Budget) -> std::result::Result<Value, Fault> {
    // The densest JSON is numbers of one digit: two bytes of text for a value, twice.
    budget.spend(bytes.len().saturating_mul(size_of::<Value>()), "JSON")?;
    let value = serde_json::from_slice(bytes).map_err(|error| Fault::malformed("JSON", error, "JSON"))?;
    Ok(plain(value))
}

fn plain(value: serde_json::Value) -> Value {
    use serde_json::Value as Json;
    match value {
        Json::Null => Value::None,
        Json::Bool(value) => Value::Bool(value),
        Json::Number(number) => match (number.as_i64(), number.as_f64()) {
            (Some(integer), _) => Value::Int(integer),
            (None, Some(value)) => Value::Float(value),
            (None, None) => Value::None,
        },
        Json::String(text) => Value::Text(text),
        Json::Array(items) => Value::List(items.into_iter().map(plain).collect()),
        Json::Object(entries) => {
            Value::Dict(entries.into_iter().map(|(key, value)| (Value::Text(key), plain(value))).collect())
        }
    }
}

/// What is known by its beginning and not read, and what to do.
fn not_read(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    const RESAVE: &str = "save it again without compression, or with zlib or gzip: joblib.dump(joblib.load(\"OLD\"), \"NEW\", compress=0)";
    let known: [(&[u8], &str, &str); 7] = [
        (torch::LEGACY, "a file in PyTorch's format before 1.6", torch::REWRITE),
        (b"BZh", "data compressed by bzip2", RESAVE),
        (b"\xfd7zXZ", "data compressed by xz", RESAVE),
        (b"\x5d\x00\x00", "data compressed by lzma", RESAVE),
        (b"\x04\x22\x4d\x18", "data compressed by lz4", RESAVE),
        (
            b"\x89HDF\r\n\x1a\n",
            "an HDF5 file",
            "save its arrays as an npz in Python: f = h5py.File(\"OLD\"); numpy.savez(\"NEW.npz\", **{k: f[k][()] for k in f})",
        ),
        (b"Kaydara FBX", "an FBX file", "export it as BVH, from Blender for instance"),
    ];
    known.iter().find(|(start, ..)| bytes.starts_with(start)).map(|(_, found, remedy)| (*found, *remedy))
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::{GzEncoder, ZlibEncoder};

    use super::*;
    use crate::npy_bytes;

    fn parsed(bytes: &[u8]) -> ArrayFile {
        ArrayFile::unpacked(bytes).unwrap().unwrap()
    }

    // {"a": [1.5, 2], "b": {"c": 3}}, as pickle of protocol 0.
    const PICKLE: &[u8] = b"(dp0\nS'a'\n(lp1\nF1.5\naI2\nasS'b'\n(dp2\nS'c'\nI3\nss.";

    #[test]
    fn the_same_arrays_come_out_of_every_container() {
        let expected = parsed(PICKLE).arrays;
        assert_eq!(expected["a"].to_f64().unwrap(), [1.5, 2.0]);
        assert_eq!(expected["b.c"].to_f64().unwrap(), [3.0]);
        let json = parsed(b" {\"a\": [1.5, 2], \"b\": {\"c\": 3}}");
        assert_eq!((json.container, json.arrays), (Container::Json, expected.clone()));
        let mut zlib = ZlibEncoder::new(Vec::new(), Compression::default());
        let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
        zlib.write_all(PICKLE).unwrap();
        gzip.write_all(PICKLE).unwrap();
        for packed in [zlib.finish().unwrap(), gzip.finish().unwrap()] {
            assert_eq!(parsed(&packed), ArrayFile { container: Container::Pickle, arrays: expected.clone() });
            // Cut short.
            assert!(ArrayFile::unpacked(&packed[..packed.len() / 2]).is_err());
        }
    }

    #[test]
    fn one_array_has_no_name() {
        let array = Array::from_f32(&[2, 1], vec![1.0, 2.0]);
        let npy = parsed(&npy_bytes(&array));
        assert_eq!((npy.container, npy.single()), (Container::Npy, Some(&array)));
        assert_eq!(parsed(b"[[1, 2], [3, 4]]").single().unwrap().shape, [2, 2]);
        assert_eq!(parsed(PICKLE).single(), None);
    }

    #[test]
    fn a_little_that_unpacks_to_much_is_refused() {
        let mut zlib = ZlibEncoder::new(Vec::new(), Compression::best());
        let zeros = vec![0; 1 << 20];
        (0..100).for_each(|_| zlib.write_all(&zeros).unwrap());
        let packed = zlib.finish().unwrap();
        assert!(matches!(ArrayFile::unpacked(&packed), Err(Fault::TooLarge { .. })));
    }

    #[test]
    fn what_is_not_read_is_named_with_the_way_out() {
        for (start, words) in [
            (&b"BZh91AY"[..], "bzip2"),
            (b"\x89HDF\r\n\x1a\n\0", "numpy.savez"),
            (b"Kaydara FBX Binary", "BVH"),
            (torch::LEGACY, "torch.save"),
        ] {
            let (found, remedy) = not_read(start).unwrap();
            assert!(format!("{found}; {remedy}").contains(words));
        }
        for unknown in [&b""[..], b"frame,x,y\n", b"\x00\x01", b"x"] {
            assert!(not_read(unknown).is_none() && ArrayFile::unpacked(unknown).unwrap().is_none(), "{unknown:?}");
        }
    }
}
