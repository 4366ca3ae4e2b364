//! Joints that turn about fixed axes: hinges, double hinges, and limits of their angles (Osman 4.4; METHOD-BODY sections 2 and 9.2).
//!
//! A pose is P numbers: three of a free joint, one of a hinge R(a, t), two of a double hinge R(a1, t1) R(a2, t2). The correctives' feature of a
//! joint is q(R) - (0, 0, 0, 1). SUPR's released code turns hinges by -t while their features are of +t, and takes (q2 - 1)(q1 - 1) for a
//! double hinge; its correctives were trained so. B frames, J joints; radians, quaternions x y z w.

use xavatar_formats::{Array, ArrayMap, Error, Result};
use xavatar_vector::Scalar;

use super::chain::Chain;
use super::rotation::{
    Matrix3, dot, matrix_product, product_transposed, quaternion, quaternion_pullback, rotation_matrix,
    rotation_pullback, transposed_product,
};
use super::{FrameCotangents, PoseBatch, PosedBatch, add, require_length};
use crate::{BodyModel, Correctives};

/// How a joint may turn, and which numbers of the pose turn it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointFreedom {
    /// Axis-angle.
    Free([usize; 3]),
    /// An angle about a unit axis.
    Hinge(usize, [f64; 3]),
    /// Two angles about two unit axes; the second turns first.
    DoubleHinge([usize; 2], [[f64; 3]; 2]),
}

/// Which way a positive angle turns, and what drives the correctives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HingeConvention {
    /// As SUPR's released code has it, for its files.
    Released,
    /// Right-handed, with the features of the rotation itself.
    RightHanded,
}

/// How the joints of a skeleton may turn.
#[derive(Clone, Debug, PartialEq)]
pub struct JointConstraints {
    joints: Vec<JointFreedom>,
    convention: HingeConvention,
    numbers: usize,
}

/// The poses of B frames in the numbers of constraints; also their cotangents.
#[derive(Clone, Debug, PartialEq)]
pub struct ConstrainedBatch<T> {
    /// (B, P), radians.
    pub numbers: Vec<T>,
    /// Shape, then expression coefficients (B, K).
    pub coefficients: Vec<T>,
    /// (B), metres.
    pub translations: Vec<[T; 3]>,
}

impl JointConstraints {
    /// The constraints of a skeleton's joints (J), in their order.
    ///
    /// # Errors
    /// [`Error::Value`] if the numbers are not 0 to P - 1, each of one joint, or an axis is not of unit length.
    pub fn new(joints: Vec<JointFreedom>, convention: HingeConvention) -> Result<Self> {
        let mut numbers: Vec<usize> = joints.iter().flat_map(JointFreedom::numbers).copied().collect();
        numbers.sort_unstable();
        let wrong = |name: &str, found: String, expected: &str| {
            Err(Error::Value { name: name.into(), found, expected: expected.into() })
        };
        if !numbers.iter().copied().eq(0..numbers.len()) {
            return wrong("the numbers of constrained joints", format!("{numbers:?}"), "each number of the pose once");
        }
        if let Some(axis) =
            joints.iter().flat_map(JointFreedom::axes).find(|axis| (dot(**axis, **axis) - 1.0).abs() > 1e-3)
        {
            return wrong("a hinge's axis", format!("{axis:?}"), "of unit length");
        }
        Ok(Self { numbers: numbers.len(), joints, convention })
    }

