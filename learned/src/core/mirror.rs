//! Which vertex and which joint are each other's mirror images: U(x)_i = diag(-1, 1, 1) x_pair(i) (METHOD-BODY 3).

use glam::DVec3;

/// A vertex is another's image within this, metres.
const NEAR: f64 = 1e-3;
/// A joint is another's within this, metres.
const JOINT_NEAR: f64 = 0.01;

/// The images of vertices (V) and joints (J); one in the middle is its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mirror {
    /// Pairs of vertices (V).
    pub vertices: Vec<usize>,
    /// Pairs of joints (J).
    pub joints: Vec<usize>,
}

impl Mirror {
    /// Of a template (V) and its joints (J) about x = 0; none if they are not symmetric, vertex by vertex.
    pub fn of(template: &[DVec3], joints: &[DVec3]) -> Option<Self> {
        Some(Self { vertices: pairs(template, NEAR)?, joints: pairs(joints, JOINT_NEAR)? })
    }
}

fn image(point: DVec3) -> DVec3 {
    DVec3::new(-point.x, point.y, point.z)
}

/// The nearest to each point's image, if that is one-to-one.
fn pairs(points: &[DVec3], near: f64) -> Option<Vec<usize>> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|one, other| points[*one].y.total_cmp(&points[*other].y).then(one.cmp(other)));
    let pair = |point: &DVec3| {
        let wanted = image(*point);
        let first = order.partition_point(|other| points[*other].y < wanted.y - near);
        let close = order[first..].iter().take_while(|other| points[**other].y <= wanted.y + near);
        let nearest = close.min_by(|one, other| {
            points[**one].distance_squared(wanted).total_cmp(&points[**other].distance_squared(wanted))
        })?;
        (points[*nearest].distance(wanted) <= near).then_some(*nearest)
    };
    let pairs: Vec<usize> = points.iter().map(pair).collect::<Option<_>>()?;
    (0..pairs.len()).all(|index| pairs[pairs[index]] == index).then_some(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{indices, reference, vectors};

    #[test]
    fn the_mirror_is_the_references() {
        let golden = reference("symmetry");
        let points = vectors(&golden["points"]);
        let pair = indices(&golden["pair"]);
        for (index, expected) in vectors(&golden["mirrored"]).into_iter().enumerate() {
            assert!(image(points[pair[index]]).distance(expected) < 1e-15);
        }
    }

    #[test]
    fn pairs_are_found_and_what_has_none_is_not_symmetric() {
        let mut points = vec![DVec3::new(0.1, 1.0, 0.0), DVec3::new(0.0, 1.0, 0.2), DVec3::new(-0.1, 1.0, 0.0004)];
        assert_eq!(pairs(&points, NEAR).unwrap(), [2, 1, 0]);
        points[2].z = 0.01;
        assert_eq!(pairs(&points, NEAR), None);
    }
}
