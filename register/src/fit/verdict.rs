//! Which frames ended in the wrong place, by what can be measured.

use xavatar_body::{Role, Skeleton};

use super::quality::FrameQuality;

/// Share of the body that may be far from the scan.
const BODY_FAR: f64 = 0.06;
/// A frame is odd if more of its scan is uncovered than of the median frame, by this and by three deviations.
const MORE_UNCOVERED: f64 = 0.03;
/// Share of a hand that is far from the scan where the scan has no hand.
const HAND_FAR: f64 = 0.22;

impl FrameQuality {
    /// The names of the hands that the scan does not show: those that are far from it, and those that no landmark is of.
    pub fn missing_hands(&self, skeleton: &Skeleton, without_landmarks: &[String]) -> Vec<String> {
        let hands = skeleton.parts_of(Role::Hands).map(|part| &skeleton.parts[part.index()].name);
        let is_far = |name: &String| self.parts.get(name).is_some_and(|part| part.far > HAND_FAR);
        hands.filter(|name| is_far(name) || without_landmarks.contains(name)).cloned().collect()
    }

    /// One number to choose between fits of the same frame by; less is better.
    pub fn misfit(&self) -> f64 {
        self.uncovered + self.body_far()
    }

    /// The largest share of a part of the body that is far from the scan.
    pub fn body_far(&self) -> f64 {
        self.parts
            .get("body")
            .map_or_else(|| self.parts.values().map(|part| part.far).fold(0.0, f64::max), |body| body.far)
    }
}

/// Which frames are doubtful among those of one subject.
pub fn doubtful(qualities: &[FrameQuality]) -> Vec<bool> {
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    let usual = median(qualities.iter().map(|quality| quality.uncovered).collect());
    let deviation = 1.4826 * median(qualities.iter().map(|quality| (quality.uncovered - usual).abs()).collect());
    let most = usual + MORE_UNCOVERED.max(3.0 * deviation);
    qualities.iter().map(|quality| quality.uncovered > most || quality.body_far() > BODY_FAR).collect()
}
