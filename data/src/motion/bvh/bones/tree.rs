//! What the tree of a skeleton tells where names do not: the pelvis, the back, the neck, and helper bones.

use xavatar_body::smplx::joint;

use super::Bones;
use crate::motion::bvh::skeleton::Joint;

/// Positions closer than this, as a share of a leg's length, are one.
const COINCIDENT: f64 = 1e-3;
/// How far up the back, from the pelvis to the neck, SMPL-X's three joints of it are.
const BACK: [(usize, f64); 3] = [(joint::SPINE1, 0.22), (joint::SPINE2, 0.47), (joint::SPINE3, 0.68)];

/// The bones of a skeleton as a tree.
pub(super) struct Tree<'a> {
    pub(super) joints: &'a [Joint],
}

impl Tree<'_> {
    /// The bones from one up to the root, with both.
    fn ancestry(&self, bone: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(bone), |bone| self.joints[*bone].parent)
    }

    pub(super) fn is_above(&self, above: usize, bone: usize) -> bool {
        self.ancestry(bone).any(|other| other == above)
    }

    /// The lowest bone that is above all of some, or one of them.
    pub(super) fn common(&self, bones: &[usize]) -> Option<usize> {
        let (first, others) = bones.split_first()?;
        self.ancestry(*first).find(|bone| others.iter().all(|other| self.is_above(*bone, *other)))
    }

    /// The bones below `above` down to `below`, with it; none if that is not below.
    pub(super) fn path(&self, above: usize, below: usize) -> Vec<usize> {
        if !self.is_above(above, below) {
            return Vec::new();
        }
        let mut path: Vec<usize> = self.ancestry(below).take_while(|bone| *bone != above).collect();
        path.reverse();
        path
    }

    /// How far along the bones of a path each one is.
    fn lengths(&self, path: &[usize]) -> Vec<f64> {
        path.iter()
            .scan(0.0, |length, bone| {
                *length += self.joints[*bone].offset.length();
                Some(*length)
            })
            .collect()
    }

    /// Which of the bones of the back, in order from the pelvis up, are SMPL-X's: those nearest to its in height. The neck begins
    /// at `top`, if there is one.
    pub(super) fn back(&self, path: &[usize], top: Option<usize>) -> Vec<(usize, usize)> {
        match *path {
            [] => return Vec::new(),
            [only] => return vec![(joint::SPINE2, only)],
            [first, second] => return vec![(joint::SPINE1, first), (joint::SPINE3, second)],
            _ => {}
        }
        let heights = self.lengths(path);
        let beyond =
            top.map_or(0.0, |top| self.lengths(&self.path(path[path.len() - 1], top)).last().copied().unwrap_or(0.0));
        let length = heights.last().copied().unwrap_or(0.0) + beyond;
        let error =
            |place: usize, wanted: f64| if length > 0.0 { (heights[place] / length - wanted).abs() } else { 0.0 };
        let mut best = (f64::INFINITY, [0; 3]);
        for first in 0..path.len() {
            for second in first + 1..path.len() {
                for third in second + 1..path.len() {
                    let chosen = [first, second, third];
                    let sum: f64 =
                        chosen.iter().zip(BACK).map(|(place, (_, wanted))| error(*place, wanted).powi(2)).sum();
                    // Of bones in one place the lowest has the turns of all.
                    if sum <= best.0 + 1e-12 {
                        best = (sum, chosen);
                    }
                }
            }
        }
        BACK.iter().zip(best.1).map(|((joint, _), place)| (*joint, path[place])).collect()
    }

    /// The bones with each replaced by the helper below it that stands in the same place and carries all that is below:
    /// the turns of both are the joint's.
    pub(super) fn carriers(&self, bones: &Bones) -> Bones {
        let leg: f64 = [joint::LEFT_KNEE, joint::LEFT_ANKLE]
            .iter()
            .filter_map(|joint| bones[*joint])
            .map(|bone| self.joints[bone].offset.length())
            .sum();
        let is_helper =
            |bone: &usize| !bones.contains(&Some(*bone)) && self.joints[*bone].offset.length() <= COINCIDENT * leg;
        let mut carriers = bones.clone();
        for carrier in carriers.iter_mut().flatten() {
            while let Some(below) = self.carries_on(*carrier, bones).filter(is_helper) {
                *carrier = below;
            }
        }
        carriers
    }

    /// The bone's one child that is above other joints' bones, or its only child where none is.
    fn carries_on(&self, bone: usize, bones: &Bones) -> Option<usize> {
        let children: Vec<usize> =
            (bone + 1..self.joints.len()).filter(|child| self.joints[*child].parent == Some(bone)).collect();
        let carries = |child: &&usize| bones.iter().flatten().any(|mapped| self.is_above(**child, *mapped));
        let carrying: Vec<usize> = children.iter().filter(carries).copied().collect();
        match (&carrying[..], &children[..]) {
            ([child], _) | ([], [child]) => Some(*child),
            _ => None,
        }
    }

    /// The longest way up from a bone through bones for which `goes` holds, without it.
    pub(super) fn chain(&self, from: usize, goes: impl Fn(usize) -> bool) -> Vec<usize> {
        let mut chain = Vec::new();
        let mut bone = from;
        while let Some(next) =
            (bone + 1..self.joints.len()).find(|child| self.joints[*child].parent == Some(bone) && goes(*child))
        {
            chain.push(next);
            bone = next;
        }
        chain
    }
}
