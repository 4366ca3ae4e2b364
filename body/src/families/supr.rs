//! SUPR (Osman 2022) and its parts: quaternion correctives with the root's, and joints as an affine function of the shaped vertices.
//!
//! The regressor is (3 J, 3 V + 1) on [vertices row by row | 1]. The file has the tree; names where it has none are `joint_00` and on. Where
//! expressions begin among the coefficients is not in the file: all are shape.

use glam::DVec3;

use super::Family;
use super::layout::part;
use crate::model_file::{ModelFile, points};
use crate::{Anatomy, BlendShapes, Coefficients, Correctives, JointBasis, PoseAxisAngle, Role, Skeleton};
use xavatar_formats::Result;

/// Coefficients of shape that are used where not all are asked for.
const SHAPES: usize = 10;

/// How its files are found, recognised and read.
pub(super) const FAMILY: Family = Family {
    name: "SUPR",
    format: "SUPR model",
    stem: "SUPR",
    recognises: |file| match (file.joints(), file.vertices()) {
        (Some(joints), Some(vertices)) => file.shape("J_regressor") == Some(&[3 * joints, 3 * vertices + 1]),
        _ => false,
    },
    read,
};

fn skeleton(parents: Vec<Option<usize>>) -> Skeleton {
    let joints = parents.len();
    Skeleton {
        family: FAMILY.name.into(),
        joints: (0..joints).map(|joint| format!("joint_{joint:02}")).collect(),
        parents,
        parts: vec![part("body", Role::Body, (0..joints).collect(), (0..joints).collect())],
        starts: (0..joints).collect(),
        canonical: vec![PoseAxisAngle::default(); joints],
        conditioning: (1..joints).collect(),
    }
}

fn read(file: &ModelFile, coefficients: Coefficients) -> Result<Anatomy> {
    let template = file.template()?;
    let parents = file.kinematic_tree()?;
    let (vertices, joints) = (template.len() / 3, parents.len());
    let columns = file.used_columns(SHAPES, coefficients)?;
    let (directions, shape) = file.floats("shapedirs", &[vertices, 3, 0])?;
    let stride = shape[2];
    let with_root = file.columns("posedirs") == Some(4 * joints);
    let first_joint = usize::from(!with_root);
    let width = 3 * vertices + 1;
    let (regressor, _) = file.floats("J_regressor", &[3 * joints, width])?;
    let regressed = |value: &dyn Fn(usize) -> f64, bias: f64| -> Vec<DVec3> {
        let row = |row: &[f64]| (0..width - 1).map(|at| row[at] * value(at)).sum::<f64>() + bias * row[width - 1];
        let joint =
            |rows: &[f64]| DVec3::new(row(&rows[..width]), row(&rows[width..2 * width]), row(&rows[2 * width..]));
        regressor.chunks_exact(3 * width).map(joint).collect()
    };
    Ok(Anatomy {
        faces: file.faces(vertices)?,
        skinning_weights: file.skinning_weights(vertices, joints)?,
        joints: JointBasis {
            template: regressed(&|at| template[at], 1.0),
            directions: (0..columns).map(|column| regressed(&|at| directions[at * stride + column], 0.0)).collect(),
        },
        shapes: BlendShapes::from_columns(&directions, stride, 0..columns),
        expressions: 0,
        template: points(&template),
        correctives: Correctives::Quaternions {
            first_joint,
            coefficient: None,
            shapes: file.correctives(vertices, 4 * (joints - first_joint))?,
        },
        hands: Vec::new(),
        skeleton: skeleton(parents),
    })
}
