//! OBJ file -> mesh.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{Vec2, Vec3};
use image::RgbImage;

use super::parse::{Corner, Statements, parse_mtl, parse_obj};
use crate::fault::{Fault, Parsed};
use crate::texture::{read_referenced_texture, referenced_file};
use crate::{Colouring, TriangleMesh};
use xavatar_formats::{Error, Result, read_bytes};

/// Reads an OBJ file, and the MTL and image it refers to if its faces have texture coordinates.
///
/// # Errors
/// [`Error::Io`]; [`Error::Malformed`] for a file that does not follow the format; [`Error::Missing`] for an MTL or image
/// that is not there; [`Error::Mismatch`] if faces use more than one texture.
pub fn read_obj(path: impl AsRef<Path>) -> Result<TriangleMesh> {
    let path = path.as_ref();
    let bytes = read_bytes(path)?;
    // Only names of materials and files can be other than ASCII.
    let statements = parse_obj(&String::from_utf8_lossy(&bytes)).map_err(|fault| fault.in_file(path, "OBJ"))?;
    let has_uvs = statements.triangles.iter().flatten().any(|corner| corner.uv.is_some());
    let texture = if has_uvs { read_texture(path, &statements)? } else { None };
    assemble(statements, texture).map_err(|fault| fault.in_file(path, "OBJ"))
}

/// The one image that all faces use; `None` if they use none.
fn read_texture(path: &Path, statements: &Statements) -> Result<Option<RgbImage>> {
    let mut texture_of_material: HashMap<String, (PathBuf, usize, String)> = HashMap::new();
    for (line, name) in &statements.material_files {
        let file = referenced_file(path, "OBJ", format!("line {line}"), name)?;
        if !file.exists() {
            return Err(Error::Missing {
                what: "material file".into(),
                remedy: format!("put it there, or remove `mtllib` from {}", path.display()),
                path: file,
            });
        }
        let bytes = read_bytes(&file)?;
        let textures = parse_mtl(&String::from_utf8_lossy(&bytes)).map_err(|fault| fault.in_file(&file, "MTL"))?;
        texture_of_material
            .extend(textures.into_iter().map(|(name, (line, texture))| (name, (file.clone(), line, texture))));
    }
    let texture_of = |material: &Option<String>| texture_of_material.get(material.as_ref()?);
    let used: BTreeSet<_> = statements.used_materials.iter().map(texture_of).collect();
    match used.iter().collect::<Vec<_>>()[..] {
        [] | [None] => Ok(None),
        [Some((file, line, texture))] => {
            read_referenced_texture(file, "MTL", format!("line {line}"), texture).map(Some)
        }
        _ => Err(Error::Mismatch {
            path: path.into(),
            found: format!("faces of {} different textures or none", used.len()),
            expected: "one texture for all faces".into(),
            remedy: "bake the materials into one image".into(),
        }),
    }
}

/// Vertices out of corners. Without a texture, coordinates do not split vertices.
pub(super) fn assemble(statements: Statements, texture: Option<RgbImage>) -> Parsed<TriangleMesh> {
    let Statements { positions, colours, uvs, normals, mut triangles, .. } = statements;
    let has_normals = !triangles.is_empty() && triangles.iter().flatten().all(|corner| corner.normal.is_some());
    for corner in triangles.iter_mut().flatten() {
        if texture.is_none() {
            corner.uv = None;
        } else if corner.uv.is_none() {
            return Err(Fault::new("f", "a corner without vt", "vt at all corners, as the faces have a texture"));
        }
        if !has_normals {
            corner.normal = None;
        }
    }

    let source_count = positions.len();
    let mut kinds: Vec<Option<Corner>> = vec![None; source_count];
    let mut split: HashMap<Corner, u32> = HashMap::new();
    let mut vertex_of = |corner: Corner| -> u32 {
        let first = kinds[corner.position as usize].get_or_insert(corner);
        if *first == corner {
            return corner.position;
        }
        *split.entry(corner).or_insert_with(|| {
            kinds.push(Some(corner));
            kinds.len() as u32 - 1
        })
    };
    let faces = triangles.into_iter().map(|corners| corners.map(&mut vertex_of)).collect();
    let source = |vertex: usize| kinds[vertex].map_or(vertex, |corner| corner.position as usize);
    let all = || 0..kinds.len();
    let uv_of = |vertex: usize| kinds[vertex].and_then(|c| c.uv).map_or(Vec2::ZERO, |uv| uvs[uv as usize]);
    let normal_of = |vertex: usize| kinds[vertex].and_then(|c| c.normal).map_or(Vec3::ZERO, |n| normals[n as usize]);
    let colouring = match texture {
        Some(image) => Colouring::Texture { uvs: all().map(uv_of).collect(), image: Arc::new(image) },
        None if colours.is_empty() => Colouring::None,
        None => Colouring::Vertex(all().map(|v| colours[source(v)]).collect()),
    };
    Ok(TriangleMesh {
        vertices: all().map(|v| positions[source(v)]).collect(),
        faces,
        normals: has_normals.then(|| all().map(normal_of).collect()),
        colouring,
    })
}
