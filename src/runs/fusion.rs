//! How well views fuse: the error of avatars that were trained on more and more of a camera's turn around the subject.

use glam::Vec3;
use serde::Serialize;

use super::table::RowKey;
use crate::body::Gender;
use crate::data::{Capture, CaptureKind, FrameId, RgbdFrame, Source};
use crate::{Error, InputError, Result, formats};

/// Half a degree of room, so that a frame at the end of a part of the turn is within it whatever the rounding.
const ROUNDING: f64 = 0.5;

/// How far the camera has gone around the subject in each frame since its sequence's first, degrees; `picture` reads a frame.
///
/// # Errors
/// The first error of `picture`.
pub fn turned(
    ids: &[FrameId],
    picture: impl Fn(usize) -> formats::Result<RgbdFrame>,
    mut progress: impl FnMut(usize),
) -> Result<Vec<f64>> {
    let mut turned = Vec::with_capacity(ids.len());
    let mut last: Option<(FrameId, f64, f64)> = None;
    for index in 0..ids.len() {
        let frame = picture(index)?;
        let azimuth = azimuth(&frame);
        let is_next = |id: &FrameId| (&id.split, &id.sequence) == (&frame.id.split, &frame.id.sequence);
        // The shorter way around from the frame before.
        let angle = match last.take().filter(|(id, ..)| is_next(id)) {
            Some((_, before, angle)) => angle + (azimuth - before + 180.0).rem_euclid(360.0) - 180.0,
            None => 0.0,
        };
        turned.push(angle.abs());
        last = Some((frame.id, azimuth, angle));
        progress(index + 1);
    }
    Ok(turned)
}

/// The direction from the subject to the camera about +Y, degrees.
fn azimuth(frame: &RgbdFrame) -> f64 {
    let Vec3 { x, z, .. } = frame.camera.position() - frame.parameters.translation();
    f64::from(x.atan2(z)).to_degrees()
}

/// Some captures of a source.
pub struct SomeCaptures<'a> {
    source: &'a dyn Source,
    chosen: Vec<usize>,
    ids: Vec<FrameId>,
}

impl<'a> SomeCaptures<'a> {
    /// The frames in which the camera has turned by less than `turn` degrees; of them at most `limit`, evenly spread.
    ///
    /// # Errors
    /// [`Error::Value`] if there is none.
    pub fn within(source: &'a dyn Source, turned: &[f64], turn: f64, limit: Option<usize>) -> Result<Self> {
        let within = |frame: &usize| turned[*frame] < turn - ROUNDING || turned[*frame] < ROUNDING;
        let mut chosen: Vec<usize> = (0..turned.len()).filter(within).collect();
        if let Some(limit) = limit.filter(|limit| *limit < chosen.len()) {
            chosen = (0..limit).map(|place| chosen[place * chosen.len() / limit]).collect();
        }
        if chosen.is_empty() {
            return Err(Error::from(InputError::Value {
                name: "frames to train on".into(),
                found: "none".into(),
                expected: "at least one".into(),
            }));
        }
        Ok(Self { source, ids: chosen.iter().map(|frame| source.ids()[*frame].clone()).collect(), chosen })
    }
}

impl Source for SomeCaptures<'_> {
    fn kind(&self) -> CaptureKind {
        self.source.kind()
    }

    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, index: usize) -> formats::Result<Capture> {
        self.source.read(self.chosen[index])
    }

    fn betas(&self) -> &[f32] {
        self.source.betas()
    }

    fn gender(&self) -> Gender {
        self.source.gender()
    }
}

/// The row of a part of the turn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Turn {
    /// How much of the turn the camera went, degrees.
    pub turn: f64,
    /// Frames that it was trained on.
    pub trained_on: usize,
}

impl RowKey for Turn {
    const COLUMNS: &'static [&'static str] = &["turn", "frames"];

    fn cells(&self) -> Vec<String> {
        vec![format!("{}°", self.turn), self.trained_on.to_string()]
    }
}

#[cfg(test)]
mod tests {
    use image::RgbImage;

    use super::*;
    use crate::body::smplx;
    use crate::data::RgbdCapture;
    use crate::mesh::camera::PinholeCamera;

    /// Two sequences; in each the camera goes around by 30 degrees a frame, in the second backwards.
    struct Turns(Vec<FrameId>);

    impl Turns {
        fn new() -> Self {
            let id = |sequence: &str, number| FrameId { split: "train".into(), sequence: sequence.into(), number };
            Self(["Take1", "Take2"].iter().flat_map(|take| (0..12).map(move |number| id(take, number))).collect())
        }
    }

    impl Turns {
        fn picture(&self, index: usize) -> formats::Result<RgbdFrame> {
            let id = self.0[index].clone();
            let step = if id.sequence == "Take1" { 30.0_f32 } else { -30.0 };
            let angle = (170.0 + step * id.number as f32).to_radians();
            let subject = Vec3::new(0.3, 1.0, -2.0);
            let position = subject + 6.0 * Vec3::new(angle.sin(), 0.2, angle.cos());
            Ok(RgbdFrame {
                id,
                camera: PinholeCamera::looking_at(position, subject, 0.5, [8, 12])?,
                colour: RgbImage::new(8, 12),
                depth: vec![6.0; 96],
                mask: None,
                parameters: smplx::Parameters { transl: subject, ..Default::default() }.into(),
            })
        }
    }

    impl Source for Turns {
        fn kind(&self) -> CaptureKind {
            CaptureKind::Rgbd
        }

        fn ids(&self) -> &[FrameId] {
            &self.0
        }

        fn read(&self, index: usize) -> formats::Result<Capture> {
            Ok(Capture::Rgbd(Box::new(RgbdCapture::of(self.picture(index)?)?)))
        }

        fn betas(&self) -> &[f32] {
            &[]
        }

        fn gender(&self) -> Gender {
            Gender::Neutral
        }
    }

    #[test]
    fn each_sequence_turns_by_itself_in_either_direction() {
        let source = Turns::new();
        let turned = turned(source.ids(), |index| source.picture(index), |_| {}).unwrap();
        for (frame, angle) in turned.iter().enumerate() {
            assert!((angle - 30.0 * (frame % 12) as f64).abs() < 1e-3, "{turned:?}");
        }
        let count = |turn, limit| SomeCaptures::within(&source, &turned, turn, limit).unwrap().chosen.len();
        assert_eq!([0.1, 30.0, 90.0, 360.0].map(|turn| count(turn, None)), [2, 2, 6, 24]);
        assert_eq!(count(360.0, Some(5)), 5);
        let some = SomeCaptures::within(&source, &turned, 360.0, Some(4)).unwrap();
        assert_eq!(some.chosen, [0, 6, 12, 18]);
        assert_eq!(some.ids()[3], source.ids()[18]);
    }
}