    /// The constraints in a SUPR file's `axis_meta`, in its released convention; none if it has none.
    ///
    /// # Errors
    /// [`Error::Value`] for lists that do not say how each joint turns.
    pub fn of_supr(arrays: &ArrayMap) -> Result<Option<Self>> {
        let array = |name: &str| arrays.get(&format!("axis_meta.{name}"));
        if array("reverse_indx").is_none() {
            return Ok(None);
        }
        let broken = |name: &str| Error::Value {
            name: format!("axis_meta.{name}"),
            found: array(name).map_or_else(|| "absent".into(), Array::description),
            expected: "the lists of a constrained SUPR".into(),
        };
        // A kind of joint that a model lacks is an empty list.
        let list = |name: &str| -> Result<Vec<usize>> {
            let Some(found) = array(name) else { return Ok(Vec::new()) };
            let indices = found.to_indices(u16::MAX.into()).ok_or_else(|| broken(name))?;
            Ok(indices.into_iter().map(|index| index as usize).collect())
        };
        let axes = array("axis").and_then(Array::to_f64).ok_or_else(|| broken("axis"))?;
        let order = list("axis_indx")?;
        let axis = |place: usize| -> Option<[f64; 3]> { axes.as_chunks::<3>().0.get(*order.get(place)?).copied() };
        let pairs = |numbers: &str, axes: &str| -> Result<Vec<(usize, [f64; 3])>> {
            let (places, of) = (list(numbers)?, list(axes)?);
            let found = places.iter().zip(&of).map(|(number, place)| Some((*number, axis(*place)?)));
            found.collect::<Option<Vec<_>>>().filter(|found| found.len() == places.len()).ok_or_else(|| broken(axes))
        };
        let hinges = pairs("indx_hinge", "indx_hinge_axis")?;
        let firsts = pairs("indx_double_hinge1", "indx_double_hinge1_axis")?;
        let seconds = pairs("indx_double_hinge2", "indx_double_hinge2_axis")?;
        let free = list("indx_spherical")?
            .as_chunks::<3>()
            .0
            .iter()
            .map(|numbers| JointFreedom::Free(*numbers))
            .collect::<Vec<_>>();
        let hinges = hinges.into_iter().map(|(number, axis)| JointFreedom::Hinge(number, axis));
        let doubles = firsts
            .into_iter()
            .zip(seconds)
            .map(|(first, second)| JointFreedom::DoubleHinge([first.0, second.0], [first.1, second.1]));
        let kinds: Vec<JointFreedom> = free.into_iter().chain(hinges).chain(doubles).collect();
        let joints =
            list("reverse_indx")?.into_iter().map(|place| kinds.get(place).copied()).collect::<Option<Vec<_>>>();
        Self::new(joints.ok_or_else(|| broken("reverse_indx"))?, HingeConvention::Released).map(Some)
    }

    /// P.
    pub fn numbers(&self) -> usize {
        self.numbers
    }

    /// How each joint may turn (J).
    pub fn joints(&self) -> &[JointFreedom] {
        &self.joints
    }

    /// The same joints in another convention.
    #[must_use]
    pub fn in_convention(&self, convention: HingeConvention) -> Self {
        Self { convention, ..self.clone() }
    }

    /// The sign by which an angle turns about its axis.
    fn sign<T: Scalar>(&self) -> T {
        match self.convention {
            HingeConvention::Released => -T::one(),
            HingeConvention::RightHanded => T::one(),
        }
    }

    /// The matrix of each joint and its feature (J), of a frame's numbers (P).
    fn turned<T: Scalar>(&self, numbers: &[T]) -> (Vec<Matrix3<T>>, Vec<[T; 4]>) {
        let sign = self.sign::<T>();
        let joint = |freedom: &JointFreedom| match freedom {
            JointFreedom::Free(places) => {
                let r = places.map(|place| numbers[place]);
                (rotation_matrix(r), less_rest(quaternion(r)))
            }
            JointFreedom::Hinge(place, axis) => {
                let r = scaled(axis, numbers[*place]);
                (rotation_matrix(r.map(|value| sign * value)), less_rest(quaternion(r)))
            }
            JointFreedom::DoubleHinge(places, axes) => {
                let [first, second] = [0, 1].map(|at| scaled(&axes[at], numbers[places[at]]));
                let [a, b] = [first, second].map(|r| rotation_matrix(r.map(|value| sign * value)));
                (matrix_product(&a, &b), self.double_feature(quaternion(first), quaternion(second)))
            }
        };
        self.joints.iter().map(joint).unzip()
    }

    fn double_feature<T: Scalar>(&self, first: [T; 4], second: [T; 4]) -> [T; 4] {
        match self.convention {
            HingeConvention::Released => quaternion_product(less_rest(second), less_rest(first)),
            HingeConvention::RightHanded => less_rest(quaternion_product(first, second)),
        }
    }

