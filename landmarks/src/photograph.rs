//! Landmarks in one picture of a depth camera: where the networks see joints, at the depth that was measured there.
//!
//! What is measured is skin or cloth, joints lie under it by a distance of their kind. A point that the network takes for hidden, or where
//! nothing was measured, is no landmark; nor is one that lies far from its limb's depth, which is what hides it. Pixels, metres.

use glam::{DVec3, Vec2};
use image::RgbImage;
use xavatar_mesh::camera::PinholeCamera;

use crate::body::{self, point};
use crate::finder::{ARMS, Arm, JOINTS, Landmark, TO_MIDDLE, hand_point_name};
use crate::hands;
use crate::models::Models;
use crate::network::Workspace;
use crate::picture::Crop;

/// How deep joints lie under what is seen of them, metres.
const DEEP: [(&str, f32); 7] = [
    ("eye", 0.01),
    ("shoulder", 0.06),
    ("elbow", 0.04),
    ("wrist", 0.025),
    ("hip", 0.10),
    ("knee", 0.06),
    ("ankle", 0.045),
];
/// The same of fingers.
const FINGERS_DEEP: f32 = 0.008;
/// Fingers farther from the wrist's depth are hidden by something else, metres.
const OF_HAND: f32 = 0.15;
/// Around a point, in pixels, depths are looked at ...
const AROUND: i64 = 2;
/// ... and have to be there at so many.
const ENOUGH: usize = 5;
/// What a landmark of one picture counts, of one that many agree on.
const ALONE: f64 = 0.6;

/// A colour picture with the depth of each of its pixels that shows the person (rows x columns).
#[derive(Clone, Copy)]
pub struct Photograph<'a> {
    /// sRGB.
    pub colour: &'a RgbImage,
    /// Metres; none where the person's surface was not measured.
    pub depth: &'a [Option<f32>],
    /// The camera of both.
    pub camera: &'a PinholeCamera,
}

/// A point of the body in a picture.
#[derive(Clone, Copy)]
struct Spot {
    at: Vec2,
    sure: f64,
}

impl Photograph<'_> {
    /// The landmarks of the person in the picture, in the camera's world.
    pub fn landmarks(&self, models: &Models) -> Vec<Landmark> {
        let mut workspace = Workspace::default();
        let Some(points) = self.body(models, &mut workspace) else { return Vec::new() };
        let wrists = ARMS.map(|arm| arm.wrist);
        let joints = JOINTS.iter().filter(|(_, point)| !wrists.contains(point));
        let mut landmarks: Vec<Landmark> =
            joints.filter_map(|(name, point)| self.landmark(name, points[*point]?, deep(name), None)).collect();
        for arm in &ARMS {
            landmarks.extend(self.hand(models, arm, &points, &mut workspace).unwrap_or_default());
        }
        landmarks
    }

    /// The points of the body, framed by what was measured of the person, then by hips and shoulders.
    fn body(&self, models: &Models, workspace: &mut Workspace) -> Option<Vec<Option<Spot>>> {
        let width = self.camera.width as usize;
        let shown: Vec<Vec2> = (self.depth.iter().enumerate())
            .filter(|(_, depth)| depth.is_some())
            .map(|(pixel, _)| Vec2::new((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5))
            .collect();
        let [low, high] = [Vec2::min, Vec2::max].map(|of| shown.iter().copied().reduce(of));
        let (low, high) = (low?, high?);
        let whole = Crop {
            middle: (low + high) / 2.0,
            up: Vec2::NEG_Y,
            side: body::MARGIN * (high - low).max_element(),
            pixels: body::PIXELS,
        };
        let first = self.points(models, &whole, workspace)?;
        let middle = |one: usize, other: usize| Some((first[one]?.at + first[other]?.at) / 2.0);
        let hips = middle(point::LEFT_HIP, point::RIGHT_HIP);
        let shoulders = middle(point::LEFT_SHOULDER, point::RIGHT_SHOULDER);
        let (Some(hips), Some(shoulders)) = (hips, shoulders) else { return Some(first) };
        let radius = shown.iter().map(|place| place.distance(hips)).fold(0.0, f32::max);
        let upright = Crop {
            middle: hips,
            up: (shoulders - hips).normalize_or(Vec2::NEG_Y),
            side: body::MARGIN * 2.0 * radius,
            pixels: body::PIXELS,
        };
        self.points(models, &upright, workspace).or(Some(first))
    }

    fn points(&self, models: &Models, crop: &Crop, workspace: &mut Workspace) -> Option<Vec<Option<Spot>>> {
        let outputs = models.body.run(&crop.taken(self.colour), workspace);
        let seen = body::seen(&outputs)?;
        Some(seen.into_iter().map(|seen| seen.map(|(at, sure)| Spot { at: crop.in_picture(at), sure })).collect())
    }

    /// The joints of a hand and its wrist; none if no hand of that side is seen.
    fn hand(
        &self,
        models: &Models,
        arm: &Arm,
        points: &[Option<Spot>],
        workspace: &mut Workspace,
    ) -> Option<Vec<Landmark>> {
        let (elbow, wrist) = (points[arm.elbow]?.at, points[arm.wrist]?.at);
        let knuckles = match arm.knuckles.map(|point| points[point]) {
            [Some(pinky), Some(index)] => (pinky.at + index.at) / 2.0,
            _ => wrist + (wrist - elbow) / 3.0,
        };
        let depth = self.depth_at(wrist)?;
        let metre = self.camera.fx / depth;
        let outward = (knuckles - wrist).normalize_or((wrist - elbow).normalize_or(Vec2::NEG_Y));
        let mut middle = wrist + outward * (knuckles.distance(wrist)).min(TO_MIDDLE as f32 * metre);
        let mut up = outward;
        let mut spots = Vec::new();
        for round in &hands::ROUNDS {
            let crop = Crop { middle, up, side: round.side * metre, pixels: hands::PIXELS };
            let seen = hands::seen(&models.hand.run(&crop.taken(self.colour), workspace));
            let seen = seen.filter(|seen| seen.side == arm.side && seen.points.len() == hands::POINTS)?;
            spots = seen.points.iter().map(|at| Spot { at: crop.in_picture(*at), sure: seen.sure }).collect();
            middle = spots.iter().map(|spot: &Spot| spot.at).sum::<Vec2>() / spots.len() as f32;
            up = (spots[hands::KNUCKLE].at - spots[hands::WRIST].at).try_normalize()?;
        }
        let landmark = |(point, spot): (usize, &Spot)| {
            let deep = if point == hands::WRIST { deep("wrist") } else { FINGERS_DEEP };
            self.landmark(&hand_point_name(arm.name, point), *spot, deep, Some(depth))
        };
        Some(spots.iter().enumerate().filter_map(landmark).collect())
    }

    /// A point under what was measured around its place in the picture, near the depth of its limb if that is known.
    fn landmark(&self, name: &str, spot: Spot, deep: f32, of_limb: Option<f32>) -> Option<Landmark> {
        let depth = self.depth_at(spot.at)?;
        if of_limb.is_some_and(|limb| (depth - limb).abs() > OF_HAND) {
            return None;
        }
        let place: DVec3 = self.camera.back_project(spot.at, depth + deep).as_dvec3();
        Some(Landmark { name: name.into(), place, confidence: ALONE * spot.sure })
    }

    /// The median of the person's depths around a place in the picture, if there are enough.
    fn depth_at(&self, at: Vec2) -> Option<f32> {
        let (width, height) = (i64::from(self.camera.width), i64::from(self.camera.height));
        let [column, row] = at.is_finite().then(|| at.to_array().map(|along| i64::from(along.floor() as i32)))?;
        let around =
            (-AROUND..=AROUND).flat_map(|down| (-AROUND..=AROUND).map(move |right| (column + right, row + down)));
        let inside = around.filter(|(column, row)| (0..width).contains(column) && (0..height).contains(row));
        let mut depths: Vec<f32> =
            inside.filter_map(|(column, row)| self.depth[(row * width + column) as usize]).collect();
        depths.sort_by(f32::total_cmp);
        (depths.len() >= ENOUGH).then(|| depths[depths.len() / 2])
    }
}

