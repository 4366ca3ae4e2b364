//! From which bones the search for a point's canonical points starts: those of the part that it is labelled with (thesis ch. 4.2.3).

use xavatar_deformer::StartGroups;

use crate::Result;
use crate::body::{FULL_GROUP, JOINTS, Part};
use crate::config::Starts;

/// The start groups of a choice of starts; labels are places in [`Part::ALL`].
///
/// # Errors
/// Never for the SMPL-X skeleton.
pub fn start_groups(starts: Starts) -> Result<StartGroups> {
    let part_joints = |part: Part| match starts {
        Starts::Part => part.joints().to_vec(),
        Starts::Body => Part::Body.joints().to_vec(),
        Starts::All => (0..JOINTS).collect(),
    };
    let full = match starts {
        Starts::Part => FULL_GROUP.to_vec(),
        Starts::Body => Part::Body.joints().to_vec(),
        Starts::All => (0..JOINTS).collect(),
    };
    Ok(StartGroups::new(JOINTS, Part::ALL.map(part_joints).to_vec(), full)?)
}

/// The start groups of a union: for every part the body's and the face's bones too, since a hand may touch the body, and the
/// scalp, which is labelled as body, moves with the head.
///
/// # Errors
/// Never for the SMPL-X skeleton.
pub fn union_start_groups(starts: Starts) -> Result<StartGroups> {
    if starts != Starts::Part {
        return start_groups(starts);
    }
    let with_body = |part: Part| {
        let others = [Part::Body, Part::Face].into_iter().flat_map(Part::joints);
        let others = others.filter(|joint| !part.joints().contains(joint));
        part.joints().iter().chain(others).copied().collect()
    };
    Ok(StartGroups::new(JOINTS, Part::ALL.map(with_body).to_vec(), FULL_GROUP.to_vec())?)
}

/// The label of a part in [`start_groups`].
pub fn part_label(part: Part) -> u8 {
    part as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_union_starts_from_the_points_own_part_the_body_and_the_head() {
        let groups = union_start_groups(Starts::Part).unwrap();
        for part in Part::ALL {
            let bones = groups.bones(Some(part_label(part))).unwrap();
            let expected = [part, Part::Body, Part::Face].into_iter().flat_map(Part::joints);
            assert!(expected.into_iter().all(|bone| bones.contains(bone)), "{part:?}");
        }
    }
}
