//! Untrusted bytes to arrays, tensors and pictures, and files written whole or not at all. Knows nothing of bodies or avatars.
//!
//! | file | read by |
//! |---|---|
//! | npy, npz | [`read_npy`], [`read_npz`]; written by [`write_npz`] |
//! | pickle, of every protocol | [`read_pickle`], [`read_pickle_arrays`]: a machine with an allow-list that runs nothing that is in the file |
//! | PyTorch checkpoint | [`read_torch`] |
//! | any of these and JSON, by what it begins with, compressed or not | [`ArrayFile`] |
//! | safetensors | [`TensorFile`] |
//! | a folder, a zip archive or a .tgz, as named files | [`FileTree`] |
//! | PNG, JPEG, TIFF, BMP, TGA | [`read_picture`] |
//!
//! Files are opened by [`open_file`], which refuses pipes and devices, and read on a budget of memory in proportion to their size.
//! What messages quote of them goes through [`Shown`], which leaves nothing that steers a terminal.
//!
//! Readers of bytes return a [`Fault`], which names place, finding and expectation; readers of paths an [`Error`], which names the
//! file as well. Every crate below training shares this [`Error`]: what a user gave, and what is wrong with it.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod array;
mod array_file;
mod atomic_file;
mod budget;
mod element;
mod error;
mod fault;
mod file_tree;
mod input_file;
mod jpeg;
mod npy;
mod npz;
mod output_folder;
mod pickle;
mod picture_file;
mod remedy;
mod shown;
mod tarball;
mod tensor_file;
mod text;
mod torch;

pub use array::{Array, ArrayData, ArrayMap};
pub use array_file::{ArrayFile, Container};
pub use atomic_file::write_atomically;
pub use element::element_count;
pub use error::{Error, MemoryLimit, Result};
pub use fault::{Fault, excerpt};
pub use file_tree::FileTree;
pub use input_file::{open_file, read_bytes, read_text};
pub use npy::{npy_bytes, parse_npy, read_npy};
pub use npz::{parse_npz, read_npz, write_npz};
pub use output_folder::{FolderLock, create_folder, is_vacant, remove_partial};
pub use pickle::{
    Value, parse_pickle, parse_pickle_arrays, read_pickle, read_pickle_arrays, write_pickle, write_pickle_array,
};
pub use picture_file::{PICTURE_FORMATS, decode_picture, guarded, read_picture, write_picture};
pub use remedy::{Choice, Remedy};
pub use shown::{Shown, harmless};
pub use tensor_file::{NamedTensors, TensorFile};
pub use text::decode_text;
pub use torch::{parse_torch, read_torch};
