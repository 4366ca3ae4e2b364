//! Where a captured surface puts a pose: turns of joints and the translation for which an avatar's surface lies on it.
//!
//! At a captured point with root x_c under the pose's warp d, r = f(x_c) / |g| is how far the avatar's surface is from it, to first order,
//! with g = J^-T grad f, the deformed gradient. Gauss and Newton's method makes the sum of rho(r) least,
//! r(delta) = r - g / |g| . d(d(x_c)) / d(delta), held to the pose that was registered. J joints, N points; metres, radians.

use glam::{DVec3, Mat3, Vec3};
use xavatar_deformer::Jacobian;
use xavatar_register::linear::{Basis, Besides, Extents, FramePose, Linkage, NormalEquations, Row, Unknowns, so3};

use super::skinning::image;
use super::{FieldPose, Fields, PosedField, Poser};
use crate::Result;
use crate::body::{BodyModel, Pose, Role};

/// Gauss-Newton steps; a fourth would move no joint by a tenth of a degree.
const STEPS: usize = 3;
/// Distance at which a point counts a quarter, metres; and from which it counts nothing.
const SCALE: f64 = 0.006;
const FARTHEST: f64 = 0.03;
/// Standard deviation of an avatar's surface, metres, and how many of a frame's points are independent of each other.
const SURFACE: f64 = 0.003;
const INDEPENDENT: f64 = 300.0;
/// Standard deviations of what registrations are wrong by: radians, metres.
const TURN: f64 = 0.03;
const SHIFT: f64 = 0.01;

/// Points of a captured surface.
#[derive(Clone, Debug, Default)]
pub struct CapturedPoints {
    /// In the world, metres (N).
    pub points: Vec<Vec3>,
    /// Their parts' labels (N).
    pub labels: Vec<u8>,
}

/// A pose that was fitted, and how far the captured surface is from the avatar's.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedPose {
    /// The pose.
    pub pose: Pose,
    /// Median distance before, metres.
    pub before: f64,
    /// And after.
    pub after: f64,
}

/// Fits poses of a body.
#[derive(Debug)]
pub struct PoseFit<'a> {
    body: &'a BodyModel,
    linkage: Linkage,
    unknowns: Unknowns,
}

/// The rows of one step.
struct Linearised {
    equations: NormalEquations,
    /// Median distance of the points from the avatar's surface.
    median: f64,
}

impl<'a> PoseFit<'a> {
    /// Of a body, of which only joints of some roles turn.
    pub fn new(body: &'a BodyModel, turns: impl Fn(Role) -> bool) -> Self {
        let skeleton = body.skeleton();
        let parts = skeleton.parts_of_joints();
        let joints: Vec<usize> = (0..parts.len()).filter(|joint| turns(skeleton.role(parts[*joint]))).collect();
        let linkage = Linkage::of(body);
        let unknowns = Unknowns::new(linkage.extents(), &joints, Besides { translation: true, ..Besides::default() });
        Self { body, linkage, unknowns }
    }

    /// How many joints and coefficients a pose has.
    pub fn extents(&self) -> Extents {
        self.linkage.extents()
    }

    /// The pose of a captured surface, from `start` on and held to `registered`.
    ///
    /// # Errors
    /// If a pose does not fit the body; those of the search.
    pub fn fit(
        &self,
        (poser, fields): (&Poser, &Fields<f32>),
        captured: &CapturedPoints,
        registered: &Pose,
        start: &Pose,
    ) -> Result<FittedPose> {
        let extents = self.linkage.extents();
        let mut shape: Vec<f64> = start.shape.iter().map(|value| f64::from(*value)).collect();
        shape.resize(extents.shapes, 0.0);
        let registered = FramePose::of(registered, extents);
        let mut pose = FramePose::of(start, extents);
        let mut linearised = self.linearised((poser, fields), captured, &pose, &shape)?;
        let before = linearised.median;
        for _ in 0..STEPS {
            let Linearised { mut equations, .. } = linearised;
            self.hold(&registered, &pose, &mut equations);
            let Some(factor) = equations.matrix.cholesky() else { break };
            pose = pose.moved(extents, &self.unknowns.spread(factor.solve(&-equations.gradient).as_slice()));
            linearised = self.linearised((poser, fields), captured, &pose, &shape)?;
        }
        let pose = Pose { shape: start.shape.clone(), expression: start.expression.clone(), ..pose.pose(&shape) };
        Ok(FittedPose { pose, before, after: linearised.median })
    }

