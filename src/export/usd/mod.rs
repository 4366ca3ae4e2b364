//! Universal Scene Description: the rig as UsdSkel, in text (`.usda`) or packed with its texture (`.usdz`).
//!
//! <https://openusd.org/release/api/usd_skel_page_front.html>. Joints are paths, matrices have a row an axis (they multiply row vectors), v
//! runs up, and morph weights have no bounds. Expressions that are nobody's in the clip stay at 0.

mod scene;
mod text;

use std::io::{Cursor, Write};
use std::path::Path;

use xavatar_formats::write_atomically;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::rig::RiggedMesh;
use crate::mesh::{Colouring, encode_png};
use crate::{InputError, Result};

/// Where files in a package begin: a multiple of this, so that they can be read where they are.
const ALIGNMENT: u16 = 64;

/// Writes the rig as text; a texture goes into a PNG of the same name beside it.
///
/// # Errors
/// [`InputError::Value`] for a mesh that [`TriangleMesh::check`](crate::mesh::TriangleMesh::check) refuses; [`InputError::Io`].
pub fn write_usda(path: impl AsRef<Path>, rigged: &RiggedMesh) -> Result<()> {
    let path = path.as_ref();
    rigged.mesh.check()?;
    let picture = path.with_extension("png");
    if let Colouring::Texture { image, .. } = &rigged.mesh.colouring {
        let png = encode_png(image).map_err(InputError::io(&picture))?;
        write_atomically(&picture, |file| file.write_all(&png))?;
    }
    let name = picture.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let scene = scene::text(rigged, &name);
    Ok(write_atomically(path, |file| file.write_all(scene.as_bytes()))?)
}

/// Writes the rig and its texture as one file.
///
/// # Errors
/// As [`write_usda`].
pub fn write_usdz(path: impl AsRef<Path>, rigged: &RiggedMesh) -> Result<()> {
    const PICTURE: &str = "avatar.png";
    let path = path.as_ref();
    rigged.mesh.check()?;
    let mut files = vec![("avatar.usda", scene::text(rigged, PICTURE).into_bytes())];
    if let Colouring::Texture { image, .. } = &rigged.mesh.colouring {
        files.push((PICTURE, encode_png(image).map_err(InputError::io(path))?));
    }
    let mut package = ZipWriter::new(Cursor::new(Vec::new()));
    let mut pack = || {
        for (name, content) in &files {
            // The format allows no compression; the current time would make equal packages differ.
            let options = SimpleFileOptions::default()
                .compression_method(CompressionMethod::Stored)
                .last_modified_time(DateTime::default())
                .with_alignment(ALIGNMENT);
            package.start_file(*name, options)?;
            package.write_all(content)?;
        }
        Ok::<(), zip::result::ZipError>(())
    };
    pack().map_err(|error| InputError::io(path)(error.into()))?;
    let bytes = package.finish().map_err(|error| InputError::io(path)(error.into()))?.into_inner();
    Ok(write_atomically(path, |file| file.write_all(&bytes))?)
}
