//! `register.json`: what became of every frame, and why.

use std::fmt;

use serde::{Deserialize, Serialize};
use xavatar_body::Role;
use xavatar_data::FrameNotes;
use xavatar_mesh::Note;

use super::coordinates::FileCoordinates;
use crate::fit::{Fitter, FrameQuality, Shaped};

/// The file.
pub const REPORT_FILE: &str = "register.json";

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// It lies on its scan.
    Registered,
    /// It does not, whatever it was started from: it is left out of the data.
    LeftOut,
    /// It does not, in data that somebody else registered.
    Doubtful,
}

/// One frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameReport {
    /// `train/Take1/f00001`.
    pub frame: String,
    /// What became of it.
    pub verdict: Verdict,
    /// Why it is left out; empty if it is not.
    pub reason: String,
    /// How well it lies; none if no fit began.
    pub quality: Option<FrameQuality>,
    /// Hands that the scan does not show: their fingers are relaxed, and say nothing.
    pub missing_hands: Vec<String>,
    /// Hands that do not lie where their landmarks are: they say nothing, either.
    #[serde(default)]
    pub turned_hands: Vec<String>,
    /// Landmarks that were believed.
    pub landmarks: usize,
    /// Landmarks that were not.
    pub dropped_landmarks: Vec<String>,
    /// What was noted of the scan as it was read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<Note>,
}

/// A subject.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegistrationReport {
    /// What the scans' files are in.
    pub coordinates: FileCoordinates,
    /// beta.
    pub betas: Vec<f64>,
    /// Mean thickness of the clothing, millimetres.
    pub clothing_mm: f64,
    /// How far the surface wavers between frames at rest: half the range that holds half of them, median over the body, millimetres.
    pub jitter_mm: f64,
    /// Every frame, the worst first.
    pub frames: Vec<FrameReport>,
}

impl FrameReport {
    /// The larger, the worse.
    pub(super) fn badness(&self) -> f64 {
        self.quality.as_ref().map_or(f64::INFINITY, FrameQuality::misfit)
    }
}

/// A subject's report, with its frames in order.
pub(super) fn summary(
    coordinates: FileCoordinates,
    shaped: &Shaped,
    fitter: &Fitter<'_>,
    mut frames: Vec<FrameReport>,
) -> RegistrationReport {
    frames.sort_by(|one, other| other.badness().total_cmp(&one.badness()).then(one.frame.cmp(&other.frame)));
    let roles = fitter.surface.roles.iter();
    let cloth = roles.zip(&shaped.clothing.thickness).filter(|(role, _)| **role == Role::Body);
    let cloth: Vec<f64> = cloth.map(|(_, thickness)| *thickness).collect();
    let mut spread: Vec<f64> = shaped.clothing.spread.iter().copied().filter(|spread| spread.is_finite()).collect();
    spread.sort_by(f64::total_cmp);
    RegistrationReport {
        coordinates,
        betas: shaped.shape.clone(),
        clothing_mm: 1e3 * cloth.iter().sum::<f64>() / cloth.len().max(1) as f64,
        jitter_mm: 1e3 * spread.get(spread.len() / 2).copied().unwrap_or(0.0),
        frames,
    }
}

/// Why a frame is not believed.
pub(super) fn why(quality: &FrameQuality) -> String {
    if !quality.slipped.is_empty() {
        return format!("{} from the scan", quality.slipped.join(", "));
    }
    format!(
        "{:.0} % of the scan is not covered by the body, {:.0} % of the body is far from the scan",
        1e2 * quality.uncovered,
        1e2 * quality.body_far()
    )
}

impl RegistrationReport {
    /// Frames that were registered.
    pub fn registered(&self) -> usize {
        self.frames.iter().filter(|frame| frame.verdict == Verdict::Registered).count()
    }

    /// Whether enough frames were registered to go on with: four of five.
    pub fn is_fit(&self) -> bool {
        let registered = self.registered();
        registered > 0 && registered * 5 >= self.frames.len() * 4
    }
}

impl fmt::Display for RegistrationReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "registered         {} of {} frames", self.registered(), self.frames.len())?;
        writeln!(f, "clothing           {:.1} mm thick in the mean", self.clothing_mm)?;
        writeln!(f, "jitter             {:.1} mm between frames", self.jitter_mm)?;
        let mut medians: std::collections::BTreeMap<&str, Vec<f64>> = std::collections::BTreeMap::new();
        for quality in self
            .frames
            .iter()
            .filter(|frame| frame.verdict == Verdict::Registered)
            .filter_map(|frame| frame.quality.as_ref())
        {
            quality.parts.iter().for_each(|(name, part)| medians.entry(name).or_default().push(part.median_mm));
        }
        for (part, mut values) in medians {
            values.sort_by(f64::total_cmp);
            writeln!(f, "{part:<18} {:.1} mm from the scan, median", values[values.len() / 2])?;
        }
        let hands = self.frames.iter().filter(|frame| !frame.missing_hands.is_empty()).count();
        if hands > 0 {
            writeln!(f, "hands              not in the scan in {hands} frames")?;
        }
        for frame in self.frames.iter().filter(|frame| !frame.turned_hands.is_empty()) {
            writeln!(f, "turned: {}: {} away from its landmarks", frame.frame, frame.turned_hands.join(", "))?;
        }
        let mut notes = FrameNotes::default();
        self.frames.iter().for_each(|frame| notes.add(&frame.frame, &frame.notes));
        notes.lines().try_for_each(|line| writeln!(f, "noted: {line}"))?;
        for frame in &self.frames {
            match frame.verdict {
                Verdict::Registered => {}
                Verdict::LeftOut => writeln!(f, "left out: {}: {}", frame.frame, frame.reason)?,
                Verdict::Doubtful => writeln!(f, "doubtful: {}: {}", frame.frame, frame.reason)?,
            }
        }
        Ok(())
    }
}
