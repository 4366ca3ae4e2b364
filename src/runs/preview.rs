//! What a run shows of itself: a capture beside the avatar in the same pose.

use std::path::{Path, PathBuf};

use glam::Vec3;
use image::RgbImage;

use crate::avatar::Avatar;
use crate::body::{BodyModel, PartLabels};
use crate::data::Capture;
use crate::mesh::TriangleMesh;
use crate::mesh::camera::{FRONT, PinholeCamera};
use crate::render::{Tile, View, contact_sheet, render_mesh, write_png};
use crate::{Error, InputError, Result};

/// The folder of a run's previews.
pub(super) const FOLDER: &str = "previews";
/// Cells along the longest side of the box around the body.
const RESOLUTION: usize = 128;
const WIDTH: u32 = 480;
const HEIGHT: u32 = 640;

/// Writes a preview into a run's folder; none if the avatar has no surface yet.
pub(super) fn write(
    run: &Path,
    avatar: &Avatar,
    body: &BodyModel,
    labels: &PartLabels,
    capture: &Capture,
) -> Result<Option<PathBuf>> {
    let pose = body.resolve(capture.parameters())?;
    let extracted = match avatar.extract_posed(body, labels, &pose, RESOLUTION) {
        Err(Error::NoSurface { .. }) => return Ok(None),
        extracted => extracted?,
    };
    let folder = run.join(FOLDER);
    std::fs::create_dir_all(&folder).map_err(InputError::io(&folder))?;
    let path = folder.join(format!("step-{:08}.png", avatar.steps));
    write_png(&path, &sheet(capture, &extracted.mesh)?)?;
    Ok(Some(path))
}

/// A scan and the avatar from the front, in colour and as normals; or a picture and the avatar by the same camera.
fn sheet(capture: &Capture, avatar: &TriangleMesh) -> Result<RgbImage> {
    let row = match capture {
        Capture::Scan(frame) => {
            let camera = front_view(&frame.scan)?;
            let tiles = |view: View| -> Result<Vec<Tile>> {
                Ok(vec![
                    Tile::new(render_mesh(&frame.scan, &camera, view)?, "scan"),
                    Tile::new(render_mesh(avatar, &camera, view)?, "avatar"),
                ])
            };
            [tiles(View::Colour)?, tiles(View::Normals)?].concat()
        }
        Capture::Rgbd(capture) => {
            let camera = &capture.frame.camera;
            vec![
                Tile::new(capture.frame.colour.clone(), "picture"),
                Tile::new(render_mesh(avatar, camera, View::Colour)?, "avatar"),
                Tile::new(render_mesh(avatar, camera, View::Normals)?, "avatar"),
            ]
        }
    };
    Ok(contact_sheet(&[row])?)
}

fn front_view(mesh: &TriangleMesh) -> Result<PinholeCamera> {
    let low = mesh.vertices.iter().copied().reduce(Vec3::min).unwrap_or_default();
    let high = mesh.vertices.iter().copied().reduce(Vec3::max).unwrap_or_default();
    Ok(PinholeCamera::framing(low, high, FRONT, WIDTH, HEIGHT)?)
}
