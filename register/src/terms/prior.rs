//! What is known before anything is seen: how far joints turn, and that shape and expression are near the mean.
//!
//! ((log R - mean) / sigma)^2 of every joint but the root; beyond its limits (thesis tables A.1-A.3) a component costs (excess / 0.05 rad)^2 more.
//! Derivatives go through Jr^-1(log R). Radians.

use glam::DVec3;
use xavatar_body::BodyModel;

use crate::linear::{FramePose, NormalEquations, Row, Unknowns, so3};

/// Excess over a limit that costs 1, radians.
const LIMIT: f64 = 0.05;

/// What is known of one joint's turn.
#[derive(Clone, Debug)]
struct Joint {
    mean: DVec3,
    sigma: DVec3,
    /// Lowest and highest of each component.
    limits: [Option<[f64; 2]>; 3],
}

/// What is known of a skeleton's turns.
#[derive(Clone, Debug)]
pub struct PosePrior {
    joints: Vec<Joint>,
}

impl PosePrior {
    /// Of a body's skeleton, by the names of its joints.
    pub fn of(model: &BodyModel) -> Self {
        let means = mean_turns(model);
        let joint = |(name, mean): (&String, DVec3)| Joint { mean, sigma: sigma(name), limits: limits(name) };
        Self { joints: model.skeleton().joints.iter().zip(means).map(joint).collect() }
    }

    /// The mean turn of each joint (J): fingers are relaxed, all else is at rest.
    pub fn means(&self) -> impl Iterator<Item = (usize, DVec3)> + '_ {
        self.joints.iter().map(|joint| joint.mean).enumerate()
    }

    /// The mean turn of one joint.
    pub fn mean(&self, joint: usize) -> DVec3 {
        self.joints[joint].mean
    }

    /// The components of a pose that are beyond their limits: joint, axis, and by how much.
    pub fn beyond_limits(&self, pose: &FramePose) -> Vec<(usize, usize, f64)> {
        let turns = pose.rotations.iter().map(so3::log).enumerate().skip(1);
        let of_joint = |(joint, turn): (usize, DVec3)| {
            let limits = self.joints[joint].limits.into_iter().enumerate();
            limits
                .filter_map(move |(axis, limits)| Some((joint, axis, excess(turn[axis], limits?))))
                .filter(|(_, _, excess)| *excess != 0.0)
        };
        turns.flat_map(of_joint).collect()
    }

    /// Adds the term to a frame's equations.
    pub fn add(&self, pose: &FramePose, unknowns: &Unknowns, equations: &mut NormalEquations) {
        let extents = unknowns.extents();
        let mut row = Row::default();
        for (index, (joint, rotation)) in self.joints.iter().zip(&pose.rotations).enumerate().skip(1) {
            if unknowns.place(extents.turn(index)).is_none() {
                continue;
            }
            let turn = so3::log(rotation);
            let slope = so3::right_jacobian_inverse(turn);
            for axis in 0..3 {
                row.clear();
                for column in 0..3 {
                    row.push(unknowns, extents.turn(index) + column, slope.col(column)[axis]);
                }
                equations.add(&row, turn[axis] - joint.mean[axis], 1.0 / joint.sigma[axis].powi(2));
                if let Some(excess) = joint.limits[axis].map(|limits| excess(turn[axis], limits)).filter(|e| *e != 0.0)
                {
                    equations.add(&row, excess, 1.0 / LIMIT.powi(2));
                }
            }
        }
    }
}

/// Adds that expressions are near zero.
pub fn add_expression(pose: &FramePose, weight: f64, unknowns: &Unknowns, equations: &mut NormalEquations) {
    let columns = unknowns.extents().expression();
    for (column, value) in columns.zip(&pose.expression) {
        equations.add_single(unknowns.place(column), *value, weight);
    }
}

fn excess(turn: f64, [lowest, highest]: [f64; 2]) -> f64 {
    (turn - lowest).min(0.0) + (turn - highest).max(0.0)
}

/// Fingers as in the model's relaxed hands.
fn mean_turns(model: &BodyModel) -> Vec<DVec3> {
    let joints = &model.skeleton().joints;
    let fingers = joints.iter().enumerate().filter(|(_, name)| finger(name).is_some()).map(|(joint, _)| joint);
    let relaxed = model.hands().iter().flat_map(|hand| hand.mean.as_chunks::<3>().0);
    let mut means = vec![DVec3::ZERO; joints.len()];
    fingers.zip(relaxed).for_each(|(joint, turn)| means[joint] = DVec3::from_array(turn.map(f64::from)));
    means
}

/// The finger, which of its joints from the palm on, and the sign of the side (right is mirrored).
fn finger(name: &str) -> Option<(&str, usize, f64)> {
    let (side, name) = match name.split_once('_') {
        Some(("right", rest)) => (-1.0, rest),
        Some(("left", rest)) => (1.0, rest),
        _ => (1.0, name),
    };
    let (finger, place) = name.split_at_checked(name.len().checked_sub(1)?)?;
    let known = ["index", "middle", "pinky", "ring", "thumb"].contains(&finger);
    Some((finger, place.parse().ok().filter(|place| known && (1..=3).contains(place))?, side))
}

