//! Reading a mesh, whatever its format.

use std::path::Path;

use super::TriangleMesh;
use super::glb::read_glb;
use super::notes::Note;
use super::obj::read_obj;
use super::ply::read_ply;
use xavatar_formats::{Error, Result, decode_text, read_bytes};

/// A mesh that was read, and what of its file is not in it.
#[derive(Clone, Debug)]
pub struct ReadMesh {
    /// The mesh, which passes [`TriangleMesh::check`] and has at least one vertex.
    pub mesh: TriangleMesh,
    /// What was lost and why; empty if nothing was.
    pub notes: Vec<Note>,
}

/// What the bytes of a file, or its name, say that it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Ply,
    Obj,
    Glb,
    /// None that is read here: its name.
    Other(&'static str),
}

/// Extensions of the meshes that are read, in lower case.
pub const MESH_EXTENSIONS: [&str; 3] = ["ply", "obj", "glb"];

/// Reads a PLY, OBJ or GLB file with the pictures and materials that it refers to; its content tells the format, and the
/// extension, in any case, where the content does not.
///
/// What a file lacks of its colours or normals, and what in it is none of a mesh, is noted; a file that breaks its format's rules
/// is an error.
///
/// # Errors
/// [`Error::Io`]; [`Error::Mismatch`] for other formats, by their name; [`Error::Malformed`] for a file that is cut short,
/// inconsistent, holds positions that are no numbers, or no vertex at all, and for a broken picture.
pub fn read_mesh(path: impl AsRef<Path>) -> Result<ReadMesh> {
    let path = path.as_ref();
    parse_mesh(path, &read_bytes(path)?)
}

/// The mesh of a file's bytes; what they refer to is looked for beside `path`, where the file is or could be.
///
/// # Errors
/// As [`read_mesh`].
pub fn parse_mesh(path: &Path, bytes: &[u8]) -> Result<ReadMesh> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_ascii_lowercase();
    let (read, format) = match recognise(bytes, &extension) {
        Format::Ply => (read_ply(path, bytes)?, "PLY"),
        Format::Obj => (read_obj(path, bytes)?, "OBJ"),
        Format::Glb => (read_glb(path, bytes)?, "GLB"),
        Format::Other(name) => {
            return Err(Error::Mismatch {
                path: path.into(),
                found: name.into(),
                expected: "a PLY, OBJ or GLB mesh".into(),
                remedy: "save it as one of these, in Blender or MeshLab for instance".into(),
            });
        }
    };
    let malformed = |place: String, found: String, expected: &str| Error::Malformed {
        path: path.into(),
        format,
        place,
        found,
        expected: expected.into(),
    };
    read.mesh.check().map_err(|error| match error {
        Error::Value { name, found, expected } => malformed(name, found, &expected),
        other => other,
    })?;
    if read.mesh.vertices.is_empty() {
        return Err(malformed("the file".into(), "without a vertex".into(), "a mesh"));
    }
    Ok(read)
}

fn recognise(bytes: &[u8], extension: &str) -> Format {
    const SIGNATURES: [(&[u8], Format); 12] = [
        (b"ply", Format::Ply),
        (b"glTF", Format::Glb),
        (b"solid", Format::Other("an STL mesh, which has no colours")),
        (b"Kaydara FBX Binary", Format::Other("an FBX file")),
        (b"; FBX", Format::Other("an FBX file")),
        (b"OFF", Format::Other("an OFF mesh")),
        (b"COFF", Format::Other("an OFF mesh")),
        (b"BLENDER", Format::Other("a Blender file")),
        (b"DRACO", Format::Other("a Draco mesh")),
        (b"#VRML", Format::Other("a VRML file")),
        (b"\x1f\x8b", Format::Other("a file compressed with gzip")),
        (b"PK\x03\x04", Format::Other("an archive (zip, USDZ or 3MF)")),
    ];
    const EXTENSIONS: [(&str, Format); 10] = [
        ("ply", Format::Ply),
        ("obj", Format::Obj),
        ("glb", Format::Glb),
        ("gltf", Format::Other("a glTF file whose data are in other files")),
        ("stl", Format::Other("an STL mesh, which has no colours")),
        ("fbx", Format::Other("an FBX file")),
        ("dae", Format::Other("a COLLADA file")),
        ("usd", Format::Other("a USD file")),
        ("usda", Format::Other("a USD file")),
        ("usdc", Format::Other("a USD file")),
    ];
    // Text may begin with a byte order mark, or be UTF-16.
    let start = decode_text(&bytes[..bytes.len().min(4096)]);
    let begins = |signature: &[u8]| bytes.starts_with(signature) || start.as_bytes().starts_with(signature);
    let signature = SIGNATURES.iter().find(|(signature, _)| begins(signature));
    // Scans of one program begin `solid` in their OBJ's name; an OBJ may say anything in its first line.
    match signature {
        Some((_, format @ (Format::Ply | Format::Glb))) => *format,
        _ if extension == "obj" => Format::Obj,
        Some((_, format)) => *format,
        None => match EXTENSIONS.iter().find(|(known, _)| *known == extension) {
            Some((_, format)) => *format,
            None if has_vertices(&start) => Format::Obj,
            None => Format::Other("a file in no known format"),
        },
    }
}

/// Whether a text's first lines are those of an OBJ.
fn has_vertices(start: &str) -> bool {
    start.lines().any(|line| line.starts_with("v ") || line.starts_with("mtllib "))
}
