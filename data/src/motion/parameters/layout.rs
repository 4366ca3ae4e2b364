//! How rotations lie in an array: people, frames, joints, and vectors or matrices, told by its shape.
//!
//! | joints | model | what they are |
//! |---|---|---|
//! | 21 (22 with the root) | SMPL-X or any | the body's |
//! | 23 (24) | SMPL | the body's and two of the hands, which have no counterpart |
//! | 51 (52) | SMPL+H | the body's, 2 x 15 of the hands |
//! | 54 (55) | SMPL-X | the body's, jaw, eyes, 2 x 15 of the hands |

use xavatar_body::smplx::joint;
use xavatar_body::{smpl, smplh, smplx};
use xavatar_formats::element_count;

/// What rotations are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rotations {
    /// Axis times angle.
    Vectors,
    /// Row-major matrices.
    Matrices,
}

/// Whose joints are in the array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Model {
    Body,
    Smpl,
    SmplH,
    SmplX,
}

impl Model {
    pub(super) const ALL: [Self; 4] = [Self::Body, Self::Smpl, Self::SmplH, Self::SmplX];

    /// Joints without the root.
    pub(super) fn joints(self) -> usize {
        match self {
            Self::Body => smplx::BODY_JOINTS,
            Self::Smpl => smpl::skeleton().joints.len() - 1,
            Self::SmplH => smplh::skeleton().joints.len() - 1,
            Self::SmplX => smplx::skeleton().joints.len() - 1,
        }
    }

    /// The first joint of the hands, counted without the root, of models that have them: the hands come last.
    pub(super) fn first_of_hands(self) -> Option<usize> {
        match self {
            Self::SmplH | Self::SmplX => Some(self.joints() - 2 * joint::HAND),
            Self::Body | Self::Smpl => None,
        }
    }

    /// What of SMPL-X the model does not have, for people.
    pub(super) fn left_out(self) -> Option<&'static str> {
        match self {
            Self::Smpl => {
                Some("a motion of SMPL: its two hand joints are left out, hands are flat, the face is neutral")
            }
            Self::SmplH => Some("a motion of SMPL+H: the face is neutral"),
            Self::Body | Self::SmplX => None,
        }
    }
}

/// Where rotations are in an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    /// People, of whom each has as many frames; the outermost extent if there are several.
    pub(super) people: usize,
    pub(super) frames: usize,
    pub(super) joints: usize,
    pub(super) rotations: Rotations,
    pub(super) model: Model,
}

/// Numbers of a VPoser code.
const VPOSER: usize = 32;

impl Layout {
    /// Of an array of this shape, whose last extents are those of the joints; `None` for anything else.
    pub(super) fn of(shape: &[usize]) -> Option<Self> {
        Model::ALL.into_iter().flat_map(|model| [(model.joints(), model), (model.joints() + 1, model)]).find_map(
            |(joints, model)| {
                let endings: [(&[usize], Rotations); 5] = [
                    (&[joints, 3, 3], Rotations::Matrices),
                    (&[joints, 9], Rotations::Matrices),
                    (&[9 * joints], Rotations::Matrices),
                    (&[joints, 3], Rotations::Vectors),
                    (&[3 * joints], Rotations::Vectors),
                ];
                endings.iter().find_map(|(ending, rotations)| {
                    let leading = shape.strip_suffix(*ending)?;
                    let frames = element_count(leading).ok().filter(|frames| *frames > 0)?;
                    let several: Vec<usize> = leading.iter().copied().filter(|extent| *extent > 1).collect();
                    let people = if let [people, _] = several[..] { people } else { 1 };
                    (several.len() <= 2).then_some(Self {
                        people,
                        frames: frames / people,
                        joints,
                        rotations: *rotations,
                        model,
                    })
                })
            },
        )
    }

    /// Whether the first joint is the root.
    pub(super) fn has_root(&self) -> bool {
        Model::ALL.into_iter().all(|model| self.joints != model.joints())
    }
}

/// Whether an array of this shape has codes of VPoser, not rotations.
pub(super) fn is_vposer_code(shape: &[usize]) -> bool {
    shape.last() == Some(&VPOSER) && shape.len() <= 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_tell_people_frames_joints_and_kind() {
        let of = |shape: &[usize]| {
            Layout::of(shape).map(|found| (found.people, found.frames, found.joints, found.rotations, found.model))
        };
        use Rotations::{Matrices, Vectors};
        for (shape, expected) in [
            (&[63][..], (1, 1, 21, Vectors, Model::Body)),
            (&[5, 66], (1, 5, 22, Vectors, Model::Body)),
            (&[1, 5, 63], (1, 5, 21, Vectors, Model::Body)),
            (&[5, 1, 63], (1, 5, 21, Vectors, Model::Body)),
            (&[2, 5, 63], (2, 5, 21, Vectors, Model::Body)),
            (&[21, 3], (1, 1, 21, Vectors, Model::Body)),
            (&[5, 22, 3, 3], (1, 5, 22, Matrices, Model::Body)),
            (&[4, 69], (1, 4, 23, Vectors, Model::Smpl)),
            (&[4, 72], (1, 4, 24, Vectors, Model::Smpl)),
            (&[4, 216], (1, 4, 24, Matrices, Model::Smpl)),
            (&[23, 3, 3], (1, 1, 23, Matrices, Model::Smpl)),
            (&[4, 24, 9], (1, 4, 24, Matrices, Model::Smpl)),
            (&[4, 156], (1, 4, 52, Vectors, Model::SmplH)),
            (&[4, 153], (1, 4, 51, Vectors, Model::SmplH)),
            (&[165], (1, 1, 55, Vectors, Model::SmplX)),
            (&[4, 55, 3, 3], (1, 4, 55, Matrices, Model::SmplX)),
        ] {
            assert_eq!(of(shape), Some(expected), "{shape:?}");
        }
        for shape in [&[][..], &[0, 63], &[4, 32], &[4, 144], &[4, 24, 4], &[2, 2, 2, 63], &[20, 3], &[3]] {
            assert_eq!(of(shape), None, "{shape:?}");
        }
        assert!(is_vposer_code(&[1, 32]) && is_vposer_code(&[32]) && !is_vposer_code(&[4, 63]));
    }
}
