//! Which direction of shape says how heavy a body is for its height: STAR's second coefficient (METHOD-BODY 3, step 6).

use glam::DVec3;

use crate::core::{Identity, Shapes};

/// Makes the direction second that tells best how heavy a body is for its height; says how well it does.
pub(super) fn heaviest_second(shapes: &mut Shapes, subjects: &[Identity], faces: &[[u32; 3]]) -> Option<f64> {
    let heaviness: Vec<f64> =
        subjects.iter().map(|subject| volume(&subject.template, faces) / height(&subject.template).powi(3)).collect();
    let correlation = |direction: usize| {
        let own: Vec<f64> = shapes.coefficients.iter().map(|c| c[direction]).collect();
        correlation(&own, &heaviness)
    };
    let found: Vec<f64> = (0..shapes.directions.len()).map(correlation).collect();
    let best = (0..found.len()).max_by(|one, other| found[*one].abs().total_cmp(&found[*other].abs()))?;
    let strength = found[best];
    if shapes.directions.len() > 1 {
        shapes.move_to(best, 1);
    }
    Some(strength)
}

fn correlation(one: &[f64], other: &[f64]) -> f64 {
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    let (a, b) = (mean(one), mean(other));
    let sum = |f: &dyn Fn(f64, f64) -> f64| one.iter().zip(other).map(|(x, y)| f(x - a, y - b)).sum::<f64>();
    sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt().max(f64::MIN_POSITIVE)
}

fn volume(vertices: &[DVec3], faces: &[[u32; 3]]) -> f64 {
    let of_face = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|corner| vertices[corner as usize]);
        a.dot(b.cross(c)) / 6.0
    };
    faces.iter().map(of_face).sum()
}

fn height(vertices: &[DVec3]) -> f64 {
    let heights = || vertices.iter().map(|vertex| vertex.y);
    heights().fold(f64::MIN, f64::max) - heights().fold(f64::MAX, f64::min)
}
