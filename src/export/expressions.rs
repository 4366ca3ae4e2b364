//! What an expression does to the canonical surface, asked of the geometry field: d_k = x' - x with f(x', c_k) = 0.
//!
//! c_k is the condition of a unit of coefficient k alone; x' is found from x by Newton's method along the gradient,
//! x <- x - f grad f / |grad f|^2. For avatars whose warp does not carry the body model's expressions. V vertices, E
//! coefficients; metres.

use glam::Vec3;

use crate::avatar::Avatar;
use crate::fields::FieldEvaluator;

/// Newton steps; the second leaves hundredths of a millimetre.
const STEPS: usize = 3;
/// Longest step, metres: longer ones come of a flat field and lead nowhere.
const LONGEST_STEP: f32 = 4e-3;

/// The displacement of each vertex (V) by a unit of each expression coefficient (E).
pub(super) fn displacements(avatar: &Avatar, vertices: &[Vec3]) -> Vec<Vec<Vec3>> {
    let condition = avatar.condition();
    let displaced = |expression: &[f32]| {
        let evaluator = FieldEvaluator::new(&avatar.fields, &condition.of_expression(expression));
        let mut points: Vec<[f32; 3]> = vertices.iter().map(Vec3::to_array).collect();
        for _ in 0..STEPS {
            let (values, gradients) = evaluator.values_and_gradients(&points);
            for ((point, value), gradient) in points.iter_mut().zip(values).zip(gradients) {
                let gradient = Vec3::from_array(gradient);
                let step = gradient * (value / gradient.length_squared().max(f32::MIN_POSITIVE));
                *point = (Vec3::from_array(*point) - step.clamp_length_max(LONGEST_STEP)).to_array();
            }
        }
        points
    };
    // The mesh's vertices are not exactly on the level set: what the steps do without an expression is none of it.
    let resting = displaced(&[]);
    let unit = |coefficient| {
        let moved = displaced(&unit_expression(coefficient));
        moved.iter().zip(&resting).map(|(to, from)| Vec3::from_array(*to) - Vec3::from_array(*from)).collect()
    };
    (0..condition.expressions()).map(unit).collect()
}

/// A unit of one coefficient alone.
pub(super) fn unit_expression(coefficient: usize) -> Vec<f32> {
    let mut expression = vec![0.0; coefficient + 1];
    expression[coefficient] = 1.0;
    expression
}
