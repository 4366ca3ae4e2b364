//! GLB meshes: glTF 2.0 in one binary file (Khronos 2021), everything of its scene as one mesh.
//!
//! Read: triangles, strips and fans with POSITION, NORMAL, TEXCOORD_n and COLOR_0, under the transforms of their nodes and skins as
//! they stand in the file; base colours of materials (pictures in the file or beside it, factors, KHR_texture_transform, the older
//! KHR_materials_pbrSpecularGlossiness); KHR_mesh_quantization. Vertex colours and factors are linear in glTF and become sRGB.
//! Refused by name: Draco and meshopt compression. Points, lines and morph targets are noted.
//!
//! Hostile files: all of a file's indices are checked, its nodes have to be a forest, and instances cannot make more vertices and
//! faces than the file has bytes.

mod accessor;
mod container;
mod document;
mod material;
mod node;
mod read;

pub(super) use read::read_glb;

#[cfg(test)]
mod tests;
