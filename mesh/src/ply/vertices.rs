//! The vertices of a PLY file.

use glam::{Vec2, Vec3};

use super::body::Body;
use super::header::{Element, Layout};
use crate::Parsed;
use crate::colours::byte_colours;
use crate::surface::unit_normal;
use xavatar_formats::Fault;

/// V vertices.
#[derive(Default)]
pub(super) struct Vertices {
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Option<Vec<Vec3>>,
    /// Where they are known.
    pub(super) colours: Option<Vec<Option<[u8; 3]>>>,
    /// Not finite where the file's are not.
    pub(super) uvs: Option<Vec<Vec2>>,
}

pub(super) fn read_vertices(element: &Element, body: &mut Body) -> Parsed<Vertices> {
    const UVS: [[&str; 2]; 4] = [["s", "t"], ["u", "v"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];
    let position = element
        .scalars(["x", "y", "z"])
        .ok_or_else(|| Fault::malformed("element vertex", "without x, y, z", "the three coordinates as scalars"))?;
    let normal = element.scalars(["nx", "ny", "nz"]);
    let colour = element.colour();
    let uv = UVS.into_iter().find_map(|names| element.scalars(names));

    let mut positions = Vec::with_capacity(element.count);
    let mut normals = normal.map(|_| Vec::with_capacity(element.count));
    let mut colours = colour.map(|_| Vec::with_capacity(element.count));
    let mut uvs = uv.map(|_| Vec::with_capacity(element.count));
    let mut row = vec![0.0; element.properties.len()];
    for index in 0..element.count {
        body.next_row();
        for (value, property) in row.iter_mut().zip(&element.properties) {
            match property.layout {
                Layout::Scalar(scalar) => *value = body.number(scalar)?,
                list => body.skip(list)?,
            }
        }
        let vector = |columns: [usize; 3]| columns.map(|column| row[column] as f32);
        let place = Vec3::from(vector(position));
        if !place.is_finite() {
            let found = format!("position {:?}", place.to_array());
            return Err(Fault::malformed(format!("vertex {index}"), found, "finite numbers"));
        }
        positions.push(place);
        if let (Some(normals), Some(columns)) = (&mut normals, normal) {
            let normal = Vec3::from(vector(columns));
            // Where it is no number, the face's stands in.
            normals.push(if normal.is_finite() { unit_normal(normal) } else { Vec3::ZERO });
        }
        if let (Some(colours), Some(columns)) = (&mut colours, colour) {
            colours.push(vector(columns));
        }
        if let (Some(uvs), Some([u, v])) = (&mut uvs, uv) {
            uvs.push(Vec2::new(row[u] as f32, row[v] as f32));
        }
    }
    let are_integers = colour.is_some_and(|columns| element.are_integers(columns));
    let colours = colours.map(|colours| byte_colours(&colours, are_integers));
    Ok(Vertices { positions, normals, colours, uvs })
}
