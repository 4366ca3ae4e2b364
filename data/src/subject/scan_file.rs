//! A frame's scan in a file: a pickle with its texture atlas, or a mesh of any format.

use std::path::Path;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use image::RgbImage;

use crate::fields::Fields;
use xavatar_formats::{
    Array, ArrayData, ArrayMap, Choice, Error, Remedy, Result, Value, read_pickle, read_pickle_arrays,
};
use xavatar_mesh::{Colouring, ReadMesh, TriangleMesh, read_mesh};

const FORMAT: &str = "scan";

/// Reads a scan: every number finite, every index in range, every length consistent, at least one face.
///
/// # Errors
/// [`Error::Missing`], [`Error::Malformed`], [`Error::Refused`]; [`Error::Mismatch`] for a scan without faces.
pub(super) fn read_scan(path: &Path) -> Result<ReadMesh> {
    let is_pickle = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("pkl"));
    let read = if is_pickle { ReadMesh { mesh: pickled(path)?, notes: Vec::new() } } else { read_mesh(path)? };
    let scan = &read.mesh;
    scan.check().map_err(|error| in_scan(error, path))?;
    if scan.faces.is_empty() {
        return Err(Error::Mismatch {
            path: path.into(),
            found: format!("a scan of {} vertices and no faces", scan.vertices.len()),
            expected: "a surface".into(),
            remedy: Remedy::choosing(Choice::SkipBadFrames, "leave the frame out or export it again"),
        });
    }
    Ok(read)
}

/// A raw scan: `vertices` (V, 3), `normals` (V, 3), `faces` (F, 3), and `uvs` (V, 2) with an atlas (height, width, 3) in a file of
/// its own, or `colors` (V, 3 or 4).
fn pickled(path: &Path) -> Result<TriangleMesh> {
    let arrays = read_pickle_arrays(path)?;
    let fields = Fields { path, format: FORMAT, arrays: &arrays };
    let vertices = points(&fields.rows("vertices", 3)?);
    let normals = match arrays.contains_key("normals") {
        true => Some(points(&fields.rows("normals", 3)?).into_iter().map(Vec3::normalize_or_zero).collect()),
        false => None,
    };
    let faces = fields.array("faces")?;
    let corners = faces.to_indices(vertices.len()).filter(|_| matches!(faces.shape[..], [_, 3]));
    let corners = corners.ok_or_else(|| {
        let expected = format!("indices below {} in 3 columns", vertices.len());
        fields.malformed("faces", faces.description(), expected)
    })?;
    let colouring = colouring(path, &fields, vertices.len())?;
    Ok(TriangleMesh { faces: corners.as_chunks::<3>().0.to_vec(), vertices, normals, colouring })
}

fn colouring(path: &Path, fields: &Fields<'_>, vertices: usize) -> Result<Colouring> {
    let atlas = atlas_of(path);
    if fields.arrays.contains_key("uvs") && atlas.is_file() {
        let uvs = fields.rows("uvs", 2)?;
        // Texels past the border do not exist; some raw coordinates lie there by rounding.
        let uvs = uvs.as_chunks::<2>().0.iter().map(|&uv| Vec2::from(uv).clamp(Vec2::ZERO, Vec2::ONE)).collect();
        return Ok(Colouring::Texture { uvs, image: Arc::new(read_atlas(&atlas)?) });
    }
    match vertex_colours(fields.arrays, vertices) {
        Some(colours) => Ok(Colouring::Vertex(colours)),
        None if fields.arrays.contains_key("uvs") => Err(Error::Missing {
            path: atlas,
            what: "the scan's texture atlas".into(),
            remedy: Remedy::choosing(Choice::SkipBadFrames, "complete the data set, or leave the frame out"),
        }),
        None => Ok(Colouring::None),
    }
}

/// `atlas-f00001.pkl` of `mesh-f00001.pkl`.
fn atlas_of(scan: &Path) -> std::path::PathBuf {
    let name = scan.file_name().map(|name| name.to_string_lossy().replacen("mesh", "atlas", 1)).unwrap_or_default();
    scan.with_file_name(name)
}

/// Colours of 0 to 255, or of 0 to 1, one a vertex.
fn vertex_colours(arrays: &ArrayMap, vertices: usize) -> Option<Vec<[u8; 3]>> {
    let array: &Array = arrays.get("colors")?;
    let &[rows, width @ (3 | 4)] = array.shape.as_slice() else { return None };
    let values = array.to_f32().filter(|values| rows == vertices && values.iter().all(|value| value.is_finite()))?;
    let is_whole =
        matches!(array.data, ArrayData::U8(_) | ArrayData::I64(_)) || values.iter().any(|value| *value > 1.0);
    let factor = if is_whole { 1.0 } else { 255.0 };
    let colour = |row: &[f32]| std::array::from_fn(|channel| (row[channel] * factor).round().clamp(0.0, 255.0) as u8);
    Some(values.chunks_exact(width).map(colour).collect())
}

fn points(values: &[f32]) -> Vec<Vec3> {
    values.as_chunks::<3>().0.iter().map(|&point| point.into()).collect()
}

fn read_atlas(path: &Path) -> Result<RgbImage> {
    let malformed = |found: String| Error::Malformed {
        path: path.into(),
        format: "texture atlas",
        place: "top level".into(),
        found,
        expected: "u8 (height, width, 3)".into(),
    };
    let Value::Array(array) = read_pickle(path)? else {
        return Err(malformed("no array".into()));
    };
    let image = match (&array.shape[..], &array.data) {
        (&[height, width, 3], ArrayData::U8(texels)) if !texels.is_empty() => {
            let extents = u32::try_from(width).ok().zip(u32::try_from(height).ok());
            extents.and_then(|(width, height)| RgbImage::from_raw(width, height, texels.clone()))
        }
        _ => None,
    };
    image.ok_or_else(|| malformed(array.description()))
}

/// A mesh's own complaint, which knows no file, as one about the scan's file.
fn in_scan(error: Error, path: &Path) -> Error {
    match error {
        Error::Value { name, found, expected } => {
            Error::Malformed { path: path.into(), format: FORMAT, place: name, found, expected }
        }
        other => other,
    }
}
