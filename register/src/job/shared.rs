//! `clothing.npz`: what all frames of a subject share, its shape and its clothing.

use std::path::Path;

use xavatar_formats::{Array, ArrayData, ArrayMap, Error, Result, read_npz, write_npz};

use crate::fit::{Clothing, Fitter, Shaped};

/// The file.
pub const CLOTHING_FILE: &str = "clothing.npz";

/// Writes shape (S) and, for each fitted vertex (N), its number in the model, its clothing's thickness and spread, metres.
///
/// # Errors
/// [`Error::Io`].
pub fn write(folder: &Path, fitter: &Fitter<'_>, shaped: &Shaped) -> Result<()> {
    let numbers = |values: &[f64]| Array { shape: vec![values.len()], data: ArrayData::F64(values.to_vec()) };
    let vertices: Vec<i64> = fitter.surface.vertices.iter().map(|vertex| *vertex as i64).collect();
    let arrays = ArrayMap::from([
        ("betas".to_owned(), numbers(&shaped.shape)),
        ("offset".to_owned(), numbers(&shaped.clothing.thickness)),
        ("spread".to_owned(), numbers(&shaped.clothing.spread)),
        ("vertices".to_owned(), Array { shape: vec![vertices.len()], data: ArrayData::I64(vertices) }),
    ]);
    write_npz(folder.join(CLOTHING_FILE), &arrays)
}

/// Reads it, if it is there.
///
/// # Errors
/// [`Error::Mismatch`] if it is of another body; [`Error::Malformed`] or [`Error::Io`].
pub fn read(folder: &Path, fitter: &Fitter<'_>, bare: bool) -> Result<Option<Shaped>> {
    let path = folder.join(CLOTHING_FILE);
    if !path.is_file() {
        return Ok(None);
    }
    let arrays = read_npz(&path)?;
    let numbers =
        |name: &str, count: usize| arrays.get(name).and_then(Array::to_f64).filter(|values| values.len() == count);
    let count = fitter.surface.len();
    let read = (numbers("betas", fitter.linkage.extents().shapes), numbers("offset", count), numbers("spread", count));
    let (Some(shape), Some(thickness), Some(spread)) = read else {
        return Err(Error::Mismatch {
            path,
            found: "clothing of another body model".into(),
            expected: format!("{count} vertices of {}", fitter.model.path().display()),
            remedy: "give the body that the registration was begun with, or a new folder".into(),
        });
    };
    let clothing = Clothing::assumed(fitter, bare).measured(thickness, spread);
    Ok(Some(Shaped { shape, clothing }))
}
