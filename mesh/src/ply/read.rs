//! PLY file -> mesh.

use std::path::Path;
use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::body::Body;
use super::header::{Element, Encoding, Header, Layout, Scalar, parse_header};
use crate::fault::{Fault, Parsed};
use crate::surface::unit_normal;
use crate::texture::read_referenced_texture;
use crate::{Colouring, TriangleMesh};
use xavatar_formats::{Result, read_bytes};

/// Reads a PLY file: positions in metres, unit normals, colours and texture where the file has them.
///
/// # Errors
/// [`Error::Io`]; [`Error::Malformed`] for a file that is cut short, inconsistent, or holds non-finite numbers;
/// [`Error::Missing`] for a texture image that is not there.
pub fn read_ply(path: impl AsRef<Path>) -> Result<TriangleMesh> {
    let path = path.as_ref();
    let bytes = read_bytes(path)?;
    let (mut mesh, texture) = parse_ply(&bytes).map_err(|fault| fault.in_file(path, "PLY"))?;
    if let Some((uvs, name)) = texture {
        let image = read_referenced_texture(path, "PLY", "comment TextureFile".into(), &name)?;
        mesh.colouring = Colouring::Texture { uvs, image: Arc::new(image) };
    }
    Ok(mesh)
}

/// Texture coordinates and the image they look up.
type Texture = (Vec<Vec2>, String);

/// The mesh in `bytes`, its vertex colours, and what it says of a texture.
pub(super) fn parse_ply(bytes: &[u8]) -> Parsed<(TriangleMesh, Option<Texture>)> {
    let Header { encoding, elements, texture_file, length } = parse_header(bytes)?;
    let mut body = Body::new(bytes, length, encoding);
    let mut vertices = None;
    let mut faces = Vec::new();
    for element in &elements {
        check_count(element, encoding, &body)?;
        match element.name.as_str() {
            "vertex" => vertices = Some(read_vertices(element, &mut body)?),
            "face" => faces = read_faces(element, &mut body)?,
            _ => {
                for _ in 0..element.count {
                    element.properties.iter().try_for_each(|p| body.skip(p.layout))?;
                }
            }
        }
    }
    let vertices = vertices.ok_or_else(|| Fault::new("the header", "no element `vertex`", "vertices"))?;
    let count = vertices.positions.len();
    if let Some(index) = faces.iter().flatten().find(|&&index| index as usize >= count) {
        return Err(Fault::new("element face", format!("vertex index {index}"), format!("less than {count}")));
    }
    let colouring = vertices.colours.map_or(Colouring::None, Colouring::Vertex);
    let mesh = TriangleMesh { vertices: vertices.positions, faces, normals: vertices.normals, colouring };
    Ok((mesh, vertices.uvs.zip(texture_file)))
}

fn check_count(element: &Element, encoding: Encoding, body: &Body) -> Parsed<()> {
    // One byte more than is left, because the last word of an ascii file needs no separator after it.
    let possible = (body.bytes_left() + 1) / element.smallest_row(encoding).max(1);
    if element.count > possible {
        let found = format!("{} rows of element {:?}", element.count, element.name);
        return Err(Fault::new("the header", found, format!("at most the {possible} that the file's size can hold")));
    }
    Ok(())
}

struct Vertices {
    positions: Vec<Vec3>,
    normals: Option<Vec<Vec3>>,
    colours: Option<Vec<[u8; 3]>>,
    uvs: Option<Vec<Vec2>>,
}

fn read_vertices(element: &Element, body: &mut Body) -> Parsed<Vertices> {
    let columns = |names: [&str; 3]| -> Option<[usize; 3]> {
        let [a, b, c] = names.map(|name| scalar_column(element, name));
        Some([a?, b?, c?])
    };
    let position = columns(["x", "y", "z"])
        .ok_or_else(|| Fault::new("element vertex", "without x, y, z", "the three coordinates as scalars"))?;
    let normal = columns(["nx", "ny", "nz"]);
    let colour = columns(["red", "green", "blue"]);
    let uv = [("s", "t"), ("u", "v"), ("texture_u", "texture_v")]
        .into_iter()
        .find_map(|(u, v)| scalar_column(element, u).zip(scalar_column(element, v)));
    let colour_scale = colour.map(|columns| colour_scale(element, columns)).transpose()?;

    let mut positions = Vec::with_capacity(element.count);
    let mut normals = normal.map(|_| Vec::with_capacity(element.count));
    let mut colours = colour.map(|_| Vec::with_capacity(element.count));
    let mut uvs = uv.map(|_| Vec::with_capacity(element.count));
    let mut row = vec![0.0; element.properties.len()];
    for index in 0..element.count {
        for (value, property) in row.iter_mut().zip(&element.properties) {
            match property.layout {
                Layout::Scalar(scalar) => *value = body.number(scalar)?,
                list => body.skip(list)?,
            }
        }
        let vector = |columns: [usize; 3], what: &str| finite_vector(columns.map(|c| row[c] as f32), what, index);
        positions.push(vector(position, "position")?);
        if let (Some(normals), Some(columns)) = (&mut normals, normal) {
            normals.push(unit_normal(vector(columns, "normal")?));
        }
        if let (Some(colours), Some(columns), Some(scale)) = (&mut colours, colour, colour_scale) {
            colours.push(byte_colour(columns.map(|c| row[c] * scale), index)?);
        }
        if let (Some(uvs), Some((u, v))) = (&mut uvs, uv) {
            uvs.push(vector([u, v, v], "texture coordinate")?.truncate());
        }
    }
    Ok(Vertices { positions, normals, colours, uvs })
}

