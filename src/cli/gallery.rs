//! The demo's pictures. The main one: a column a pose, the subject above the avatar above the avatar's shape; the canonical pose last.

use std::path::Path;

use glam::Vec3;
use image::imageops::{FilterType, resize};
use image::{Rgb, RgbImage};
use xavatar::Result;
use xavatar::data::RgbdFrame;
use xavatar::mesh::TriangleMesh;
use xavatar::render::{Camera, FRONT, THREE_QUARTER, Tile, View, contact_sheet, render_mesh, write_png};

/// Pictures of one size, collected into a sheet.
pub struct Gallery {
    size: (u32, u32),
    subject: Vec<Tile>,
    avatar: Vec<Tile>,
    shape: Vec<Tile>,
}

impl Gallery {
    /// For pictures of `size` columns and rows, pixels.
    pub fn new(size: (u32, u32)) -> Self {
        Self { size, subject: Vec::new(), avatar: Vec::new(), shape: Vec::new() }
    }

    /// Puts an avatar's posed mesh below the scan that it should look like, seen by the same camera.
    pub fn add_pose(&mut self, scan: &TriangleMesh, mesh: &TriangleMesh) -> Result<()> {
        let camera = self.camera(scan, THREE_QUARTER)?;
        let pose = self.subject.len() + 1;
        self.subject.push(Tile::new(render_mesh(scan, &camera, View::Colour)?, format!("subject, pose {pose}")));
        self.avatar.push(Tile::new(render_mesh(mesh, &camera, View::Colour)?, format!("avatar, pose {pose}")));
        self.shape.push(Tile::new(render_mesh(mesh, &camera, View::Shaded)?, "its shape"));
        Ok(())
    }

    /// Writes the sheet, the canonical pose beside the others.
    pub fn write(mut self, canonical: &TriangleMesh, path: &Path) -> Result<()> {
        let camera = self.camera(canonical, FRONT)?;
        let columns = [
            (&mut self.subject, View::Normals, "canonical normals"),
            (&mut self.avatar, View::Colour, "canonical"),
            (&mut self.shape, View::Shaded, "its shape"),
        ];
        for (row, view, label) in columns {
            row.push(Tile::new(render_mesh(canonical, &camera, view)?, label));
        }
        write_png(path, &contact_sheet(&[self.subject, self.avatar, self.shape])?)
    }

    fn camera(&self, mesh: &TriangleMesh, azimuth: f32) -> Result<Camera> {
        let minimum = mesh.vertices.iter().copied().fold(Vec3::MAX, Vec3::min);
        let maximum = mesh.vertices.iter().copied().fold(Vec3::MIN, Vec3::max);
        Camera::framing(minimum, maximum, azimuth, self.size.0, self.size.1)
    }
}

/// Pictures of the RGB-D camera to show.
const SHOWN: usize = 6;

/// What the RGB-D camera took: colours above depths, evenly spread over the take.
pub fn sheet_of_pictures(frames: &[RgbdFrame], size: (u32, u32)) -> Result<RgbImage> {
    let shown = frames.iter().step_by(frames.len().div_ceil(SHOWN).max(1));
    let scaled = |picture: &RgbImage| {
        let width = (picture.width() * size.1 / picture.height().max(1)).max(1);
        resize(picture, width, size.1, FilterType::Triangle)
    };
    let (colours, depths) = shown
        .map(|frame| {
            let depth = depth_picture(frame);
            (Tile::new(scaled(&frame.colour), frame.id.to_string()), Tile::new(scaled(&depth), "its depth"))
        })
        .unzip();
    contact_sheet(&[colours, depths])
}

/// Depths from near, white, to far; what has none is black.
fn depth_picture(frame: &RgbdFrame) -> RgbImage {
    let depths = || (0..frame.depth.len()).filter_map(|pixel| frame.surface_depth(pixel));
    let (near, far) = depths().fold((f32::MAX, f32::MIN), |(near, far), depth| (near.min(depth), far.max(depth)));
    RgbImage::from_fn(frame.camera.width, frame.camera.height, |column, row| {
        let depth = frame.surface_depth((row * frame.camera.width + column) as usize);
        let light = depth.map_or(0.0, |depth| 255.0 - 200.0 * (depth - near) / (far - near).max(f32::MIN_POSITIVE));
        Rgb([light as u8; 3])
    })
}
