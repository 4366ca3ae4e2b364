//! The skinning field in one pose: the map d(x_c) of canonical points to deformed ones, and its inverse.
//!
//! The search inverts it from the bones ([`PosedWarp::candidates`]); where a canonical point is nearly known, Newton's method does,
//! x_c <- x_c - J^-1 (d(x_c) - x_d) ([`PosedWarp::refined`]). N points, R nodes; metres.

use glam::{Mat3, Vec3};
use rayon::prelude::*;
use xavatar_deformer::{
    BakedWarp, BakedWeights, BoneTransform, Candidates, ExactWarp, ExactWorkspace, Jacobian, SearchSettings,
    StartGroups, Warp, search, search_and_polish,
};
use xavatar_network::{SkinningField, SkinningTrace};

use super::{Kind, Skinning};
use crate::Result;
use crate::fields::BLOCK_ROWS;

/// Newton steps; the first leaves less than a tenth of a millimetre of a guess that is a cell off.
const NEWTON_STEPS: usize = 3;
/// Residual from which one more step is enough for colours and normals, metres.
const NEAR: f32 = 1e-3;
/// Longest Newton step, metres; a longer one leads to another part of the body.
const LONGEST_STEP: f32 = 0.03;

/// One pose's warp, canonical to deformed.
#[derive(Debug)]
pub struct PosedWarp<'a>(Warps<'a>);

#[derive(Debug)]
enum Warps<'a> {
    /// The skinning network itself.
    Network(ExactWarp<'a, f32, SkinningField<f32>>),
    /// The network on a grid, whose roots the network polishes.
    Polished(BakedWarp<'a, f32>, ExactWarp<'a, f32, SkinningField<f32>>),
    /// A grid alone.
    Grid(BakedWarp<'a, f32>),
}

impl Skinning<f32> {
    /// The warp of `bones` (J). A network's search runs on `baked` where it has been sampled; `offsets` (R) move the nodes of a grid.
    ///
    /// # Errors
    /// If the bones do not fit the field or are not finite.
    pub fn warp<'a>(
        &'a self,
        baked: Option<&'a BakedWeights<f32>>,
        bones: &'a [BoneTransform<f32>],
        offsets: Option<&[[f32; 3]]>,
    ) -> Result<PosedWarp<'a>> {
        Ok(PosedWarp(match (&self.kind, baked) {
            (Kind::Network(field), None) => Warps::Network(ExactWarp::new(field, bones)?),
            (Kind::Network(field), Some(baked)) => {
                Warps::Polished(baked.warp(bones, None)?, ExactWarp::new(field, bones)?)
            }
            (Kind::Grid(field), _) => Warps::Grid(field.baked().warp(bones, offsets)?),
        }))
    }

    /// Adds to `gradient` (P) what the cotangents of a frame's roots pull back to on a grid, whose posed warp and offsets (R) these are.
    /// A network's gradient has them already ([`Skinning::roots_backward`]).
    ///
    /// # Errors
    /// If the arrays differ in length, or the warp is of another field.
    pub fn pull_back_roots(
        &self,
        warp: &PosedWarp,
        offsets: Option<&[[f32; 3]]>,
        roots: &[[f32; 3]],
        cotangents: impl FnOnce() -> Vec<[f32; 3]>,
        gradient: &mut [f32],
    ) -> Result<()> {
        if let (Kind::Grid(field), Warps::Grid(warp)) = (&self.kind, &warp.0) {
            field.root_backward(warp, offsets, roots, &cotangents(), gradient)?;
        }
        Ok(())
    }
}

impl<'a> PosedWarp<'a> {
    /// The warp of sampled weights alone: what a search on them finds without polishing.
    ///
    /// # Errors
    /// As [`Skinning::warp`].
    pub fn sampled(baked: &'a BakedWeights<f32>, bones: &'a [BoneTransform<f32>]) -> Result<Self> {
        Ok(Self(Warps::Grid(baked.warp(bones, None)?)))
    }

