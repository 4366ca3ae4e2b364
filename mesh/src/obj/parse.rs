//! The statements of OBJ and MTL files.

use std::collections::{BTreeMap, BTreeSet};

use glam::{Vec2, Vec3};

use crate::fault::{Fault, Parsed};
use crate::surface::unit_normal;

/// A face's corner: zero-based indices of position, texture coordinate, normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Corner {
    pub(super) position: u32,
    pub(super) uv: Option<u32>,
    pub(super) normal: Option<u32>,
}

/// What an OBJ file says; all indices are in range.
#[derive(Debug, Default)]
pub(super) struct Statements {
    pub(super) positions: Vec<Vec3>,
    /// Empty, or one a position.
    pub(super) colours: Vec<[u8; 3]>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    pub(super) triangles: Vec<[Corner; 3]>,
    /// Files of `mtllib`, with the line that names them.
    pub(super) material_files: Vec<(usize, String)>,
    /// Materials that faces use; none for faces before the first `usemtl`.
    pub(super) used_materials: BTreeSet<Option<String>>,
}

pub(super) fn parse_obj(text: &str) -> Parsed<Statements> {
    let mut statements = Statements::default();
    let mut material = None;
    for (index, line) in text.lines().enumerate() {
        let number = index + 1;
        let (keyword, rest) = statement(line);
        match keyword {
            "v" => statements.add_vertex(number, rest)?,
            "vt" => {
                let [u, v] = leading_numbers(number, rest, 1)?;
                statements.uvs.push(Vec2::new(u, v));
            }
            "vn" => {
                let normal: [f32; 3] = leading_numbers(number, rest, 3)?;
                statements.normals.push(unit_normal(Vec3::from(normal)));
            }
            "f" => {
                statements.add_face(number, rest)?;
                statements.used_materials.insert(material.clone());
            }
            "usemtl" => material = Some(rest.to_owned()),
            "mtllib" => statements.material_files.push((number, rest.to_owned())),
            _ => {}
        }
    }
    statements.check()?;
    Ok(statements)
}

/// The texture of each material of an MTL file that has one, with the line that names it.
pub(super) fn parse_mtl(text: &str) -> Parsed<BTreeMap<String, (usize, String)>> {
    let mut textures = BTreeMap::new();
    let mut material = String::new();
    for (index, line) in text.lines().enumerate() {
        let number = index + 1;
        match statement(line) {
            ("newmtl", name) => material = name.to_owned(),
            ("map_Kd", file) if file.starts_with('-') => {
                return Err(Fault::new(format!("line {number}"), format!("{file:?}"), "a file name without options"));
            }
            ("map_Kd", file) => drop(textures.insert(material.clone(), (number, file.to_owned()))),
            _ => {}
        }
    }
    Ok(textures)
}

fn statement(line: &str) -> (&str, &str) {
    let line = line.trim();
    let (keyword, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
    (keyword, rest.trim_start())
}

impl Statements {
    fn add_vertex(&mut self, number: usize, rest: &str) -> Parsed<()> {
        let values = numbers(number, rest)?;
        let (position, colour) = match values[..] {
            // A fourth number alone is a weight for curves.
            [x, y, z] | [x, y, z, _] => (Vec3::new(x, y, z), None),
            [x, y, z, r, g, b] => (Vec3::new(x, y, z), Some([r, g, b])),
            _ => {
                let found = format!("a vertex of {} numbers", values.len());
                return Err(Fault::new(format!("line {number}"), found, "3, 4, or 6 with a colour"));
            }
        };
        self.positions.push(position);
        if let Some(colour) = colour {
            if !colour.iter().all(|c| (0.0..=1.0).contains(c)) {
                return Err(Fault::new(format!("line {number}"), format!("colour {colour:?}"), "channels in [0, 1]"));
            }
            self.colours.push(colour.map(|c| (c * 255.0).round() as u8));
        }
        Ok(())
    }

    fn add_face(&mut self, number: usize, rest: &str) -> Parsed<()> {
        let mut corners = rest.split_ascii_whitespace().map(|word| self.corner(number, word));
        let mut next = || corners.next().transpose();
        let (Some(first), Some(mut previous)) = (next()?, next()?) else {
            return Err(Fault::new(format!("line {number}"), "a face of less than two corners", "at least 3"));
        };
        let mut triangles = Vec::new();
        while let Some(corner) = next()? {
            triangles.push([first, previous, corner]);
            previous = corner;
        }
        if triangles.is_empty() {
            return Err(Fault::new(format!("line {number}"), "a face of two corners", "at least 3"));
        }
        self.triangles.append(&mut triangles);
        Ok(())
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&self, number: usize, word: &str) -> Parsed<Corner> {
        let mut parts = word.split('/');
        let mut index = |count: usize| match parts.next() {
            None | Some("") => Ok(None),
            Some(text) => zero_based(text, count).map(Some).ok_or_else(|| {
                Fault::new(format!("line {number}"), format!("index {text:?}"), "1, 2, ... or -1, -2, ...")
            }),
        };
        let (position, uv, normal) = (index(self.positions.len())?, index(self.uvs.len())?, index(self.normals.len())?);
        match (position, parts.next()) {
            (Some(position), None) => Ok(Corner { position, uv, normal }),
            _ => Err(Fault::new(format!("line {number}"), format!("corner {word:?}"), "v, v/vt, v//vn or v/vt/vn")),
        }
    }

    fn check(&self) -> Parsed<()> {
        if !self.colours.is_empty() && self.colours.len() != self.positions.len() {
            let found = format!("{} colours for {} vertices", self.colours.len(), self.positions.len());
            return Err(Fault::new("v", found, "a colour at all vertices or none"));
        }
        // Faces may come before their vertices.
        let counts = [("v", self.positions.len()), ("vt", self.uvs.len()), ("vn", self.normals.len())];
        for corner in self.triangles.iter().flatten() {
            let indices = [Some(corner.position), corner.uv, corner.normal];
            for (index, (what, count)) in indices.into_iter().zip(counts) {
                if let Some(index) = index.filter(|&index| index as usize >= count) {
                    let found = format!("{what} index {}", u64::from(index) + 1);
                    return Err(Fault::new("f", found, format!("at most {count}")));
                }
            }
        }
        Ok(())
    }
}

/// An OBJ index, which counts from 1, or from the last of the `count` so far as -1.
fn zero_based(text: &str, count: usize) -> Option<u32> {
    let index: i64 = text.parse().ok()?;
    match index {
        1.. => u32::try_from(index - 1).ok(),
        0 => None,
        _ => u32::try_from(i64::try_from(count).ok()?.checked_add(index)?).ok(),
    }
}

fn numbers(number: usize, rest: &str) -> Parsed<Vec<f32>> {
    let parse = |word: &str| {
        word.parse()
            .ok()
            .filter(|value: &f32| value.is_finite())
            .ok_or_else(|| Fault::new(format!("line {number}"), format!("{word:.40?}"), "a finite number"))
    };
    rest.split_ascii_whitespace().map(parse).collect()
}

/// The first N numbers, of which `least` have to be there; the others are 0.
fn leading_numbers<const N: usize>(number: usize, rest: &str, least: usize) -> Parsed<[f32; N]> {
    let values = numbers(number, rest)?;
    if values.len() < least {
        return Err(Fault::new(format!("line {number}"), format!("{} numbers", values.len()), format!("{least}")));
    }
    Ok(std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0)))
}
