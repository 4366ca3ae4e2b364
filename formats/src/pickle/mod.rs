//! Python pickles, protocols 0 to 5, read by an allow-list interpreter that runs nothing.
//!
//! A pickle is a program for a stack machine that may call any Python function. [`machine`] executes only the
//! opcodes that build plain data; the few callables that numpy, scipy, chumpy and joblib put into data files are known by name
//! in [`callables`] and re-done in Rust; anything else that would be called is refused by its name. Memory is bounded
//! by the file's [`Budget`], nesting by [`value::MAX_DEPTH`], so cycles and "billion laughs" are errors.
//!
//! Persistent ids lead to a PyTorch archive's storages ([`tensors`]), or to numbers packed beside them ([`packed_storage`]), and are
//! refused elsewhere; so are out-of-band buffers.

mod callables;
mod cursor;
mod flatten;
mod literals;
mod machine;
mod node;
mod object;
mod packed_storage;
mod tensors;
mod value;
mod write;

use std::path::Path;

pub use value::Value;
pub use write::{write_pickle, write_pickle_array};

pub(super) use flatten::flatten;
pub(super) use tensors::Storages;

use crate::budget::Budget;
use crate::fault::Fault;
use crate::input_file::read_bytes;
use crate::{ArrayMap, Result};
use machine::{Machine, Outside};

const FORMAT: &str = "pickle";

/// Reads a pickle of plain data: numbers, text, arrays, and lists, tuples and dicts of these.
///
/// # Errors
/// [`Error::Refused`](crate::Error::Refused) names the callable if the pickle asks for one that is not on the allow-list, such as
/// `os.system`; [`Error::Malformed`](crate::Error::Malformed) names the byte offset where a pickle breaks off or goes wrong.
pub fn read_pickle(path: impl AsRef<Path>) -> Result<Value> {
    let path = path.as_ref();
    parse_pickle(&read_bytes(path)?).map_err(|fault| fault.in_file(path, FORMAT))
}

/// Reads a pickled dict of arrays, as body models and frames are stored.
///
/// Numbers become arrays without extents, nested lists of numbers arrays, strings text; the entries of a dict inside
/// the dict are named `outer.inner`, those of a list of dicts `outer[0].inner`. What has no array form (`None`, lists of different lengths) is left out.
///
/// # Errors
/// As [`read_pickle`]; [`Error::Malformed`](crate::Error::Malformed) too if the pickle is not a dict.
pub fn read_pickle_arrays(path: impl AsRef<Path>) -> Result<ArrayMap> {
    let path = path.as_ref();
    parse_pickle_arrays(&read_bytes(path)?).map_err(|fault| fault.in_file(path, FORMAT))
}

/// The data of a pickle's bytes.
///
/// # Errors
/// As [`read_pickle`], without the file's name.
pub fn parse_pickle(bytes: &[u8]) -> std::result::Result<Value, Fault> {
    interpret(bytes, &Budget::of_file(bytes.len()))
}

/// The arrays of a pickled dict's bytes.
///
/// # Errors
/// As [`read_pickle_arrays`], without the file's name.
pub fn parse_pickle_arrays(bytes: &[u8]) -> std::result::Result<ArrayMap, Fault> {
    let budget = Budget::of_file(bytes.len());
    let value = interpret(bytes, &budget)?;
    if !matches!(value, Value::Dict(_)) {
        return Err(Fault::malformed("top level", value.kind(), "a dict of arrays"));
    }
    let mut arrays = ArrayMap::new();
    flatten("", value, &budget, &mut arrays)?;
    Ok(arrays)
}

/// Interprets the bytes of a pickle that stands in a larger file.
pub(super) fn interpret(bytes: &[u8], budget: &Budget) -> std::result::Result<Value, Fault> {
    Machine::new(bytes, Outside::Nowhere, budget).run()
}

/// Interprets the pickle of an archive whose tensors' numbers are in `storages`.
pub(super) fn interpret_with_tensors(
    bytes: &[u8],
    storages: &Storages<'_>,
    budget: &Budget,
) -> std::result::Result<Value, Fault> {
    Machine::new(bytes, Outside::Members(storages), budget).run()
}
