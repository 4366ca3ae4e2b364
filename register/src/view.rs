//! What one camera saw of a person: the space that it saw through, where no body is, and the surface, behind which a body may be anywhere.
//!
//! A point x with outward normal n projects to a pixel u of depth d(u), z being its own. Nothing is known beyond d(u), or where nothing was
//! measured. Before it, x is in the open: it has to go back along its ray where the pixel shows the person, else across, to the
//! nearest pixel that does. Points that face the camera where it saw the person are compared with the surface instead. Metres, pixels.

use glam::{DVec3, Vec2};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use xavatar_data::RgbdFrame;
use xavatar_formats::{Error, Result};
use xavatar_mesh::camera::{PinholeCamera, pixel_centre};

/// Depths are no more certain than this.
const UNCERTAIN: f64 = 0.01;
/// A point that faces the camera is hidden if it is farther behind the surface than this.
const BEHIND: f64 = 0.1;

/// What a camera saw.
pub struct View {
    camera: PinholeCamera,
    /// Up to where rays met nothing (rows x columns); none where nothing was measured.
    free_until: Vec<Option<f32>>,
    /// Pixels that show the person (rows x columns).
    is_person: Vec<bool>,
    /// Middles of the person's pixels beside others.
    outline: Vec<[f32; 2]>,
    index: ImmutableKdTree<f32, 2>,
}

/// What a view says of a place on a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sight {
    /// It is on the surface that was seen, or should be: how far behind it, metres, negative before it.
    Seen(f64),
    /// Nothing: it is hidden, or was not looked at.
    Hidden,
    /// There is nothing here: the way to where something may be, metres.
    Open(DVec3),
}

impl View {
    /// Of a frame whose camera is in the world of the body.
    ///
    /// # Errors
    /// [`Error::Value`] if no pixel shows the person.
    pub fn of(frame: &RgbdFrame) -> Result<Self> {
        let PinholeCamera { width, height, .. } = frame.camera;
        let is_person: Vec<bool> = (0..frame.depth.len()).map(|pixel| frame.surface_depth(pixel).is_some()).collect();
        let at = |column: u32, row: u32| is_person[(row * width + column) as usize];
        let is_edge = |column: u32, row: u32| {
            let columns = column.saturating_sub(1)..=(column + 1).min(width - 1);
            let rows = row.saturating_sub(1)..=(row + 1).min(height - 1);
            columns.clone().any(|other| !at(other, row)) || rows.clone().any(|other| !at(column, other))
        };
        let pixels = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
        let edges = pixels.clone().filter(|(column, row)| at(*column, *row) && is_edge(*column, *row));
        let mut outline: Vec<[f32; 2]> = edges.map(|(column, row)| pixel_centre(column, row).to_array()).collect();
        if outline.is_empty() {
            // The person fills the picture: nobody is ever beside it.
            outline = pixels.take(1).map(|(column, row)| pixel_centre(column, row).to_array()).collect();
        }
        let wrong = |found: String| Error::Value {
            name: "depth picture".into(),
            found,
            expected: "pixels that show the person".into(),
        };
        if !is_person.contains(&true) {
            return Err(wrong("none that does".into()));
        }
        Ok(Self {
            camera: frame.camera,
            free_until: (0..frame.depth.len()).map(|pixel| frame.free_until(pixel)).collect(),
            index: ImmutableKdTree::new_from_slice(&outline).map_err(|failure| wrong(failure.to_string()))?,
            is_person,
            outline,
        })
    }

