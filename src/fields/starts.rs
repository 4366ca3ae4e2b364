//! From which bones the search for a point's canonical points starts: those of the part that it is labelled with (thesis ch. 4.2.3).

use xavatar_deformer::StartGroups;

use crate::Result;
use crate::body::{PartGroup, Role, Skeleton};
use crate::config::Starts;

/// The start groups of a skeleton by a choice of starts; labels are the places of its parts.
///
/// # Errors
/// If the skeleton fails [`Skeleton::check`].
pub fn start_groups(starts: Starts, skeleton: &Skeleton) -> Result<StartGroups> {
    let joints = skeleton.joints.len();
    let common: Option<Vec<usize>> = match starts {
        Starts::Part => None,
        // Without such a part, as by parts.
        Starts::Body => Some(starts_of(skeleton, &[Role::Body])).filter(|starts| !starts.is_empty()),
        Starts::All => Some((0..joints).collect()),
    };
    let of_part = |part: &PartGroup| common.clone().unwrap_or_else(|| part.starts.clone());
    let parts = skeleton.parts.iter().map(of_part).collect();
    Ok(StartGroups::new(joints, parts, common.clone().unwrap_or_else(|| skeleton.starts.clone()))?)
}

/// The start groups of a union: for every part the body's and the face's bones too, since a hand may touch the body, and the
/// scalp, which is labelled as body, moves with the head.
///
/// # Errors
/// If the skeleton fails [`Skeleton::check`].
pub fn union_start_groups(starts: Starts, skeleton: &Skeleton) -> Result<StartGroups> {
    if starts != Starts::Part {
        return start_groups(starts, skeleton);
    }
    let common = starts_of(skeleton, &[Role::Body, Role::Face]);
    let with_body = |part: &PartGroup| {
        let others = common.iter().filter(|joint| !part.starts.contains(joint));
        part.starts.iter().chain(others).copied().collect()
    };
    let parts = skeleton.parts.iter().map(with_body).collect();
    Ok(StartGroups::new(skeleton.joints.len(), parts, skeleton.starts.clone())?)
}

/// The starts of the parts of these roles.
fn starts_of(skeleton: &Skeleton, roles: &[Role]) -> Vec<usize> {
    let parts = skeleton.parts.iter().filter(|part| roles.contains(&part.role));
    parts.flat_map(|part| part.starts.iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::smplx;

    #[test]
    fn a_union_starts_from_the_points_own_part_the_body_and_the_head() {
        let skeleton = smplx::skeleton();
        let groups = union_start_groups(Starts::Part, skeleton).unwrap();
        for (part, group) in skeleton.parts() {
            let bones = groups.bones(Some(part.0)).unwrap();
            let expected = group.starts.iter().chain(&skeleton.parts[0].starts).chain(&skeleton.parts[1].starts);
            assert!(expected.into_iter().all(|bone| bones.contains(bone)), "{}", group.name);
        }
    }
}
