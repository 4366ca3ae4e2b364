//! The mannequin as the arrays of an SMPL-X model file.
//!
//! The arrays are what is written as `SMPLX_NEUTRAL.npz`; the model is read from them like any other, so that the built-in
//! subject takes the same road as a user's.

use glam::Vec3;

use super::directions::{LeftView, bulge_direction, expression_direction, shape_direction};
use super::flesh::Flesh;
use super::recipe::{Hands, Recipe};
use super::rig::{WeightRows, add_eyeball, regressor_row, skinning_weights};
use crate::body::{JOINTS, PARENTS};
use crate::formats::Result;
use crate::formats::{Array, ArrayData, ArrayMap};
use crate::mesh::TriangleMesh;

/// Entries of the rotation matrices that drive the pose correctives.
const POSE_FEATURES: usize = (JOINTS - 1) * 9;

/// The mannequin's surface and rig.
pub(super) struct Mannequin {
    /// Skin, then the left and the right eyeball.
    pub(super) mesh: TriangleMesh,
    /// Vertices of the skin: the first of the mesh.
    pub(super) skin_vertices: usize,
    /// Faces of the skin: the first of the mesh.
    pub(super) skin_faces: usize,
    pub(super) weights: WeightRows,
    pub(super) joints: [Vec3; JOINTS],
}

impl Mannequin {
    pub(super) fn of(recipe: &Recipe, flesh: &Flesh) -> Result<Self> {
        let joints = recipe.joint_positions()?;
        let mut mesh = flesh.mesh(&recipe.mesh)?;
        let (skin_vertices, skin_faces) = (mesh.vertices.len(), mesh.faces.len());
        let mut weights = skinning_weights(flesh, &mesh, recipe.rig.diffusion_rounds);
        for eye in [23, 24] {
            let added = add_eyeball(&mut mesh, joints[eye], recipe.rig.eyeball_radius);
            let row = std::array::from_fn(|joint| if joint == eye { 1.0 } else { 0.0 });
            weights.extend(std::iter::repeat_n(row, added));
        }
        Ok(Self { mesh, skin_vertices, skin_faces, weights, joints })
    }

    /// The arrays of the model file.
    pub(super) fn arrays(&self, recipe: &Recipe) -> Result<ArrayMap> {
        let vertices = &self.mesh.vertices;
        let count = vertices.len();
        let normals = self.mesh.vertex_normals();
        let views: Vec<LeftView> =
            (0..count).map(|vertex| LeftView::of(vertices[vertex], normals[vertex], &self.weights[vertex])).collect();

        let mut directions = Vec::new();
        for shape in &recipe.shapes {
            directions.push(shape_direction(&shape.moves, &views)?);
        }
        directions.extend(recipe.expressions.iter().map(|expression| expression_direction(&expression.pulls, &views)));
        let mut correctives = vec![0.0; count * 3 * POSE_FEATURES];
        for bulge in &recipe.correctives.bulges {
            for (joint, direction) in bulge_direction(bulge, &self.joints, &views)? {
                for (vertex, displacement) in direction.iter().enumerate().filter(|(_, moved)| **moved != Vec3::ZERO) {
                    for axis in 0..3 {
                        for diagonal in [0, 4, 8] {
                            let feature = (joint - 1) * 9 + diagonal;
                            correctives[(vertex * 3 + axis) * POSE_FEATURES + feature] += displacement[axis];
                        }
                    }
                }
            }
        }

        let regressor: Vec<f64> =
            (0..JOINTS).flat_map(|joint| regressor_row(joint, self.joints[joint], vertices, &self.weights)).collect();
        let parents = (0..JOINTS).map(|joint| if joint == 0 { i64::from(u32::MAX) } else { PARENTS[joint] as i64 });
        let tree: Vec<i64> = parents.chain(0..JOINTS as i64).collect();
        let faces = self.mesh.faces.iter().flatten().map(|corner| i64::from(*corner)).collect();
        let interleaved =
            (0..count * 3).flat_map(|at| directions.iter().map(move |direction| direction[at / 3][at % 3]));

        let mut arrays = ArrayMap::new();
        let mut insert =
            |key: &str, shape: &[usize], data| arrays.insert(key.into(), Array { shape: shape.to_vec(), data });
        insert(
            "v_template",
            &[count, 3],
            ArrayData::F32(vertices.iter().flat_map(|vertex| vertex.to_array()).collect()),
        );
        insert("f", &[self.mesh.faces.len(), 3], ArrayData::I64(faces));
        insert("weights", &[count, JOINTS], ArrayData::F32(self.weights.as_flattened().to_vec()));
        insert("J_regressor", &[JOINTS, count], ArrayData::F64(regressor));
        insert("kintree_table", &[2, JOINTS], ArrayData::I64(tree));
        insert("shapedirs", &[count, 3, directions.len()], ArrayData::F32(interleaved.collect()));
        insert("posedirs", &[count, 3, POSE_FEATURES], ArrayData::F32(correctives));
        for (side, sign) in [("l", 1.0), ("r", -1.0)] {
            let curl = closed_hand(&recipe.hands, sign);
            let mean = curl.iter().map(|angle| angle * recipe.hands.relaxed).collect();
            insert(&format!("hands_mean{side}"), &[45], ArrayData::F32(mean));
            insert(&format!("hands_components{side}"), &[45, 45], ArrayData::F32(components(&curl)));
        }
        Ok(arrays)
    }
}

/// The pose of a fist, 15 axis-angle rotations; `sign` -1 mirrors it to the right hand.
pub(super) fn closed_hand(hands: &Hands, sign: f32) -> [f32; 45] {
    std::array::from_fn(|at| {
        let (joint, axis) = (at / 3, at % 3);
        let curl = if joint < 12 { hands.finger_curl[joint % 3] } else { hands.thumb_curl[joint - 12] };
        // A rotation vector keeps its x in the mirror and changes the sign of the rest.
        if axis == 0 { curl[axis] } else { sign * curl[axis] }
    })
}

/// 45 orthonormal rows, the first along `curl`: the reflection that takes the first axis there.
fn components(curl: &[f32; 45]) -> Vec<f32> {
    let length = curl.iter().map(|angle| angle * angle).sum::<f32>().sqrt();
    let mut mirror = curl.map(|angle| angle / length);
    mirror[0] -= 1.0;
    let squared: f32 = mirror.iter().map(|entry| entry * entry).sum();
    let entry =
        |row: usize, column: usize| f32::from(u8::from(row == column)) - 2.0 * mirror[row] * mirror[column] / squared;
    (0..45 * 45).map(|at| entry(at / 45, at % 45)).collect()
}
