//! Mesh -> binary little-endian PLY.

use std::io::Write;
use std::path::Path;

use crate::texture::write_texture;
use crate::{Colouring, TriangleMesh};
use xavatar_formats::{Result, write_atomically};

/// Writes a binary little-endian PLY with the mesh's normals and colours; it appears whole or not at all.
///
/// A textured mesh gets coordinates `s t` and its image beside it, under the same name with `.png`, referred to by
/// `comment TextureFile` as MeshLab does.
///
/// # Errors
/// [`Error::Value`](xavatar_formats::Error::Value) for a mesh that [`TriangleMesh::check`] refuses; [`Error::Io`](xavatar_formats::Error::Io).
pub fn write_ply(path: impl AsRef<Path>, mesh: &TriangleMesh) -> Result<()> {
    let path = path.as_ref();
    mesh.check()?;
    let texture = match &mesh.colouring {
        Colouring::Texture { image, .. } => {
            let texture = path.with_extension("png");
            write_texture(&texture, image)?;
            texture.file_name().map(|name| name.to_string_lossy().into_owned())
        }
        Colouring::None | Colouring::Vertex(_) => None,
    };
    write_atomically(path, |writer| {
        writer.write_all(header(mesh, texture.as_deref()).as_bytes())?;
        write_body(writer, mesh)
    })
}

fn header(mesh: &TriangleMesh, texture: Option<&str>) -> String {
    let mut lines = vec!["ply".to_owned(), "format binary_little_endian 1.0".into()];
    lines.extend(texture.map(|name| format!("comment TextureFile {name}")));
    lines.push(format!("element vertex {}", mesh.vertices.len()));
    let mut properties = |kind: &str, names: &[&str]| {
        lines.extend(names.iter().map(|name| format!("property {kind} {name}")));
    };
    properties("float", &["x", "y", "z"]);
    if mesh.normals.is_some() {
        properties("float", &["nx", "ny", "nz"]);
    }
    match mesh.colouring {
        Colouring::None => {}
        Colouring::Vertex(_) => properties("uchar", &["red", "green", "blue"]),
        Colouring::Texture { .. } => properties("float", &["s", "t"]),
    }
    lines.push(format!("element face {}", mesh.faces.len()));
    lines.push("property list uchar int vertex_indices".into());
    lines.push("end_header\n".into());
    lines.join("\n")
}

fn write_body(writer: &mut impl Write, mesh: &TriangleMesh) -> std::io::Result<()> {
    for (index, vertex) in mesh.vertices.iter().enumerate() {
        write_floats(writer, &vertex.to_array())?;
        if let Some(normals) = &mesh.normals {
            write_floats(writer, &normals[index].to_array())?;
        }
        match &mesh.colouring {
            Colouring::None => {}
            Colouring::Vertex(colours) => writer.write_all(&colours[index])?,
            Colouring::Texture { uvs, .. } => write_floats(writer, &uvs[index].to_array())?,
        }
    }
    for face in &mesh.faces {
        writer.write_all(&[3])?;
        face.iter().try_for_each(|index| writer.write_all(&index.to_le_bytes()))?;
    }
    Ok(())
}

fn write_floats(writer: &mut impl Write, values: &[f32]) -> std::io::Result<()> {
    values.iter().try_for_each(|value| writer.write_all(&value.to_le_bytes()))
}
