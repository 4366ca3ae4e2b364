//! Labels drawn over their picture, for people to look at: the box, the bones, the joints, what each pixel is.

use image::{GrayImage, Rgb, RgbImage};

use super::labels::{JointLabel, Labels, Visibility};
use crate::render::joint_colours;

const BOX: [u8; 3] = [240, 228, 66];
const HIDDEN: [u8; 3] = [120, 120, 120];
/// How much of a pixel's label shows over the picture.
const LABEL_SHARE: f32 = 0.65;

/// The picture, of whatever size, with the box, and the joints with the bones between them, those that are hidden in grey.
pub(super) fn with_skeleton(picture: &RgbImage, labels: &Labels, parents: &[Option<usize>]) -> RgbImage {
    let mut drawn = picture.clone();
    let scale = f64::from(picture.width()) / f64::from(labels.camera.size[0]);
    let at = |label: &JointLabel| label.pixel.map(|along| along * scale);
    let [left, top, width, height] = labels.bounds.map(|side| f64::from(side) * scale);
    let corners = [[left, top], [left + width, top], [left + width, top + height], [left, top + height]];
    (0..4).for_each(|side| line(&mut drawn, corners[side], corners[(side + 1) % 4], BOX));
    let colours = joint_colours(parents);
    let ink = |joint: usize, label: &JointLabel| match label.visibility {
        Visibility::Seen => colours[joint],
        Visibility::Hidden | Visibility::Outside => HIDDEN,
    };
    for (joint, label) in labels.joints.iter().enumerate() {
        if let Some(parent) = parents[joint] {
            line(&mut drawn, at(&labels.joints[parent]), at(label), ink(joint, label));
        }
    }
    for (joint, label) in labels.joints.iter().enumerate() {
        dot(&mut drawn, at(label), ink(joint, label));
    }
    for label in labels.keypoints.iter().flatten() {
        put(&mut drawn, at(label), [255; 3]);
    }
    drawn
}

/// The picture under the colours of its pixels' joints.
pub(super) fn with_joints(picture: &RgbImage, joints: &GrayImage, parents: &[Option<usize>]) -> RgbImage {
    let colours = joint_colours(parents);
    RgbImage::from_fn(picture.width(), picture.height(), |x, y| {
        let behind = picture.get_pixel(x, y).0;
        let label = usize::from(joints.get_pixel(x, y).0[0]).checked_sub(1).and_then(|joint| colours.get(joint));
        let Some(label) = label else { return Rgb(behind) };
        let mixed =
            |channel: usize| f32::from(behind[channel]) * (1.0 - LABEL_SHARE) + f32::from(label[channel]) * LABEL_SHARE;
        Rgb([0, 1, 2].map(|channel| mixed(channel) as u8))
    })
}

fn line(picture: &mut RgbImage, from: [f64; 2], to: [f64; 2], ink: [u8; 3]) {
    let length = (from[0] - to[0]).abs().max((from[1] - to[1]).abs()).ceil().clamp(1.0, 1e4);
    for step in 0..=length as usize {
        let share = step as f64 / length;
        put(picture, [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * share), ink);
    }
}

fn dot(picture: &mut RgbImage, place: [f64; 2], ink: [u8; 3]) {
    for (x, y) in (-1..=1).flat_map(|x| (-1..=1).map(move |y| (x, y))) {
        put(picture, [place[0] + f64::from(x), place[1] + f64::from(y)], ink);
    }
}

/// The pixel of a place, if it is in the picture.
fn put(picture: &mut RgbImage, [x, y]: [f64; 2], ink: [u8; 3]) {
    if x >= 0.0 && y >= 0.0 && x < f64::from(picture.width()) && y < f64::from(picture.height()) {
        picture.put_pixel(x as u32, y as u32, Rgb(ink));
    }
}
