//! A posed avatar as a field: deformed points to canonical correspondences and their geometry (thesis eq. 4.4-4.6).
//!
//! Every valid candidate of the search is a point of the body; their union wins: maximum occupancy, minimum distance.
//! N points; canonical and deformed coordinates in metres, the registration's translation subtracted.

use glam::Vec3;
use rayon::prelude::*;
use xavatar_deformer::{
    BakedWarp, BakedWeights, BoneTransform, Candidates, ExactWarp, ExactWorkspace, Grid, Jacobian, SearchSettings,
    StartGroups, Warp, bone_transform, search, search_and_polish,
};
use xavatar_network::{SkinningField, SkinningTrace, Trace};

use crate::Result;
use crate::body::{PartGroup, Role, Skeleton};
use crate::config::{SearchedField, Starts};
use crate::fields::{Fields, Skinning};

/// Rows a thread evaluates at a time.
const BLOCK_ROWS: usize = 256;

/// The start groups of a skeleton by a choice of starts; labels are the places of its parts.
///
/// # Errors
/// If the skeleton fails [`Skeleton::check`].
pub fn start_groups(starts: Starts, skeleton: &Skeleton) -> Result<StartGroups> {
    let joints = skeleton.joints.len();
    let common: Option<Vec<usize>> = match starts {
        Starts::Part => None,
        // Without such a part, as by parts.
        Starts::Body => Some(starts_of(skeleton, &[Role::Body])).filter(|starts| !starts.is_empty()),
        Starts::All => Some((0..joints).collect()),
    };
    let of_part = |part: &PartGroup| common.clone().unwrap_or_else(|| part.starts.clone());
    let parts = skeleton.parts.iter().map(of_part).collect();
    Ok(StartGroups::new(joints, parts, common.clone().unwrap_or_else(|| skeleton.starts.clone()))?)
}

/// The start groups of a union: for every part the body's and the face's bones too, since a hand may touch the body, and the
/// scalp, which is labelled as body, moves with the head.
///
/// # Errors
/// If the skeleton fails [`Skeleton::check`].
pub fn union_start_groups(starts: Starts, skeleton: &Skeleton) -> Result<StartGroups> {
    if starts != Starts::Part {
        return start_groups(starts, skeleton);
    }
    let common = starts_of(skeleton, &[Role::Body, Role::Face]);
    let with_body = |part: &PartGroup| {
        let others = common.iter().filter(|joint| !part.starts.contains(joint));
        part.starts.iter().chain(others).copied().collect()
    };
    let parts = skeleton.parts.iter().map(with_body).collect();
    Ok(StartGroups::new(skeleton.joints.len(), parts, skeleton.starts.clone())?)
}

/// The starts of the parts of these roles.
fn starts_of(skeleton: &Skeleton, roles: &[Role]) -> Vec<usize> {
    let parts = skeleton.parts.iter().filter(|part| roles.contains(&part.role));
    parts.flat_map(|part| part.starts.iter().copied()).collect()
}

/// Bone transforms as the search takes them.
pub fn bone_rows(transforms: &[glam::Affine3A]) -> Vec<BoneTransform<f32>> {
    transforms.iter().map(bone_transform).collect()
}

/// The winning correspondence of a deformed point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    /// x_c.
    pub canonical: [f32; 3],
    /// Occupancy logit or signed distance there.
    pub value: f32,
}

/// One frame's warp, canonical to deformed.
pub enum PosedWarp<'a> {
    /// The skinning network itself.
    Network(ExactWarp<'a, f32, SkinningField<f32>>),
    /// The network on a grid, whose roots the network polishes.
    Polished(BakedWarp<'a, f32>, ExactWarp<'a, f32, SkinningField<f32>>),
    /// A skinning field that is a grid.
    Voxels(BakedWarp<'a, f32>),
}

impl<'a> PosedWarp<'a> {
    /// The warp of `bones` (J), which `baked` samples where the skinning field is a network that has been sampled; `offsets`
    /// are those of its nodes where it is a grid.
    ///
    /// # Errors
    /// If the bones do not fit the field or are not finite.
    pub fn new(
        skinning: &'a Skinning<f32>,
        baked: Option<&'a BakedWeights<f32>>,
        bones: &'a [BoneTransform<f32>],
        offsets: Option<&[[f32; 3]]>,
    ) -> Result<Self> {
        Ok(match (skinning, baked) {
            (Skinning::Network(field), None) => Self::Network(ExactWarp::new(field, bones)?),
            (Skinning::Network(field), Some(baked)) => {
                Self::Polished(baked.warp(bones, None)?, ExactWarp::new(field, bones)?)
            }
            (Skinning::Voxels(field), _) => Self::Voxels(field.baked().warp(bones, offsets)?),
        })
    }
}

impl PosedWarp<'_> {
    /// Blended transforms (N) and Jacobians (N) at canonical points (N).
    pub fn transforms_and_jacobians(
        &self,
        workspace: &mut ExactWorkspace<f32, SkinningTrace<f32>>,
        points: &[[f32; 3]],
        transforms: &mut [BoneTransform<f32>],
        jacobians: &mut [Jacobian<f32>],
    ) {
        match self {
            Self::Network(exact) | Self::Polished(_, exact) => {
                exact.transforms_and_jacobians(workspace, points, transforms, jacobians);
            }
            Self::Voxels(grid) => grid.transforms_and_jacobians(&mut (), points, transforms, jacobians),
        }
    }
}

