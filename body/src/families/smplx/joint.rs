//! SMPL-X's joints by name: their places in its [`skeleton`](super::skeleton).

use std::ops::Range;

use crate::hands::HAND_JOINTS;

macro_rules! joints {
    ($($name:ident $place:literal)*) => {
        $(
            #[doc = concat!("The place of `", stringify!($name), "`, which the skeleton has in lower case.")]
            pub const $name: usize = $place;
        )*

        #[cfg(test)]
        const PLACES: &[(&str, usize)] = &[$((stringify!($name), $place)),*];
    };
}

joints! {
    PELVIS 0 LEFT_HIP 1 RIGHT_HIP 2 SPINE1 3 LEFT_KNEE 4 RIGHT_KNEE 5 SPINE2 6 LEFT_ANKLE 7 RIGHT_ANKLE 8 SPINE3 9
    LEFT_FOOT 10 RIGHT_FOOT 11 NECK 12 LEFT_COLLAR 13 RIGHT_COLLAR 14 HEAD 15 LEFT_SHOULDER 16 RIGHT_SHOULDER 17
    LEFT_ELBOW 18 RIGHT_ELBOW 19 LEFT_WRIST 20 RIGHT_WRIST 21 JAW 22 LEFT_EYE 23 RIGHT_EYE 24
}

/// Joints of a hand: five fingers of three, the thumb last.
pub const HAND: usize = HAND_JOINTS;
/// Joints of a finger.
const FINGER: usize = 3;
/// The joints of the left hand.
pub const LEFT_HAND: Range<usize> = RIGHT_EYE + 1..RIGHT_EYE + 1 + HAND;
/// The joints of the right hand.
pub const RIGHT_HAND: Range<usize> = LEFT_HAND.end..LEFT_HAND.end + HAND;
/// The joints of the left thumb.
pub const LEFT_THUMB: Range<usize> = LEFT_HAND.end - FINGER..LEFT_HAND.end;
/// The joints of the right thumb.
pub const RIGHT_THUMB: Range<usize> = RIGHT_HAND.end - FINGER..RIGHT_HAND.end;
/// All joints.
pub const COUNT: usize = RIGHT_HAND.end;

/// Joints of both sides, the left one first.
pub mod sides {
    /// The hips.
    pub const HIPS: [usize; 2] = [super::LEFT_HIP, super::RIGHT_HIP];
    /// The knees.
    pub const KNEES: [usize; 2] = [super::LEFT_KNEE, super::RIGHT_KNEE];
    /// The ankles.
    pub const ANKLES: [usize; 2] = [super::LEFT_ANKLE, super::RIGHT_ANKLE];
    /// The collars.
    pub const COLLARS: [usize; 2] = [super::LEFT_COLLAR, super::RIGHT_COLLAR];
    /// The shoulders.
    pub const SHOULDERS: [usize; 2] = [super::LEFT_SHOULDER, super::RIGHT_SHOULDER];
    /// The elbows.
    pub const ELBOWS: [usize; 2] = [super::LEFT_ELBOW, super::RIGHT_ELBOW];
    /// The wrists.
    pub const WRISTS: [usize; 2] = [super::LEFT_WRIST, super::RIGHT_WRIST];
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::smplx::skeleton;

    #[test]
    fn the_names_are_the_skeletons() {
        for (name, place) in PLACES {
            assert_eq!(skeleton().joint(&name.to_lowercase()), Some(*place), "{name}");
        }
        for (name, range) in
            [("left", LEFT_HAND), ("right", RIGHT_HAND), ("left_thumb", LEFT_THUMB), ("right_thumb", RIGHT_THUMB)]
        {
            assert!(skeleton().joints[range.clone()].iter().all(|joint| joint.starts_with(name)), "{name}");
            assert!(!skeleton().joints[range.start - 1].starts_with(name), "{name}");
        }
        assert_eq!(skeleton().joints.len(), COUNT);
    }
}
