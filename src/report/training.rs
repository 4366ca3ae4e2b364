//! What a run noted while it trained, for the page: curves of its losses, its time, its previews.

use std::path::{Path, PathBuf};

use super::chart::{Chart, grouped, number};
use super::page::{Curve, Picture};
use super::picture::data_uri;
use crate::Result;
use crate::formats::read_picture;
use crate::runs::{NotedStep, has_notes, noted_steps, previews};
use crate::train::Stage;

/// Previews that are shown, evenly spaced over the run.
const PREVIEWS: usize = 6;
/// Steps whose mean is a run's final loss.
const LAST_STEPS: usize = 50;
/// The weighted sum of all losses.
const TOTAL: &str = "total";

/// The notes of a run; empty for an avatar whose run is not known.
#[derive(Default)]
pub(super) struct TrainingRecord {
    /// In order.
    steps: Vec<NotedStep>,
    /// Steps and pictures, in order.
    previews: Vec<(u64, PathBuf)>,
}

impl TrainingRecord {
    /// Of a folder that holds an avatar alone, nothing is known.
    pub(super) fn read(run: &Path) -> Result<Self> {
        match has_notes(run) {
            true => Ok(Self { steps: noted_steps(run)?, previews: previews(run)? }),
            false => Ok(Self::default()),
        }
    }

    fn on_frames(&self) -> impl DoubleEndedIterator<Item = &NotedStep> {
        self.steps.iter().filter(|step| step.stage == Stage::Frames)
    }

    /// Wall time of all steps; none if there are none.
    pub(super) fn seconds(&self) -> Option<f64> {
        (!self.steps.is_empty()).then(|| self.steps.iter().map(|step| step.seconds).sum())
    }

    /// Mean wall time of the steps on frames.
    pub(super) fn seconds_per_step(&self) -> Option<f64> {
        let count = self.on_frames().count();
        (count > 0).then(|| self.on_frames().map(|step| step.seconds).sum::<f64>() / count as f64)
    }

    /// The mean of the total loss over the last steps.
    pub(super) fn final_loss(&self) -> Option<f64> {
        let last: Vec<f64> =
            self.on_frames().rev().take(LAST_STEPS).filter_map(|step| step.losses.get(TOTAL).copied()).collect();
        (!last.is_empty()).then(|| last.iter().sum::<f64>() / last.len() as f64)
    }

    /// What the curves show.
    pub(super) fn caption(&self) -> String {
        let steps = self.on_frames().count();
        let before = self.steps.len() - steps;
        let points = self.on_frames().map(|step| step.points as f64).sum::<f64>();
        let seconds = self.on_frames().map(|step| step.seconds).sum::<f64>().max(1e-9);
        format!(
            "{} steps on the frames, after {} on the body model alone; {} points a second. Losses are unweighted, the total is their \
             weighted sum; lines are means of neighbouring steps, bands their range.",
            grouped(steps as i64),
            grouped(before as i64),
            number(points / seconds)
        )
    }

    /// One curve a loss, the total first; those that were zero throughout left out.
    pub(super) fn curves(&self) -> Vec<Curve> {
        let mut names: Vec<&String> = self.on_frames().flat_map(|step| step.losses.keys()).collect();
        names.sort_by_key(|name| (*name != TOTAL, *name));
        names.dedup();
        names.into_iter().filter_map(|name| self.curve(name)).collect()
    }

    fn curve(&self, name: &str) -> Option<Curve> {
        let value = |step: &NotedStep| Some((step.step as f64, *step.losses.get(name)?));
        let points: Vec<(f64, f64)> = self.on_frames().filter_map(value).collect();
        if points.iter().all(|(_, value)| *value == 0.0) {
            return None;
        }
        let mean = |points: &[(f64, f64)]| points.iter().map(|point| point.1).sum::<f64>() / points.len() as f64;
        let few = LAST_STEPS.min(points.len().div_ceil(4));
        let (first, last) = (mean(&points[..few]), mean(&points[points.len() - few..]));
        let caption = format!("{} \u{2192} {}", number(first), number(last));
        let name = if name == TOTAL { "Total loss".into() } else { capitalised(&name.replace('_', " ")) };
        let label =
            format!("{name} over {} steps: {} at the start, {} at the end", points.len(), number(first), number(last));
        Some(Curve { chart: Chart::curve(label, &points)?, name, caption })
    }

    /// Previews from the first to the last.
    pub(super) fn previews(&self, width: u32) -> Result<Vec<Picture>> {
        let count = self.previews.len();
        let shown = PREVIEWS.min(count);
        let chosen = (0..shown).map(|index| if shown < 2 { 0 } else { index * (count - 1) / (shown - 1) });
        chosen
            .map(|index| {
                let (step, path) = &self.previews[index];
                let caption = format!("Step {}", grouped(*step as i64));
                Ok(Picture {
                    name: String::new(),
                    alternative: format!("{caption}: scan and avatar in colour, then their normals"),
                    caption,
                    picture: data_uri(&read_picture(path)?.into_rgb8(), width)?,
                })
            })
            .collect()
    }
}

fn capitalised(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
