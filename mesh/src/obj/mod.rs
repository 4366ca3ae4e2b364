//! Wavefront OBJ meshes, with one texture (MTL `map_Kd`, PNG or JPEG) or colours after the coordinates (`v x y z r g b`).
//!
//! Read: v, vt, vn, f (polygons become fans; indices from the end too), usemtl, mtllib; everything else is skipped. A vertex
//! whose corners differ in vt or vn is split: the first kind keeps the vertex's number, the others follow after the last,
//! so topologies survive. MTL and image are opened only for faces that have texture coordinates.

mod parse;
mod read;
mod write;

pub use read::read_obj;
pub use write::write_obj;

#[cfg(test)]
mod tests;
