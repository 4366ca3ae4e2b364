//! OBJ file -> mesh.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use glam::Vec2;

use super::material::{Material, Texture, parse_mtl};
use super::parse::{Statements, parse_obj};
use crate::ReadMesh;
use crate::colours::byte_colours;
use crate::draft::{Draft, Paint, Triangle};
use crate::notes::{Loss, Note, counted, listed, missing_pictures};
use crate::texture::{Pictures, find_referenced};
use xavatar_formats::{Result, decode_text, read_bytes};

/// Reads the OBJ file at `path`, which holds `bytes`, with the MTL files and pictures that it refers to.
///
/// # Errors
/// [`Error::Malformed`] for a file that does not follow the format, or a picture that is none; [`Error::Io`] and
/// [`Error::Mismatch`] for pictures that cannot be opened or are too many.
pub(crate) fn read_obj(path: &Path, bytes: &[u8]) -> Result<ReadMesh> {
    let statements = parse_obj(&decode_text(bytes)).map_err(|fault| fault.in_file(path, "OBJ"))?;
    let mut missing = Missing::default();
    let library = Library::read(path, &statements.material_files, &mut missing)?;
    let coats = Coats::of(path, &statements, &library, &mut missing)?;
    let mut notes = notes_on_faces(&statements);
    let has_uvs = statements.triangles.iter().flatten().any(|corner| corner.uv.is_some());
    let mut draft = draft(statements, coats);
    draft.drop_plain_without_meaning();
    let is_colourless = draft.is_colourless();
    // Materials of faces without texture coordinates matter only where nothing else has a colour.
    let mut reasons = if is_colourless || has_uvs { missing.reasons() } else { Vec::new() };
    if reasons.is_empty() && is_colourless && has_uvs {
        reasons.push(match library.materials.is_empty() {
            true => "texture coordinates, but no line `mtllib` that names a material file".into(),
            false => "texture coordinates, but no material with a picture (map_Kd)".into(),
        });
    }
    let mesh = draft.assemble(reasons, &mut notes);
    Ok(ReadMesh { mesh, notes })
}

fn notes_on_faces(statements: &Statements) -> Vec<Note> {
    let mut notes = Vec::new();
    if statements.degenerate > 0 {
        let why = format!("{} of less than three corners", counted(statements.degenerate, "face"));
        notes.push(Note::new(Loss::Faces, why));
    }
    if statements.free_forms > 0 {
        let why = format!("{} or free-form surfaces", counted(statements.free_forms, "curve"));
        notes.push(Note::new(Loss::Faces, why));
    }
    notes
}

/// Material files that are looked for, and pictures that may be missing until no more are: a file can name a million.
const MOST_FILES: usize = 256;

/// What an OBJ refers to and is not there.
#[derive(Default)]
struct Missing {
    material_files: Vec<String>,
    materials: Vec<String>,
    pictures: Vec<String>,
    /// Faces before the first `usemtl`, of which several materials could be meant.
    has_unnamed: bool,
}

impl Missing {
    fn reasons(self) -> Vec<String> {
        let mut reasons = Vec::new();
        if !self.material_files.is_empty() {
            reasons
                .push(format!("material files not beside the mesh: {}; put them there", listed(&self.material_files)));
        }
        if !self.materials.is_empty() {
            reasons.push(format!("materials in no material file: {}", listed(&self.materials)));
        }
        if self.has_unnamed {
            reasons.push("faces before the first line `usemtl`, of several materials".into());
        }
        reasons.extend(missing_pictures(&self.pictures));
        reasons
    }
}

/// The materials of all material files.
struct Library {
    /// With the file that each is in.
    materials: BTreeMap<String, (PathBuf, Material)>,
}

impl Library {
    fn read(path: &Path, named: &[String], missing: &mut Missing) -> Result<Self> {
        let mut library = Self { materials: BTreeMap::new() };
        let mut is_read = BTreeSet::new();
        for name in named.iter().filter(|name| is_read.insert(*name)).take(MOST_FILES) {
            // One name with blanks, or several without.
            let mut files: Vec<PathBuf> = find_referenced(path, name).into_iter().collect();
            if files.is_empty() {
                let names = name.split_ascii_whitespace().take(MOST_FILES);
                files.extend(names.filter_map(|name| find_referenced(path, name)));
            }
            if files.is_empty() {
                missing.material_files.push(name.clone());
            }
            for file in files {
                let bytes = read_bytes(&file)?;
                let materials = parse_mtl(&decode_text(&bytes)).into_iter();
                library.materials.extend(materials.map(|(name, material)| (name, (file.clone(), material))));
            }
        }
        Ok(library)
    }

