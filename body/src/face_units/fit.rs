//! What a body's own expressions, jaw and eyes do of each facial action: over e and r,
//!
//! ```text
//! min sum_v |u_v - sum_k e_k E_kv - sum_b w_bv (r_b x (v - p_b))|^2 + prior^2 |e|^2
//! ```
//!
//! with u the action, E the expression directions, b the jaw and the eyes, w their skinning weights, p their joints, r turns to first order. What
//! is left, u - fit, is kept. V vertices, K expression coefficients; metres, radians.

use glam::{DVec3, Vec3};
use serde::Serialize;
use xavatar_formats::Result;

use super::{FaceUnits, MOVES};
use crate::BodyModel;
use crate::least_squares::solved;

/// The joints that a face turns.
const TURNED: [&str; 3] = ["jaw", "left_eye", "right_eye"];
/// What a coefficient of one costs, metres: expressions that hardly move anything are left alone.
const PRIOR: f64 = 1e-3;

/// An action, taken apart.
#[derive(Clone, Debug)]
pub struct FittedUnit {
    /// ARKit's name.
    pub name: String,
    /// Of the body's expressions (K).
    pub expression: Vec<f32>,
    /// Joints and their turns, as vectors along their axes.
    pub turns: Vec<(usize, Vec3)>,
    /// The action itself, at rest (V).
    pub offsets: Vec<Vec3>,
    /// What expressions and turns leave of it (V).
    pub rest: Vec<Vec3>,
    /// How well they do.
    pub error: UnitError,
}

/// How far an action and its fit are apart, over the vertices that it moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct UnitError {
    /// The farthest that the action moves a vertex, metres.
    pub size: f64,
    /// The root of the mean square, metres.
    pub root_mean_square: f64,
    /// The largest, metres.
    pub max: f64,
}

impl UnitError {
    /// Of pairs of what an action does and what is missing of it.
    pub fn of(pairs: impl Iterator<Item = (f64, f64)>) -> Self {
        let (mut error, mut count) = (Self::default(), 0);
        for (moved, missing) in pairs.filter(|(moved, _)| *moved > MOVES) {
            error.size = error.size.max(moved);
            error.max = error.max.max(missing);
            error.root_mean_square += missing * missing;
            count += 1;
        }
        error.root_mean_square = (error.root_mean_square / f64::from(count.max(1))).sqrt();
        error
    }
}

impl FaceUnits {
    /// The actions on a body of this shape, in the order of [`FaceUnits::offsets`].
    ///
    /// # Errors
    /// [`Error::Unfit`](xavatar_formats::Error::Unfit) for a body without a head; [`BodyModel::pose`]'s for the shape.
    pub fn fitted(&self, body: &BodyModel, shape: &[f32]) -> Result<Vec<FittedUnit>> {
        let actions = self.on(body)?;
        let skeleton = body.skeleton();
        let turned: Vec<usize> = TURNED.iter().filter_map(|name| skeleton.joint(name)).collect();
        let mut columns = expressions(body);
        let count = columns.len();
        for (index, column) in columns.iter_mut().enumerate() {
            column.extend((0..count).map(|other| if other == index { PRIOR } else { 0.0 }));
        }
        let pose = crate::Pose { shape: shape.to_vec(), ..skeleton.rest_pose() };
        let posed = body.pose(&pose)?;
        for joint in &turned {
            let weight = |vertex: usize| body.skinning_weights()[vertex * skeleton.joints.len() + joint];
            for axis in DVec3::AXES {
                let place = |(vertex, place): (usize, &Vec3)| {
                    (axis.cross((*place - posed.joints[*joint]).as_dvec3()) * f64::from(weight(vertex))).to_array()
                };
                let column = posed.vertices.iter().enumerate().flat_map(place).chain(std::iter::repeat_n(0.0, count));
                columns.push(column.collect());
            }
        }
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let units = self.offsets.iter().zip(actions).map(|((name, _), action)| {
            let wanted = action.iter().flat_map(DVec3::to_array).chain(std::iter::repeat_n(0.0, count));
            let x = solved(&columns, &wanted.collect::<Vec<f64>>());
            let fitted = |vertex: usize| {
                let at = |axis: usize| columns.iter().zip(&x).map(|(column, x)| column[3 * vertex + axis] * x).sum();
                DVec3::new(at(0), at(1), at(2))
            };
            let rest: Vec<DVec3> = action.iter().enumerate().map(|(vertex, offset)| *offset - fitted(vertex)).collect();
            let turns = turned.iter().zip(x[count..].as_chunks::<3>().0);
            FittedUnit {
                name: name.clone(),
                expression: x[..count].iter().map(|value| *value as f32).collect(),
                turns: turns.map(|(joint, turn)| (*joint, DVec3::from(*turn).as_vec3())).collect(),
                error: UnitError::of(action.iter().zip(&rest).map(|(moved, left)| (moved.length(), left.length()))),
                offsets: action.iter().map(|offset| offset.as_vec3()).collect(),
                rest: rest.iter().map(|offset| offset.as_vec3()).collect(),
            }
        });
        Ok(units.collect())
    }
}

/// The expression directions (K) of (V, 3) numbers.
fn expressions(body: &BodyModel) -> Vec<Vec<f64>> {
    let anatomy = body.anatomy();
    let all = anatomy.shapes.directions().skip(anatomy.shape_coefficients());
    all.map(|direction| match direction.is_empty() {
        true => vec![0.0; 3 * body.vertex_count()],
        false => direction.iter().map(|value| f64::from(*value)).collect(),
    })
    .collect()
}