fn deep(name: &str) -> f32 {
    DEEP.iter().find(|(kind, _)| name.ends_with(kind)).map_or(0.0, |(_, deep)| *deep)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAME: &str = "left_wrist";

    /// What is found at a place of a picture in which a wall stands 2 m away, but for a hand 1.5 m away, in the columns from 20 on, and for
    /// columns from 40 on, where nothing was measured.
    fn found(at: Vec2, of_limb: Option<f32>) -> Option<Landmark> {
        let (width, height) = (60, 30);
        let camera = PinholeCamera {
            width,
            height,
            fx: 50.0,
            fy: 50.0,
            cx: 30.0,
            cy: 15.0,
            rotation: glam::Mat3::IDENTITY,
            translation: glam::Vec3::ZERO,
        };
        let depth = |column: u32| match column {
            0..20 => Some(2.0),
            20..40 => Some(1.5),
            _ => None,
        };
        let depth: Vec<Option<f32>> = (0..width * height).map(|pixel| depth(pixel % width)).collect();
        let colour = RgbImage::new(width, height);
        let photograph = Photograph { colour: &colour, depth: &depth, camera: &camera };
        photograph.landmark(NAME, Spot { at, sure: 0.5 }, deep(NAME), of_limb)
    }

    #[test]
    fn a_joint_lies_under_what_is_measured_where_it_is_seen() {
        let wrist = found(Vec2::new(30.0, 15.0), Some(1.52)).unwrap();
        assert!(wrist.place.abs_diff_eq(DVec3::new(0.0, 0.0, 1.525), 1e-6), "{}", wrist.place);
        assert_eq!((wrist.name.as_str(), wrist.confidence), (NAME, 0.5 * ALONE));
    }

    #[test]
    fn what_is_hidden_or_not_measured_is_no_landmark() {
        assert!(found(Vec2::new(10.0, 15.0), None).is_some());
        assert_eq!(found(Vec2::new(10.0, 15.0), Some(1.5)), None, "behind something else than its hand");
        for beside in [Vec2::new(45.0, 15.0), Vec2::new(-3.0, 4.0), Vec2::new(30.0, 1e9), Vec2::new(f32::NAN, 0.0)] {
            assert_eq!(found(beside, None), None, "{beside}");
        }
    }
}
