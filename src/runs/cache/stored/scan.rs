//! A scan as arrays; absent ones for what it does not have.

use std::sync::Arc;

use glam::Vec2;

use super::{Stored, picture_array, rows};
use crate::body::BodyParameters;
use crate::data::{FrameId, ScanFrame};
use crate::formats::{Array, ArrayData, ArrayMap, Result};
use crate::mesh::{Colouring, TriangleMesh};

/// Names of parts that the scan does not show, a line each; absent if it shows all.
const UNSEEN: &str = "unseen_parts";

pub(super) fn to_arrays(frame: &ScanFrame) -> ArrayMap {
    let scan = &frame.scan;
    let faces = scan.faces.iter().flatten().map(|index| i64::from(*index)).collect();
    let mut arrays = ArrayMap::from([
        ("vertices".to_owned(), rows(scan.vertices.iter().copied())),
        ("faces".to_owned(), Array { shape: vec![scan.faces.len(), 3], data: ArrayData::I64(faces) }),
    ]);
    if !frame.unseen_parts.is_empty() {
        arrays.insert(UNSEEN.to_owned(), Array::from_text(frame.unseen_parts.join("\n")));
    }
    if let Some(normals) = &scan.normals {
        arrays.insert("normals".to_owned(), rows(normals.iter().copied()));
    }
    match &scan.colouring {
        Colouring::None => {}
        Colouring::Vertex(colours) => {
            let data = ArrayData::U8(colours.as_flattened().to_vec());
            arrays.insert("colours".to_owned(), Array { shape: vec![colours.len(), 3], data });
        }
        Colouring::Texture { uvs, image } => {
            let flat = uvs.iter().flat_map(|uv| uv.to_array()).collect();
            arrays.insert("uvs".to_owned(), Array::from_f32(&[uvs.len(), 2], flat));
            arrays.insert("atlas".to_owned(), picture_array(image));
        }
    }
    arrays
}

pub(super) fn of(stored: &Stored, id: FrameId, parameters: BodyParameters) -> Result<ScanFrame> {
    let vertices = stored.points("vertices")?;
    let faces = stored.indices("faces", vertices.len())?;
    let colouring = if stored.has("atlas") {
        let uvs = stored.floats("uvs")?.as_chunks().0.iter().copied().map(Vec2::from_array).collect();
        Colouring::Texture { uvs, image: Arc::new(stored.picture("atlas")?) }
    } else if stored.has("colours") {
        Colouring::Vertex(stored.bytes("colours")?.as_chunks().0.to_vec())
    } else {
        Colouring::None
    };
    let normals = stored.has("normals").then(|| stored.points("normals")).transpose()?;
    let scan = TriangleMesh { vertices, faces: faces.as_chunks().0.to_vec(), normals, colouring };
    scan.check()?;
    let unseen = stored.arrays.get(UNSEEN).and_then(Array::text);
    let unseen_parts = unseen.into_iter().flat_map(str::lines).map(str::to_owned).collect();
    Ok(ScanFrame { id, scan, parameters, unseen_parts, notes: Vec::new() })
}
