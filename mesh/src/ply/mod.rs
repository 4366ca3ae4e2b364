//! PLY meshes (Turk 1994): ascii, one row a line, and binary, either byte order.
//!
//! Read: vertex positions, normals (nx ny nz), colours (red green blue, also as r g b or diffuse_red ..., in bytes, 16 bits or real
//! numbers), texture coordinates (s t, u v or texture_u texture_v); faces as lists of any integer type (polygons become fans), their
//! colours, their texture coordinates (texcoord) and the picture of each (texnumber, of the lines `comment TextureFile` of MeshLab);
//! strips of triangles. Texture comes before the colours of vertices, and these before those of faces. Names may be of any case.
//! Other elements are noted. A file without faces is a point cloud: a mesh with F = 0.
//!
//! Hostile files: every count is checked against the bytes that are left before anything is allocated.

mod body;
mod faces;
mod header;
mod read;
mod vertices;
mod write;

pub(super) use read::read_ply;
pub use write::write_ply;

#[cfg(test)]
mod tests;
