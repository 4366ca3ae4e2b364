//! The tree-structured softmax: logits to skinning weights along a kinematic tree (METHOD section 2).
//!
//! Mass 1 enters at the root. A joint with children keeps 1 - sigma(gate) of its mass and sends the rest on; siblings
//! share it by softmax of their logits: w_j = m_j (1 - sigma_j), m_c = m_j sigma_j p_c; a leaf keeps all of its mass.
//! The gate of a joint with one child is that child's logit, of the root logit 0; every other branching joint has an
//! extra logit after the J joints', in joint order (SMPL-X: 55 + 4). Written once for any [`Scalar`]: sixteen rows at a
//! time for speed, and dual numbers of those for derivatives along a direction.

use std::ops::{Add, Mul, Sub};

use crate::{Error, Real, Result};

/// What the softmax computes with.
pub(crate) trait Scalar: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// The constant zero.
    fn zero() -> Self;
    /// The constant one.
    fn one() -> Self;
    /// exp(self), for self <= 0.
    fn exp_negative(self) -> Self;
    /// 1 / self.
    fn reciprocal(self) -> Self;
    /// The larger of the two, as a constant: shifting a softmax by it changes no derivative.
    fn constant_maximum(self, other: Self) -> Self;
}

/// Rows that are computed side by side.
pub(crate) const LANES: usize = 16;

/// Sixteen rows' values of one quantity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes<T>(pub [T; LANES]);

impl<T: Real> Lanes<T> {
    #[inline(always)]
    fn map(self, function: impl Fn(T) -> T) -> Self {
        // A loop, because `array::map` is not inlined and so would be compiled without the caller's vectors.
        let mut result = self.0;
        for value in &mut result {
            *value = function(*value);
        }
        Self(result)
    }

    #[inline(always)]
    fn zip(self, other: Self, function: impl Fn(T, T) -> T) -> Self {
        let mut result = self.0;
        for (value, other) in result.iter_mut().zip(other.0) {
            *value = function(*value, other);
        }
        Self(result)
    }
}

impl<T: Real> Add for Lanes<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl<T: Real> Sub for Lanes<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl<T: Real> Mul for Lanes<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl<T: Real> Scalar for Lanes<T> {
    #[inline(always)]
    fn zero() -> Self {
        Self([T::zero(); LANES])
    }
    #[inline(always)]
    fn one() -> Self {
        Self([T::one(); LANES])
    }
    #[inline(always)]
    fn exp_negative(self) -> Self {
        self.map(T::exp_negative)
    }
    #[inline(always)]
    fn reciprocal(self) -> Self {
        self.map(|value| T::one() / value)
    }
    #[inline(always)]
    fn constant_maximum(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
}

/// A value and its derivative along one direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dual<S> {
    pub value: S,
    pub along: S,
}

impl<S: Scalar> Add for Dual<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, along: self.along + other.along }
    }
}

impl<S: Scalar> Sub for Dual<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, along: self.along - other.along }
    }
}

impl<S: Scalar> Mul for Dual<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { value: self.value * other.value, along: self.along * other.value + self.value * other.along }
    }
}

impl<S: Scalar> Scalar for Dual<S> {
    #[inline(always)]
    fn zero() -> Self {
        Self { value: S::zero(), along: S::zero() }
    }
    #[inline(always)]
    fn one() -> Self {
        Self { value: S::one(), along: S::zero() }
    }
    #[inline(always)]
    fn exp_negative(self) -> Self {
        let value = self.value.exp_negative();
        Self { value, along: value * self.along }
    }
    #[inline(always)]
    fn reciprocal(self) -> Self {
        let value = self.value.reciprocal();
        Self { value, along: S::zero() - value * value * self.along }
    }
    #[inline(always)]
    fn constant_maximum(self, other: Self) -> Self {
        Self { value: self.value.constant_maximum(other.value), along: S::zero() }
    }
}

/// A joint that passes mass on.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Branch {
    joint: usize,
    gate: usize,
    children: Vec<usize>,
}

/// A kinematic tree: J joints, each after its parent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KinematicTree {
    parents: Vec<Option<usize>>,
    branches: Vec<Branch>,
    logits: usize,
}

