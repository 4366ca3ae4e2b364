//! What pictures need of a camera beyond [`PinholeCamera::check`]: the integers of the rasteriser are bounded.

use xavatar_formats::{Error, Result};
use xavatar_mesh::camera::PinholeCamera;

/// Focal lengths that pictures are drawn with, in longest sides of the picture.
const FOCAL_LENGTHS: std::ops::RangeInclusive<f32> = 0.005..=1000.0;
/// How far the principal point may lie from the picture's corner, in longest sides.
const FARTHEST_PRINCIPAL_POINT: f32 = 4.0;

/// Checks what pictures need beyond [`PinholeCamera::check`].
pub(super) fn check_camera(camera: &PinholeCamera) -> Result<()> {
    camera.check()?;
    let side = camera.width.max(camera.height) as f32;
    for (name, length) in [("fx", camera.fx), ("fy", camera.fy)] {
        if !FOCAL_LENGTHS.contains(&(length / side)) {
            let [least, most] = [FOCAL_LENGTHS.start() * side, FOCAL_LENGTHS.end() * side];
            return Err(Error::Value {
                name: name.into(),
                found: format!("{length} pixels"),
                expected: format!("{least} to {most} for a picture of this size"),
            });
        }
    }
    for (name, place) in [("cx", camera.cx), ("cy", camera.cy)] {
        let farthest = FARTHEST_PRINCIPAL_POINT * side;
        if place.abs() > farthest {
            return Err(Error::Value {
                name: name.into(),
                found: format!("{place} pixels"),
                expected: format!("at most {farthest} from the corner of a picture of this size"),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use xavatar_mesh::camera::FRONT;

    use super::*;

    #[test]
    fn cameras_that_no_picture_can_be_drawn_with_are_errors() {
        let good = PinholeCamera::looking_at(Vec3::Z, Vec3::ZERO, 0.5, [8, 8]).unwrap();
        assert!(check_camera(&good).is_ok());
        assert!(check_camera(&PinholeCamera { width: 0, ..good }).is_err());
        assert!(check_camera(&PinholeCamera { fx: 1e-4, ..good }).is_err());
        assert!(check_camera(&PinholeCamera { fy: 1e20, ..good }).is_err());
        assert!(check_camera(&PinholeCamera { cx: -1e9, ..good }).is_err());
        assert!(PinholeCamera::framing(Vec3::MAX, Vec3::MIN, FRONT, 8, 8).is_err(), "bounds of nothing");
    }
}
