//! The statements of OBJ files.

use std::collections::HashMap;

use glam::{Vec2, Vec3};

use crate::Parsed;
use crate::draft::Corner;
use crate::surface::unit_normal;
use crate::text::numbered_lines;
use xavatar_formats::{Fault, excerpt};

/// What an OBJ file says; positions of corners are in range.
#[derive(Debug, Default)]
pub(super) struct Statements {
    pub(super) positions: Vec<Vec3>,
    /// As written, NaN where a vertex has none; empty if none has one.
    pub(super) colours: Vec<[f32; 3]>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    pub(super) triangles: Vec<[Corner; 3]>,
    /// The material of each triangle, as a place in `materials`; none before the first `usemtl`.
    pub(super) material_of: Vec<Option<u32>>,
    /// The names that `usemtl` gives.
    pub(super) materials: Vec<String>,
    /// What `mtllib` statements name.
    pub(super) material_files: Vec<String>,
    /// Faces of less than three corners.
    pub(super) degenerate: usize,
    /// Statements of curves and surfaces other than faces.
    pub(super) free_forms: usize,
    /// The highest position that a face names, and the line where it does.
    highest: Option<(u32, usize)>,
}

pub(super) fn parse_obj(text: &str) -> Parsed<Statements> {
    let mut statements = Statements::default();
    let mut place_of: HashMap<String, u32> = HashMap::new();
    let mut material = None;
    for (number, line) in numbered_lines(text) {
        let (keyword, rest) = statement(&line);
        match keyword {
            "v" => statements.add_vertex(number, rest)?,
            "vt" => {
                let [u, v] = leading_numbers(rest);
                // The second coordinate may be left out.
                statements.uvs.push(Vec2::new(u, if v.is_nan() { 0.0 } else { v }));
            }
            "vn" => {
                let normal = Vec3::from(leading_numbers::<3>(rest));
                statements.normals.push(if normal.is_finite() { unit_normal(normal) } else { normal });
            }
            "f" => {
                statements.add_face(number, rest)?;
                statements.material_of.resize(statements.triangles.len(), material);
            }
            "usemtl" => {
                material = Some(*place_of.entry(rest.to_owned()).or_insert_with(|| {
                    statements.materials.push(rest.to_owned());
                    statements.materials.len() as u32 - 1
                }));
            }
            "mtllib" => statements.material_files.push(rest.to_owned()),
            "curv" | "curv2" | "surf" => statements.free_forms += 1,
            _ => {}
        }
    }
    // Faces may come before their vertices.
    let count = statements.positions.len();
    match statements.highest {
        Some((index, number)) if index as usize >= count => {
            let found = format!("a corner at vertex {}", u64::from(index) + 1);
            Err(Fault::malformed(format!("line {number}"), found, format!("at most {count}")))
        }
        _ => Ok(statements),
    }
}

/// The keyword of a line, and what follows it.
pub(super) fn statement(line: &str) -> (&str, &str) {
    let (keyword, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
    (keyword, rest.trim())
}

/// The words of a statement without names, up to a comment.
fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split_ascii_whitespace().take_while(|word| !word.starts_with('#'))
}

/// The first N numbers of a statement; NaN for those that are not there, or no numbers.
fn leading_numbers<const N: usize>(rest: &str) -> [f32; N] {
    let mut numbers = words(rest).map(|word| word.parse().unwrap_or(f32::NAN));
    std::array::from_fn(|_| numbers.next().unwrap_or(f32::NAN))
}

impl Statements {
    /// x y z, the weight of a curve's point, or a colour: x y z r g b, with or without an alpha.
    fn add_vertex(&mut self, number: usize, rest: &str) -> Parsed<()> {
        let [x, y, z, colour @ ..] = leading_numbers::<6>(rest);
        let position = Vec3::new(x, y, z);
        if !position.is_finite() {
            let wrong = words(rest).take(3).find(|word| !word.parse().is_ok_and(f32::is_finite));
            let found = wrong.map_or("a vertex of less than 3 numbers".into(), excerpt);
            return Err(Fault::malformed(format!("line {number}"), found, "three finite numbers"));
        }
        if words(rest).nth(5).is_some() {
            self.colours.resize(self.positions.len(), [f32::NAN; 3]);
            self.colours.push(colour);
        } else if !self.colours.is_empty() {
            self.colours.push([f32::NAN; 3]);
        }
        self.positions.push(position);
        Ok(())
    }

    fn add_face(&mut self, number: usize, rest: &str) -> Parsed<()> {
        let corners = words(rest).map(|word| self.corner(number, word)).collect::<Parsed<Vec<Corner>>>()?;
        let highest = corners.iter().map(|corner| (corner.position, number)).max();
        self.highest = self.highest.max(highest);
        self.degenerate += usize::from(corners.len() < 3);
        if let [first, rest @ ..] = &corners[..] {
            self.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        }
        Ok(())
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&self, number: usize, word: &str) -> Parsed<Corner> {
        let mut parts = word.split('/');
        let mut index = |count: usize| match parts.next() {
            None | Some("") => Ok(None),
            Some(text) => zero_based(text, count).map(Some).ok_or_else(|| {
                Fault::malformed(
                    format!("line {number}"),
                    format!("index {}", excerpt(text)),
                    "1, 2, ... or -1, -2, ...",
                )
            }),
        };
        let (position, uv, normal) = (index(self.positions.len())?, index(self.uvs.len())?, index(self.normals.len())?);
        match (position, parts.next()) {
            (Some(position), None) => Ok(Corner { position, uv, normal }),
            _ => {
                let found = format!("corner {}", excerpt(word));
                Err(Fault::malformed(format!("line {number}"), found, "v, v/vt, v//vn or v/vt/vn"))
            }
        }
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