/// The intermediate values of one softmax: masses, gates and shares of the J joints.
#[derive(Clone, Debug)]
pub(crate) struct Flow<S> {
    mass: Vec<S>,
    gate: Vec<S>,
    share: Vec<S>,
}

impl<S> Default for Flow<S> {
    fn default() -> Self {
        Self { mass: Vec::new(), gate: Vec::new(), share: Vec::new() }
    }
}

impl KinematicTree {
    /// A tree given by each joint's parent; joint 0 is the root.
    ///
    /// # Errors
    /// [`Error::Shape`] names the first joint whose parent does not precede it.
    pub fn new(parents: &[Option<usize>]) -> Result<Self> {
        for (joint, parent) in parents.iter().enumerate() {
            if (joint == 0) != parent.is_none() || parent.is_some_and(|parent| parent >= joint) {
                return Err(Error::Shape {
                    name: "parent of joint",
                    found: format!("{parent:?} for joint {joint}"),
                    expected: "a joint before it, and none for joint 0 alone".into(),
                });
            }
        }
        let mut children = vec![Vec::new(); parents.len()];
        for (joint, parent) in parents.iter().enumerate() {
            if let Some(parent) = parent {
                children[*parent].push(joint);
            }
        }
        let mut logits = parents.len();
        let mut branches = Vec::new();
        for (joint, children) in children.into_iter().enumerate() {
            let gate = match children.as_slice() {
                [] => continue,
                _ if joint == 0 => 0,
                [only] => *only,
                _ => {
                    logits += 1;
                    logits - 1
                }
            };
            branches.push(Branch { joint, gate, children });
        }
        Ok(Self { parents: parents.to_vec(), branches, logits })
    }

    /// J.
    pub fn joints(&self) -> usize {
        self.parents.len()
    }

    /// Logits the softmax takes: J, and one more for each branching joint but the root.
    pub fn logits(&self) -> usize {
        self.logits
    }

    /// Each joint's parent.
    pub fn parents(&self) -> &[Option<usize>] {
        &self.parents
    }

    /// Writes the weights (J) of `logits`; leaves in `flow` what [`KinematicTree::backward`] needs.
    #[inline(always)]
    pub(crate) fn weights<S: Scalar>(&self, logits: &[S], flow: &mut Flow<S>, weights: &mut [S]) {
        for values in [&mut flow.mass, &mut flow.gate, &mut flow.share] {
            values.resize(self.joints(), S::one());
        }
        flow.mass[0] = S::one();
        weights.copy_from_slice(&flow.mass);
        for Branch { joint, gate, children } in &self.branches {
            let logit = logits[*gate];
            let maximum = logit.constant_maximum(S::zero());
            let on = (logit - maximum).exp_negative();
            let off = (S::zero() - maximum).exp_negative();
            let total = (on + off).reciprocal();
            let mass = flow.mass[*joint];
            flow.gate[*joint] = on * total;
            weights[*joint] = mass * off * total;
            let passed = mass * flow.gate[*joint];
            if let [only] = children.as_slice() {
                flow.share[*only] = S::one();
                flow.mass[*only] = passed;
                weights[*only] = passed;
                continue;
            }
            let first = logits[children[0]];
            let maximum = children.iter().fold(first, |maximum, child| maximum.constant_maximum(logits[*child]));
            let mut total = S::zero();
            for child in children {
                flow.share[*child] = (logits[*child] - maximum).exp_negative();
                total = total + flow.share[*child];
            }
            let total = total.reciprocal();
            for child in children {
                flow.share[*child] = flow.share[*child] * total;
                flow.mass[*child] = passed * flow.share[*child];
                weights[*child] = flow.mass[*child];
            }
        }
    }

