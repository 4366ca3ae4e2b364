//! One frame's warp on a grid: A(x) = sum_k share_k(x) A_k over the eight nodes k of the cell that holds x.
//!
//! The Jacobian is the exact derivative of that look-up within a cell. R nodes; metres.

use std::sync::{Mutex, PoisonError};

use xavatar_network::Real;
use xavatar_vector::vectorised;

use crate::affine::apply;
use crate::warp::skinning::jacobian_from_slopes;
use crate::{BoneTransform, Grid, Jacobian, StartBoxes, Warp};

/// A node's blended transform, padded to a cache line of 16 f32 so that a look-up touches eight lines and no more.
#[repr(align(64))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node<T>(pub [T; 16]);

impl<T: Real> Node<T> {
    #[inline(always)]
    pub(crate) fn transform(&self) -> BoneTransform<T> {
        std::array::from_fn(|index| self.0[index])
    }

    /// A -> A T, with T the translation by `offset`.
    #[inline(always)]
    pub(crate) fn translate_first(&mut self, offset: [T; 3]) {
        let [x, y, z] = apply(&self.transform(), offset);
        [self.0[3], self.0[7], self.0[11]] = [x, y, z];
    }
}

/// Nodes of frames gone by: fresh memory of this size costs more than the blending that fills it.
#[derive(Debug)]
pub(crate) struct Spare<T>(Mutex<Vec<Vec<Node<T>>>>);

impl<T> Default for Spare<T> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<T> Clone for Spare<T> {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl<T: Real> Spare<T> {
    /// `count` nodes that hold anything.
    pub(crate) fn take(&self, count: usize) -> Vec<Node<T>> {
        let spare = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop();
        spare.unwrap_or_else(|| vec![Node([T::zero(); 16]); count])
    }
}

/// One frame's warp on a grid: fast, and as exact as the grid is fine.
#[derive(Debug)]
pub struct BakedWarp<'a, T> {
    grid: &'a Grid<T>,
    /// A at each node (R).
    transforms: Vec<Node<T>>,
    bones: &'a [BoneTransform<T>],
    starts: Option<StartBoxes<'a, T>>,
    spare: &'a Spare<T>,
}

impl<T> Drop for BakedWarp<'_, T> {
    fn drop(&mut self) {
        self.spare.0.lock().unwrap_or_else(PoisonError::into_inner).push(std::mem::take(&mut self.transforms));
    }
}

impl<'a, T: Real> BakedWarp<'a, T> {
    pub(crate) fn new(
        grid: &'a Grid<T>,
        transforms: Vec<Node<T>>,
        bones: &'a [BoneTransform<T>],
        starts: Option<StartBoxes<'a, T>>,
        spare: &'a Spare<T>,
    ) -> Self {
        Self { grid, transforms, bones, starts, spare }
    }

    pub(crate) fn grid(&self) -> &Grid<T> {
        self.grid
    }

    /// A at one point.
    #[inline(always)]
    fn look_up(&self, point: [T; 3]) -> [T; 16] {
        let cell = self.grid.cell(point);
        let mut sum = [T::zero(); 16];
        for corner in 0..8 {
            let share = cell.share(corner);
            let node = &self.transforms[cell.corner(corner)].0;
            for index in 0..16 {
                sum[index] += share * node[index];
            }
        }
        sum
    }

    /// A and J at one point.
    #[inline(always)]
    pub(crate) fn look_up_with_jacobian(&self, point: [T; 3]) -> (BoneTransform<T>, Jacobian<T>) {
        let cell = self.grid.cell(point);
        let cell_slopes = self.grid.slopes(&cell, point);
        let mut transform = [T::zero(); 12];
        let mut slopes = [[T::zero(); 12]; 3];
        for corner in 0..8 {
            let share = cell.share(corner);
            let gradient = cell.share_gradient(corner, cell_slopes);
            for (index, &value) in self.transforms[cell.corner(corner)].0[..12].iter().enumerate() {
                transform[index] += share * value;
                for (slope, along) in slopes.iter_mut().zip(gradient) {
                    slope[index] += along * value;
                }
            }
        }
        let jacobian = jacobian_from_slopes(&transform, &slopes, point);
        (transform, jacobian)
    }
}

impl<T: Real> Warp<T> for BakedWarp<'_, T> {
    type Workspace = ();

    // The eight nodes of each point stay in the second-level cache from one iteration to the next.
    const BATCH: usize = 128;

    fn bones(&self) -> &[BoneTransform<T>] {
        self.bones
    }

    fn start_boxes(&self) -> Option<&StartBoxes<'_, T>> {
        self.starts.as_ref()
    }

    fn matters(&self, point: [T; 3]) -> bool {
        let Some(starts) = &self.starts else { return true };
        self.grid.cell_number(point).is_some_and(|cell| starts.cell_matters(cell))
    }

    fn transforms(&self, _: &mut (), points: &[[T; 3]], transforms: &mut [BoneTransform<T>]) {
        vectorised(
            #[inline(always)]
            || {
                for (&point, transform) in points.iter().zip(transforms) {
                    transform.copy_from_slice(&self.look_up(point)[..12]);
                }
            },
        );
    }

    fn transforms_and_jacobians(
        &self,
        _: &mut (),
        points: &[[T; 3]],
        transforms: &mut [BoneTransform<T>],
        jacobians: &mut [Jacobian<T>],
    ) {
        vectorised(
            #[inline(always)]
            || {
                for ((&point, transform), jacobian) in points.iter().zip(transforms).zip(jacobians) {
                    (*transform, *jacobian) = self.look_up_with_jacobian(point);
                }
            },
        );
    }
}