    /// The cotangents of a frame's numbers (P), given those of its joints' matrices and features (J).
    fn pullback<T: Scalar>(&self, numbers: &[T], rotations: &[Matrix3<T>], features: &[[T; 4]]) -> Vec<T> {
        let sign = self.sign::<T>();
        let mut cotangent = vec![T::zero(); numbers.len()];
        // Of an angle about an axis: by its matrix, and by its quaternion.
        let of_angle = |axis: &[f64; 3], angle: T, matrix: &Matrix3<T>, of_quaternion: [T; 4]| {
            let r = scaled(axis, angle);
            let turned = r.map(|value| sign * value);
            let by_matrix = rotation_pullback(turned, &rotation_matrix(turned), matrix);
            let by_quaternion = quaternion_pullback(r, of_quaternion);
            let axis = axis.map(T::of);
            sign * dot(axis, by_matrix) + dot(axis, by_quaternion)
        };
        for ((freedom, of_matrix), of_feature) in self.joints.iter().zip(rotations).zip(features) {
            match freedom {
                JointFreedom::Free(places) => {
                    let r = places.map(|place| numbers[place]);
                    let by_matrix = rotation_pullback(r, &rotation_matrix(r), of_matrix);
                    let by_quaternion = quaternion_pullback(r, *of_feature);
                    (0..3).for_each(|axis| cotangent[places[axis]] += by_matrix[axis] + by_quaternion[axis]);
                }
                JointFreedom::Hinge(place, axis) => {
                    cotangent[*place] += of_angle(axis, numbers[*place], of_matrix, *of_feature);
                }
                JointFreedom::DoubleHinge(places, axes) => {
                    let turns = [0, 1].map(|at| scaled(&axes[at], numbers[places[at]]));
                    let [a, b] = turns.map(|r| rotation_matrix(r.map(|value| sign * value)));
                    let of_matrices = [product_transposed(of_matrix, &b), transposed_product(&a, of_matrix)];
                    let of_quaternions = self.double_feature_pullback(turns.map(quaternion), *of_feature);
                    for at in 0..2 {
                        let angle = numbers[places[at]];
                        cotangent[places[at]] += of_angle(&axes[at], angle, &of_matrices[at], of_quaternions[at]);
                    }
                }
            }
        }
        cotangent
    }

    /// The cotangents of the first and the second quaternion. Of a product p q they are d q* and p* d.
    fn double_feature_pullback<T: Scalar>(&self, [first, second]: [[T; 4]; 2], d: [T; 4]) -> [[T; 4]; 2] {
        match self.convention {
            HingeConvention::Released => {
                let (p, q) = (less_rest(second), less_rest(first));
                [quaternion_product(conjugate(p), d), quaternion_product(d, conjugate(q))]
            }
            HingeConvention::RightHanded => {
                [quaternion_product(d, conjugate(second)), quaternion_product(conjugate(first), d)]
            }
        }
    }
}

impl JointFreedom {
    fn numbers(&self) -> &[usize] {
        match self {
            Self::Free(numbers) => numbers,
            Self::Hinge(number, _) => std::slice::from_ref(number),
            Self::DoubleHinge(numbers, _) => numbers,
        }
    }

    fn axes(&self) -> &[[f64; 3]] {
        match self {
            Self::Free(_) => &[],
            Self::Hinge(_, axis) => std::slice::from_ref(axis),
            Self::DoubleHinge(_, axes) => axes,
        }
    }
}

impl BodyModel {
    /// The bodies of a batch of constrained poses.
    ///
    /// # Errors
    /// [`Error::Value`] if constraints or batch do not fit the model.
    pub fn pose_constrained<T: Scalar>(
        &self,
        constraints: &JointConstraints,
        batch: &ConstrainedBatch<T>,
    ) -> Result<PosedBatch<T>> {
        let plain = batch.plain(self, constraints)?;
        let chain = |(frame, numbers): (usize, &[T])| {
            let (rotations, quaternions) = constraints.turned(numbers);
            let coefficients = plain.frame_coefficients(frame);
            let features = features(&self.anatomy.correctives, &rotations, &quaternions, coefficients);
            Chain::turned(self, rotations, features, coefficients)
        };
        let frames = batch.numbers.chunks_exact(constraints.numbers.max(1)).enumerate();
        Ok(self.posed(frames.map(chain).collect(), &plain))
    }
}

impl<T: Scalar> PosedBatch<T> {
    /// As [`pullback`](Self::pullback), of bodies of constrained poses.
    ///
    /// # Errors
    /// [`Error::Value`] if an array has another length.
    pub fn pullback_constrained(
        &self,
        model: &BodyModel,
        constraints: &JointConstraints,
        batch: &ConstrainedBatch<T>,
        vertices: &[[T; 3]],
        joints: &[[T; 3]],
    ) -> Result<ConstrainedBatch<T>> {
        let plain = batch.plain(model, constraints)?;
        let frames = self.frame_cotangents(model, &plain, vertices, joints)?;
        let mut cotangent =
            ConstrainedBatch { numbers: Vec::new(), coefficients: Vec::new(), translations: Vec::new() };
        for (of, numbers) in frames.into_iter().zip(batch.numbers.chunks_exact(constraints.numbers.max(1))) {
            let FrameCotangents { mut rotations, features, coefficients, translation } = of;
            let quaternions = feature_cotangents(&model.anatomy.correctives, &features, &mut rotations);
            cotangent.numbers.extend(constraints.pullback(numbers, &rotations, &quaternions));
            cotangent.coefficients.extend(coefficients);
            cotangent.translations.push(translation);
        }
        Ok(cotangent)
    }
}

