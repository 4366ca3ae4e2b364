//! Where rays meet that should all go through one point, some of which do not: the point that most of them pass, then the one that is
//! nearest to these.
//!
//! Every pair of rays proposes the point between them; the one that most rays pass within `reach` wins (all pairs, so the result does
//! not depend on chance). It is then refined: argmin_x sum_i w_i rho(d_i), d_i = |(I - u_i u_i^T)(x - o_i)|, rho of Geman and McClure.

use glam::{DMat3, DVec3};

/// Refinements; they settle in fewer.
const REFINEMENTS: usize = 15;
/// Cosine of the angle below which two rays say little of where they meet (8 degrees).
const PARALLEL: f64 = 0.99;

/// What one picture says of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where the camera is, metres.
    pub origin: DVec3,
    /// Towards the point, of length 1.
    pub direction: DVec3,
    /// How sure the picture is, 0 to 1.
    pub weight: f64,
}

/// Where rays meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// The point.
    pub place: DVec3,
    /// Mean distance of the rays within reach from it, metres.
    pub error: f64,
    /// Share of the weight of all rays that is within reach.
    pub share: f64,
}

impl Ray {
    /// How far a point is from the ray's line.
    pub fn distance(&self, place: DVec3) -> f64 {
        (place - self.origin).cross(self.direction).length()
    }
}

/// Where most of some rays meet, within `reach` metres; none if no two do.
pub fn meeting(rays: &[Ray], reach: f64) -> Option<Meeting> {
    let pairs =
        rays.iter().enumerate().flat_map(|(index, one)| rays[index + 1..].iter().map(move |other| (one, other)));
    let proposals = pairs.filter_map(|(one, other)| between(one, other));
    let score = |place: &DVec3| -> f64 {
        rays.iter().map(|ray| ray.weight * (1.0 - (ray.distance(*place) / reach).powi(2)).max(0.0)).sum()
    };
    let (mut place, _) = proposals
        .map(|place| (place, score(&place)))
        .reduce(|best, other| if other.1 > best.1 { other } else { best })?;
    for _ in 0..REFINEMENTS {
        place = nearest(rays, |ray| ray.weight * (1.0 + (ray.distance(place) / reach).powi(2)).powi(-2))?;
    }
    let near: Vec<&Ray> = rays.iter().filter(|ray| ray.distance(place) < reach).collect();
    let weight = |rays: &mut dyn Iterator<Item = &Ray>| rays.map(|ray| ray.weight).sum::<f64>();
    let inside = weight(&mut near.iter().copied());
    (near.len() > 1 && inside > 0.0).then(|| Meeting {
        place,
        error: near.iter().map(|ray| ray.weight * ray.distance(place)).sum::<f64>() / inside,
        share: inside / weight(&mut rays.iter()),
    })
}

/// The middle of the shortest way between two rays, if they are not parallel and it is before both cameras.
fn between(one: &Ray, other: &Ray) -> Option<DVec3> {
    let cosine = one.direction.dot(other.direction);
    if cosine.abs() > PARALLEL {
        return None;
    }
    let apart = other.origin - one.origin;
    let (along, across) = (apart.dot(one.direction), apart.dot(other.direction));
    let sine = 1.0 - cosine * cosine;
    let first = (along - across * cosine) / sine;
    let second = (along * cosine - across) / sine;
    let place = (one.origin + one.direction * first + other.origin + other.direction * second) / 2.0;
    (first > 0.0 && second > 0.0).then_some(place)
}

/// The point of which the weighted squared distances to rays are least.
fn nearest(rays: &[Ray], weight: impl Fn(&Ray) -> f64) -> Option<DVec3> {
    let (mut matrix, mut sum) = (DMat3::ZERO, DVec3::ZERO);
    for ray in rays {
        let u = ray.direction;
        let across = (DMat3::IDENTITY - DMat3::from_cols(u * u.x, u * u.y, u * u.z)) * weight(ray);
        matrix += across;
        sum += across * ray.origin;
    }
    let place = matrix.inverse() * sum;
    place.is_finite().then_some(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays from a ring of cameras, 3 m away, towards places.
    fn ring(towards: impl Fn(usize) -> DVec3) -> Vec<Ray> {
        let ray = |index: usize| {
            let (sin, cos) = (index as f64 * 0.5).sin_cos();
            let origin = DVec3::new(3.0 * cos, 1.0 + 0.3 * sin, 3.0 * sin);
            Ray { origin, direction: (towards(index) - origin).normalize(), weight: 0.9 }
        };
        (0..12).map(ray).collect()
    }

    #[test]
    fn rays_through_a_point_meet_there() {
        let point = DVec3::new(0.2, 1.1, -0.3);
        let met = meeting(&ring(|_| point), 0.05).unwrap();
        assert!(met.place.distance(point) < 1e-9 && met.error < 1e-9);
        assert!((met.share - 1.0).abs() < 1e-12);
    }

    // Four of twelve go through one wrong point, as when a picture takes the left wrist for the right one.
    #[test]
    fn a_minority_that_agrees_on_another_point_does_not_count() {
        let (point, wrong) = (DVec3::new(0.2, 1.1, -0.3), DVec3::new(-0.2, 1.0, 0.1));
        let met = meeting(&ring(|index| if index < 10 && index % 5 < 2 { wrong } else { point }), 0.05).unwrap();
        assert!(met.place.distance(point) < 5e-3, "{met:?}");
        assert!((met.share - 8.0 / 12.0).abs() < 0.01);
    }

    #[test]
    fn parallel_rays_and_single_ones_meet_nowhere() {
        let ray = |x: f64| Ray { origin: DVec3::new(x, 0.0, 0.0), direction: DVec3::Z, weight: 1.0 };
        assert!(meeting(&[ray(0.0), ray(0.1)], 0.5).is_none() && meeting(&[ray(0.0)], 0.5).is_none());
    }
}
