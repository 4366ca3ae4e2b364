//! Wavefront OBJ meshes, with the pictures or colours of their materials (MTL `map_Kd`, `Kd`), or colours after the coordinates
//! (`v x y z r g b`).
//!
//! Read: v, vt, vn, f (polygons become fans; indices from the end too), usemtl, mtllib; everything else is skipped. Pictures come
//! before the colours of vertices, and these before `Kd`, which counts only where it tells faces apart or is no grey: exporters
//! write a grey where they know no colour. MTL files and pictures that are not there are noted, not errors.

mod material;
mod parse;
mod read;
mod write;

pub(super) use read::read_obj;
pub use write::write_obj;

#[cfg(test)]
mod tests;
