//! Where the camera stands for a picture: level with the subject, just far enough away that all of it is seen.

use glam::{Mat3, Vec3};

use super::PinholeCamera;
use xavatar_formats::{Error, Result};

/// Azimuth of a picture from the front: the subject faces +Z. Radians.
pub const FRONT: f32 = 0.0;
/// Azimuth of a picture that shows the front and the subject's left side. Radians (35 degrees).
pub const THREE_QUARTER: f32 = 0.61;

/// A portrait lens: bodies keep their proportions. Radians (20 degrees).
const FIELD_OF_VIEW: f32 = 0.35;
/// Room between the subject and the edges of a picture, as a factor on its extent.
const MARGIN: f32 = 1.06;

impl PinholeCamera {
    /// A camera that sees the whole box (`minimum`, `maximum`), level with its centre, from the direction `azimuth` about +Y
    /// ([`FRONT`] is +Z, positive turns towards +X, the subject's left).
    ///
    /// # Errors
    /// [`Error::Value`] if the box is empty or not finite (a mesh without vertices has no bounds).
    pub fn framing(minimum: Vec3, maximum: Vec3, azimuth: f32, width: u32, height: u32) -> Result<Self> {
        let extent = maximum - minimum;
        if !(extent.min_element() >= 0.0 && extent.max_element() > 0.0 && extent.is_finite() && azimuth.is_finite()) {
            return Err(Error::Value {
                name: "box to be framed".into(),
                found: format!("{minimum} to {maximum}, seen from azimuth {azimuth}"),
                expected: "a finite box with an extent".into(),
            });
        }
        let corner = |index: u32, axis: usize| if index >> axis & 1 == 0 { minimum[axis] } else { maximum[axis] };
        let corners: Vec<Vec3> =
            (0..8).map(|index| Vec3::from_array([0, 1, 2].map(|axis| corner(index, axis)))).collect();
        Self::framing_points(&corners, azimuth, width, height)
    }

    /// As [`framing`](Self::framing), but of points: nearer than for their box, unless the azimuth is along one of its sides.
    ///
    /// # Errors
    /// [`Error::Value`] if there are none, or none but one place, or one is not finite.
    pub fn framing_points(points: &[Vec3], azimuth: f32, width: u32, height: u32) -> Result<Self> {
        let axes = view_axes(azimuth);
        let [low, high] = extent(points, axes);
        let finite = azimuth.is_finite() && points.iter().all(|point| point.is_finite());
        if !(finite && (high - low).max_element() > 0.0) {
            return Err(Error::Value {
                name: "points to be framed".into(),
                found: format!("{} from {low} to {high}, seen from azimuth {azimuth}", points.len()),
                expected: "finite points that have an extent".into(),
            });
        }
        let middle = (low + high) / 2.0;
        let vertical = (FIELD_OF_VIEW / 2.0).tan();
        let horizontal = vertical * width as f32 / height.max(1) as f32;
        let distance = points
            .iter()
            .map(|point| {
                let offset = (axes * *point - middle) * MARGIN;
                (offset.x.abs() / horizontal).max(offset.y.abs() / vertical) + offset.z
            })
            .fold(0.0, f32::max);
        let place = |along: Vec3| axes.transpose() * along;
        Self::looking_at(place(middle + Vec3::Z * distance), place(middle), FIELD_OF_VIEW, [width, height])
    }

    /// The camera after it has gone around the vertical line through `centre` by `angle`, radians, towards the subject's left.
    #[must_use]
    pub fn gone_around(self, centre: Vec3, angle: f32) -> Self {
        let turn = Mat3::from_rotation_y(-angle);
        let translation = self.rotation * (centre - turn * centre) + self.translation;
        Self { rotation: self.rotation * turn, translation, ..self }
    }
}

/// Rows: right, up and towards the camera, for one that is level and looks from this azimuth.
fn view_axes(azimuth: f32) -> Mat3 {
    let (sin, cos) = azimuth.sin_cos();
    Mat3::from_cols(Vec3::new(cos, 0.0, -sin), Vec3::Y, Vec3::new(sin, 0.0, cos)).transpose()
}

/// The lowest and highest coordinates along the rows of `axes`.
fn extent(points: &[Vec3], axes: Mat3) -> [Vec3; 2] {
    points.iter().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], point| {
        let place = axes * *point;
        [low.min(place), high.max(place)]
    })
}

