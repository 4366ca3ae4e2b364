//! Writing one frame of a subject in the raw X-Humans layout: the scan with its texture, the parameters, the registered body.

use std::fs;
use std::path::{Path, PathBuf};

use glam::Vec3;
use xavatar_body::BodyParameters;
use xavatar_formats::{Array, ArrayData, ArrayMap, Error, Result, write_pickle, write_pickle_array};
use xavatar_mesh::{Colouring, TriangleMesh, write_ply};

use super::write::{create_folder, write_parameters};
use super::{PARAMETERS, RAW_SCANS};
use crate::FrameId;

/// Where the files of one frame go.
#[derive(Clone, Debug)]
pub struct FrameFolder {
    sequence: PathBuf,
    number: u32,
}

impl FrameFolder {
    /// Of a frame in a subject's folder.
    pub fn of(subject: &Path, id: &FrameId) -> Self {
        Self { sequence: subject.join(&id.split).join(&id.sequence), number: id.number }
    }

    /// Writes the registered body: its parameters, hands as offsets from the mean hand, and its mesh.
    ///
    /// # Errors
    /// [`Error::Value`] for parameters of another family or convention; [`Error::Io`].
    pub fn write_body(&self, parameters: &BodyParameters, mesh: &TriangleMesh) -> Result<()> {
        write_parameters(&self.sequence, self.number, parameters)?;
        write_ply(self.sequence.join(PARAMETERS).join(format!("mesh-f{:05}_smplx.ply", self.number)), mesh)
    }

    /// Writes a scan, with its texture or its vertices' colours.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write_scan(&self, scan: &TriangleMesh) -> Result<()> {
        create_folder(&self.sequence.join(RAW_SCANS))?;
        let rows =
            |points: &[Vec3]| Array::from_f32(&[points.len(), 3], points.iter().flat_map(Vec3::to_array).collect());
        let faces = scan.faces.as_flattened().iter().map(|corner| i64::from(*corner)).collect();
        let mut arrays = ArrayMap::from([
            ("vertices".to_owned(), rows(&scan.vertices)),
            ("normals".to_owned(), rows(&scan.vertex_normals())),
            ("faces".to_owned(), Array { shape: vec![scan.faces.len(), 3], data: ArrayData::I64(faces) }),
        ]);
        match &scan.colouring {
            Colouring::None => {}
            Colouring::Vertex(colours) => {
                let data = ArrayData::U8(colours.as_flattened().to_vec());
                arrays.insert("colors".to_owned(), Array { shape: vec![colours.len(), 3], data });
            }
            Colouring::Texture { uvs, image } => {
                let values = uvs.iter().flat_map(|uv| uv.to_array()).collect();
                arrays.insert("uvs".to_owned(), Array::from_f32(&[uvs.len(), 2], values));
                let shape = vec![image.height() as usize, image.width() as usize, 3];
                let atlas = Array { shape, data: ArrayData::U8(image.as_raw().clone()) };
                write_pickle_array(self.scan_file("atlas"), &atlas)?;
            }
        }
        write_pickle(self.scan_file("mesh"), &arrays)
    }

    /// Takes over a raw scan of X-Humans, with its atlas, as it is: as hard links, or copies where the file system has none. Files
    /// of another kind are left alone, and the answer is no.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn link_scan(&self, scan: &Path) -> Result<bool> {
        let name = scan.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if !(name.starts_with("mesh") && name.ends_with(".pkl")) {
            return Ok(false);
        }
        create_folder(&self.sequence.join(RAW_SCANS))?;
        for kind in ["mesh", "atlas"] {
            let (from, to) = (scan.with_file_name(name.replacen("mesh", kind, 1)), self.scan_file(kind));
            if from.is_file() && !to.exists() && fs::hard_link(&from, &to).is_err() {
                fs::copy(&from, &to).map_err(Error::io(&to))?;
            }
        }
        Ok(true)
    }

    /// Removes what was written of the frame before.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn clear(&self) -> Result<()> {
        let of_body = |extension: &str| {
            self.sequence.join(PARAMETERS).join(format!("mesh-f{:05}_smplx.{extension}", self.number))
        };
        for file in [self.scan_file("mesh"), self.scan_file("atlas"), of_body("pkl"), of_body("ply")] {
            if file.exists() {
                fs::remove_file(&file).map_err(Error::io(&file))?;
            }
        }
        Ok(())
    }

    fn scan_file(&self, kind: &str) -> PathBuf {
        self.sequence.join(RAW_SCANS).join(format!("{kind}-f{:05}.pkl", self.number))
    }
}
