//! What a run shows of itself: a captured frame beside the avatar in the same pose.

use glam::Vec3;
use image::RgbImage;

use super::captured::CapturedFrame;
use crate::Result;
use crate::mesh::TriangleMesh;
use crate::mesh::camera::{FRONT, PinholeCamera};
use crate::render::{Tile, View, contact_sheet, render_mesh};

const WIDTH: u32 = 480;
const HEIGHT: u32 = 640;

/// A scan and the avatar from the front, in colour and as normals; or a picture and the avatar by the same camera.
pub(super) fn sheet(frame: &CapturedFrame, avatar: &TriangleMesh) -> Result<RgbImage> {
    let row = match frame {
        CapturedFrame::Scan(frame) => {
            let camera = front_view(&frame.scan)?;
            let tiles = |view: View| -> Result<Vec<Tile>> {
                Ok(vec![
                    Tile::new(render_mesh(&frame.scan, &camera, view)?, "scan"),
                    Tile::new(render_mesh(avatar, &camera, view)?, "avatar"),
                ])
            };
            [tiles(View::Colour)?, tiles(View::Normals)?].concat()
        }
        CapturedFrame::Rgbd(capture) => {
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
