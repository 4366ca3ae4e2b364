//! Landmarks that cannot be right: where a bone between two of them is far longer or shorter than the body's, the outer one is dropped.

use super::{Seen, Site, Sites};
use crate::linear::Linkage;

/// Length over the body's, relative to the median bone of the frame, of bones that are believed.
const BELIEVED: std::ops::RangeInclusive<f64> = 0.6..=1.35;
/// Shorter bones say more of the noise than of mistakes, metres.
const SHORTEST: f64 = 0.15;

/// The landmarks whose bones are as long as the body's, and the names of the others.
pub fn believed(linkage: &Linkage, sites: &Sites, seen: &[Seen]) -> (Vec<Seen>, Vec<String>) {
    let place =
        |joint: usize| seen.iter().find(|one| sites.site(one.site).at == Site::Joint(joint)).map(|one| one.place);
    let ratio = |one: &Seen| {
        let Site::Joint(joint) = sites.site(one.site).at else { return None };
        let parent = linkage.parents()[joint]?;
        let length = linkage.rest()[joint].distance(linkage.rest()[parent]);
        (length >= SHORTEST).then_some(one.place.distance(place(parent)?) / length)
    };
    let mut ratios: Vec<f64> = seen.iter().filter_map(ratio).collect();
    ratios.sort_by(f64::total_cmp);
    let Some(median) = ratios.get(ratios.len() / 2).copied().filter(|median| *median > 0.0) else {
        return (seen.to_vec(), Vec::new());
    };
    let is_believed = |one: &&Seen| ratio(one).is_none_or(|ratio| BELIEVED.contains(&(ratio / median)));
    let (kept, dropped): (Vec<&Seen>, Vec<&Seen>) = seen.iter().partition(is_believed);
    (kept.into_iter().copied().collect(), dropped.into_iter().map(|one| sites.site(one.site).name.clone()).collect())
}
