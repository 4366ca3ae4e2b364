//! A picture of a depth camera with the body registered to it: the picture, the body over it, and how far it is from what was measured.

use image::{Rgb, RgbImage};

use crate::Result;
use crate::data::RgbdCapture;
use crate::mesh::TriangleMesh;
use crate::render::{ColourMap, Tile, View, contact_sheet, render_depth, render_mesh};

/// Distances from here on have the darkest colour, metres.
const FARTHEST: f32 = 0.03;
/// How much the body hides of the picture.
const OPACITY: f32 = 0.6;
/// Where body or depth is missing.
const NOTHING: Rgb<u8> = Rgb([255; 3]);

/// Three pictures side by side, from where the camera stood.
///
/// # Errors
/// [`InputError::Value`](crate::InputError::Value) if the body has impossible coordinates.
pub fn overlay(capture: &RgbdCapture, body: &TriangleMesh) -> Result<RgbImage> {
    let frame = &capture.frame;
    let camera = &frame.camera;
    let drawn = render_mesh(body, camera, View::Colour)?;
    let depth = render_depth(body, camera)?;
    let at = |column: u32, row: u32| (row * camera.width + column) as usize;
    let over = |column: u32, row: u32| {
        let own = frame.colour.get_pixel(column, row);
        if depth[at(column, row)].is_infinite() {
            return *own;
        }
        let mixed =
            |(own, body): (u8, u8)| (f32::from(own) * (1.0 - OPACITY) + f32::from(body) * OPACITY).round() as u8;
        let body = drawn.get_pixel(column, row).0;
        Rgb([0, 1, 2].map(|channel| mixed((own.0[channel], body[channel]))))
    };
    let error = |column: u32, row: u32| match (frame.surface_depth(at(column, row)), depth[at(column, row)]) {
        (Some(measured), of_body) if of_body.is_finite() => {
            Rgb(ColourMap::Heat.colour((measured - of_body).abs() / FARTHEST))
        }
        _ => NOTHING,
    };
    let (width, height) = (camera.width, camera.height);
    Ok(contact_sheet(&[vec![
        Tile::new(frame.colour.clone(), "picture"),
        Tile::new(RgbImage::from_fn(width, height, over), "body"),
        Tile::new(RgbImage::from_fn(width, height, error), "error: light 0, black 30 mm"),
    ]])?)
}
