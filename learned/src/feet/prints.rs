//! What registrations say of feet on the ground: of each frame and foot what its network is asked, and what it ought to answer.
//!
//! A person's shape is the mean of those of all frames, poses are found in it; contact is the registration's own, and the answer what is left of the registration at rest.
//! Where a body is its own mirror image, a left foot mirrored is a right foot.

use glam::{DQuat, DVec3};
use rayon::prelude::*;
use xavatar_body::BodyModel;
use xavatar_formats::{ArrayMap, Result};

use super::foot::{Asked, Foot};
use super::ground::{ground_under, is_in_contact};
use crate::core::{Fitted, FittedBody, Mirror, PoseFit, shaped, unposed};
use crate::named_arrays::{NamedArrays, array, flat, points_of};

/// A foot in a frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Print {
    pub asked: Asked,
    /// At rest (F).
    pub offsets: Vec<DVec3>,
}

/// A person's registrations as a body has them: one shape, a pose each.
pub(super) struct FittedPerson {
    /// The template (V).
    pub rest: Vec<DVec3>,
    pub frames: Vec<Fitted>,
}

impl FittedPerson {
    /// Of a person's registrations (N, V).
    pub fn of(model: &BodyModel, body: &FittedBody, registrations: &[Vec<DVec3>]) -> Self {
        let expression = model.expression_coefficients() > 0;
        let each = PoseFit { shape: true, expression };
        let found: Vec<Fitted> = registrations.par_iter().map(|frame| each.nearest(body, frame, None)).collect();
        let mut shape = vec![0.0; body.linkage.extents().shapes];
        for fitted in &found {
            shape.iter_mut().zip(&fitted.shape).for_each(|(sum, value)| *sum += value / found.len() as f64);
        }
        let posed = PoseFit { shape: false, expression };
        let again = |(fitted, frame): (Fitted, &Vec<DVec3>)| {
            posed.nearest(body, frame, Some(Fitted { shape: shape.clone(), ..fitted }))
        };
        let frames = found.into_par_iter().zip(registrations).map(again).collect();
        Self { rest: shaped(model, &shape).template, frames }
    }
}

impl Foot {
    /// The ground under a registration (V): what is known of it, or where its feet are flat.
    pub(super) fn ground(feet: &[Self; 2], registration: &[DVec3], known: Option<f64>) -> f64 {
        let places = || feet.iter().flat_map(|foot| foot.vertices.iter().map(|vertex| registration[*vertex]));
        known.or_else(|| ground_under(&places().collect::<Vec<DVec3>>())).unwrap_or_default()
    }

    /// The prints of a foot in a person's registrations (N, V), on the ground or on what is found of it.
    pub(super) fn prints(
        feet: &[Self; 2],
        body: &FittedBody,
        person: &FittedPerson,
        registrations: &[Vec<DVec3>],
        ground: Option<f64>,
    ) -> Vec<[Print; 2]> {
        let of_frame = |(fitted, registration): (&Fitted, &Vec<DVec3>)| {
            let (posed, chain) = body.posed(&fitted.pose, &fitted.shape);
            let nothing = vec![DVec3::ZERO; registration.len()];
            let left = unposed(&posed.positions, &posed.turns, registration, &nothing);
            let ground = Self::ground(feet, registration, ground);
            feet.each_ref().map(|foot| {
                let contact = foot.vertices.iter().map(|vertex| is_in_contact(registration[*vertex], ground));
                Print {
                    asked: foot.asked(&fitted.pose.rotations, &chain.turns, &person.rest, contact.collect()),
                    offsets: foot.vertices.iter().map(|vertex| left[*vertex]).collect(),
                }
            })
        };
        person.frames.par_iter().zip(registrations).map(of_frame).collect()
    }
}

/// Where each vertex and each joint of a foot are in the mirror image of the other.
#[derive(Clone, Debug)]
pub(super) struct Twin {
    vertices: Vec<usize>,
    joints: Vec<usize>,
}

