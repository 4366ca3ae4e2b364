//! Readers until those of `data` are merged.

use std::path::Path;

use npyz::npz::NpzArchive;

use crate::data::{Array, ArrayData, ArrayMap};
use crate::{Error, Result};

fn array<R: std::io::Read>(file: npyz::NpyFile<R>) -> Option<Array> {
    let shape: Vec<usize> = file.shape().iter().map(|extent| *extent as usize).collect();
    if file.header().order() != npyz::Order::C {
        return None;
    }
    let data = match file.dtype() {
        npyz::DType::Plain(kind) => match kind.to_string().as_str() {
            "<f8" => ArrayData::F64(file.into_vec().ok()?),
            "<f4" => ArrayData::F32(file.into_vec().ok()?),
            "<i8" => ArrayData::I64(file.into_vec().ok()?),
            "<u4" => ArrayData::I64(file.into_vec::<u32>().ok()?.into_iter().map(i64::from).collect()),
            _ => return None,
        },
        _ => return None,
    };
    Some(Array { shape, data })
}

pub(super) fn read_npz(path: &Path) -> Result<ArrayMap> {
    let mut archive = NpzArchive::open(path).map_err(Error::io(path))?;
    let names: Vec<String> = archive.array_names().map(str::to_owned).collect();
    let mut arrays = ArrayMap::new();
    for name in names {
        if let Some(array) = archive.by_name(&name).map_err(Error::io(path))?.and_then(array) {
            arrays.insert(name, array);
        }
    }
    Ok(arrays)
}

pub(super) fn read_npy(path: &Path) -> Result<Array> {
    Err(Error::Refused { path: path.to_path_buf(), found: "no reader yet".into() })
}

pub(super) fn read_pickle_arrays(path: &Path) -> Result<ArrayMap> {
    Err(Error::Refused { path: path.to_path_buf(), found: "no reader yet".into() })
}
