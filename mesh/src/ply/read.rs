//! PLY file -> mesh.

use std::path::Path;

use glam::Vec2;

use super::body::Body;
use super::faces::Faces;
use super::header::{Element, Encoding, Header, parse_header};
use super::vertices::{Vertices, read_vertices};
use crate::Parsed;
use crate::draft::{Corner, Draft, Paint, Triangle, vertex_colouring};
use crate::notes::{Loss, Note, colour_notes, counted, listed, missing_pictures};
use crate::texture::{Pictures, find_referenced};
use crate::{Colouring, ReadMesh, TriangleMesh};
use xavatar_formats::{Fault, Result, decode_text, excerpt};

/// Reads the PLY file at `path`, which holds `bytes`, with the pictures that it refers to.
///
/// # Errors
/// [`Error::Malformed`](xavatar_formats::Error::Malformed) for a file that is cut short, inconsistent, or has positions that are no numbers,
/// or for a picture that is none; [`Error::Io`](xavatar_formats::Error::Io) and [`Error::Mismatch`](xavatar_formats::Error::Mismatch) for pictures that
/// cannot be opened or are too many.
pub(crate) fn read_ply(path: &Path, bytes: &[u8]) -> Result<ReadMesh> {
    // Ascii files of some Windows programs.
    let text = (!bytes.starts_with(b"ply")).then(|| decode_text(bytes));
    let content =
        parse_ply(text.as_deref().map_or(bytes, str::as_bytes)).map_err(|fault| fault.in_file(path, "PLY"))?;
    content.into_mesh(path)
}

/// The pictures of a file.
struct Opened {
    pictures: Pictures,
    /// The picture of each texture file, if it is there.
    place_of: Vec<Option<u32>>,
}

/// What a PLY file says; corners are in range.
pub(super) struct Content {
    vertices: Vertices,
    faces: Faces,
    texture_files: Vec<String>,
    /// Elements that mean nothing here.
    unread: Vec<String>,
    /// Properties that may be colours, but in no known way.
    unread_colours: Vec<String>,
}

pub(super) fn parse_ply(bytes: &[u8]) -> Parsed<Content> {
    let Header { encoding, elements, texture_files, length } = parse_header(bytes)?;
    let mut body = Body::new(bytes, length, encoding);
    let (mut vertices, mut faces) = (None, Faces::default());
    let (mut unread, mut unread_colours) = (Vec::new(), Vec::new());
    for element in &elements {
        check_count(element, encoding, &body)?;
        match element.name.to_ascii_lowercase().as_str() {
            "vertex" => {
                vertices = Some(read_vertices(element, &mut body)?);
                unread_colours = possible_colours(element);
            }
            _ if element.count == 0 => {}
            "face" => faces = faces.and(Faces::read_polygons(element, &mut body)?),
            "tristrips" => faces = faces.and(Faces::read_strips(element, &mut body)?),
            _ => {
                for _ in 0..element.count {
                    body.next_row();
                    element.properties.iter().try_for_each(|property| body.skip(property.layout))?;
                }
                unread.push(element.name.clone());
            }
        }
    }
    let vertices = vertices.ok_or_else(|| Fault::malformed("the header", "no element `vertex`", "vertices"))?;
    let count = vertices.positions.len();
    if let Some(index) = faces.triangles.iter().flatten().find(|&&index| index as usize >= count) {
        return Err(Fault::malformed("element face", format!("vertex index {index}"), format!("less than {count}")));
    }
    Ok(Content { vertices, faces, texture_files, unread, unread_colours })
}

fn check_count(element: &Element, encoding: Encoding, body: &Body) -> Parsed<()> {
    // One byte more than is left, because the last word of an ascii file needs no separator after it.
    let possible = (body.bytes_left() + 1) / element.smallest_row(encoding).max(1);
    if element.count > possible {
        let found = format!("{} rows of element {}", element.count, excerpt(&element.name));
        return Err(Fault::malformed(
            "the header",
            found,
            format!("at most the {possible} that the file's size can hold"),
        ));
    }
    Ok(())
}

/// The vertices' properties whose names speak of colour, if none of them is understood.
fn possible_colours(element: &Element) -> Vec<String> {
    const WORDS: [&str; 7] = ["red", "green", "blue", "rgb", "color", "colour", "f_dc"];
    if element.colour().is_some() {
        return Vec::new();
    }
    let names = element.properties.iter().map(|property| property.name.as_str());
    let speaks = |name: &&str| WORDS.iter().any(|word| name.to_ascii_lowercase().contains(word));
    names.filter(speaks).map(str::to_owned).collect()
}