    /// What is known of a place with this unit normal.
    pub fn sight(&self, place: DVec3, normal: DVec3) -> Sight {
        let (at, depth) = self.camera.project(place.as_vec3());
        let is_inside = at.cmpge(Vec2::ZERO).all()
            && at.cmplt(Vec2::new(self.camera.width as f32, self.camera.height as f32)).all();
        if depth <= 0.0 || !is_inside {
            return Sight::Hidden;
        }
        let pixel = at.y as usize * self.camera.width as usize + at.x as usize;
        let Some(free_until) = self.free_until[pixel] else { return Sight::Hidden };
        let behind = f64::from(depth) - f64::from(free_until);
        let faces_camera = normal.dot(self.camera.position().as_dvec3() - place) > 0.0;
        match (self.is_person[pixel], faces_camera) {
            (true, true) if behind < BEHIND => Sight::Seen(behind),
            _ if behind > -UNCERTAIN => Sight::Hidden,
            (true, _) => Sight::Open(self.camera.back_project(at, free_until).as_dvec3() - place),
            (false, _) => {
                let nearest = self.index.query(&at.to_array()).nearest_one::<SquaredEuclidean<f32>>().execute();
                let beside = Vec2::from(self.outline[nearest.item as usize]);
                Sight::Open(self.camera.back_project(beside, depth).as_dvec3() - place)
            }
        }
    }
}

impl std::fmt::Debug for View {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("View").field("camera", &self.camera).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xavatar_body::smplx;
    use xavatar_data::{BACKGROUND, FrameId, NO_MEASUREMENT};

    /// A camera at the origin, looking along z; a wall of the person 2 m away fills the left half, nothing the right one, and the lowest
    /// row measured nothing.
    fn view() -> View {
        let (width, height) = (20, 10);
        let camera = PinholeCamera {
            width,
            height,
            fx: 10.0,
            fy: 10.0,
            cx: 10.0,
            cy: 5.0,
            rotation: glam::Mat3::IDENTITY,
            translation: glam::Vec3::ZERO,
        };
        let depth = |(column, row): (u32, u32)| match (column, row) {
            (_, 9) => NO_MEASUREMENT,
            (0..10, _) => 2.0,
            _ => BACKGROUND,
        };
        let frame = RgbdFrame {
            id: FrameId { split: "train".into(), sequence: "A".into(), number: 1 },
            camera,
            colour: image::RgbImage::new(width, height),
            depth: (0..height).flat_map(|row| (0..width).map(move |column| depth((column, row)))).collect(),
            mask: None,
            parameters: smplx::Parameters::default().into(),
        };
        View::of(&frame).unwrap()
    }

    #[test]
    fn what_faces_the_camera_before_the_person_is_compared_whatever_is_behind_is_not() {
        let view = view();
        for (z, behind) in [(1.7, -0.3), (2.05, 0.05)] {
            let sight = view.sight(DVec3::new(-0.9, 0.0, z), DVec3::NEG_Z);
            assert!(matches!(sight, Sight::Seen(found) if (found - behind).abs() < 1e-6), "{sight:?}");
        }
        assert_eq!(view.sight(DVec3::new(-0.9, 0.0, 2.2), DVec3::NEG_Z), Sight::Hidden, "a limb behind another");
        assert_eq!(view.sight(DVec3::new(-0.9, 0.0, 2.2), DVec3::Z), Sight::Hidden, "the back");
    }

    #[test]
    fn a_back_before_the_surface_goes_behind_it_and_what_is_beside_the_person_goes_across() {
        let view = view();
        let Sight::Open(way) = view.sight(DVec3::new(-0.9, 0.0, 1.8), DVec3::Z) else { panic!("it is in the open") };
        assert!(way.abs_diff_eq(DVec3::new(-0.1, 0.0, 0.2), 1e-6), "{way}");
        for normal in [DVec3::Z, DVec3::NEG_Z] {
            let Sight::Open(way) = view.sight(DVec3::new(0.5, 0.1, 2.5), normal) else { panic!("nobody is there") };
            // To the middle of the nearest pixel of the person, (9.5, 5.5), at its own depth.
            assert!(way.abs_diff_eq(DVec3::new(-0.625, 0.025, 0.0), 1e-6), "{way}");
        }
    }

    #[test]
    fn nothing_is_known_where_nothing_was_measured_or_no_camera_looked() {
        let view = view();
        for place in [DVec3::new(0.1, 0.9, 2.0), DVec3::new(5.0, 0.0, 2.0), DVec3::new(0.1, 0.1, -2.0)] {
            assert_eq!(view.sight(place, DVec3::NEG_Z), Sight::Hidden, "{place}");
        }
    }
}