impl Twin {
    /// Of a foot in another; none if they are not each other's images.
    pub fn of(foot: &Foot, other: &Foot, mirror: &Mirror) -> Option<Self> {
        let place = |among: &[usize], image: usize| among.iter().position(|own| *own == image);
        let vertices = foot.vertices.iter().map(|vertex| place(&other.vertices, mirror.vertices[*vertex]));
        let joints = foot.joints.iter().map(|joint| place(&other.joints, mirror.joints[*joint]));
        Some(Self { vertices: vertices.collect::<Option<_>>()?, joints: joints.collect::<Option<_>>()? })
    }

    /// A print of the other foot as one of this.
    pub fn mirrored(&self, print: &Print) -> Print {
        let image = |point: DVec3| DVec3::new(-point.x, point.y, point.z);
        let turn = |turn: DQuat| DQuat::from_xyzw(turn.x, -turn.y, -turn.z, turn.w);
        let Print { asked, offsets } = print;
        Print {
            asked: Asked {
                turns: self.joints.iter().map(|joint| turn(asked.turns[*joint])).collect(),
                rest: self.vertices.iter().map(|vertex| image(asked.rest[*vertex])).collect(),
                contact: self.vertices.iter().map(|vertex| asked.contact[*vertex]).collect(),
            },
            offsets: self.vertices.iter().map(|vertex| image(offsets[*vertex])).collect(),
        }
    }
}

/// Prints of a foot as arrays, their names after a prefix: turns (N, J, 4), rest (N, F, 3), contact (N, F), offsets (N, F, 3).
pub(super) fn to_arrays(prints: &[&Print], prefix: &str) -> ArrayMap {
    let (joints, vertices) = prints.first().map_or((0, 0), |print| (print.asked.turns.len(), print.offsets.len()));
    let count = prints.len();
    let turns = prints.iter().flat_map(|print| &print.asked.turns).flat_map(|turn| turn.to_array()).collect();
    let contact = prints.iter().flat_map(|print| &print.asked.contact).map(|touches| f64::from(u8::from(*touches)));
    let arrays = [
        ("turns", array(&[count, joints, 4], turns)),
        ("rest", array(&[count, vertices, 3], flat(prints.iter().flat_map(|print| &print.asked.rest)))),
        ("contact", array(&[count, vertices], contact.collect())),
        ("offsets", array(&[count, vertices, 3], flat(prints.iter().flat_map(|print| &print.offsets)))),
    ];
    arrays.into_iter().map(|(name, array)| (format!("{prefix}{name}"), array)).collect()
}

/// The prints of a foot that [`to_arrays`] made arrays of.
///
/// # Errors
/// [`Error::Malformed`](xavatar_formats::Error::Malformed) naming the array that is missing or has another shape.
pub(super) fn from_arrays(file: NamedArrays<'_>, foot: &Foot, prefix: &str) -> Result<Vec<Print>> {
    let (joints, vertices) = (foot.joints.len(), foot.vertices.len());
    let [count, _] = file.extents(&format!("{prefix}contact"));
    let numbers = |name: &str, shape: &[usize]| file.numbers(&format!("{prefix}{name}"), shape);
    let turns = numbers("turns", &[count, joints, 4])?;
    let turns: Vec<DQuat> = turns.as_chunks::<4>().0.iter().map(|turn| DQuat::from_array(*turn)).collect();
    let rest = points_of(&numbers("rest", &[count, vertices, 3])?);
    let contact: Vec<bool> = numbers("contact", &[count, vertices])?.iter().map(|touches| *touches != 0.0).collect();
    let offsets = points_of(&numbers("offsets", &[count, vertices, 3])?);
    let print = |frame: usize| {
        let own = frame * vertices..(frame + 1) * vertices;
        Print {
            asked: Asked {
                turns: turns[frame * joints..(frame + 1) * joints].to_vec(),
                rest: rest[own.clone()].to_vec(),
                contact: contact[own.clone()].to_vec(),
            },
            offsets: offsets[own].to_vec(),
        }
    };
    Ok((0..count).map(print).collect())
}
