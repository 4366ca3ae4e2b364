//! The demo's pictures. The main one: a column a pose, the subject above the avatar above the avatar's shape; the canonical pose last.

use std::path::Path;

use glam::Vec3;
use image::imageops::{FilterType, resize};
use image::{Rgb, RgbImage};
use xavatar::data::{RgbdFrame, Source};
use xavatar::formats::Result;
use xavatar::mesh::TriangleMesh;
use xavatar::mesh::camera::{FRONT, THREE_QUARTER, framing_row};
use xavatar::render::{Scene, Tile, View, contact_sheet, write_png};
use xavatar::synthetic::FilmedScans;

/// Meshes that are pictured on one sheet, all at the same scale.
pub struct Gallery {
    height: u32,
    /// The subject and its avatar in each pose.
    poses: Vec<(TriangleMesh, TriangleMesh)>,
}

impl Gallery {
    /// For pictures of `height` rows, pixels.
    pub fn new(height: u32) -> Self {
        Self { height, poses: Vec::new() }
    }

    /// Puts an avatar's posed mesh below the scan that it should look like.
    pub fn add_pose(&mut self, scan: &TriangleMesh, mesh: &TriangleMesh) {
        self.poses.push((scan.clone(), mesh.clone()));
    }

    /// Writes the sheet, the canonical pose beside the others, and returns it.
    pub fn write(self, canonical: &TriangleMesh, path: &Path) -> Result<RgbImage> {
        let scans: Vec<&[Vec3]> = self.poses.iter().map(|(scan, _)| scan.vertices.as_slice()).collect();
        let cameras = framing_row(&scans, THREE_QUARTER, self.height)?;
        let [mut subject, mut avatar, mut shape] = [Vec::new(), Vec::new(), Vec::new()];
        for ((scan, mesh), camera) in self.poses.iter().zip(cameras) {
            subject.push(Tile::new(lit(scan)?.render(&camera, View::Colour)?, "subject"));
            let scene = lit(mesh)?;
            avatar.push(Tile::new(scene.render(&camera, View::Colour)?, "avatar"));
            shape.push(Tile::new(scene.render(&camera, View::Shaded)?, "its shape"));
        }
        let camera = framing_row(&[&canonical.vertices], FRONT, self.height)?[0];
        let scene = lit(canonical)?;
        let columns = [
            (&mut subject, View::Normals, "canonical normals"),
            (&mut avatar, View::Colour, "canonical avatar"),
            (&mut shape, View::Shaded, "canonical shape"),
        ];
        for (row, view, label) in columns {
            row.push(Tile::new(scene.render(&camera, view)?, label));
        }
        let sheet = contact_sheet(&[subject, avatar, shape])?;
        write_png(path, &sheet)?;
        Ok(sheet)
    }
}

/// On the floor that it stands on.
fn lit(mesh: &TriangleMesh) -> Result<Scene<'_>> {
    let floor = mesh.vertices.iter().map(|vertex| vertex.y).fold(f32::MAX, f32::min);
    Scene::new(mesh)?.with_ambient_occlusion(Some(floor))
}

/// Pictures of the RGB-D camera to show.
const SHOWN: usize = 6;

/// What the RGB-D camera took: colours above depths, evenly spread over the take.
pub fn sheet_of_pictures(source: &FilmedScans, height: u32) -> Result<RgbImage> {
    let count = source.ids().len();
    let shown: Result<Vec<_>> =
        (0..count).step_by(count.div_ceil(SHOWN).max(1)).map(|index| source.picture(index)).collect();
    let scaled = |picture: &RgbImage| {
        let width = (picture.width() * height / picture.height().max(1)).max(1);
        resize(picture, width, height, FilterType::Triangle)
    };
    let (colours, depths) = shown?
        .iter()
        .map(|frame| {
            let depth = depth_picture(frame);
            (Tile::new(scaled(&frame.colour), "picture"), Tile::new(scaled(&depth), "its depth"))
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