impl<T: Scalar> ConstrainedBatch<T> {
    /// The batch as its surface sees it: without rotations.
    fn plain(&self, model: &BodyModel, constraints: &JointConstraints) -> Result<PoseBatch<T>> {
        let (joints, frames) = (model.skeleton().joints.len(), self.translations.len());
        require_length("constrained joints", constraints.joints.len(), joints)?;
        require_length("numbers of constrained poses", self.numbers.len(), frames * constraints.numbers)?;
        let plain = PoseBatch {
            rotations: vec![[T::zero(); 3]; frames * joints],
            coefficients: self.coefficients.clone(),
            translations: self.translations.clone(),
        };
        plain.check(model)?;
        Ok(plain)
    }
}

/// Limits of angles: theta = (high - low) / 2 tanh x + (high + low) / 2 keeps within them whatever x is.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Of each number, radians.
    pub low: Vec<f64>,
    /// Of each number, radians.
    pub high: Vec<f64>,
}

impl Limits {
    /// The angles of x, any number of frames of as many numbers as there are limits.
    pub fn angles<T: Scalar>(&self, x: &[T]) -> Vec<T> {
        self.spans(x).map(|(half, middle, x)| half * x.tanh() + middle).collect()
    }

    /// The cotangents of x, given those of the angles.
    pub fn pullback<T: Scalar>(&self, x: &[T], angles: &[T]) -> Vec<T> {
        let slope = |(half, _, x): (T, T, T)| half * (T::one() - x.tanh() * x.tanh());
        self.spans(x).map(slope).zip(angles).map(|(slope, angle)| slope * *angle).collect()
    }

    fn spans<T: Scalar>(&self, x: &[T]) -> impl Iterator<Item = (T, T, T)> {
        let limits = self.low.iter().zip(&self.high).cycle();
        limits.zip(x).map(|((low, high), x)| (T::of((high - low) / 2.0), T::of((high + low) / 2.0), *x))
    }
}

/// What drives correctives (F).
fn features<T: Scalar>(
    correctives: &Correctives,
    rotations: &[Matrix3<T>],
    quaternions: &[[T; 4]],
    coefficients: &[T],
) -> Vec<T> {
    match correctives {
        Correctives::Quaternions { first_joint, coefficient, .. } => {
            let of_joints = quaternions.iter().skip(*first_joint).flatten().copied();
            of_joints.chain(coefficient.map(|index| coefficients[index])).collect()
        }
        // Those have no use for axis-angles.
        _ => super::features(correctives, &[], rotations, coefficients),
    }
}

/// The cotangents of the joints' quaternions (J), given those of the features (F); those of entries go to the matrices (J).
fn feature_cotangents<T: Scalar>(
    correctives: &Correctives,
    features: &[T],
    rotations: &mut [Matrix3<T>],
) -> Vec<[T; 4]> {
    let mut quaternions = vec![[T::zero(); 4]; rotations.len()];
    match correctives {
        Correctives::None => {}
        Correctives::RotationEntries(_) => {
            let blocks = features.as_chunks::<9>().0;
            rotations.iter_mut().skip(1).zip(blocks).for_each(|(sum, block)| add(sum, block));
        }
        Correctives::Quaternions { first_joint, .. } => {
            let blocks = features.as_chunks::<4>().0;
            quaternions.iter_mut().skip(*first_joint).zip(blocks).for_each(|(sum, block)| *sum = *block);
        }
    }
    quaternions
}

fn scaled<T: Scalar>(axis: &[f64; 3], angle: T) -> [T; 3] {
    axis.map(|component| T::of(component) * angle)
}

/// q - (0, 0, 0, 1).
fn less_rest<T: Scalar>([x, y, z, w]: [T; 4]) -> [T; 4] {
    [x, y, z, w - T::one()]
}

fn conjugate<T: Scalar>([x, y, z, w]: [T; 4]) -> [T; 4] {
    [-x, -y, -z, w]
}

/// Hamilton's product p q.
fn quaternion_product<T: Scalar>(p: [T; 4], q: [T; 4]) -> [T; 4] {
    let ([a, b, c, w], [d, e, f, v]) = (p, q);
    [
        w * d + v * a + b * f - c * e,
        w * e + v * b + c * d - a * f,
        w * f + v * c + a * e - b * d,
        w * v - a * d - b * e - c * f,
    ]
}