    /// The material of this name; of faces that name none, the only one there is.
    fn find(&self, name: Option<&str>) -> Option<(&Path, &Material)> {
        let (file, material) = match name {
            Some(name) => self.materials.get(name)?,
            None if self.materials.len() == 1 => self.materials.values().next()?,
            None => return None,
        };
        Some((file, material))
    }
}

/// Where the faces of each material have their colour from.
struct Coats {
    /// By the place of the name in [`Statements::materials`].
    of_named: Vec<Coat>,
    /// That of faces without a material's name.
    of_unnamed: Coat,
    pictures: Pictures,
    /// These come before `Kd`.
    vertices_have_colours: bool,
}

#[derive(Clone, Copy)]
struct Coat {
    paint: Paint,
    /// Texture coordinates are looked up at uv * scale + offset.
    scale: Vec2,
    offset: Vec2,
}

impl Coat {
    fn new(paint: Paint) -> Self {
        Self { paint, scale: Vec2::ONE, offset: Vec2::ZERO }
    }
}

impl Coats {
    /// Opens the pictures of the materials that faces use.
    fn of(path: &Path, statements: &Statements, library: &Library, missing: &mut Missing) -> Result<Self> {
        let vertices = Coat::new(Paint::Vertices);
        let mut coats = Self {
            of_named: vec![vertices; statements.materials.len()],
            of_unnamed: vertices,
            pictures: Pictures::default(),
            vertices_have_colours: !statements.colours.is_empty(),
        };
        let mut used: Vec<Option<u32>> = statements.material_of.clone();
        used.sort_unstable();
        used.dedup();
        // Without materials, that is what is missing.
        for place in used.into_iter().filter(|_| !library.materials.is_empty()) {
            let name = place.map(|place| &statements.materials[place as usize]);
            match (library.find(name.map(String::as_str)), place, name) {
                (Some((file, material)), Some(place), _) => {
                    coats.of_named[place as usize] = coats.coat(path, file, material, missing)?;
                }
                (Some((file, material)), None, _) => coats.of_unnamed = coats.coat(path, file, material, missing)?,
                (None, _, Some(name)) => missing.materials.push(name.clone()),
                (None, _, None) => missing.has_unnamed = true,
            }
        }
        Ok(coats)
    }

    fn coat(&mut self, path: &Path, file: &Path, material: &Material, missing: &mut Missing) -> Result<Coat> {
        let Some(Texture { file: picture, scale, offset }) = &material.texture else {
            let byte = |colour: [f32; 3]| byte_colours(&[colour], false)[0].filter(|_| !self.vertices_have_colours);
            return Ok(Coat::new(material.diffuse.and_then(byte).map_or(Paint::Vertices, Paint::Plain)));
        };
        let is_known_missing = missing.pictures.contains(picture) || missing.pictures.len() >= MOST_FILES;
        let found = || find_referenced(file, picture).or_else(|| find_referenced(path, picture));
        let Some(found) = (!is_known_missing).then(found).flatten() else {
            if !is_known_missing {
                missing.pictures.push(picture.clone());
            }
            return Ok(Coat::new(Paint::Vertices));
        };
        Ok(Coat { paint: Paint::Picture(self.pictures.read(&found)?), scale: *scale, offset: *offset })
    }
}

fn draft(statements: Statements, coats: Coats) -> Draft {
    let Statements { positions, mut colours, mut uvs, normals, triangles, material_of, .. } = statements;
    if !colours.is_empty() {
        colours.resize(positions.len(), [f32::NAN; 3]);
    }
    let mut painted = Vec::with_capacity(triangles.len());
    for (mut corners, material) in triangles.into_iter().zip(material_of) {
        let coat = material.map_or(coats.of_unnamed, |place| coats.of_named[place as usize]);
        if coat.scale != Vec2::ONE || coat.offset != Vec2::ZERO {
            for corner in &mut corners {
                let uv = corner.uv.and_then(|uv| uvs.get(uv as usize)).map(|uv| *uv * coat.scale + coat.offset);
                corner.uv = uv.map(|uv| {
                    uvs.push(uv);
                    uvs.len() as u32 - 1
                });
            }
        }
        painted.push(Triangle { corners, paint: coat.paint });
    }
    Draft {
        colours: byte_colours(&colours, false),
        positions,
        uvs,
        normals,
        triangles: painted,
        pictures: coats.pictures.into_inner(),
    }
}
