//! How well views fuse: the error of avatars that were trained on more and more of a camera's turn around the subject.

use std::fmt;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::metrics::FrameMetrics;
use super::part_columns::PartColumns;
use crate::body::Gender;
use crate::data::{FrameId, RgbdFrame, RgbdSource};
use crate::{Error, InputError, Result};

/// Half a degree of room, so that a frame at the end of a part of the turn is within it whatever the rounding.
const ROUNDING: f64 = 0.5;

/// How far the camera has gone around the subject in each frame since its sequence's first, degrees.
///
/// # Errors
/// The first error of the source.
pub fn turned(frames: &dyn RgbdSource, mut progress: impl FnMut(usize)) -> Result<Vec<f64>> {
    let mut turned = Vec::with_capacity(frames.ids().len());
    let mut last: Option<(FrameId, f64, f64)> = None;
    for index in 0..frames.ids().len() {
        let frame = frames.read(index)?;
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

/// Some frames of a source.
pub struct SomeFrames<'a> {
    source: &'a dyn RgbdSource,
    chosen: Vec<usize>,
    ids: Vec<FrameId>,
}

impl<'a> SomeFrames<'a> {
    /// The frames in which the camera has turned by less than `turn` degrees; of them at most `limit`, evenly spread.
    ///
    /// # Errors
    /// [`Error::Value`] if there is none.
    pub fn within(source: &'a dyn RgbdSource, turned: &[f64], turn: f64, limit: Option<usize>) -> Result<Self> {
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

impl RgbdSource for SomeFrames<'_> {
    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, index: usize) -> crate::formats::Result<RgbdFrame> {
        self.source.read(self.chosen[index])
    }

    fn betas(&self) -> &[f32] {
        self.source.betas()
    }

    fn gender(&self) -> Gender {
        self.source.gender()
    }
}

/// One part of the turn, and what an avatar that was trained on it is like.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FusionRow {
    /// How much of the turn the camera went, degrees.
    pub turn: f64,
    /// Frames that it was trained on.
    pub trained_on: usize,
    /// Steps on frames that it was trained for.
    pub steps: u64,
    /// Mean wall time of such a step.
    pub seconds_per_step: Option<f64>,
    /// Frames that it was measured on.
    pub frames: usize,
    /// The mean of the metrics over those frames.
    pub mean: FrameMetrics,
}

/// The parts of the turn one below the other. `Display` prints it for a terminal, [`FusionTable::markdown`] for a document.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FusionTable {
    /// One row a part of the turn, growing.
    pub rows: Vec<FusionRow>,
}

impl FusionTable {
    /// The table in Markdown; distances in millimetres.
    pub fn markdown(&self) -> String {
        let columns = PartColumns::of(self.rows.iter().map(|row| &row.mean));
        let head: Vec<String> =
            ["turn".to_owned(), "frames".into()].into_iter().chain(columns.markdown_heads()).collect();
        let rule = vec!["---".to_owned(); head.len()];
        let rows = self.rows.iter().map(|row| {
            let ends = [format!("{}°", row.turn), row.trained_on.to_string()];
            ends.into_iter().chain(columns.values(&row.mean)).collect()
        });
        [head, rule].into_iter().chain(rows).map(|cells| format!("| {} |\n", cells.join(" | "))).collect()
    }
}

impl fmt::Display for FusionTable {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let columns = PartColumns::of(self.rows.iter().map(|row| &row.mean));
        let [first, second] = columns.heads();
        write!(formatter, "{:>7} {:>7}{first}", "", "")?;
        write!(formatter, "\n{:>7} {:>7}{second}", "turn", "frames")?;
        for row in &self.rows {
            write!(formatter, "\n{:>6}° {:>7}{}", row.turn, row.trained_on, columns.cells(&row.mean))?;
        }
        writeln!(formatter)
    }
}

#[cfg(test)]
mod tests {
    use image::RgbImage;

    use super::*;
    use crate::body::{Role, smplx};
    use crate::evaluate::PartMetrics;
    use crate::mesh::camera::PinholeCamera;

    /// Two sequences; in each the camera goes around by 30 degrees a frame, in the second backwards.
    struct Turns(Vec<FrameId>);

    impl Turns {
        fn new() -> Self {
            let id = |sequence: &str, number| FrameId { split: "train".into(), sequence: sequence.into(), number };
            Self(["Take1", "Take2"].iter().flat_map(|take| (0..12).map(move |number| id(take, number))).collect())
        }
    }

    impl RgbdSource for Turns {
        fn ids(&self) -> &[FrameId] {
            &self.0
        }

        fn read(&self, index: usize) -> crate::formats::Result<RgbdFrame> {
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

        fn betas(&self) -> &[f32] {
            &[]
        }

        fn gender(&self) -> Gender {
            Gender::Neutral
        }
    }

    #[test]
    fn each_sequence_turns_by_itself_in_either_direction() {
        let turned = turned(&Turns::new(), |_| {}).unwrap();
        for (frame, angle) in turned.iter().enumerate() {
            assert!((angle - 30.0 * (frame % 12) as f64).abs() < 1e-3, "{turned:?}");
        }
        let count = |turn, limit| SomeFrames::within(&Turns::new(), &turned, turn, limit).unwrap().chosen.len();
        assert_eq!([0.1, 30.0, 90.0, 360.0].map(|turn| count(turn, None)), [2, 2, 6, 24]);
        assert_eq!(count(360.0, Some(5)), 5);
        let source = Turns::new();
        let some = SomeFrames::within(&source, &turned, 360.0, Some(4)).unwrap();
        assert_eq!(some.chosen, [0, 6, 12, 18]);
        assert_eq!(some.read(3).unwrap().id, some.ids()[3]);
    }

    #[test]
    fn both_tables_stand_in_columns() {
        let part = PartMetrics { cd_mm: 1.25, cd_max_mm: 40.5, nc: 0.975, iou: 0.98, iou_box: 0.9 };
        let by_role = [(Role::Hands, Some(part)), (Role::Face, None)].into();
        let mean = FrameMetrics { all: Some(part), by_role };
        let row = |turn| {
            let mean = mean.clone();
            FusionRow { turn, trained_on: 12, steps: 6000, seconds_per_step: Some(0.25), frames: 10, mean }
        };
        let table = FusionTable { rows: [45.0, 90.0, 180.0, 360.0].map(row).to_vec() };
        let printed = table.to_string();
        let mut widths = printed.lines().map(|line| line.chars().count());
        let first = widths.next().unwrap();
        assert!(widths.all(|width| width == first), "{printed}");
        let markdown = table.markdown();
        assert_eq!(markdown.lines().count(), 6);
        assert!(markdown.lines().all(|line| line.matches('|').count() == 15), "{markdown}");
        assert!(markdown.contains("| 45° | 12 | 1.25 | 40.50 | 0.975 | 0.980 |"), "{markdown}");
    }
}
