//! PLY meshes (Turk 1994): ascii and binary, either byte order.
//!
//! Read: vertex positions, normals (nx ny nz), colours (red green blue; uchar, or float in [0, 1]), texture coordinates
//! (s t, u v or texture_u texture_v, used with the `comment TextureFile` of MeshLab), faces as lists of any integer
//! type (polygons become fans). Everything else is skipped. A file without faces is a point cloud: a mesh with F = 0.
//!
//! Hostile files: every count is checked against the bytes that are left before anything is allocated.

mod body;
mod header;
mod read;
mod write;

pub use read::read_ply;
pub use write::write_ply;

#[cfg(test)]
mod tests;
