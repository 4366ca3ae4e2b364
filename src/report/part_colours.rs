//! The colours of a body's parts in pictures and reports (palette of Okabe & Ito).

use crate::body::{Part, PartLabels, Skeleton};

/// By the parts' places, again from the first after the last: sky blue, orange, green, purple, blue, yellow.
const PARTS: [[u8; 3]; 6] =
    [[86, 180, 233], [230, 159, 0], [0, 158, 115], [204, 121, 167], [0, 114, 178], [240, 228, 66]];
/// What is sampled more densely of a part: vermilion.
const DETAIL: [u8; 3] = [213, 94, 0];

/// The colour of a part.
#[must_use]
pub fn part_colour(part: Part) -> [u8; 3] {
    PARTS[part.index() % PARTS.len()]
}

/// The parts of a body, then their details, with their colours.
#[must_use]
pub fn part_names(skeleton: &Skeleton) -> Vec<(String, [u8; 3])> {
    let details = skeleton.parts.iter().filter_map(|group| group.detail.as_ref());
    let details = details.map(|detail| (detail.name.replace('_', ", "), DETAIL));
    skeleton.parts().map(|(part, group)| (group.title(), part_colour(part))).chain(details).collect()
}

/// The colour of each vertex's part (V).
#[must_use]
pub fn part_colours(labels: &PartLabels) -> Vec<[u8; 3]> {
    let labels = labels.parts.iter().zip(&labels.detail);
    labels.map(|(part, is_detail)| if *is_detail { DETAIL } else { part_colour(*part) }).collect()
}
