//! A mesh as files say it, and how it becomes one with a single kind of every vertex.
//!
//! In files each corner of a face has a position, a texture coordinate and a normal of its own, and each face may have another
//! picture or colour. A vertex whose corners differ is split: the first kind keeps the vertex's number, the others follow after
//! the last, so topologies survive. Several pictures become one.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};

use super::atlas::Atlas;
use super::colours::UNKNOWN_COLOUR;
use super::notes::{Loss, Note, colour_notes, counted};
use super::{Colouring, TriangleMesh};

/// What a file says. V positions; positions of corners are in range, the others need not be.
#[derive(Debug, Default)]
pub(super) struct Draft {
    pub(super) positions: Vec<Vec3>,
    /// Empty, or one a position (V) where it is known.
    pub(super) colours: Vec<Option<[u8; 3]>>,
    pub(super) uvs: Vec<Vec2>,
    /// Of unit length or zero; not finite where the file's are not.
    pub(super) normals: Vec<Vec3>,
    pub(super) triangles: Vec<Triangle>,
    /// What [`Paint::Picture`] counts; row 0 is v = 0.
    pub(super) pictures: Vec<Arc<RgbImage>>,
}

/// Three corners, counter-clockwise seen from outside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub(super) corners: [Corner; 3],
    pub(super) paint: Paint,
}

/// Places in the arrays of a [`Draft`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    pub(super) position: u32,
    pub(super) uv: Option<u32>,
    pub(super) normal: Option<u32>,
}

/// Where a face has its colour from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Paint {
    /// From its vertices, if they have one.
    Vertices,
    /// A picture, at its texture coordinates.
    Picture(u32),
    /// The same all over.
    Plain([u8; 3]),
}

/// The colour of a corner, as bits: what splits a vertex.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Coat {
    OfVertex,
    At([u32; 2]),
    Plain([u8; 3]),
}

/// A vertex of the mesh.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Kind {
    position: u32,
    normal: Option<u32>,
    coat: Coat,
}

/// The vertices met so far.
struct Vertices {
    /// The first kind of each position (V), then the others.
    kinds: Vec<Option<Kind>>,
    others: HashMap<Kind, u32>,
}

impl Vertices {
    fn of_kind(&mut self, kind: Kind) -> u32 {
        let first = self.kinds[kind.position as usize].get_or_insert(kind);
        if *first == kind {
            return kind.position;
        }
        *self.others.entry(kind).or_insert_with(|| {
            self.kinds.push(Some(kind));
            self.kinds.len() as u32 - 1
        })
    }

    /// The position and, unless it is of no face, the kind of every vertex.
    fn iter(&self) -> impl Iterator<Item = (usize, Option<Kind>)> {
        let position =
            |(vertex, kind): (usize, &Option<Kind>)| (kind.map_or(vertex, |kind| kind.position as usize), *kind);
        self.kinds.iter().enumerate().map(position)
    }
}

