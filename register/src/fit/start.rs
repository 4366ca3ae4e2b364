//! A first guess from landmarks: the torso turned and moved onto hips, shoulders and neck (Kabsch 1976), arms hanging.

use glam::{DMat3, DVec3};
use nalgebra::Matrix3;

use crate::landmarks::{Seen, Site, Sites};
use crate::linear::{FramePose, Linkage};
use crate::terms::PosePrior;

/// How far arms hang down from the T-pose, radians.
const ARMS_DOWN: f64 = 1.0;
/// Joints whose distances no pose changes much.
const TORSO: [&str; 7] = ["pelvis", "left_hip", "right_hip", "neck", "left_shoulder", "right_shoulder", "spine3"];

/// A pose to start from, if enough was seen to say where the body is and which way it faces: of the torso, or else of all joints.
pub fn from_landmarks(linkage: &Linkage, sites: &Sites, prior: &PosePrior, seen: &[Seen]) -> Option<FramePose> {
    let of_joints = |only: &[&str]| -> Vec<(usize, DVec3, f64)> {
        let of_joint = |one: &Seen| {
            let site = sites.site(one.site);
            let Site::Joint(joint) = site.at else { return None };
            let is_wanted = one.confidence > 0.0 && (only.is_empty() || only.contains(&site.name.as_str()));
            is_wanted.then_some((joint, one.place, one.confidence * site.weight))
        };
        seen.iter().filter_map(of_joint).collect()
    };
    placed(linkage, sites, prior, &of_joints(&TORSO)).or_else(|| placed(linkage, sites, prior, &of_joints(&[])))
}

/// The body at rest but for its arms, turned and moved onto joints: number, place and weight of each.
fn placed(linkage: &Linkage, sites: &Sites, prior: &PosePrior, torso: &[(usize, DVec3, f64)]) -> Option<FramePose> {
    let total: f64 = torso.iter().map(|(_, _, weight)| weight).sum();
    let mean = |place: &dyn Fn(&(usize, DVec3, f64)) -> DVec3| {
        torso.iter().map(|one| place(one) * one.2).sum::<DVec3>() / total
    };
    let (of_body, of_scan) = (mean(&|one| linkage.rest()[one.0]), mean(&|one| one.1));
    let mut covariance = Matrix3::zeros();
    for (joint, place, weight) in torso {
        let (from, to) = (linkage.rest()[*joint] - of_body, *place - of_scan);
        covariance += Matrix3::from_fn(|row, column| from[row] * to[column]) * *weight;
    }
    let turn = nearest_rotation(covariance)?;
    let arm = |name: &str, sign: f64| {
        sites
            .named(name)
            .map(|_| name)
            .and_then(|name| joint_of(sites, name))
            .map(|joint| (joint, DVec3::Z * sign * ARMS_DOWN))
    };
    let arms = [arm("left_shoulder", -1.0), arm("right_shoulder", 1.0)];
    let mut pose = FramePose::turned(linkage.extents(), prior.means().chain(arms.into_iter().flatten()));
    pose.rotations[0] = turn;
    let chain = linkage.posed(&pose, &vec![0.0; linkage.extents().shapes]);
    pose.translation = of_scan - mean(&|one| chain.joint(one.0));
    pose.is_finite().then_some(pose)
}

fn joint_of(sites: &Sites, name: &str) -> Option<usize> {
    match sites.site(sites.named(name)?).at {
        Site::Joint(joint) => Some(joint),
        Site::Vertex(_) => None,
    }
}

/// The rotation that takes points nearest to others, both about their means; none if they lie on a line.
pub(super) fn rotation_between(pairs: &[(DVec3, DVec3)]) -> Option<DMat3> {
    let count = pairs.len().max(1) as f64;
    let [from, to] = [pairs.iter().map(|(from, _)| *from).sum::<DVec3>(), pairs.iter().map(|(_, to)| *to).sum()];
    let (from, to) = (from / count, to / count);
    let product = |(a, b): &(DVec3, DVec3)| {
        let (a, b) = (*a - from, *b - to);
        Matrix3::from_fn(|row, column| a[row] * b[column])
    };
    nearest_rotation(pairs.iter().map(product).sum())
}

/// The rotation R that makes tr(R H) largest; none if points lie on a line.
fn nearest_rotation(covariance: Matrix3<f64>) -> Option<DMat3> {
    let decomposed = covariance.svd(true, true);
    let (u, vt) = (decomposed.u?, decomposed.v_t?);
    let values = decomposed.singular_values;
    let second =
        values.iter().copied().fold([0.0, 0.0], |[a, b]: [f64; 2], v| if v > a { [v, a] } else { [a, b.max(v)] })[1];
    if second.is_nan() || second <= 1e-6 {
        return None;
    }
    let sign = (vt.transpose() * u.transpose()).determinant().signum();
    let weakest = values.imin();
    let mut flip = Matrix3::identity();
    flip[(weakest, weakest)] = sign;
    let rotation = vt.transpose() * flip * u.transpose();
    Some(DMat3::from_cols_slice(rotation.as_slice()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::so3;

    #[test]
    fn a_rotation_is_found_from_points_that_it_turned_even_in_a_plane() {
        let turn = so3::exp(DVec3::new(0.3, 2.0, -0.8));
        let points = [DVec3::new(0.1, 0.0, 0.0), DVec3::new(-0.1, 0.5, 0.0), DVec3::new(0.2, -0.3, 0.0)];
        let mut covariance = Matrix3::zeros();
        for point in points {
            let turned = turn * point;
            covariance += Matrix3::from_fn(|row, column| point[row] * turned[column]);
        }
        assert!((nearest_rotation(covariance).unwrap() - turn).to_cols_array().iter().all(|entry| entry.abs() < 1e-12));
        assert!(nearest_rotation(Matrix3::from_fn(|row, column| points[0][row] * points[0][column])).is_none());
    }
}