    /// The rows of the points about a pose.
    fn linearised(
        &self,
        (poser, fields): (&Poser, &Fields<f32>),
        captured: &CapturedPoints,
        pose: &FramePose,
        shape: &[f64],
    ) -> Result<Linearised> {
        let Self { body, linkage, unknowns } = self;
        let body_pose = pose.pose(shape);
        let points: Vec<[f32; 3]> =
            captured.points.iter().map(|point| (*point - body_pose.translation).to_array()).collect();
        let field_pose = FieldPose::new(body, &body_pose)?;
        let posed = poser.pose(fields, &field_pose, &field_pose.condition)?;
        let found = posed.correspondences(&points, &captured.labels)?;
        let (roots, targets): (Vec<[f32; 3]>, Vec<Vec3>) = found
            .into_iter()
            .zip(&points)
            .filter_map(|(found, point)| Some((found?.canonical, Vec3::from_array(*point))))
            .unzip();
        let distances = distances(&posed, &roots, &targets);

        let chain = linkage.posed(pose, shape);
        let basis = Basis { linkage, chain: &chain, unknowns };
        let bones = &field_pose.bones;
        let weights = posed.evaluator.weights(&roots);
        let mut equations = NormalEquations::new(unknowns.count());
        let mut row = Row::default();
        let mut pulls = Vec::with_capacity(bones.len());
        let share = INDEPENDENT / (roots.len().max(1) as f64 * SURFACE * SURFACE);
        for ((root, weights), (distance, normal)) in roots.iter().zip(weights.chunks_exact(bones.len())).zip(&distances)
        {
            if distance.abs() > FARTHEST {
                continue;
            }
            pulls.clear();
            pulls.extend(bones.iter().zip(weights).map(|(bone, weight)| {
                let weight = f64::from(*weight);
                (image(bone, *root).as_dvec3() * weight, weight)
            }));
            basis.skinned_row(&mut pulls, *normal, &mut row);
            equations.add(&row, -distance, share * (1.0 + (distance / SCALE).powi(2)).powi(-2));
        }
        Ok(Linearised { equations, median: median(distances.iter().map(|(distance, _)| distance.abs()).collect()) })
    }

    /// Holds a pose to the registered one.
    fn hold(&self, registered: &FramePose, pose: &FramePose, equations: &mut NormalEquations) {
        let extents = self.linkage.extents();
        let turned = registered.rotations.iter().zip(&pose.rotations);
        let turns = turned.flat_map(|(from, to)| so3::log(&(from.transpose() * *to)).to_array());
        let shift = (pose.translation - registered.translation).to_array();
        let residuals = turns.map(|turn| (turn, TURN)).chain(shift.map(|shift| (shift, SHIFT)));
        let columns = (0..3 * extents.joints).chain(extents.translation());
        for (column, (residual, deviation)) in columns.zip(residuals) {
            equations.add_single(self.unknowns.place(column), residual, deviation.powi(-2));
        }
    }
}

/// Of roots (N) of `targets` (N): how far the avatar's surface is from the target, to first order, metres, and the unit vector along which the
/// field grows there.
fn distances(posed: &PosedField, roots: &[[f32; 3]], targets: &[Vec3]) -> Vec<(f64, DVec3)> {
    let (roots, jacobians) = posed.warp.refined(roots, targets);
    let (values, gradients) = posed.evaluator.values_and_gradients(&roots);
    let distance = |((value, gradient), jacobian): ((&f32, &[f32; 3]), &Jacobian<f32>)| {
        let deformed = (Mat3::from_cols_array_2d(jacobian).inverse() * Vec3::from_array(*gradient)).as_dvec3();
        let length = deformed.length();
        if length > 0.0 && length.is_finite() {
            (f64::from(*value) / length, deformed / length)
        } else {
            (f64::INFINITY, DVec3::ZERO)
        }
    };
    values.iter().zip(&gradients).zip(&jacobians).map(distance).collect()
}

/// The middle one; of none, 0.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}
