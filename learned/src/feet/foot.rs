//! One foot of a body: its vertices, its joints, how feet differ, and the network of its contact.
//!
//! Joints are those from the ankle on. The first turns the foot in the world, and the ground knows no heading: of its turn R = R_y(heading) R' only R' is a
//! feature. Shapes beta_1, beta_2 are the principal components, of unit variance, of what the body's shapes do to the foot at rest, wherever that is.

use candle_core::{Device, Result as TensorResult, Tensor};
use candle_nn::Linear;
use glam::{DMat3, DQuat, DVec3};
use xavatar_body::{BodyModel, ShapeSpace};
use xavatar_formats::Result;
use xavatar_register::linear::so3;

use super::network::{UNIT, layers, through, widths};
use crate::descent::{Parameters, of_tensors};

/// Shapes of a foot that its network sees.
pub(super) const SHAPES: usize = 2;
/// Names of the joints at which feet begin, left and right.
pub(super) const SIDES: [(&str, &str); 2] = [("left", "left_ankle"), ("right", "right_ankle")];
/// Less of a turn than this about the vertical is no heading: the foot is upside down.
const NO_HEADING: f64 = 1e-9;

/// A foot.
#[derive(Clone, Debug)]
pub struct Foot {
    /// Of the body, ascending (F).
    pub vertices: Vec<usize>,
    /// Of the body; the first turns the whole foot.
    pub joints: Vec<usize>,
    pub(super) shape: FootShape,
    pub(super) layers: Vec<Linear>,
}

/// How feet at rest differ.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FootShape {
    /// About its middle (F).
    pub mean: Vec<DVec3>,
    /// What a foot is multiplied by for each of its coefficients (2, F), per metre.
    pub directions: Vec<Vec<DVec3>>,
}

/// What a foot's network is asked.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Asked {
    /// Of the foot's joints: the first in the world, without heading, the others beside their parents.
    pub turns: Vec<DQuat>,
    /// At rest (F).
    pub rest: Vec<DVec3>,
    /// (F).
    pub contact: Vec<bool>,
}

impl Foot {
    /// The foot from a joint on, its network with parameters of this name.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) if the body has no such joint, or nothing follows it.
    pub(super) fn of(model: &BodyModel, joint: &str, parameters: &mut Parameters, name: &str) -> Result<Self> {
        let vertices = model.vertices_from(joint)?;
        let skeleton = model.skeleton();
        if vertices.is_empty() {
            let (name, found) = ("the body's feet".into(), format!("no vertex that follows {joint}"));
            return Err(xavatar_formats::Error::Value { name, found, expected: "some".into() });
        }
        let first = skeleton.joint(joint);
        let hangs = |joint: usize| {
            std::iter::successors(Some(joint), |joint| skeleton.parents[*joint]).any(|above| Some(above) == first)
        };
        let joints: Vec<usize> = (0..skeleton.joints.len()).filter(|joint| hangs(*joint)).collect();
        let shape = FootShape::of(model, &vertices);
        let widths = widths(features(joints.len(), vertices.len()), vertices.len());
        let layers = layers(parameters, name, &widths).map_err(of_tensors)?;
        Ok(Self { vertices, joints, shape, layers })
    }

    /// What is asked of a foot in a pose: turns of the body's joints beside their parents and in the world (J), the body at rest (V), contact (F).
    pub(super) fn asked(&self, rotations: &[DMat3], turns: &[DMat3], rest: &[DVec3], contact: Vec<bool>) -> Asked {
        let turn = |(place, joint): (usize, &usize)| match place {
            0 => without_heading(so3::quaternion(&turns[*joint])),
            _ => so3::quaternion(&rotations[*joint]),
        };
        Asked {
            turns: self.joints.iter().enumerate().map(turn).collect(),
            rest: self.vertices.iter().map(|vertex| rest[*vertex]).collect(),
            contact,
        }
    }

