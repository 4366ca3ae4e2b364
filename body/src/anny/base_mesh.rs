//! MakeHuman's base mesh (hm08): quads in named groups, of which skin and eyes become the body; the cubes in it mark the joints.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::source::Source;
use xavatar_formats::Result;

const GROUPS: &str = "mpfb2/mesh_metadata/basemesh_vertex_groups.json";
/// The groups that are the body, in the order of the model's vertices.
const USED: [&str; 3] = ["body", "helper-l-eye", "helper-r-eye"];

/// A corner's vertex and texture coordinate.
type Corner = (usize, usize);

/// The base mesh.
pub(super) struct BaseMesh {
    /// Decimetres, Y up.
    pub vertices: Vec<DVec3>,
    uvs: Vec<DVec2>,
    /// Polygons of the groups that are used, in the file's order.
    faces: Vec<Vec<Corner>>,
    groups: BTreeMap<String, Vec<usize>>,
}

impl BaseMesh {
    pub fn read(source: &mut Source) -> Result<Self> {
        let text = source.base_mesh()?;
        let mut mesh = Self { vertices: Vec::new(), uvs: Vec::new(), faces: Vec::new(), groups: BTreeMap::new() };
        let mut is_used = false;
        for (number, line) in (1..).zip(text.lines()) {
            let read = mesh.read_line(line, &mut is_used);
            read.ok_or_else(|| {
                source.malformed(&format!("base.obj, line {number}"), "something else", "OBJ's v, vt, f or g")
            })?;
        }
        let (vertices, uvs) = (mesh.vertices.len(), mesh.uvs.len());
        let is_known = |corner: &Corner| corner.0 < vertices && corner.1 < uvs;
        if mesh.faces.is_empty() || !mesh.faces.iter().flatten().all(is_known) {
            return Err(source.malformed("base.obj", "faces of other vertices, or none", "faces of its own"));
        }
        let ranges: BTreeMap<String, Vec<[usize; 2]>> = source.json(GROUPS)?;
        for (name, ranges) in ranges {
            if ranges.iter().any(|[_, last]| *last >= vertices) {
                return Err(source.malformed(&name, "vertices beyond the mesh", format!("ranges below {vertices}")));
            }
            mesh.groups.insert(name, ranges.into_iter().flat_map(|[first, last]| first..=last).collect());
        }
        if let Some(name) = USED.into_iter().find(|name| mesh.group(name).is_none_or(<[usize]>::is_empty)) {
            return Err(source.malformed(GROUPS, format!("without {name}"), "body and eyes"));
        }
        Ok(mesh)
    }

    /// The vertices of a group.
    pub fn group(&self, name: &str) -> Option<&[usize]> {
        self.groups.get(name).map(Vec::as_slice)
    }

    /// The vertices of the body in the model's order (V): skin, left eye, right eye.
    pub fn used_vertices(&self) -> Vec<usize> {
        USED.into_iter().filter_map(|name| self.group(name)).flatten().copied().collect()
    }

    /// The body's triangles in the model's numbers (F), and their texture coordinates: quads are cut along their shorter diagonal.
    pub fn triangles(&self, vertices: &[DVec3]) -> (Vec<[u32; 3]>, Vec<[DVec2; 3]>) {
        let mut number = vec![u32::MAX; vertices.len()];
        for (used, vertex) in (0..).zip(self.used_vertices()) {
            number[vertex] = used;
        }
        let (mut faces, mut uvs) = (Vec::new(), Vec::new());
        for face in &self.faces {
            let length = |from: usize, to: usize| vertices[face[from].0].distance(vertices[face[to].0]);
            let first = usize::from(face.len() == 4 && length(0, 2) > length(1, 3));
            let corner = |place: usize| face[(first + place) % face.len()];
            for place in 1..face.len() - 1 {
                let corners = [corner(0), corner(place), corner(place + 1)];
                let numbers = corners.map(|(vertex, _)| number[vertex]);
                if numbers.iter().all(|number| *number != u32::MAX) {
                    faces.push(numbers);
                    uvs.push(corners.map(|(_, uv)| self.uvs[uv]));
                }
            }
        }
        (faces, uvs)
    }

    /// Takes a line in; none if it is malformed.
    fn read_line(&mut self, line: &str, is_used: &mut bool) -> Option<()> {
        let mut words = line.split_ascii_whitespace();
        let number = |words: &mut std::str::SplitAsciiWhitespace| words.next()?.parse::<f64>().ok();
        match words.next() {
            Some("v") => {
                self.vertices.push(DVec3::new(number(&mut words)?, number(&mut words)?, number(&mut words)?));
            }
            Some("vt") => self.uvs.push(DVec2::new(number(&mut words)?, number(&mut words)?)),
            Some("g") => *is_used = words.next().is_some_and(|name| USED.contains(&name)),
            Some("f") if *is_used => {
                let face = words.map(corner).collect::<Option<Vec<Corner>>>()?;
                (face.len() >= 3).then(|| self.faces.push(face))?;
            }
            _ => {}
        }
        Some(())
    }
}

/// `vertex/texture`, counted from 1.
fn corner(word: &str) -> Option<Corner> {
    let mut numbers = word.split('/').map(|number| number.parse::<usize>().ok()?.checked_sub(1));
    Some((numbers.next()??, numbers.next()??))
}
