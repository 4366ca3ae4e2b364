//! Where the nodes of a scene stand, and what their skins do.

use glam::{Mat4, Quat, Vec3};

use super::container::Container;
use super::document::{Document, Node};
use crate::Parsed;
use xavatar_formats::Fault;

impl Node {
    fn transform(&self) -> Mat4 {
        if let Some(matrix) = self.matrix {
            return Mat4::from_cols_array(&matrix);
        }
        Mat4::from_scale_rotation_translation(
            self.scale.map_or(Vec3::ONE, Vec3::from),
            self.rotation.map_or(Quat::IDENTITY, |rotation| Quat::from_array(rotation).normalize()),
            self.translation.map_or(Vec3::ZERO, Vec3::from),
        )
    }
}

impl Document {
    /// The transform of each node to the world, and whether the scene shows it: the file's scene, else its first, else all.
    pub(super) fn placed_nodes(&self) -> Parsed<Vec<(Mat4, bool)>> {
        let count = self.nodes.len();
        let mut parents = vec![None; count];
        for (index, node) in self.nodes.iter().enumerate() {
            for &child in &node.children {
                match parents.get_mut(child) {
                    Some(parent @ None) => *parent = Some(index),
                    _ => {
                        return Err(Fault::malformed(
                            format!("node {index}"),
                            format!("the parent of {child}"),
                            "a node without another",
                        ));
                    }
                }
            }
        }
        let roots = (0..count).filter(|node| parents[*node].is_none());
        let scene = self.scenes.get(self.scene.unwrap_or(0));
        let mut is_listed = vec![scene.is_none(); count];
        for node in scene.iter().flat_map(|scene| &scene.nodes) {
            is_listed.get_mut(*node).into_iter().for_each(|listed| *listed = true);
        }
        let mut placed = vec![None; count];
        let mut stack: Vec<(usize, Mat4, bool)> = roots.map(|node| (node, Mat4::IDENTITY, false)).collect();
        while let Some((index, above, shown)) = stack.pop() {
            let node = &self.nodes[index];
            let (transform, shown) = (above * node.transform(), shown || is_listed[index]);
            if !transform.is_finite() {
                return Err(Fault::malformed(format!("node {index}"), "no transform of finite numbers", "one"));
            }
            placed[index] = Some((transform, shown));
            stack.extend(node.children.iter().map(|child| (*child, transform, shown)));
        }
        let in_circle = || Fault::malformed("the nodes", "in a circle", "a tree");
        placed.into_iter().map(|node| node.ok_or_else(in_circle)).collect()
    }
}

impl Container<'_> {
    /// What takes each joint of a skin from the pose that the mesh is stored in to the one of the file.
    pub(super) fn joint_transforms(&self, skin: usize, placed: &[(Mat4, bool)]) -> Parsed<Vec<Mat4>> {
        let place = || format!("skin {skin}");
        let skin =
            self.document.skins.get(skin).ok_or_else(|| Fault::malformed(place(), "missing", "one that there is"))?;
        let binds = match skin.inverse_bind_matrices {
            Some(accessor) => self.vectors::<16>(accessor)?.iter().map(Mat4::from_cols_array).collect(),
            None => vec![Mat4::IDENTITY; skin.joints.len()],
        };
        if binds.len() < skin.joints.len() {
            let found = format!("{} matrices for {} joints", binds.len(), skin.joints.len());
            return Err(Fault::malformed(place(), found, "one a joint"));
        }
        let joint = |(node, bind): (&usize, Mat4)| match placed.get(*node) {
            Some((transform, _)) => Ok(*transform * bind),
            None => Err(Fault::malformed(place(), format!("the joint at node {node}"), "a node that there is")),
        };
        skin.joints.iter().zip(binds).map(joint).collect()
    }
}
