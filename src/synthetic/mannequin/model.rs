//! The mannequin as the arrays of an SMPL-X model file.
//!
//! The arrays are what is written as `SMPLX_NEUTRAL.npz`; the model is read from them like any other, so that the built-in
//! subject takes the same road as a user's.

use glam::Vec3;

use super::directions::{LeftView, bulge_direction, expression_direction, shape_direction};
use super::flesh::Flesh;
use super::recipe::{Hands, Recipe, joint_index};
use super::rig::{WeightRows, add_eyeball, one_hot, regressor_row, skinning_weights};
use crate::body::{Fingers, PoseAxisAngle, smplx};
use crate::formats::Result;
use crate::formats::{Array, ArrayData, ArrayMap};
use crate::mesh::TriangleMesh;

/// The joints of the eyeballs.
const EYES: [&str; 2] = ["left_eye", "right_eye"];

/// The mannequin's surface and rig.
pub(super) struct Mannequin {
    /// Skin, then the left and the right eyeball.
    pub(super) mesh: TriangleMesh,
    /// Vertices of the skin: the first of the mesh.
    pub(super) skin_vertices: usize,
    /// Faces of the skin: the first of the mesh.
    pub(super) skin_faces: usize,
    pub(super) weights: WeightRows,
    pub(super) joints: Vec<Vec3>,
}

impl Mannequin {
    pub(super) fn of(recipe: &Recipe, flesh: &Flesh) -> Result<Self> {
        let joints = recipe.joint_positions()?;
        let mut mesh = flesh.mesh(&recipe.mesh)?;
        let (skin_vertices, skin_faces) = (mesh.vertices.len(), mesh.faces.len());
        let mut weights = skinning_weights(flesh, &mesh, recipe.rig.diffusion_rounds);
        for eye in EYES {
            let eye = joint_index(eye)?;
            let added = add_eyeball(&mut mesh, joints[eye], recipe.rig.eyeball_radius);
            weights.extend(std::iter::repeat_n(one_hot(eye), added));
        }
        Ok(Self { mesh, skin_vertices, skin_faces, weights, joints })
    }

    /// The arrays of the model file.
    pub(super) fn arrays(&self, recipe: &Recipe) -> Result<ArrayMap> {
        let parents = &smplx::skeleton().parents;
        let joints = parents.len();
        // Entries of the rotation matrices that drive the pose correctives.
        let features = 9 * (joints - 1);
        let eyes = [joint_index(EYES[0])?, joint_index(EYES[1])?];
        let vertices = &self.mesh.vertices;
        let count = vertices.len();
        let normals = self.mesh.vertex_normals();
        let views: Vec<LeftView> =
            (0..count).map(|vertex| LeftView::of(vertices[vertex], normals[vertex], &self.weights[vertex])).collect();

        let mut directions = Vec::new();
        for shape in &recipe.shapes {
            directions.push(shape_direction(&shape.moves, &views)?);
        }
        directions
            .extend(recipe.expressions.iter().map(|expression| expression_direction(&expression.pulls, eyes, &views)));
        let mut correctives = vec![0.0; count * 3 * features];
        for bulge in &recipe.correctives.bulges {
            for (joint, direction) in bulge_direction(bulge, &self.joints, &views)? {
                for (vertex, displacement) in direction.iter().enumerate().filter(|(_, moved)| **moved != Vec3::ZERO) {
                    for axis in 0..3 {
                        for diagonal in [0, 4, 8] {
                            let feature = (joint - 1) * 9 + diagonal;
                            correctives[(vertex * 3 + axis) * features + feature] += displacement[axis];
                        }
                    }
                }
            }
        }

        let regressor: Vec<f64> =
            (0..joints).flat_map(|joint| regressor_row(joint, self.joints[joint], vertices, &self.weights)).collect();
        let parents = parents.iter().map(|parent| parent.map_or(i64::from(u32::MAX), |parent| parent as i64));
        let tree: Vec<i64> = parents.chain(0..joints as i64).collect();
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
        insert("weights", &[count, joints], ArrayData::F32(self.weights.concat()));
        insert("J_regressor", &[joints, count], ArrayData::F64(regressor));
        insert("kintree_table", &[2, joints], ArrayData::I64(tree));
        insert("shapedirs", &[count, 3, directions.len()], ArrayData::F32(interleaved.collect()));
        insert("posedirs", &[count, 3, features], ArrayData::F32(correctives));
        for (side, sign) in [("l", 1.0), ("r", -1.0)] {
            let curl: Vec<f32> = closed_hand(&recipe.hands, sign).iter().flat_map(|turn| turn.0.to_array()).collect();
            let (mean, size) = (curl.iter().map(|angle| angle * recipe.hands.relaxed).collect(), curl.len());
            insert(&format!("hands_mean{side}"), &[size], ArrayData::F32(mean));
            insert(&format!("hands_components{side}"), &[size, size], ArrayData::F32(components(&curl)));
        }
        Ok(arrays)
    }
}

/// The pose of a fist; `sign` -1 mirrors it to the right hand.
pub(super) fn closed_hand(hands: &Hands, sign: f32) -> Fingers {
    std::array::from_fn(|joint| {
        let curl = if joint < 12 { hands.finger_curl[joint % 3] } else { hands.thumb_curl[joint - 12] };
        // A rotation vector keeps its x in the mirror and changes the sign of the rest.
        PoseAxisAngle(Vec3::new(curl[0], sign * curl[1], sign * curl[2]))
    })
}

/// As many orthonormal rows as `curl` has entries, the first along it: the reflection that takes the first axis there.
fn components(curl: &[f32]) -> Vec<f32> {
    let length = curl.iter().map(|angle| angle * angle).sum::<f32>().sqrt();
    let mut mirror: Vec<f32> = curl.iter().map(|angle| angle / length).collect();
    mirror[0] -= 1.0;
    let squared: f32 = mirror.iter().map(|entry| entry * entry).sum();
    let entry =
        |row: usize, column: usize| f32::from(u8::from(row == column)) - 2.0 * mirror[row] * mirror[column] / squared;
    let size = curl.len();
    (0..size * size).map(|at| entry(at / size, at % size)).collect()
}
