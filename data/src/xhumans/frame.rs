//! One frame of a subject, read and checked.

use std::path::Path;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use image::RgbImage;

use crate::fields::{Fields, rotations};
use crate::{FrameFiles, ScanFrame};
use xavatar_body::{BodyParameters, HandPose};
use xavatar_formats::{ArrayData, ArrayMap, Error, Result, Value, read_pickle, read_pickle_arrays};
use xavatar_mesh::{Colouring, TriangleMesh, read_ply};

const FORMAT: &str = "X-Humans frame";

/// Reads a frame: its scan with texture or vertex colours, and its parameters with the subject's mean shape `betas`.
///
/// Every number is finite, every index in range and every length consistent in what is returned.
///
/// # Errors
/// [`Error::Frame`] naming the frame and, inside, the file: [`Error::Missing`], [`Error::Malformed`],
/// [`Error::Mismatch`] for an empty scan, or [`Error::Refused`].
pub fn read_frame(files: &FrameFiles, betas: &[f32; 10]) -> Result<ScanFrame> {
    let read = || {
        let scan = match &files.atlas {
            Some(atlas) => textured_scan(&files.scan, atlas)?,
            None => {
                must_exist(&files.scan, "the frame's scan")?;
                read_ply(&files.scan)?
            }
        };
        scan.check().map_err(|error| in_scan(error, &files.scan))?;
        if scan.faces.is_empty() {
            return Err(Error::Mismatch {
                path: files.scan.clone(),
                found: format!("a scan of {} vertices and no faces", scan.vertices.len()),
                expected: "a surface".into(),
                remedy: "leave the frame out (--skip-bad-frames) or export it again".into(),
            });
        }
        must_exist(&files.parameters, "the frame's SMPL-X parameters")?;
        let arrays = read_pickle_arrays(&files.parameters)?;
        let parameters = BodyParameters { betas: *betas, ..parameters_of(&files.parameters, &arrays)? };
        Ok(ScanFrame { id: files.id.clone(), scan, parameters })
    };
    read().map_err(|error: Error| error.in_frame(files.id.to_string()))
}

/// The registered parameters of a frame; shape is left at zero.
pub(crate) fn parameters_of(path: &Path, arrays: &ArrayMap) -> Result<BodyParameters> {
    let fields = Fields { path, format: FORMAT, arrays };
    let [global_orient] = rotations(&fields.vector::<3>("global_orient")?);
    let [jaw_pose] = rotations(&fields.vector::<3>("jaw_pose")?);
    let [left_eye_pose] = rotations(&fields.vector::<3>("leye_pose")?);
    let [right_eye_pose] = rotations(&fields.vector::<3>("reye_pose")?);
    Ok(BodyParameters {
        betas: [0.0; 10],
        expression: fields.vector("expression")?,
        global_orient,
        body_pose: rotations(&fields.vector::<63>("body_pose")?),
        jaw_pose,
        left_eye_pose,
        right_eye_pose,
        left_hand_pose: HandPose::RelativeToMean(rotations(&fields.vector::<45>("left_hand_pose")?)),
        right_hand_pose: HandPose::RelativeToMean(rotations(&fields.vector::<45>("right_hand_pose")?)),
        transl: fields.vector::<3>("transl")?.into(),
    })
}

/// A raw scan: `vertices` (V, 3), `normals` (V, 3), `uvs` (V, 2), `faces` (F, 3), and its atlas (height, width, 3).
fn textured_scan(scan: &Path, atlas: &Path) -> Result<TriangleMesh> {
    must_exist(scan, "the frame's scan")?;
    must_exist(atlas, "the scan's texture atlas")?;
    let arrays = read_pickle_arrays(scan)?;
    let fields = Fields { path: scan, format: FORMAT, arrays: &arrays };
    let vertices = points(&fields.rows("vertices", 3)?);
    let normals = points(&fields.rows("normals", 3)?).into_iter().map(Vec3::normalize_or_zero).collect();
    let uvs = fields.rows("uvs", 2)?;
    // Texels past the border do not exist; some raw coordinates lie there by rounding.
    let uvs = uvs.as_chunks::<2>().0.iter().map(|&uv| Vec2::from(uv).clamp(Vec2::ZERO, Vec2::ONE)).collect();
    let faces = fields.array("faces")?;
    let corners = faces.to_indices(vertices.len()).filter(|_| matches!(faces.shape[..], [_, 3]));
    let corners = corners.ok_or_else(|| {
        let expected = format!("indices below {} in 3 columns", vertices.len());
        fields.malformed("faces", faces.description(), expected)
    })?;
    Ok(TriangleMesh {
        faces: corners.as_chunks::<3>().0.to_vec(),
        vertices,
        normals: Some(normals),
        colouring: Colouring::Texture { uvs, image: Arc::new(read_atlas(atlas)?) },
    })
}

fn points(values: &[f32]) -> Vec<Vec3> {
    values.as_chunks::<3>().0.iter().map(|&point| point.into()).collect()
}

fn read_atlas(path: &Path) -> Result<RgbImage> {
    let malformed = |found: String| Error::Malformed {
        path: path.into(),
        format: "X-Humans texture atlas",
        place: "top level".into(),
        found,
        expected: "u8 (height, width, 3)".into(),
    };
    let Value::Array(array) = read_pickle(path)? else {
        return Err(malformed("no array".into()));
    };
    let image = match (&array.shape[..], &array.data) {
        (&[height, width, 3], ArrayData::U8(texels)) if !texels.is_empty() => {
            let extents = u32::try_from(width).ok().zip(u32::try_from(height).ok());
            extents.and_then(|(width, height)| RgbImage::from_raw(width, height, texels.clone()))
        }
        _ => None,
    };
    image.ok_or_else(|| malformed(array.description()))
}

fn must_exist(path: &Path, what: &str) -> Result<()> {
    if path.exists() {
        return Ok(());
    }
    Err(Error::Missing {
        path: path.into(),
        what: what.into(),
        remedy: "complete the data set, or leave the frame out with --skip-bad-frames".into(),
    })
}

/// A mesh's own complaint, which knows no file, as one about the scan's file.
fn in_scan(error: Error, path: &Path) -> Error {
    match error {
        Error::Value { name, found, expected } => {
            Error::Malformed { path: path.into(), format: FORMAT, place: name, found, expected }
        }
        other => other,
    }
}
