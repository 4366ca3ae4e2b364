//! Which frames ended in the wrong place, by what can be measured.

use xavatar_body::{Role, Skeleton};

use super::quality::FrameQuality;

/// Share of the body that may be far from the scan.
const BODY_FAR: f64 = 0.06;
/// A frame is odd if more of its scan is uncovered than of the median frame, by this and by three deviations.
const MORE_UNCOVERED: f64 = 0.03;
/// What a limb that has slipped counts, of the whole body far from the scan.
const SLIPPED: f64 = 0.05;
/// Share of a hand that is far from the scan where the scan has no hand.
const HAND_FAR: f64 = 0.22;

/// Fingers farther from their landmarks than this in the mean, and than this many times the subject's usual distance, are of a hand that
/// is turned the wrong way: others have a third of it. Millimetres.
const TURNED: (f64, f64) = (25.0, 2.0);

impl FrameQuality {
    /// The names of the hands that the scan does not show: those that are far from it or were not seen, and those that no landmark is of.
    pub fn missing_hands(&self, skeleton: &Skeleton, without_landmarks: &[String]) -> Vec<String> {
        let hands = skeleton.parts_of(Role::Hands).map(|part| &skeleton.parts[part.index()].name);
        let is_far = |name: &String| self.parts.get(name).is_none_or(|part| part.far > HAND_FAR);
        hands.filter(|name| is_far(name) || without_landmarks.contains(name)).cloned().collect()
    }

    /// One number to choose between fits of the same frame by; less is better.
    pub fn misfit(&self) -> f64 {
        self.uncovered + self.body_far() + SLIPPED * self.slipped.len() as f64
    }

    /// The largest share of a part of the body that is far from the scan.
    pub fn body_far(&self) -> f64 {
        self.parts
            .get("body")
            .map_or_else(|| self.parts.values().map(|part| part.far).fold(0.0, f64::max), |body| body.far)
    }
}

/// Of each frame of one subject, the names of the hands that do not lie where their landmarks are.
pub fn turned_hands(qualities: &[&FrameQuality]) -> Vec<Vec<String>> {
    let mut usual: Vec<f64> = qualities.iter().flat_map(|quality| quality.landmarks_mm.values().copied()).collect();
    usual.sort_by(f64::total_cmp);
    let most = TURNED.0.max(TURNED.1 * usual.get(usual.len() / 2).copied().unwrap_or(0.0));
    let of_frame = |quality: &&FrameQuality| {
        let far = quality.landmarks_mm.iter().filter(|(_, distance)| **distance > most);
        far.map(|(hand, _)| hand.clone()).collect()
    };
    qualities.iter().map(of_frame).collect()
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
    let is_doubtful = |quality: &FrameQuality| {
        quality.uncovered > most || quality.body_far() > BODY_FAR || !quality.slipped.is_empty()
    };
    qualities.iter().map(is_doubtful).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen_at(distances: &[(&str, f64)]) -> FrameQuality {
        FrameQuality {
            parts: Default::default(),
            landmarks_mm: distances.iter().map(|(hand, distance)| ((*hand).to_owned(), *distance)).collect(),
            uncovered: 0.0,
            beyond_limits: 0,
            slipped: Vec::new(),
        }
    }

    #[test]
    fn a_hand_far_from_its_landmarks_is_turned_if_other_hands_are_not_as_far() {
        let good = seen_at(&[("left_hand", 9.0), ("right_hand", 12.0)]);
        let bad = seen_at(&[("left_hand", 49.0), ("right_hand", 14.0)]);
        assert_eq!(turned_hands(&[&good, &bad]), [vec![], vec!["left_hand".to_owned()]]);
        let noisy = [seen_at(&[("left_hand", 40.0)]), seen_at(&[("left_hand", 49.0)])];
        assert!(turned_hands(&[&noisy[0], &noisy[1]]).iter().all(Vec::is_empty), "landmarks that are noisy everywhere");
    }
}