impl Draft {
    /// The mesh. What has to be left out of it is noted; `reasons` are why colours are lost already.
    pub(super) fn assemble(mut self, mut reasons: Vec<String>, notes: &mut Vec<Note>) -> TriangleMesh {
        let has_normals = self.keep_whole_normals(notes);
        let coordinates = self.keep_whole_coordinates(&mut reasons);
        let atlas = self.atlas();
        let mut vertices = Vertices { kinds: vec![None; self.positions.len()], others: HashMap::new() };
        let mut faces = Vec::with_capacity(self.triangles.len());
        for (index, triangle) in self.triangles.iter().enumerate() {
            let coats = match (&atlas, triangle.paint) {
                (Some((atlas, place)), Paint::Picture(picture)) => {
                    coordinates[index].map(|uv| at(atlas.uv(place[&Source::Picture(picture)], uv)))
                }
                (Some((atlas, place)), paint) => [at(atlas.uv(place[&Source::of(paint)], Vec2::splat(0.5))); 3],
                (None, Paint::Plain(colour)) => [Coat::Plain(colour); 3],
                (None, Paint::Vertices | Paint::Picture(_)) => [Coat::OfVertex; 3],
            };
            faces.push(std::array::from_fn(|k| {
                let Corner { position, normal, .. } = triangle.corners[k];
                vertices.of_kind(Kind { position, normal: normal.filter(|_| has_normals), coat: coats[k] })
            }));
        }
        let normal_of = |kind: Option<Kind>| kind.and_then(|kind| kind.normal).map(|n| self.normals[n as usize]);
        let colouring = self.colouring(atlas.map(|(atlas, _)| atlas.image), &vertices, &mut reasons);
        notes.extend(colour_notes(reasons, &colouring));
        TriangleMesh {
            vertices: vertices.iter().map(|(position, _)| self.positions[position]).collect(),
            faces,
            normals: has_normals
                .then(|| vertices.iter().map(|(_, kind)| normal_of(kind).unwrap_or_default()).collect()),
            colouring,
        }
    }

    /// Whether nothing says a colour.
    pub(super) fn is_colourless(&self) -> bool {
        self.colours.iter().all(Option::is_none) && self.triangles.iter().all(|face| face.paint == Paint::Vertices)
    }

    fn colouring(&self, picture: Option<Arc<RgbImage>>, vertices: &Vertices, reasons: &mut Vec<String>) -> Colouring {
        if let Some(image) = picture {
            let uv = |kind: Option<Kind>| match kind.map(|kind| kind.coat) {
                Some(Coat::At(bits)) => Vec2::from(bits.map(f32::from_bits)),
                _ => Vec2::ZERO,
            };
            return Colouring::Texture { uvs: vertices.iter().map(|(_, kind)| uv(kind)).collect(), image };
        }
        if self.colours.is_empty() && self.triangles.iter().all(|triangle| triangle.paint == Paint::Vertices) {
            return Colouring::None;
        }
        let colour = |(position, kind): (usize, Option<Kind>)| match kind.map(|kind| kind.coat) {
            Some(Coat::Plain(colour)) => Some(colour),
            _ => self.colours.get(position).copied().flatten(),
        };
        vertex_colouring(vertices.iter().map(colour).collect(), reasons)
    }

    /// Leaves colours of faces out if there is no picture and all are one grey, which exporters write where they know no colour.
    pub(super) fn drop_plain_without_meaning(&mut self) {
        let colours = || {
            self.triangles.iter().filter_map(|triangle| match triangle.paint {
                Paint::Plain(colour) => Some(colour),
                Paint::Vertices | Paint::Picture(_) => None,
            })
        };
        let is_one_grey = colours().all(|[r, g, b]| r == g && g == b && Some([r, g, b]) == colours().next());
        if self.pictures.is_empty() && is_one_grey {
            self.triangles.iter_mut().for_each(|triangle| triangle.paint = Paint::Vertices);
        }
    }

    /// Whether every corner has a normal. Those that are no numbers are zero, so that the face's stands in.
    fn keep_whole_normals(&mut self, notes: &mut Vec<Note>) -> bool {
        let count = self.normals.len();
        let corners = || self.triangles.iter().flat_map(|triangle| &triangle.corners);
        let named = corners().filter(|corner| corner.normal.is_some()).count();
        let there = corners().filter(|corner| corner.normal.is_some_and(|normal| (normal as usize) < count)).count();
        let all = corners().count();
        if named > 0 && there < all {
            let why = format!("{there} of {all} corners have one");
            notes.push(Note::new(Loss::Normals, why));
        }
        self.normals.iter_mut().filter(|normal| !normal.is_finite()).for_each(|normal| *normal = Vec3::ZERO);
        all > 0 && there == all
    }

