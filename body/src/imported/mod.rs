//! What all bodies that are imported from other projects' data become: a body in SMPL-X's T-pose with its 55 joints, as a file of SMPL-X's
//! layout, with a joint regressor (`regressor`), hands (`hands`) and labels of parts (`labels`). V vertices, F faces; metres.

mod directions;
mod hands;
mod labels;
mod regressor;
mod turns;

use glam::DVec3;

pub(crate) use self::directions::{Direction, Directions};
pub(crate) use self::turns::{Arm, Finger, TurnedBones, leg_turn};
use crate::smplx;
use xavatar_formats::{Array, ArrayData, ArrayMap};

/// Where SMPL-X has the pelvis, metres.
pub(crate) const PELVIS: DVec3 = DVec3::new(0.0, -0.35, 0.01);
/// The joints.
const COUNT: usize = smplx::joint::COUNT;
/// Numbers of a pose that its correctives are linear in: nine of each joint's rotation but the root's.
pub(crate) const POSE_FEATURES: usize = 9 * (COUNT - 1);
/// Weights below this are none.
const NEGLIGIBLE: f64 = 1e-4;

/// A body of another project in the T-pose.
pub(crate) struct TPosedBody {
    /// Vertices (V).
    pub template: Vec<DVec3>,
    /// Corners of faces (F).
    pub faces: Vec<[u32; 3]>,
    /// Skinning weights (V, 55).
    pub weights: Vec<Vec<f64>>,
    /// Where the joints are (55).
    pub joints: Vec<DVec3>,
    pub directions: Directions,
    /// What the entries of rotations, less the identity's, move the vertices by (V, 3, 486); none if nothing is known of it.
    pub correctives: Option<Vec<f32>>,
}

/// What was made of it.
pub(crate) struct Assembled {
    /// The arrays of a model's file in SMPL-X's layout.
    pub model: ArrayMap,
    /// Which vertices are which part, as [`PartLabels`](crate::PartLabels) reads them beside a model.
    pub labels: ArrayMap,
    /// The largest distance of a regressed joint from its place, metres.
    pub joint_error: f64,
}

impl TPosedBody {
    /// The model's file, and the labels of its parts, given which vertices are inside the face.
    pub fn assembled(self, is_inside: impl Fn(usize) -> bool) -> Assembled {
        let Self { template, faces, weights, joints, directions, correctives } = self;
        let (regressor, joint_error) = regressor::fitted(&template, &weights, &joints, &directions);
        let regressed = regressor::applied(&regressor, &template);
        let labels = labels::of_parts(&template, &regressed, &weights, is_inside);
        let vertices = template.len();
        let parents = &smplx::skeleton().parents;
        let parents = parents.iter().map(|parent| parent.map_or(i64::from(u32::MAX), |parent| parent as i64));
        let tree: Vec<i64> = parents.chain(0..COUNT as i64).collect();
        let correctives = correctives.unwrap_or_else(|| vec![0.0; 3 * vertices * POSE_FEATURES]);
        let mut model = ArrayMap::new();
        let mut insert = |key: &str, shape: &[usize], data| {
            model.insert(key.to_owned(), Array { shape: shape.to_vec(), data });
        };
        insert("v_template", &[vertices, 3], ArrayData::F64(template.iter().flat_map(DVec3::to_array).collect()));
        let corners = faces.iter().flatten().map(|corner| i64::from(*corner));
        insert("f", &[faces.len(), 3], ArrayData::I64(corners.collect()));
        insert("weights", &[vertices, COUNT], ArrayData::F64(weights.concat()));
        insert("J_regressor", &[COUNT, vertices], ArrayData::F64(regressor.concat()));
        insert("kintree_table", &[2, COUNT], ArrayData::I64(tree));
        insert("shapedirs", &[vertices, 3, directions.count()], ArrayData::F32(directions.interleaved()));
        insert("posedirs", &[vertices, 3, POSE_FEATURES], ArrayData::F32(correctives));
        for (side, key) in [("left", 'l'), ("right", 'r')] {
            let space = hands::space(&regressed, side);
            insert(&format!("hands_mean{key}"), &[space.mean.len()], ArrayData::F64(space.mean.clone()));
            let components = [space.components.len(), space.mean.len()];
            insert(&format!("hands_components{key}"), &components, ArrayData::F64(space.components.concat()));
        }
        Assembled { model, labels, joint_error }
    }
}

/// The row of weights of SMPL-X's joints (55) of a vertex that follows bones of other names, each of which has become one of them.
pub(crate) fn collapsed_weights(row: &[(usize, f64)], joint_of: &[usize]) -> Vec<f64> {
    let mut collapsed = vec![0.0; COUNT];
    row.iter().for_each(|(bone, weight)| collapsed[joint_of[*bone]] += weight);
    collapsed.iter_mut().filter(|weight| **weight < NEGLIGIBLE).for_each(|weight| *weight = 0.0);
    let sum: f64 = collapsed.iter().sum();
    collapsed.iter_mut().for_each(|weight| *weight /= sum);
    collapsed
}