/// How far a joint usually turns about each axis, radians.
fn sigma(name: &str) -> DVec3 {
    if let Some((finger, _, _)) = finger(name) {
        return if finger == "thumb" { DVec3::splat(0.35) } else { DVec3::new(0.15, 0.15, 0.6) };
    }
    let joint = name.strip_prefix("left_").or(name.strip_prefix("right_")).unwrap_or(name);
    match joint {
        "hip" => DVec3::splat(0.7),
        "spine1" | "spine2" | "spine3" => DVec3::splat(0.25),
        "knee" => DVec3::new(0.9, 0.12, 0.12),
        "ankle" => DVec3::new(0.35, 0.25, 0.15),
        "foot" => DVec3::splat(0.02),
        "collar" => DVec3::splat(0.2),
        "shoulder" => DVec3::splat(0.9),
        "elbow" => DVec3::new(0.5, 1.0, 0.5),
        "wrist" => DVec3::splat(0.4),
        "jaw" => DVec3::new(0.15, 0.01, 0.01),
        "eye" => DVec3::splat(0.001),
        _ => DVec3::splat(0.35),
    }
}

/// The limits of a joint's components (thesis tables A.1-A.3); y and z of right joints are mirrored.
fn limits(name: &str) -> [Option<[f64; 2]>; 3] {
    let mut degrees: [Option<[f64; 2]>; 3] = [None; 3];
    if let Some((finger, place, side)) = finger(name) {
        let is_thumb = finger == "thumb";
        degrees = match (finger, place) {
            ("thumb", 1) => [Some([-60.0, 180.0]), Some([-60.0, 120.0]), Some([-90.0, 60.0])],
            ("thumb", 2) => [Some([-60.0, 120.0]), Some([-60.0, 180.0]), Some([-90.0, 60.0])],
            ("thumb", _) => [Some([-60.0, 120.0]), Some([-20.0, 90.0]), Some([-90.0, 60.0])],
            ("pinky", _) => [Some([-60.0, 20.0]), None, Some([-90.0, 20.0])],
            _ => [Some([-15.0, 15.0]), None, Some([-90.0, 20.0])],
        };
        if !is_thumb {
            degrees[1] = Some(if place == 1 { [-20.0, 20.0] } else { [-10.0, 10.0] });
        }
        if side < 0.0 {
            degrees[1..].iter_mut().flatten().for_each(|[lowest, highest]| (*lowest, *highest) = (-*highest, -*lowest));
        }
    } else {
        match name {
            "left_knee" | "right_knee" => degrees[0] = Some([0.0, 180.0]),
            "left_collar" | "right_collar" | "left_shoulder" | "right_shoulder" => degrees[0] = Some([-60.0, 60.0]),
            "left_elbow" => degrees[..2].copy_from_slice(&[Some([-60.0, 60.0]), Some([-180.0, 0.0])]),
            "right_elbow" => degrees[..2].copy_from_slice(&[Some([-60.0, 60.0]), Some([0.0, 180.0])]),
            "left_wrist" | "right_wrist" => degrees[0] = Some([-90.0, 90.0]),
            // A closed mouth closes no further: else the head nods and the jaw makes up for it.
            "jaw" => degrees[0] = Some([0.0, 60.0]),
            _ => {}
        }
    }
    degrees.map(|limits| limits.map(|limits| limits.map(f64::to_radians)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::{Besides, Extents};
    use std::path::Path;
    use xavatar_formats::read_npz;

    // dE/dd of E = sum ((log(R exp d) - mean) / sigma)^2 + limits is 2 g.
    #[test]
    fn its_gradient_is_that_of_finite_differences() {
        const STEP: f64 = 1e-6;
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden/body/tiny_smplx.npz");
        let model = BodyModel::from_arrays(&path, &read_npz(&path).unwrap()).unwrap();
        let extents = Extents { joints: 55, shapes: 10, expressions: 10 };
        let prior = PosePrior::of(&model);
        let pose =
            FramePose::turned(extents, (0..55).map(|joint| (joint, DVec3::new(0.9, -0.7, 0.4) * (joint as f64).sin())));
        assert!(prior.beyond_limits(&pose).len() > 20);
        let joints: Vec<usize> = (1..55).collect();
        let unknowns = Unknowns::new(extents, &joints, Besides::default());
        let equations = |pose: &FramePose| {
            let mut equations = NormalEquations::new(unknowns.count());
            prior.add(pose, &unknowns, &mut equations);
            equations
        };
        let gradient = equations(&pose).gradient;
        for column in 3..165 {
            let cost = |by: f64| {
                let mut step = vec![0.0; extents.count()];
                step[column] = by;
                equations(&pose.moved(extents, &step)).cost
            };
            let numeric = (cost(STEP) - cost(-STEP)) / (2.0 * STEP);
            let found = 2.0 * gradient[column - 3];
            assert!((numeric - found).abs() < 1e-4 * numeric.abs().max(1e3), "column {column}: {numeric} {found}");
        }
    }

    #[test]
    fn elbows_bend_forwards_and_the_right_side_mirrors_the_left() {
        assert_eq!(limits("left_elbow")[1], Some([-180_f64.to_radians(), 0.0]));
        assert_eq!(limits("right_elbow")[1], Some([0.0, 180_f64.to_radians()]));
        assert_eq!(finger("right_index2"), Some(("index", 2, -1.0)));
        assert_eq!((finger("left_knee"), finger("thumb3")), (None, Some(("thumb", 3, 1.0))));
        let (left, right) = (limits("left_thumb3"), limits("right_thumb3"));
        assert_eq!((left[0], left[1].map(|[a, b]| [-b, -a])), (right[0], right[1]));
    }
}
