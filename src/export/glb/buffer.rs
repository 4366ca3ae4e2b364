//! The binary part of a GLB: arrays one after the other, each with the view and the accessor that describe it.

use glam::Vec3;
use serde_json::{Value, json};

/// Component types, as glTF numbers them.
const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
/// What a view is for: vertex attributes, or their indices.
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Bytes, and the JSON of views and accessors.
#[derive(Default)]
pub(super) struct Buffer {
    pub(super) bytes: Vec<u8>,
    pub(super) views: Vec<Value>,
    pub(super) accessors: Vec<Value>,
}

impl Buffer {
    /// Vertex attributes of three floats, with their bounds.
    pub(super) fn positions(&mut self, values: &[Vec3]) -> usize {
        let view = self.floats(values.iter().flat_map(Vec3::to_array), Some(ARRAY_BUFFER));
        let (low, high) = bounds(values);
        self.accessor(json!({ "bufferView": view, "componentType": FLOAT, "count": values.len(), "type": "VEC3", "min": low, "max": high }))
    }

    /// Offsets of a morph target. Those that are mostly zero name only the others.
    pub(super) fn offsets(&mut self, values: &[Vec3]) -> usize {
        let moved: Vec<usize> = (0..values.len()).filter(|vertex| values[*vertex] != Vec3::ZERO).collect();
        // An entry by name takes 16 bytes, one in a row 12.
        if moved.is_empty() || moved.len() * 4 >= values.len() * 3 {
            return self.positions(values);
        }
        let indices: Vec<u8> = moved.iter().flat_map(|vertex| (*vertex as u32).to_le_bytes()).collect();
        let indices = self.view(&indices, None);
        let entries = self.floats(moved.iter().flat_map(|vertex| values[*vertex].to_array()), None);
        let (low, high) = bounds(values);
        self.accessor(json!({
            "componentType": FLOAT, "count": values.len(), "type": "VEC3", "min": low, "max": high,
            "sparse": {
                "count": moved.len(),
                // The offsets are those that are meant without them, but VTK wants them said.
                "indices": { "bufferView": indices, "byteOffset": 0, "componentType": UNSIGNED_INT },
                "values": { "bufferView": entries, "byteOffset": 0 },
            },
        }))
    }

    /// Vertex attributes of N floats.
    pub(super) fn attributes<const N: usize>(&mut self, values: impl ExactSizeIterator<Item = [f32; N]>) -> usize {
        let count = values.len();
        let view = self.floats(values.flatten(), Some(ARRAY_BUFFER));
        self.accessor(json!({ "bufferView": view, "componentType": FLOAT, "count": count, "type": format!("VEC{N}") }))
    }

    /// Joints of vertices, four each.
    pub(super) fn joints(&mut self, values: impl ExactSizeIterator<Item = [u8; 4]>) -> usize {
        let count = values.len();
        let view = self.view(&values.flatten().collect::<Vec<u8>>(), Some(ARRAY_BUFFER));
        self.accessor(json!({ "bufferView": view, "componentType": UNSIGNED_BYTE, "count": count, "type": "VEC4" }))
    }

    /// Opaque colours, linear, as shares of 65535.
    pub(super) fn colours(&mut self, values: impl ExactSizeIterator<Item = [u16; 3]>) -> usize {
        let count = values.len();
        let bytes: Vec<u8> = values.flat_map(|[r, g, b]| [r, g, b, u16::MAX]).flat_map(u16::to_le_bytes).collect();
        let view = self.view(&bytes, Some(ARRAY_BUFFER));
        self.accessor(json!({
            "bufferView": view, "componentType": UNSIGNED_SHORT, "normalized": true, "count": count, "type": "VEC4",
        }))
    }

    /// Vertex indices of triangles.
    pub(super) fn indices(&mut self, faces: &[[u32; 3]]) -> usize {
        let bytes: Vec<u8> = faces.iter().flatten().flat_map(|index| index.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(ELEMENT_ARRAY_BUFFER));
        self.accessor(
            json!({ "bufferView": view, "componentType": UNSIGNED_INT, "count": 3 * faces.len(), "type": "SCALAR" }),
        )
    }

    /// Matrices, column by column.
    pub(super) fn matrices(&mut self, values: impl ExactSizeIterator<Item = [f32; 16]>) -> usize {
        let count = values.len();
        let view = self.floats(values.flatten(), None);
        self.accessor(json!({ "bufferView": view, "componentType": FLOAT, "count": count, "type": "MAT4" }))
    }

    /// Key times, ascending.
    pub(super) fn times(&mut self, values: &[f32]) -> usize {
        let view = self.floats(values.iter().copied(), None);
        let bounds = values.first().zip(values.last());
        let (first, last) = bounds.map_or((0.0, 0.0), |(first, last)| (*first, *last));
        self.accessor(json!({
            "bufferView": view, "componentType": FLOAT, "count": values.len(), "type": "SCALAR", "min": [first], "max": [last],
        }))
    }

    /// Keys of an animation, `width` floats each; scalars if 1.
    pub(super) fn keys(&mut self, values: &[f32], width: usize) -> usize {
        let view = self.floats(values.iter().copied(), None);
        let kind = if width == 1 { "SCALAR".to_owned() } else { format!("VEC{width}") };
        self.accessor(
            json!({ "bufferView": view, "componentType": FLOAT, "count": values.len() / width, "type": kind }),
        )
    }

    /// Bytes that no accessor describes; the view.
    pub(super) fn file(&mut self, bytes: &[u8]) -> usize {
        self.view(bytes, None)
    }

    fn floats(&mut self, values: impl Iterator<Item = f32>, target: Option<u32>) -> usize {
        let bytes: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
        self.view(&bytes, target)
    }

    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.bytes.extend(bytes);
        // Every array begins where any component type may.
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}

fn bounds(values: &[Vec3]) -> ([f32; 3], [f32; 3]) {
    let corner = |fold: fn(Vec3, Vec3) -> Vec3| values.iter().copied().reduce(fold).unwrap_or_default().to_array();
    (corner(Vec3::min), corner(Vec3::max))
}