    /// f, as a row for the network.
    pub(super) fn features(&self, asked: &Asked) -> Vec<f64> {
        let turns = asked.turns.iter().flat_map(|turn| [turn.x, turn.y, turn.z, turn.w - 1.0]);
        let contact = asked.contact.iter().map(|touches| f64::from(u8::from(*touches)));
        turns.chain(self.shape.coefficients(&asked.rest)).chain(contact).collect()
    }

    /// B_F at rest (F), by the network.
    pub(super) fn offsets(&self, asked: &Asked) -> TensorResult<Vec<DVec3>> {
        let features = self.features(asked);
        let features = Tensor::from_vec(features, (1, ()), &Device::Cpu)?.to_dtype(candle_core::DType::F32)?;
        let offsets = through(&self.layers, &features)?.flatten_all()?.to_dtype(candle_core::DType::F64)?;
        let offsets = offsets.to_vec1::<f64>()?;
        Ok(offsets.as_chunks::<3>().0.iter().map(|offset| DVec3::from_array(*offset) * UNIT).collect())
    }
}

/// How many numbers the network of a foot is asked.
pub(super) fn features(joints: usize, vertices: usize) -> usize {
    4 * joints + SHAPES + vertices
}

/// A turn without its part about the vertical, which comes last.
fn without_heading(turn: DQuat) -> DQuat {
    let heading = DQuat::from_xyzw(0.0, turn.y, 0.0, turn.w);
    if heading.length() < NO_HEADING { turn } else { heading.normalize().inverse() * turn }
}

impl FootShape {
    fn of(model: &BodyModel, vertices: &[usize]) -> Self {
        let chosen = |all: &[f32]| -> Vec<DVec3> {
            let place = |vertex: &usize| glam::Vec3::from_slice(&all[3 * vertex..3 * vertex + 3]).as_dvec3();
            if all.is_empty() { vec![DVec3::ZERO; vertices.len()] } else { vertices.iter().map(place).collect() }
        };
        let mean: Vec<DVec3> = vertices.iter().map(|vertex| model.template()[*vertex].as_dvec3()).collect();
        let mean = about_middle(&mean);
        let anatomy = model.anatomy();
        let shapes = anatomy.shapes.directions().take(anatomy.shape_coefficients());
        let flat = |points: Vec<DVec3>| points.iter().flat_map(|point| point.to_array()).collect::<Vec<f64>>();
        let directions: Vec<Vec<f64>> = shapes.map(|direction| flat(about_middle(&chosen(direction)))).collect();
        let space = ShapeSpace::of_directions(flat(mean.clone()), &directions);
        let direction = |place: usize| match (space.basis.get(place), space.variance.get(place)) {
            (Some(row), Some(variance)) if *variance > f64::MIN_POSITIVE => {
                row.as_chunks::<3>().0.iter().map(|entry| DVec3::from_array(*entry) / variance.sqrt()).collect()
            }
            _ => vec![DVec3::ZERO; vertices.len()],
        };
        Self { mean, directions: (0..SHAPES).map(direction).collect() }
    }

    /// beta of a foot at rest (F).
    fn coefficients(&self, rest: &[DVec3]) -> impl Iterator<Item = f64> {
        let own = about_middle(rest);
        let along = move |direction: &Vec<DVec3>| -> f64 {
            own.iter().zip(&self.mean).zip(direction).map(|((own, mean), along)| (*own - *mean).dot(*along)).sum()
        };
        self.directions.iter().map(along)
    }
}

/// Points less their mean.
fn about_middle(points: &[DVec3]) -> Vec<DVec3> {
    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    points.iter().map(|point| *point - middle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heading_is_no_feature_and_what_is_left_turns_the_foot_as_before() {
        let tilt = DQuat::from_scaled_axis(DVec3::new(0.4, 0.0, -0.2));
        for heading in [-2.0, 0.0, 0.7, 3.0] {
            let turn = DQuat::from_rotation_y(heading) * tilt;
            let left = without_heading(turn);
            assert!(left.abs_diff_eq(tilt, 1e-12), "{heading}: {left}");
        }
        let upside_down = DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0);
        assert_eq!(without_heading(upside_down), upside_down);
    }
}
