//! Mesh -> OBJ, with MTL and PNG if it is textured.

use std::io::Write;
use std::path::Path;

use crate::texture::write_texture;
use crate::{Colouring, TriangleMesh};
use xavatar_formats::{Error, Result, write_atomically};

/// Diffuse light alone: what a file leaves unsaid, readers take to be half glossy, and skin shines as if wet. Ambient light would come on top
/// of a scan's own.
const MATT: &str = "newmtl surface\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nNs 0\nd 1\nillum 1\n";

/// Writes an OBJ file; a textured mesh gets an MTL and a PNG of the same name beside it. Numbers are written so that
/// reading them gives the same bits. Each file appears whole or not at all, the OBJ last.
///
/// # Errors
/// [`Error::Value`] for a mesh that [`TriangleMesh::check`] refuses, or a file name that is not text; [`Error::Io`].
pub fn write_obj(path: impl AsRef<Path>, mesh: &TriangleMesh) -> Result<()> {
    let path = path.as_ref();
    mesh.check()?;
    let material = match &mesh.colouring {
        Colouring::Texture { image, .. } => Some(write_material(path, image)?),
        Colouring::None | Colouring::Vertex(_) => None,
    };
    write_atomically(path, |writer| write_statements(writer, mesh, material.as_deref()))
}

/// The name of the material file.
fn write_material(path: &Path, image: &image::RgbImage) -> Result<String> {
    let beside = |extension: &str| {
        let file = path.with_extension(extension);
        match file.file_name().and_then(|name| name.to_str()).map(str::to_owned) {
            Some(name) => Ok((file, name)),
            None => Err(Error::Value {
                name: "file name".into(),
                found: path.display().to_string(),
                expected: "text, as the OBJ has to name its material".into(),
            }),
        }
    };
    let (image_file, image_name) = beside("png")?;
    let (material_file, material_name) = beside("mtl")?;
    write_texture(&image_file, image)?;
    write_atomically(&material_file, |writer| writeln!(writer, "{MATT}map_Kd {image_name}"))?;
    Ok(material_name)
}

fn write_statements(writer: &mut impl Write, mesh: &TriangleMesh, material: Option<&str>) -> std::io::Result<()> {
    if let Some(material) = material {
        writeln!(writer, "mtllib {material}\nusemtl surface")?;
    }
    for (index, vertex) in mesh.vertices.iter().enumerate() {
        write!(writer, "v {} {} {}", vertex.x, vertex.y, vertex.z)?;
        match &mesh.colouring {
            Colouring::Vertex(colours) => {
                let [r, g, b] = colours[index].map(|c| f32::from(c) / 255.0);
                writeln!(writer, " {r} {g} {b}")?;
            }
            Colouring::None | Colouring::Texture { .. } => writeln!(writer)?,
        }
    }
    if let Colouring::Texture { uvs, .. } = &mesh.colouring {
        uvs.iter().try_for_each(|uv| writeln!(writer, "vt {} {}", uv.x, uv.y))?;
    }
    for normal in mesh.normals.iter().flatten() {
        writeln!(writer, "vn {} {} {}", normal.x, normal.y, normal.z)?;
    }
    for face in &mesh.faces {
        write!(writer, "f")?;
        for vertex in face.map(|v| u64::from(v) + 1) {
            match (material.is_some(), mesh.normals.is_some()) {
                (false, false) => write!(writer, " {vertex}")?,
                (true, false) => write!(writer, " {vertex}/{vertex}")?,
                (false, true) => write!(writer, " {vertex}//{vertex}")?,
                (true, true) => write!(writer, " {vertex}/{vertex}/{vertex}")?,
            }
        }
        writeln!(writer)?;
    }
    Ok(())
}