/// Cameras for pictures that stand in a row: all bodies at one scale and on one line, each picture as wide as its body needs, all
/// of them `height` pixels high. Seen from `azimuth`, as in [`PinholeCamera::framing`].
///
/// # Errors
/// [`Error::Value`] if a body has no points, or none that is finite.
pub fn framing_row(bodies: &[&[Vec3]], azimuth: f32, height: u32) -> Result<Vec<PinholeCamera>> {
    let axes = view_axes(azimuth);
    // Low and high corner of each along right, up and towards the camera.
    let extents: Vec<[Vec3; 2]> = bodies.iter().map(|points| extent(points, axes)).collect();
    let sizes = extents.iter().map(|[low, high]| *high - *low);
    let largest = sizes.fold(Vec3::ZERO, Vec3::max);
    if bodies.is_empty()
        || !(largest.y > 0.0 && largest.is_finite() && extents.as_flattened().iter().all(|p| p.is_finite()))
    {
        return Err(Error::Value {
            name: "bodies to be framed".into(),
            found: format!("{} of extent {largest}", bodies.len()),
            expected: "at least one, each with finite points and a height".into(),
        });
    }
    let tangent = (FIELD_OF_VIEW / 2.0).tan();
    let distance = largest.y * MARGIN / 2.0 / tangent + largest.z / 2.0;
    let pixels_per_metre = height as f32 / (2.0 * tangent * (distance - largest.z / 2.0));
    let room = largest.y * (MARGIN - 1.0);
    let camera = |[low, high]: &[Vec3; 2]| {
        let middle = (*low + *high) / 2.0;
        let target = axes.transpose() * Vec3::new(middle.x, low.y + largest.y / 2.0, middle.z);
        let width = ((high.x - low.x + room) * pixels_per_metre).ceil() as u32;
        PinholeCamera::looking_at(
            target + axes.transpose() * Vec3::Z * distance,
            target,
            FIELD_OF_VIEW,
            [width.max(1), height],
        )
    };
    extents.iter().map(camera).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    #[test]
    fn framing_keeps_every_corner_inside_and_fills_the_picture() {
        let (minimum, maximum) = (Vec3::new(-0.9, -1.2, -0.2), Vec3::new(0.8, 0.6, 0.3));
        for azimuth in [FRONT, THREE_QUARTER, 2.0, -1.3] {
            let camera = PinholeCamera::framing(minimum, maximum, azimuth, 300, 500).unwrap();
            let mut fill = 0.0_f32;
            for corner in 0..8 {
                let pick = |bit: u32, axis: usize| if corner >> bit & 1 == 0 { minimum[axis] } else { maximum[axis] };
                let (pixel, _) = camera.project(Vec3::new(pick(0, 0), pick(1, 1), pick(2, 2)));
                let relative = (pixel / Vec2::new(150.0, 250.0) - Vec2::ONE).abs();
                fill = fill.max(relative.max_element());
            }
            assert!((0.85..1.0).contains(&fill), "azimuth {azimuth}: corners reach {fill} of the half picture");
        }
    }

    #[test]
    fn points_fill_the_picture_where_their_box_would_not() {
        // A plank towards the camera's left and right: its box is as deep as it is wide.
        let across = Vec3::new(THREE_QUARTER.cos(), 0.0, -THREE_QUARTER.sin());
        let points = [-across, across, Vec3::Y * 0.1];
        let camera = PinholeCamera::framing_points(&points, THREE_QUARTER, 300, 300).unwrap();
        let [left, right, top] = points.map(|point| camera.project(point).0);
        assert!((5.0..12.0).contains(&left.x) && (288.0..295.0).contains(&right.x), "{left} {right}");
        assert!(top.y < left.y, "up is up");
        for wrong in [&[][..], &[Vec3::ONE; 3], &[Vec3::ZERO, Vec3::NAN]] {
            assert!(PinholeCamera::framing_points(wrong, FRONT, 300, 300).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn a_row_has_one_scale_and_one_ground_and_cuts_nothing() {
        let corners = |low: Vec3, high: Vec3| -> Vec<Vec3> {
            (0..8)
                .map(|corner| Vec3::from_array(std::array::from_fn(|axis| [low, high][corner >> axis & 1][axis])))
                .collect()
        };
        let tall = corners(Vec3::new(-0.2, 0.0, -0.1), Vec3::new(0.2, 1.9, 0.2));
        let wide = corners(Vec3::new(2.0, -1.0, 0.0), Vec3::new(3.8, 0.1, 0.3));
        let cameras = framing_row(&[&tall, &wide], THREE_QUARTER, 400).unwrap();
        assert!(cameras[1].width > 2 * cameras[0].width && cameras.iter().all(|camera| camera.height == 400));
        let mut grounds = Vec::new();
        for (camera, body) in cameras.iter().zip([&tall, &wide]) {
            assert_eq!(camera.fy, cameras[0].fy);
            let places: Vec<Vec2> = body.iter().map(|point| camera.project(*point).0).collect();
            let size = Vec2::new(camera.width as f32, camera.height as f32);
            assert!(places.iter().all(|place| place.cmpgt(Vec2::ZERO).all() && place.cmplt(size).all()), "{places:?}");
            // Under the body's middle: nearer corners are seen lower, the more so the deeper a body is.
            let (middle, ground) = ((body[0] + body[7]) / 2.0, body[0].y);
            grounds.push(camera.project(Vec3::new(middle.x, ground, middle.z)).0.y);
        }
        assert!((grounds[0] - grounds[1]).abs() < 0.1, "{grounds:?}");
        assert!(framing_row(&[], FRONT, 100).is_err() && framing_row(&[&[]], FRONT, 100).is_err());
    }

    #[test]
    fn a_camera_that_has_gone_around_sees_the_centre_from_the_other_side() {
        let centre = Vec3::new(0.3, 1.0, -0.2);
        let camera = PinholeCamera::looking_at(centre + 3.0 * Vec3::Z, centre, 0.5, [90, 90]).unwrap();
        let quarter = camera.gone_around(centre, std::f32::consts::FRAC_PI_2);
        assert!(quarter.position().abs_diff_eq(centre + 3.0 * Vec3::X, 1e-5), "{}", quarter.position());
        assert!(quarter.project(centre).0.abs_diff_eq(camera.project(centre).0, 1e-3));
    }
}
