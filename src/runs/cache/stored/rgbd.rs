//! An RGB-D picture as arrays. Of its points only pixels and normals are stored: the picture has the rest.

use glam::{Mat3, Vec3};

use super::{Stored, picture_array, rows};
use crate::body::BodyParameters;
use crate::data::{FrameId, PointCloud, RgbdCapture, RgbdFrame};
use crate::formats::{Array, ArrayData, ArrayMap, Result};
use crate::mesh::camera::{PinholeCamera, pixel_centre};

/// [fx, fy, cx, cy, R by columns, t]; its presence tells a picture from a scan.
pub(super) const CAMERA: &str = "camera";

pub(super) fn to_arrays(capture: &RgbdCapture) -> ArrayMap {
    let RgbdCapture { frame, cloud } = capture;
    let PinholeCamera { width, height, fx, fy, cx, cy, rotation, translation } = frame.camera;
    let shape = vec![height as usize, width as usize];
    let camera = [&[fx, fy, cx, cy][..], &rotation.to_cols_array(), &translation.to_array()].concat();
    let pixels = cloud.pixels.iter().map(|pixel| i64::from(*pixel)).collect();
    let mut arrays = ArrayMap::from([
        (CAMERA.to_owned(), Array::from_f32(&[camera.len()], camera)),
        ("depth".to_owned(), Array::from_f32(&shape, frame.depth.clone())),
        ("colour".to_owned(), picture_array(&frame.colour)),
        ("pixels".to_owned(), Array { shape: vec![cloud.pixels.len()], data: ArrayData::I64(pixels) }),
        ("normals".to_owned(), rows(cloud.normals.iter().copied())),
    ]);
    if let Some(mask) = &frame.mask {
        let data = ArrayData::U8(mask.iter().map(|shows| u8::from(*shows)).collect());
        arrays.insert("mask".to_owned(), Array { shape, data });
    }
    arrays
}

pub(super) fn of(stored: &Stored, id: FrameId, parameters: BodyParameters) -> Result<RgbdCapture> {
    let colour = stored.picture("colour")?;
    let values: [f32; 16] = stored.exactly(CAMERA)?;
    let [fx, fy, cx, cy, pose @ ..] = values;
    let [rotation @ .., x, y, z] = pose;
    let camera = PinholeCamera {
        width: colour.width(),
        height: colour.height(),
        fx,
        fy,
        cx,
        cy,
        rotation: Mat3::from_cols_array(&rotation),
        translation: Vec3::new(x, y, z),
    };
    let mask = match stored.has("mask") {
        true => Some(stored.bytes("mask")?.iter().map(|byte| *byte != 0).collect()),
        false => None,
    };
    let frame = RgbdFrame { id, camera, colour, depth: stored.floats("depth")?, mask, parameters };
    frame.check()?;
    let pixels = stored.indices("pixels", frame.depth.len())?;
    let normals = stored.points("normals")?;
    if pixels.len() != normals.len() || pixels.iter().any(|pixel| frame.surface_depth(*pixel as usize).is_none()) {
        return Err(stored.broken("pixels"));
    }
    let place = |pixel: u32| (pixel % camera.width, pixel / camera.width);
    let point = |pixel: &u32| {
        let (column, row) = place(*pixel);
        camera.back_project(pixel_centre(column, row), frame.depth[*pixel as usize])
    };
    let cloud = PointCloud {
        points: pixels.iter().map(point).collect(),
        colours: pixels.iter().map(|pixel| frame.colour.get_pixel(place(*pixel).0, place(*pixel).1).0).collect(),
        normals,
        pixels,
    };
    Ok(RgbdCapture { frame, cloud })
}
