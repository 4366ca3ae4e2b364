//! The least of a smooth function of many places, by conjugate gradients (Polak and Ribiere 1969).
//!
//! Along each direction p the step is that of Newton, -g.p / p.Hp, with Hp from the gradient a little farther on: for a quadratic function the
//! linear method, exactly.

use glam::DVec3;

/// How far on the gradient is looked at, over the longest part of the direction.
const AHEAD: f64 = 1e-5;

/// Moves places `x` towards the least of a function of which `gradient` is given, for so many steps at most.
pub fn descend(x: &mut [DVec3], steps: usize, gradient: impl Fn(&[DVec3]) -> Vec<DVec3>) {
    let mut slope = gradient(x);
    let mut direction: Vec<DVec3> = slope.iter().map(|slope| -*slope).collect();
    for _ in 0..steps {
        let longest = direction.iter().map(|way| way.length()).fold(0.0, f64::max);
        if longest < f64::MIN_POSITIVE {
            return;
        }
        let ahead = AHEAD / longest;
        let beyond: Vec<DVec3> = x.iter().zip(&direction).map(|(place, way)| *place + *way * ahead).collect();
        let change = gradient(&beyond);
        let curvature = dot(&direction, &change) - dot(&direction, &slope);
        if curvature <= 0.0 {
            return;
        }
        let step = -dot(&slope, &direction) * ahead / curvature;
        x.iter_mut().zip(&direction).for_each(|(place, way)| *place += *way * step);
        let next = gradient(x);
        let kept = ((dot(&next, &next) - dot(&next, &slope)) / dot(&slope, &slope)).max(0.0);
        direction.iter_mut().zip(&next).for_each(|(way, slope)| *way = *way * kept - *slope);
        slope = next;
    }
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    // sum k |x_k - (1, 2, 3)|^2: a quadratic of five eigenvalues is done in five steps.
    #[test]
    fn a_quadratic_is_solved_in_as_many_steps_as_it_has_eigenvalues() {
        let goal = DVec3::new(1.0, 2.0, 3.0);
        let mut x = [DVec3::ZERO; 5];
        descend(&mut x, 5, |x| {
            x.iter().enumerate().map(|(index, place)| (*place - goal) * (2.0 * (index + 1) as f64)).collect()
        });
        assert!(x.iter().all(|place| place.distance(goal) < 1e-6), "{x:?}");
        let found = x;
        descend(&mut x, 3, |_| vec![DVec3::ZERO; 5]);
        assert_eq!(x, found, "where it is flat nothing moves");
    }
}
