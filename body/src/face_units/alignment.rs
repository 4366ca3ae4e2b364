//! A face laid over a body's: x' = scale x + shift, by axis. From the joints of the head first, then from the face's closest points on the body in turn
//! (iterated closest points; by axis, since heads at rest look the same way).

use glam::DVec3;
use xavatar_formats::Result;

use super::{FaceUnits, headless, normals};
use crate::{BodyModel, SurfaceMap};

/// The joints that the first guess is made of, as far as a body has them.
const JOINTS: [&str; 5] = ["neck", "head", "jaw", "left_eye", "right_eye"];
/// Rounds of closest points.
const ROUNDS: usize = 15;
/// Pairs that are further apart tell nothing, metres.
const FARTHEST: f64 = 0.03;

/// The map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Alignment {
    pub(super) scale: DVec3,
    shift: DVec3,
}

impl Alignment {
    /// Lays the vertices `face` of a mesh over a body's template.
    pub(super) fn of(units: &FaceUnits, face: &[usize], body: &BodyModel) -> Result<Self> {
        let mut alignment = Self::of_joints(units, body)?;
        let source: Vec<DVec3> = face.iter().map(|vertex| units.vertices[*vertex]).collect();
        let single: Vec<_> = units.vertices.iter().map(|vertex| vertex.as_vec3()).collect();
        let all = normals(&single, &units.faces);
        let directions: Vec<DVec3> = face.iter().map(|vertex| all[*vertex]).collect();
        let template: Vec<DVec3> = body.template().iter().map(|vertex| vertex.as_dvec3()).collect();
        for _ in 0..ROUNDS {
            let laid: Vec<DVec3> = source.iter().map(|point| alignment.apply(*point)).collect();
            let found = SurfaceMap::new(&laid, &template, body.faces(), Some(&directions))?.points(&template);
            let pairs =
                source.iter().zip(&laid).zip(&found).filter(|((_, laid), found)| laid.distance(**found) < FARTHEST);
            let pairs: Vec<(DVec3, DVec3)> = pairs.map(|((source, _), found)| (*source, *found)).collect();
            alignment = Self::of_pairs(&pairs).unwrap_or(alignment);
        }
        Ok(alignment)
    }

    pub(super) fn apply(&self, point: DVec3) -> DVec3 {
        self.scale * point + self.shift
    }

    /// One scale for all axes.
    fn of_joints(units: &FaceUnits, body: &BodyModel) -> Result<Self> {
        let rest = &body.anatomy().joints.template;
        let pair = |name: &&str| {
            let own = units.joints.iter().find(|(joint, _)| joint == name)?.1;
            Some((own, rest[body.skeleton().joint(name)?]))
        };
        let pairs: Vec<(DVec3, DVec3)> = JOINTS.iter().filter_map(pair).collect();
        let (from, to) = means(&pairs);
        let spread = pairs.iter().fold((0.0, 0.0), |(one, other), pair| {
            (one + pair.0.distance_squared(from), other + pair.1.distance_squared(to))
        });
        if pairs.len() < 2 || spread.0 <= 0.0 || spread.1 <= 0.0 {
            return Err(headless(body));
        }
        let scale = DVec3::splat((spread.1 / spread.0).sqrt());
        Ok(Self { scale, shift: to - scale * from })
    }

    /// By axis, the line through the pairs; none if they are too few.
    fn of_pairs(pairs: &[(DVec3, DVec3)]) -> Option<Self> {
        let (from, to) = means(pairs);
        let products = |(sum, squares): (DVec3, DVec3), (source, found): &(DVec3, DVec3)| {
            (sum + (*source - from) * (*found - to), squares + (*source - from) * (*source - from))
        };
        let (sum, squares) = pairs.iter().fold((DVec3::ZERO, DVec3::ZERO), products);
        let scale = sum / squares;
        (pairs.len() > 3 && scale.is_finite() && scale.min_element() > 0.0)
            .then(|| Self { scale, shift: to - scale * from })
    }
}

fn means(pairs: &[(DVec3, DVec3)]) -> (DVec3, DVec3) {
    let count = pairs.len().max(1) as f64;
    (pairs.iter().map(|pair| pair.0).sum::<DVec3>() / count, pairs.iter().map(|pair| pair.1).sum::<DVec3>() / count)
}