fn scalar_column(element: &Element, name: &str) -> Option<usize> {
    element.properties.iter().position(|p| p.name == name && matches!(p.layout, Layout::Scalar(_)))
}

/// What brings a colour to 0..=255: bytes stay, real numbers are in [0, 1].
fn colour_scale(element: &Element, columns: [usize; 3]) -> Parsed<f64> {
    let kinds = columns.map(|c| element.properties[c].layout);
    match kinds[0] {
        Layout::Scalar(Scalar::U8) if kinds == [kinds[0]; 3] => Ok(1.0),
        Layout::Scalar(Scalar::F32 | Scalar::F64) if kinds == [kinds[0]; 3] => Ok(255.0),
        _ => Err(Fault::new("element vertex", format!("colours of types {kinds:?}"), "uchar, or float in [0, 1]")),
    }
}

fn byte_colour(colour: [f64; 3], index: usize) -> Parsed<[u8; 3]> {
    if colour.iter().all(|c| (0.0..=255.0).contains(c)) {
        return Ok(colour.map(|c| c.round() as u8));
    }
    let expected = "channels in 0..=255, or [0, 1] if real";
    Err(Fault::new(format!("vertex {index}"), format!("colour {colour:?}"), expected))
}

fn finite_vector(values: [f32; 3], what: &str, index: usize) -> Parsed<Vec3> {
    if values.iter().all(|v| v.is_finite()) {
        return Ok(Vec3::from(values));
    }
    Err(Fault::new(format!("vertex {index}"), format!("{what} {values:?}"), "finite numbers"))
}

fn read_faces(element: &Element, body: &mut Body) -> Parsed<Vec<[u32; 3]>> {
    let indices = ["vertex_indices", "vertex_index"].into_iter().find_map(|name| element.property(name));
    let Some(Layout::List { count, item }) = indices.map(|p| p.layout) else {
        let expected = "a list `vertex_indices` or `vertex_index`";
        return Err(Fault::new("element face", "without vertex indices", expected));
    };
    if !item.is_integer() {
        return Err(Fault::new("element face", "vertex indices that are real numbers", "integers"));
    }
    let indices = indices.map(|p| p.name.as_str());
    let mut faces = Vec::with_capacity(element.count);
    for _ in 0..element.count {
        for property in &element.properties {
            if Some(property.name.as_str()) == indices {
                read_polygon(count, item, body, &mut faces)?;
            } else {
                body.skip(property.layout)?;
            }
        }
    }
    Ok(faces)
}

/// Adds a polygon as the fan of triangles around its first corner.
fn read_polygon(count: Scalar, item: Scalar, body: &mut Body, faces: &mut Vec<[u32; 3]>) -> Parsed<()> {
    let position = body.position();
    let length = body.list_length(count, item)?;
    if length < 3 {
        return Err(Fault::new(Body::place(position), format!("a face of {length} vertices"), "at least 3"));
    }
    let (first, mut previous) = (read_index(item, body)?, read_index(item, body)?);
    for _ in 2..length {
        let next = read_index(item, body)?;
        faces.push([first, previous, next]);
        previous = next;
    }
    Ok(())
}

fn read_index(item: Scalar, body: &mut Body) -> Parsed<u32> {
    let position = body.position();
    let index = body.number(item)?;
    if (0.0..=f64::from(u32::MAX)).contains(&index) {
        return Ok(index as u32);
    }
    Err(Fault::new(Body::place(position), format!("vertex index {index}"), "zero or more"))
}