    /// The texture coordinates of each triangle (F) with a picture, moved by whole numbers to the picture's own square: pictures
    /// repeat. Triangles without coordinates lose their picture.
    fn keep_whole_coordinates(&mut self, reasons: &mut Vec<String>) -> Vec<[Vec2; 3]> {
        let uv_of = |corner: Corner| self.uvs.get(corner.uv? as usize).copied().filter(|uv| uv.is_finite());
        if !self.triangles.iter().any(|triangle| matches!(triangle.paint, Paint::Picture(_))) {
            return Vec::new();
        }
        let (mut without, mut across) = (0, 0);
        let mut wrapped = Vec::with_capacity(self.triangles.len());
        for triangle in &mut self.triangles {
            let uvs = match (triangle.paint, triangle.corners.map(uv_of)) {
                (Paint::Picture(picture), [Some(a), Some(b), Some(c)]) => {
                    let size = &self.pictures[picture as usize];
                    // Rounding may leave the square.
                    let texel = Vec2::new(size.width() as f32, size.height() as f32).recip();
                    let outside = |uv: Vec2| uv.cmplt(-texel) | uv.cmpgt(Vec2::ONE + texel);
                    let centre = (a + b + c) / 3.0;
                    let shift = Vec2::select(outside(centre), centre.floor(), Vec2::ZERO);
                    let uvs = [a, b, c].map(|uv| uv - shift);
                    across += usize::from(uvs.iter().any(|uv| outside(*uv).any()));
                    uvs
                }
                (Paint::Picture(_), _) => {
                    triangle.paint = Paint::Vertices;
                    without += 1;
                    [Vec2::ZERO; 3]
                }
                _ => [Vec2::ZERO; 3],
            };
            wrapped.push(uvs);
        }
        if without > 0 {
            reasons.push(format!("{} without texture coordinates", counted(without, "face")));
        }
        if across > 0 {
            reasons.push(format!("{} of a picture that repeats; its border goes on instead", counted(across, "face")));
        }
        wrapped
    }

    /// All pictures and colours of faces as one, and which of its regions is whose; `None` if no face has a picture.
    fn atlas(&self) -> Option<(Atlas, HashMap<Source, usize>)> {
        if !self.triangles.iter().any(|triangle| matches!(triangle.paint, Paint::Picture(_))) {
            return None;
        }
        let (mut sources, mut place) = (Vec::new(), HashMap::new());
        for triangle in &self.triangles {
            let source = Source::of(triangle.paint);
            place.entry(source).or_insert_with(|| {
                sources.push(match source {
                    Source::Picture(picture) => self.pictures[picture as usize].clone(),
                    Source::Plain(colour) => Arc::new(RgbImage::from_pixel(1, 1, Rgb(colour))),
                });
                sources.len() - 1
            });
        }
        Some((Atlas::of(&sources), place))
    }
}

/// What a region of the atlas is made of.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Source {
    Picture(u32),
    Plain([u8; 3]),
}

impl Source {
    /// That of a paint beside others that are pictures.
    fn of(paint: Paint) -> Self {
        match paint {
            Paint::Picture(picture) => Self::Picture(picture),
            Paint::Plain(colour) => Self::Plain(colour),
            Paint::Vertices => Self::Plain(UNKNOWN_COLOUR),
        }
    }
}

fn at(uv: Vec2) -> Coat {
    Coat::At(uv.to_array().map(f32::to_bits))
}

/// Colours of vertices (V) of which some may be unknown; `reasons` are why colours are lost.
pub(super) fn vertex_colouring(colours: Vec<Option<[u8; 3]>>, reasons: &mut Vec<String>) -> Colouring {
    let unknown = colours.iter().filter(|colour| colour.is_none()).count();
    if unknown == colours.len() {
        reasons.push("no vertex has one that is a number".into());
        return Colouring::None;
    }
    if unknown > 0 {
        reasons.push(format!("{unknown} of {} vertices have none, and are grey", colours.len()));
    }
    Colouring::Vertex(colours.into_iter().map(|colour| colour.unwrap_or(UNKNOWN_COLOUR)).collect())
}
