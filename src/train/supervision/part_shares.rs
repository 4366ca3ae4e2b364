//! Which share of a frame's points each part of the body gets, by its role (METHOD section 4).
//!
//! What a skeleton has no part for goes to the parts that it has, so that every body gets as many points.

use crate::body::{Part, Role, Skeleton};
use crate::config::SamplingSettings;

/// The share of one part, or of its detail alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PartShare {
    pub part: Part,
    pub is_detail: bool,
    pub share: f64,
}

/// The shares of all parts, a detail after its part; of the share of a part with a detail, `of_detail` is for that.
pub(super) fn part_shares(
    skeleton: &Skeleton,
    settings: &SamplingSettings,
    of_detail: impl Fn(f64) -> f64,
) -> Vec<PartShare> {
    let SamplingSettings { body_share, face_share, hand_share, .. } = *settings;
    let of_role = |role: Role| match role {
        Role::Body => body_share,
        Role::Hands => hand_share,
        Role::Face => face_share,
    };
    let count = |role: Role| skeleton.parts_of(role).count() as f64;
    let own = body_share * count(Role::Body) + face_share * count(Role::Face) + count(Role::Hands) * hand_share;
    let scale = if own > 0.0 { whole_share(settings) / own } else { 1.0 };
    let mut shares = Vec::new();
    for (part, group) in skeleton.parts() {
        let share = of_role(group.role);
        let detail = if group.detail.is_some() { of_detail(share) } else { 0.0 };
        shares.push(PartShare { part, is_detail: false, share: scale * (share - detail) });
        if group.detail.is_some() {
            shares.push(PartShare { part, is_detail: true, share: scale * detail });
        }
    }
    shares
}

/// The shares of a person's parts together.
pub(super) fn whole_share(settings: &SamplingSettings) -> f64 {
    settings.body_share + settings.face_share + 2.0 * settings.hand_share
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::smplx;
    use crate::config::Config;

    #[test]
    fn a_person_has_the_configured_shares_and_a_body_without_hands_and_face_all_of_them() {
        let settings = Config::preset("fast").unwrap().sampling;
        let SamplingSettings { body_share, face_share, hand_share, .. } = settings;
        let person = part_shares(smplx::skeleton(), &settings, |share| share / 2.0);
        let half = face_share / 2.0;
        assert_eq!(
            person.iter().map(|part| (part.part.0, part.is_detail, part.share)).collect::<Vec<_>>(),
            [(0, false, body_share), (1, false, half), (1, true, half), (2, false, hand_share), (3, false, hand_share)]
        );
        let mut trunk = smplx::skeleton().clone();
        trunk.parts.truncate(1);
        let alone = part_shares(&trunk, &settings, |share| share / 2.0);
        assert_eq!(alone.len(), 1);
        assert!((alone[0].share - whole_share(&settings)).abs() < 1e-12);
    }
}