/// One pose of an avatar.
pub struct PosedField<'a> {
    /// The avatar's fields.
    pub fields: &'a Fields<f32>,
    /// Bone transforms, canonical to posed (J).
    pub bones: &'a [BoneTransform<f32>],
    /// The embedded condition.
    pub embedded: &'a [f32],
    /// Which bones start the search.
    pub groups: &'a StartGroups,
    /// When starts are given up.
    pub settings: &'a SearchSettings,
    /// The frame's warp.
    pub warp: &'a PosedWarp<'a>,
    /// The canonical box; what is outside it is no part of the body.
    pub bounds: (Vec3, Vec3),
}

/// Samples a skinning network on the grid over `bounds` that the search runs on; none if it runs on the field itself.
///
/// # Errors
/// If the box is empty or the grid too large.
pub fn bake(
    skinning: &Skinning<f32>,
    searched: SearchedField,
    bounds: (Vec3, Vec3),
) -> Result<Option<BakedWeights<f32>>> {
    match (skinning, searched) {
        (Skinning::Network(field), SearchedField::Baked { nodes, .. }) => {
            let grid = Grid::regular(bounds.0.to_array(), bounds.1.to_array(), nodes)?;
            Ok(Some(BakedWeights::sample(field, grid)?))
        }
        _ => Ok(None),
    }
}

impl PosedField<'_> {
    /// The winning correspondence of each point (N) with its part's label (N); none where the search found no root.
    ///
    /// # Errors
    /// Those of the search: a point that is not finite, bones that cannot be inverted.
    pub fn correspondences(&self, points: &[[f32; 3]], labels: &[u8]) -> Result<Vec<Option<Correspondence>>> {
        let candidates = self.candidates(points, labels)?;
        let values = self.geometry(&candidates.points);
        let representation = self.fields.geometry.representation;
        let winners = self.winners(&candidates, |index, best| representation.prefers(values[index], values[best]));
        let correspondence =
            |index: usize| Correspondence { canonical: candidates.points[index], value: values[index] };
        Ok(winners.into_iter().map(|winner| winner.map(correspondence)).collect())
    }

    /// All candidates of each point (N) with its part's label (N).
    ///
    /// # Errors
    /// As [`PosedField::correspondences`].
    pub fn candidates(&self, points: &[[f32; 3]], labels: &[u8]) -> Result<Candidates<f32>> {
        let Self { groups, settings, .. } = *self;
        Ok(match self.warp {
            PosedWarp::Network(warp) => search(warp, groups, points, Some(labels), settings)?,
            PosedWarp::Polished(fast, exact) => search_and_polish(fast, exact, groups, points, Some(labels), settings)?,
            PosedWarp::Voxels(warp) => search(warp, groups, points, Some(labels), settings)?,
        })
    }

    /// The candidate of each point that is in the canonical box and that no other is preferred to.
    pub fn winners(
        &self,
        candidates: &Candidates<f32>,
        is_preferred: impl Fn(usize, usize) -> bool,
    ) -> Vec<Option<usize>> {
        self.winners_among(candidates, |_, _| true, is_preferred)
    }

    /// As [`PosedField::winners`], of those candidates that `is_possible` for (point, candidate).
    pub fn winners_among(
        &self,
        candidates: &Candidates<f32>,
        is_possible: impl Fn(usize, usize) -> bool,
        is_preferred: impl Fn(usize, usize) -> bool,
    ) -> Vec<Option<usize>> {
        let (low, high) = self.bounds;
        let in_bounds = |index: usize| {
            let point = Vec3::from_array(candidates.points[index]);
            point.cmpge(low).all() && point.cmple(high).all()
        };
        let better = |best: usize, index: usize| if is_preferred(index, best) { index } else { best };
        let winner = |point: usize| {
            let possible = candidates.range(point).filter(|&index| in_bounds(index) && is_possible(point, index));
            possible.reduce(better)
        };
        (0..candidates.len()).map(winner).collect()
    }

    /// The geometry field's values (N) at canonical points (N).
    pub fn geometry(&self, canonical: &[[f32; 3]]) -> Vec<f32> {
        let mut values = vec![0.0; canonical.len()];
        values.par_chunks_mut(BLOCK_ROWS).zip(canonical.par_chunks(BLOCK_ROWS)).for_each_init(
            Trace::default,
            |trace, (values, points)| {
                self.fields.geometry.mlp.evaluate(trace, points.as_flattened(), self.embedded, &[]);
                values.copy_from_slice(trace.output());
            },
        );
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::smplx;

    #[test]
    fn a_union_starts_from_the_points_own_part_the_body_and_the_head() {
        let skeleton = smplx::skeleton();
        let groups = union_start_groups(Starts::Part, skeleton).unwrap();
        for (part, group) in skeleton.parts() {
            let bones = groups.bones(Some(part.0)).unwrap();
            let expected = group.starts.iter().chain(&skeleton.parts[0].starts).chain(&skeleton.parts[1].starts);
            assert!(expected.into_iter().all(|bone| bones.contains(bone)), "{}", group.name);
        }
    }
}
