//! From what was seen of frames to findings about the subject: what all frames share is said once, the rest frame by frame.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use glam::Vec3;

use super::alignment::Similarity;
use super::common_placement::{Common, MOST, Shift, common_placement};
use super::finding::{Defect, Finding};
use super::inspection::{Inspection, Observation};
use super::wording::{described, findings_of_placement};
use crate::ScanPlacement;
use xavatar_formats::Choice;

/// Frames that a message names.
const NAMED: usize = 3;

/// What was seen of one frame, and what its placement could be explained by.
pub(super) struct Looked {
    /// `split/sequence/number`.
    pub frame: String,
    pub inspection: Inspection,
    /// The frame's `transl`, and where its pelvis is, metres.
    pub translation: Vec3,
    pub pelvis: Vec3,
    /// The frame whose body fits this scan, if its own does not.
    pub fits_instead: Option<String>,
    /// A placement in which the scan lies on its body as well as it does as it is.
    pub fits_too: Option<Similarity>,
}

/// Findings about scans, and the placement that would mend them, if one does.
#[derive(Default)]
pub(super) struct Judged {
    pub findings: Vec<Finding>,
    pub mend: Option<ScanPlacement>,
}

/// The placement of some frames that others, which lie on their bodies as they are, may share: those of a body in a symmetric
/// pose lie on it mirrored as well. None if no frame is misplaced, or most are.
pub(super) fn placement_of_some(looked: &[Looked]) -> Option<Similarity> {
    if common_placement(looked).is_some() {
        return None;
    }
    looked.iter().flat_map(|one| &one.inspection.observations).find_map(|observation| match observation {
        Observation::Misplaced(found) => Some(found.placement),
        _ => None,
    })
}

/// The places of frames that do not lie on their bodies, for a reason that most frames do not share.
pub(super) fn strayed(looked: &[Looked]) -> Vec<usize> {
    let common = common_placement(looked);
    let strays = |observation: &Observation| match observation {
        Observation::Unrelated { .. } => true,
        Observation::Misplaced(found) => {
            common.as_ref().is_none_or(|common| !common.explains(found) || matches!(common.shift, Shift::Each(_)))
        }
        _ => false,
    };
    (0..looked.len()).filter(|place| looked[*place].inspection.observations.iter().any(strays)).collect()
}

pub(super) fn judge(looked: &[Looked]) -> Judged {
    let mut judged = Judged::default();
    let mut of_frames: BTreeMap<Defect, Vec<(&Looked, String)>> = BTreeMap::new();
    let common = common_placement(looked);
    judged.findings.extend(common.iter().flat_map(findings_of_placement));
    // A placement that is too small to be said of all is said of each.
    let common = common.filter(|_| !judged.findings.is_empty());
    for one in looked {
        for observation in &one.inspection.observations {
            if common
                .as_ref()
                .is_some_and(|common| matches!(observation, Observation::Misplaced(found) if common.explains(found)))
            {
                continue;
            }
            let (defect, text) = described(observation, one);
            of_frames.entry(defect).or_default().push((one, text));
        }
    }
    let inside_out = of_frames.get(&Defect::InsideOut).map_or(0, Vec::len);
    let all_inside_out = inside_out > 0 && inside_out as f32 >= MOST * looked.len() as f32;
    judged.mend = common.as_ref().and_then(Common::mend);
    let mirrors = judged.mend.is_some_and(|mend| mend.rotation().determinant() < 0.0);
    if mirrors {
        // Turning a scan inside out is what a mirror does; the faces of one that was turned over already are to follow.
        of_frames.remove(&Defect::InsideOut);
        judged.mend = judged.mend.map(|mend| ScanPlacement { reverse_faces: !all_inside_out, ..mend });
    } else if all_inside_out && (common.is_none() || judged.mend.is_some()) {
        judged.mend = Some(ScanPlacement { reverse_faces: true, ..judged.mend.unwrap_or_default() });
    }
    if of_frames.contains_key(&Defect::Surroundings) && (common.is_none() || judged.mend.is_some()) {
        judged.mend = Some(ScanPlacement { person_alone: true, ..judged.mend.unwrap_or_default() });
    }
    judged.findings.extend(of_frames.into_iter().map(|(defect, frames)| merged(defect, &frames, looked.len())));
    judged
}

/// One finding of a kind: the first frame's text, and where else.
fn merged(defect: Defect, frames: &[(&Looked, String)], looked: usize) -> Finding {
    let names: Vec<String> = frames.iter().map(|(one, _)| one.frame.clone()).collect();
    let mut message = format!("{} of {looked} frames, {}: {}", names.len(), names[0], frames[0].1);
    if names.len() > 1 {
        let others: Vec<&str> = names[1..].iter().take(NAMED).map(String::as_str).collect();
        let more = if names.len() > NAMED + 1 { ", ..." } else { "" };
        let _ = write!(message, " (also {}{more})", others.join(", "));
    }
    let choice = matches!(defect, Defect::InsideOut | Defect::Surroundings).then_some(Choice::RecordPlacement);
    Finding { name: defect, message, frames: names, choice }
}