    /// Writes the cotangent of the logits; `cotangent` (J) of the weights is overwritten by that of the masses.
    ///
    /// With q = sum_c p_c m_bar_c:  m_bar = w_bar (1 - sigma) + sigma q,  sigma_bar = m (q - w_bar),
    /// logit_bar_c = m sigma p_c (m_bar_c - q),  gate_bar = sigma_bar sigma (1 - sigma).
    #[inline(always)]
    pub(crate) fn backward<S: Scalar>(&self, flow: &Flow<S>, cotangent: &mut [S], logit_cotangent: &mut [S]) {
        logit_cotangent.fill(S::zero());
        for Branch { joint, gate, children } in self.branches.iter().rev() {
            let (mass, sigma) = (flow.mass[*joint], flow.gate[*joint]);
            let kept = S::one() - sigma;
            let sent = children.iter().fold(S::zero(), |sum, child| sum + flow.share[*child] * cotangent[*child]);
            if children.len() > 1 {
                for child in children {
                    let slope = mass * sigma * flow.share[*child] * (cotangent[*child] - sent);
                    logit_cotangent[*child] = logit_cotangent[*child] + slope;
                }
            }
            let own = cotangent[*joint];
            logit_cotangent[*gate] = logit_cotangent[*gate] + mass * (sent - own) * sigma * kept;
            cotangent[*joint] = own * kept + sigma * sent;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parent_after_its_child_is_refused() {
        for parents in [vec![None, Some(2), Some(0)], vec![None, None], vec![Some(0)]] {
            assert!(matches!(KinematicTree::new(&parents), Err(Error::Shape { .. })));
        }
    }

    #[test]
    fn logits_are_counted_as_the_skeletons_need() {
        // A root with three children, one of which branches again: 6 joints and one extra gate.
        let tree = KinematicTree::new(&[None, Some(0), Some(0), Some(0), Some(1), Some(1)]).unwrap();
        assert_eq!((tree.joints(), tree.logits()), (6, 7));
    }

    // float64 vectors of the reference softmax over the skeletons of SMPL-X, SMPL and MANO, 64 rows each.
    #[test]
    fn weights_match_the_golden_vectors() {
        use candle_core::{Device, safetensors::load};
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/golden/hierarchical_softmax.safetensors");
        let golden = load(path, &Device::Cpu).unwrap();
        const SMPLX: [i32; 55] = [
            -1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15, 20, 25, 26, 20, 28,
            29, 20, 31, 32, 20, 34, 35, 20, 37, 38, 21, 40, 41, 21, 43, 44, 21, 46, 47, 21, 49, 50, 21, 52, 53,
        ];
        const SMPL: [i32; 24] = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21];
        const MANO: [i32; 16] = [-1, 0, 1, 2, 0, 4, 5, 0, 7, 8, 0, 10, 11, 0, 13, 14];
        for (name, parents) in [("smplx", SMPLX.as_slice()), ("smpl", &SMPL), ("mano", &MANO)] {
            let parents: Vec<_> = parents.iter().map(|parent| usize::try_from(*parent).ok()).collect();
            let tree = KinematicTree::new(&parents).unwrap();
            let logits: Vec<Vec<f64>> = golden[&format!("{name}.logits")].to_vec2().unwrap();
            let expected: Vec<Vec<f64>> = golden[&format!("{name}.weights")].to_vec2().unwrap();
            for (logits, expected) in logits.iter().zip(&expected) {
                assert_eq!(logits.len(), tree.logits());
                let lanes: Vec<_> = logits.iter().map(|logit| Lanes([*logit; LANES])).collect();
                let mut weights = vec![Lanes::zero(); tree.joints()];
                tree.weights(&lanes, &mut Flow::default(), &mut weights);
                for (weight, expected) in weights.iter().zip(expected) {
                    assert!((weight.0[3] - expected).abs() < 1e-9, "{name}: {} instead of {expected}", weight.0[3]);
                }
            }
        }
    }

    // Weights are a convex combination whatever the logits, far outside the range of exp too.
    #[test]
    fn weights_are_convex_for_extreme_logits() {
        let tree = KinematicTree::new(&[None, Some(0), Some(0), Some(1), Some(3), Some(3)]).unwrap();
        let mut flow = Flow::default();
        for scale in [0.0f32, 1.0, 1e3, 1e30] {
            let logits: Vec<_> = (0..tree.logits())
                .map(|i| Lanes(std::array::from_fn(|l| scale * ((i * 5 + l * 3) as f32).sin())))
                .collect();
            let mut weights = vec![Lanes::zero(); 6];
            tree.weights(&logits, &mut flow, &mut weights);
            for lane in 0..LANES {
                let sum: f32 = weights.iter().map(|weight| weight.0[lane]).sum();
                assert!((sum - 1.0).abs() < 1e-6, "sum {sum}");
                assert!(weights.iter().all(|weight| (0.0..=1.0).contains(&weight.0[lane])));
            }
        }
    }
}