    /// All canonical points (candidates) of deformed points (N) with their parts' labels (N).
    ///
    /// # Errors
    /// A point that is not finite, bones that cannot be inverted.
    pub fn candidates(
        &self,
        groups: &StartGroups,
        settings: &SearchSettings,
        points: &[[f32; 3]],
        labels: &[u8],
    ) -> Result<Candidates<f32>> {
        Ok(match &self.0 {
            Warps::Network(warp) => search(warp, groups, points, Some(labels), settings)?,
            Warps::Polished(fast, exact) => search_and_polish(fast, exact, groups, points, Some(labels), settings)?,
            Warps::Grid(warp) => search(warp, groups, points, Some(labels), settings)?,
        })
    }

    /// The canonical points of deformed `targets` (N), and the warp's Jacobians there (N), by Newton's method from guesses (N).
    #[must_use]
    pub fn refined(&self, guesses: &[[f32; 3]], targets: &[Vec3]) -> (Vec<[f32; 3]>, Vec<Jacobian<f32>>) {
        let mut canonical = guesses.to_vec();
        let mut jacobians = vec![[[0.0; 3]; 3]; guesses.len()];
        let blocks = canonical.par_chunks_mut(BLOCK_ROWS).zip(jacobians.par_chunks_mut(BLOCK_ROWS));
        blocks.zip(targets.par_chunks(BLOCK_ROWS)).for_each_init(
            Default::default,
            |(workspace, transforms), ((canonical, jacobians), targets)| {
                self.refine(workspace, transforms, canonical, jacobians, targets);
            },
        );
        (canonical, jacobians)
    }

    fn refine(
        &self,
        workspace: &mut ExactWorkspace<f32, SkinningTrace<f32>>,
        transforms: &mut Vec<BoneTransform<f32>>,
        canonical: &mut [[f32; 3]],
        jacobians: &mut [Jacobian<f32>],
        targets: &[Vec3],
    ) {
        transforms.resize(canonical.len(), [0.0; 12]);
        for _ in 0..NEWTON_STEPS {
            self.transforms_and_jacobians(workspace, canonical, transforms, jacobians);
            let mut farthest = 0.0_f32;
            let warped = canonical.iter_mut().zip(transforms.iter()).zip(jacobians.iter());
            for (((point, transform), jacobian), target) in warped.zip(targets) {
                let residual = image(transform, *point) - *target;
                let step = Mat3::from_cols_array_2d(jacobian).transpose().inverse() * residual;
                if step.length() < LONGEST_STEP {
                    *point = (Vec3::from_array(*point) - step).to_array();
                    farthest = farthest.max(residual.length());
                }
            }
            // Newton's method converges quadratically: what is left is below a hundredth of a millimetre.
            if farthest < NEAR {
                break;
            }
        }
    }

    /// Blended transforms (N) and Jacobians (N) at canonical points (N).
    fn transforms_and_jacobians(
        &self,
        workspace: &mut ExactWorkspace<f32, SkinningTrace<f32>>,
        points: &[[f32; 3]],
        transforms: &mut [BoneTransform<f32>],
        jacobians: &mut [Jacobian<f32>],
    ) {
        match &self.0 {
            Warps::Network(exact) | Warps::Polished(_, exact) => {
                exact.transforms_and_jacobians(workspace, points, transforms, jacobians);
            }
            Warps::Grid(grid) => grid.transforms_and_jacobians(&mut (), points, transforms, jacobians),
        }
    }
}

/// A x~.
pub(in crate::fields) fn image(transform: &BoneTransform<f32>, point: [f32; 3]) -> Vec3 {
    let row = |r: usize| Vec3::from_slice(&transform[4 * r..]).dot(Vec3::from_array(point)) + transform[4 * r + 3];
    Vec3::new(row(0), row(1), row(2))
}
