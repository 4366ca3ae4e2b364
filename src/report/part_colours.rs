//! The colours of a body's parts in pictures and reports (palette of Okabe & Ito).

use crate::body::{Part, PartLabels};

/// The parts of the body, and eyes and mouth, with their colours.
pub const PART_NAMES: [(&str, [u8; 3]); 5] = [
    ("body", [86, 180, 233]),
    ("face", [230, 159, 0]),
    ("left hand", [0, 158, 115]),
    ("right hand", [204, 121, 167]),
    ("eyes, mouth", [213, 94, 0]),
];

/// The colour of each vertex's part (V).
#[must_use]
pub fn part_colours(labels: &PartLabels) -> Vec<[u8; 3]> {
    let of_part = |part: Part| match part {
        Part::Body => PART_NAMES[0].1,
        Part::Face => PART_NAMES[1].1,
        Part::LeftHand => PART_NAMES[2].1,
        Part::RightHand => PART_NAMES[3].1,
    };
    let labels = labels.parts.iter().zip(&labels.eyes_mouth);
    labels.map(|(part, eyes_mouth)| if *eyes_mouth { PART_NAMES[4].1 } else { of_part(*part) }).collect()
}
