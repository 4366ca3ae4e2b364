//! From a pose to a posed avatar: what the body model makes of it, and what all poses of one avatar share.
//!
//! Condition, bones, the offsets of a grid's nodes and the warp are put together here and nowhere else. V vertices, J joints, R nodes.

use glam::{Affine3A, Vec3};
use xavatar_deformer::{BakedWeights, BoneTransform, SearchSettings, StartGroups, bone_transform};

use super::{
    CanonicalGrid, Condition, FieldEvaluator, Fields, NodeRows, PosedField, Skinning, SkinningBinding,
    union_start_groups,
};
use crate::Result;
use crate::body::{BodyModel, PartLabels, Pose};
use crate::config::{Config, SearchedField};

/// Bone transforms as the search takes them.
pub fn bone_rows(transforms: &[Affine3A]) -> Vec<BoneTransform<f32>> {
    transforms.iter().map(bone_transform).collect()
}

/// A pose as the fields take it.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldPose {
    /// c = [theta_b / pi, psi].
    pub condition: Vec<f32>,
    /// Bone transforms, canonical to posed (J).
    pub bones: Vec<BoneTransform<f32>>,
    /// What expression and pose add to the canonical body's vertices (V), metres.
    pub offsets: Vec<Vec3>,
}

impl FieldPose {
    /// What the body model makes of a pose.
    ///
    /// # Errors
    /// If the pose does not fit the body model.
    pub fn new(body: &BodyModel, pose: &Pose) -> Result<Self> {
        Ok(Self {
            bones: bone_rows(&body.canonical_to_posed(pose)?),
            offsets: body.canonical_offsets(pose)?,
            condition: Condition::new(body.skeleton(), body.expression_coefficients()).of(pose),
        })
    }
}

/// What the poses of one avatar share: where searches start and when they end, how skinning hangs on the body, and the weights that
/// were sampled for the search.
#[derive(Debug)]
pub struct Poser {
    binding: SkinningBinding,
    groups: StartGroups,
    settings: SearchSettings,
    searched: SearchedField,
    bounds: (Vec3, Vec3),
    baked: Option<BakedWeights<f32>>,
}

impl Poser {
    /// For the points of training frames. `bounds` is the canonical box of the body of `betas`.
    ///
    /// # Errors
    /// If the configured grid is out of range.
    pub fn for_training(
        config: &Config,
        body: &BodyModel,
        labels: &PartLabels,
        betas: &[f32],
        bounds: (Vec3, Vec3),
    ) -> Result<Self> {
        let binding = SkinningBinding::new(&config.fields.skinning, body, labels, betas)?;
        Ok(Self::new(config, binding.training_groups(config.starts, body.skeleton())?, binding, bounds))
    }

    /// For surfaces, which are those of the union of all correspondences.
    ///
    /// # Errors
    /// As [`Poser::for_training`].
    pub fn for_surfaces(
        config: &Config,
        body: &BodyModel,
        labels: &PartLabels,
        betas: &[f32],
        bounds: (Vec3, Vec3),
    ) -> Result<Self> {
        let binding = SkinningBinding::new(&config.fields.skinning, body, labels, betas)?;
        Ok(Self::new(config, union_start_groups(config.starts, body.skeleton())?, binding, bounds))
    }

    fn new(config: &Config, groups: StartGroups, binding: SkinningBinding, bounds: (Vec3, Vec3)) -> Self {
        let (settings, searched) = (config.search.clone(), config.searched_field);
        Self { binding, groups, settings, searched, bounds, baked: None }
    }

    /// The skinning field that training begins with, its starts pruned; of a grid, with what `rows` finds for its nodes.
    ///
    /// # Errors
    /// As [`SkinningBinding::initial`].
    pub fn initial_skinning(
        &self,
        body: &BodyModel,
        rows: impl FnOnce(&CanonicalGrid) -> Result<NodeRows>,
    ) -> Result<Skinning<f32>> {
        let mut skinning = self.binding.initial(body, rows)?;
        self.prune_starts(&mut skinning)?;
        Ok(skinning)
    }

    /// Lets searches in a skinning field skip starts that lead nowhere.
    ///
    /// # Errors
    /// If the field is of another configuration.
    pub fn prune_starts(&self, skinning: &mut Skinning<f32>) -> Result<()> {
        self.binding.prune_starts(skinning, &self.groups)
    }

    /// Samples a skinning field for the searches that follow, if they run on samples.
    ///
    /// # Errors
    /// As [`Skinning::bake`].
    pub fn bake(&mut self, skinning: &Skinning<f32>) -> Result<()> {
        self.baked = skinning.bake(self.searched, self.bounds)?;
        Ok(())
    }

    /// Whether there are samples to search on.
    pub fn is_baked(&self) -> bool {
        self.baked.is_some()
    }

    /// The fields in a pose, under a condition: the pose's own, or zeros.
    ///
    /// # Errors
    /// If the bones do not fit the skinning field or are not finite.
    pub fn pose<'a>(
        &'a self,
        fields: &'a Fields<f32>,
        pose: &'a FieldPose,
        condition: &[f32],
    ) -> Result<PosedField<'a>> {
        let node_offsets = self.binding.node_offsets(&pose.offsets);
        Ok(PosedField {
            evaluator: FieldEvaluator::new(fields, condition),
            warp: fields.skinning.warp(self.baked.as_ref(), &pose.bones, node_offsets.as_deref())?,
            groups: &self.groups,
            settings: &self.settings,
            bounds: self.bounds,
            node_offsets,
        })
    }
}
