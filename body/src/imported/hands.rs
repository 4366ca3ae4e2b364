//! A relaxed hand, and the ways in which a hand moves: closing, spreading, single fingers, then what is left.
//!
//! Fingers flex about the axis across them in the palm, and spread about the axis that turns them to the thumb's side. 15 joints a hand; radians.

use glam::DVec3;

use crate::smplx;

const FINGERS: [&str; 5] = crate::families::FINGERS;
/// Components of a hand's rotations.
const SIZE: usize = 45;
/// How far the joints of each finger are flexed in a relaxed hand, degrees, in the order of [`FINGERS`].
const RELAXED: [[f64; 3]; 5] =
    [[12.0, 20.0, 12.0], [16.0, 24.0, 14.0], [22.0, 27.0, 16.0], [20.0, 27.0, 16.0], [8.0, 6.0, 10.0]];
/// Shorter remainders of a direction are none.
const INDEPENDENT: f64 = 1e-6;

/// What hand poses are relative to.
pub(crate) struct Space {
    /// (45).
    pub mean: Vec<f64>,
    /// (45, 45), orthonormal rows.
    pub components: Vec<Vec<f64>>,
}

/// One of a joint's axes.
type Along = fn(&Axes) -> DVec3;

/// The axes of a joint.
struct Axes {
    flex: DVec3,
    spread: DVec3,
}

/// The pose space of the `side`'s hand of a body whose joints (55) are these.
pub(crate) fn space(joints: &[DVec3], side: &str) -> Space {
    let axes: Vec<Axes> = (0..SIZE / 3).map(|place| axes(joints, side, place)).collect();
    let relaxed = axes.iter().enumerate().map(|(place, axes)| axes.flex * RELAXED[place / 3][place % 3].to_radians());
    let thumb = FINGERS.len() - 1;
    let direction = |fingers: &[usize], along: Along, amounts: [f64; 3]| -> Vec<f64> {
        let amount = |place: usize| if fingers.contains(&(place / 3)) { amounts[place % 3] } else { 0.0 };
        axes.iter().enumerate().flat_map(|(place, axes)| (along(axes) * amount(place)).to_array()).collect()
    };
    let (flex, spread): (Along, Along) = (|axes| axes.flex, |axes| axes.spread);
    let (all, first) = ([1.0; 3], [1.0, 0.0, 0.0]);
    let wanted = [
        direction(&[0, 1, 2, 3], flex, all),
        direction(&[thumb], flex, all),
        direction(&[0, 1], flex, all),
        direction(&[0], flex, all),
        direction(&[2], flex, all),
        direction(&[0, 1, 2, 3], flex, [1.0, -0.5, -0.5]),
        direction(&[0], spread, first),
        direction(&[2], spread, first),
    ];
    let axis = |place: usize| (0..SIZE).map(move |at| f64::from(u8::from(at == place))).collect();
    Space {
        mean: relaxed.flat_map(|turn| turn.to_array()).collect(),
        components: orthonormal(wanted.into_iter().chain((0..SIZE).map(axis))),
    }
}

/// The axes of a hand's joint: its finger's place times three, plus its place in the finger.
fn axes(joints: &[DVec3], side: &str, place: usize) -> Axes {
    let at = |name: &str| smplx::skeleton().joint(&format!("{side}_{name}")).map_or(DVec3::ZERO, |joint| joints[joint]);
    let (wrist, index, pinky) = (at("wrist"), at("index1"), at("pinky1"));
    let out_of_palm = if side == "left" { -1.0 } else { 1.0 };
    let palm = ((index - wrist).cross(pinky - wrist) * out_of_palm).normalize_or_zero();
    let finger = FINGERS[place / 3];
    let own = at(&format!("{finger}{}", place % 3 + 1));
    let along = match place % 3 {
        2 => own - at(&format!("{finger}2")),
        within => at(&format!("{finger}{}", within + 2)) - own,
    };
    // The thumb closes towards the root of the little finger.
    let towards = if finger == "thumb" { pinky * 0.75 + wrist * 0.25 + palm * 0.03 - own } else { palm };
    Axes {
        flex: along.cross(towards.normalize_or_zero()).normalize_or_zero(),
        spread: along.cross(index - pinky).normalize_or_zero(),
    }
}

/// As many orthonormal rows as there are dimensions, each the first that is independent of those before.
fn orthonormal(rows: impl Iterator<Item = Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(SIZE);
    for mut row in rows {
        // Twice, for rounding.
        for _ in 0..2 {
            for other in &basis {
                let along: f64 = row.iter().zip(other).map(|(a, b)| a * b).sum();
                row.iter_mut().zip(other).for_each(|(a, b)| *a -= along * b);
            }
        }
        let length = row.iter().map(|value| value * value).sum::<f64>().sqrt();
        if length > INDEPENDENT && basis.len() < SIZE {
            basis.push(row.into_iter().map(|value| value / length).collect());
        }
    }
    basis
}