impl Content {
    pub(super) fn into_mesh(mut self, path: &Path) -> Result<ReadMesh> {
        let mut notes = self.notes();
        let mut reasons = Vec::new();
        let opened = self.open_pictures(path, &mut reasons)?;
        let has_faces_colours_alone = self.vertices.colours.is_none() && self.faces.colours.is_some();
        if opened.is_none()
            && self.vertices.colours.is_none()
            && !has_faces_colours_alone
            && !self.unread_colours.is_empty()
        {
            let names = listed(&self.unread_colours);
            reasons.push(format!("the vertices' properties {names} mean no known colour"));
        }
        let mesh = match opened {
            Some(opened) => self.textured(opened).assemble(reasons, &mut notes),
            None if has_faces_colours_alone => self.painted().assemble(reasons, &mut notes),
            None => self.plain(reasons, &mut notes),
        };
        Ok(ReadMesh { mesh, notes })
    }

    fn notes(&self) -> Vec<Note> {
        let mut notes = Vec::new();
        if self.faces.degenerate > 0 {
            let why = format!("{} of less than three corners", counted(self.faces.degenerate, "face"));
            notes.push(Note::new(Loss::Faces, why));
        }
        if !self.unread.is_empty() {
            notes.push(Note::new(Loss::Other, format!("of elements, {}", listed(&self.unread))));
        }
        notes
    }

    /// The pictures that texture coordinates look up, if there are any. What is missing is added to `reasons`.
    fn open_pictures(&self, path: &Path, reasons: &mut Vec<String>) -> Result<Option<Opened>> {
        let has_coordinates = self.vertices.uvs.is_some() || self.faces.uvs.is_some();
        let has_colours = self.vertices.colours.is_some() || self.faces.colours.is_some();
        if !has_coordinates {
            return Ok(None);
        }
        if self.texture_files.is_empty() && !has_colours {
            reasons.push("texture coordinates, but no line `comment TextureFile` that names a picture".into());
        }
        let mut opened = Opened { pictures: Pictures::default(), place_of: Vec::new() };
        let mut missing = Vec::new();
        for name in &self.texture_files {
            let found = find_referenced(path, name);
            if found.is_none() {
                missing.push(name.clone());
            }
            opened.place_of.push(found.map(|file| opened.pictures.read(&file)).transpose()?);
        }
        reasons.extend(missing_pictures(&missing));
        if self.faces.triangles.is_empty() {
            reasons.extend((!opened.pictures.is_empty()).then(|| "a picture, but no face that it could be on".into()));
            return Ok(None);
        }
        Ok(Some(opened).filter(|opened| !opened.pictures.is_empty()))
    }

    /// The mesh with the pictures of its faces.
    fn textured(&mut self, opened: Opened) -> Draft {
        let place_of = |file: u32| opened.place_of.get(file as usize).copied().flatten();
        let paint = |file: u32| place_of(file).map_or(Paint::Vertices, Paint::Picture);
        let pictures_of = self.faces.pictures.take();
        let of_faces = self.faces.uvs.take();
        let per_face = of_faces.is_some();
        let triangle = |(index, corners): (usize, &[u32; 3])| Triangle {
            corners: std::array::from_fn(|k| Corner {
                position: corners[k],
                uv: Some(if per_face { (3 * index + k) as u32 } else { corners[k] }),
                normal: self.vertices.normals.is_some().then_some(corners[k]),
            }),
            paint: paint(pictures_of.as_ref().map_or(0, |pictures| pictures[index])),
        };
        let triangles = self.faces.triangles.iter().enumerate().map(triangle).collect();
        let uvs = match of_faces {
            Some(uvs) => uvs.into_iter().flatten().collect::<Vec<Vec2>>(),
            None => self.vertices.uvs.take().unwrap_or_default(),
        };
        self.draft(uvs, triangles, opened.pictures)
    }

    /// The mesh with the colours of its faces.
    fn painted(&mut self) -> Draft {
        let colours = self.faces.colours.take().unwrap_or_default();
        let triangle = |(corners, colour): (&[u32; 3], Option<[u8; 3]>)| Triangle {
            corners: corners.map(|position| Corner {
                position,
                uv: None,
                normal: self.vertices.normals.is_some().then_some(position),
            }),
            paint: colour.map_or(Paint::Vertices, Paint::Plain),
        };
        let triangles = self.faces.triangles.iter().zip(colours).map(triangle).collect();
        self.draft(Vec::new(), triangles, Pictures::default())
    }

    fn draft(&mut self, uvs: Vec<Vec2>, triangles: Vec<Triangle>, pictures: Pictures) -> Draft {
        let Vertices { positions, normals, colours, .. } = std::mem::take(&mut self.vertices);
        Draft {
            positions,
            colours: colours.unwrap_or_default(),
            uvs,
            normals: normals.unwrap_or_default(),
            triangles,
            pictures: pictures.into_inner(),
        }
    }

    /// The mesh whose vertices say everything.
    fn plain(&mut self, mut reasons: Vec<String>, notes: &mut Vec<Note>) -> TriangleMesh {
        let Vertices { positions, normals, colours, .. } = std::mem::take(&mut self.vertices);
        let colouring = colours.map_or(Colouring::None, |colours| vertex_colouring(colours, &mut reasons));
        notes.extend(colour_notes(reasons, &colouring));
        TriangleMesh { vertices: positions, faces: std::mem::take(&mut self.faces.triangles), normals, colouring }
    }
}
