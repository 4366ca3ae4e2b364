//! SUPR (Osman 2022) and its parts: quaternion correctives with the root's, and joints as an affine function of the shaped vertices.
//!
//! The regressor is (3 J, 3 V + 1) on [vertices row by row | 1]. The file has the tree; names where it has none are `joint_00` and on. Where
//! expressions begin among the coefficients is not in the file: all are shape. What this program writes in this layout
//! ([`BodyModel::to_arrays`](crate::BodyModel::to_arrays)) says more: names of joints, how many of the last columns are expressions, mean hands; and its
//! correctives may be none, or driven by entries of rotations.

use glam::DVec3;

use super::layout::part;
use super::{Family, smpl, smplh, smplx};
use crate::model_file::{ModelFile, points};
use crate::{Anatomy, BlendShapes, Coefficients, Correctives, HandSpace, JointBasis, PoseAxisAngle, Role, Skeleton};
use xavatar_formats::{Array, Result};

/// Coefficients of shape, and of expression, that are used where not all are asked for.
const USUAL: usize = 10;
/// The joints' names, a line each.
pub(crate) const JOINT_NAMES: &str = "joint_names";
/// How many of the last shapes are expressions.
pub(crate) const EXPRESSIONS: &str = "expressions";
/// A hand's mean and its components, left and right.
pub(crate) const HANDS: [[&str; 2]; 2] = [["hands_meanl", "hands_componentsl"], ["hands_meanr", "hands_componentsr"]];

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

/// The skeleton of a tree: that of a family whose joints have these names, else one part that is all.
fn skeleton(parents: Vec<Option<usize>>, names: Option<Vec<String>>) -> Skeleton {
    let joints = parents.len();
    let known = [smplx::skeleton(), smplh::skeleton(), smpl::skeleton()];
    if let Some(known) =
        known.into_iter().find(|known| known.parents == parents && Some(&known.joints) == names.as_ref())
    {
        return Skeleton { family: FAMILY.name.into(), ..known.clone() };
    }
    Skeleton {
        family: FAMILY.name.into(),
        joints: names.unwrap_or_else(|| (0..joints).map(|joint| format!("joint_{joint:02}")).collect()),
        parents,
        parts: vec![part("body", Role::Body, (0..joints).collect(), (0..joints).collect())],
        starts: (0..joints).collect(),
        canonical: vec![PoseAxisAngle::default(); joints],
        conditioning: (1..joints).collect(),
    }
}

/// The names in the file, if it has any.
fn names(file: &ModelFile, joints: usize) -> Result<Option<Vec<String>>> {
    let Some(array) = file.arrays.get(JOINT_NAMES) else { return Ok(None) };
    let names: Option<Vec<String>> = array.text().map(|text| text.lines().map(str::to_owned).collect());
    match names.filter(|names| names.len() == joints) {
        Some(names) => Ok(Some(names)),
        None => Err(file.malformed(JOINT_NAMES, array.description(), format!("{joints} lines"))),
    }
}

/// How many of the last of `columns` are expressions.
fn expressions(file: &ModelFile, columns: usize) -> Result<usize> {
    let Some(array) = file.arrays.get(EXPRESSIONS) else { return Ok(0) };
    let found = array.to_indices(columns + 1).filter(|values| values.len() == 1);
    let found = found.ok_or_else(|| file.malformed(EXPRESSIONS, array.description(), format!("at most {columns}")))?;
    Ok(found[0] as usize)
}

fn hands(file: &ModelFile) -> Result<Vec<HandSpace>> {
    let has_both = HANDS.iter().flatten().all(|key| file.shape(key).is_some());
    let sides = HANDS.iter().filter(|_| has_both);
    sides.map(|[mean, components]| file.hand_space(mean, components)).collect()
}

fn correctives(file: &ModelFile, vertices: usize, joints: usize) -> Result<Correctives> {
    let of = |features| file.correctives(vertices, features);
    match file.columns("posedirs") {
        None => Ok(Correctives::None),
        Some(found) if joints > 1 && found == 9 * (joints - 1) => Ok(Correctives::RotationEntries(of(found)?)),
        found => {
            let first_joint = usize::from(found != Some(4 * joints));
            let shapes = of(4 * (joints - first_joint))?;
            Ok(Correctives::Quaternions { first_joint, coefficient: None, shapes })
        }
    }
}

fn read(file: &ModelFile, coefficients: Coefficients) -> Result<Anatomy> {
    let template = file.template()?;
    let parents = file.kinematic_tree()?;
    let (vertices, joints) = (template.len() / 3, parents.len());
    let (directions, shape) = file.floats("shapedirs", &[vertices, 3, 0])?;
    let stride = shape[2];
    let expressions = expressions(file, stride)?;
    // Bodies that were trained on few people have as many shapes as they could have.
    let most = if file.shape(EXPRESSIONS).is_some() { USUAL.min(stride - expressions) } else { USUAL };
    let shapes = file.used_columns(most, coefficients)?.min(stride - expressions);
    let used_expressions = if coefficients == Coefficients::All { expressions } else { expressions.min(USUAL) };
    let first = stride - expressions;
    let used = || (0..shapes).chain(first..first + used_expressions);
    let width = 3 * vertices + 1;
    let (regressor, _) = file.floats("J_regressor", &[3 * joints, width])?;
    let entries: Vec<Vec<(usize, f64)>> = regressor.chunks_exact(width).map(nonzero).collect();
    let regressed = |value: &dyn Fn(usize) -> f64, bias: f64| -> Vec<DVec3> {
        let row = |row: &Vec<(usize, f64)>| {
            row.iter().map(|(at, weight)| weight * if *at == width - 1 { bias } else { value(*at) }).sum::<f64>()
        };
        entries.as_chunks::<3>().0.iter().map(|rows| DVec3::new(row(&rows[0]), row(&rows[1]), row(&rows[2]))).collect()
    };
    Ok(Anatomy {
        faces: file.faces(vertices)?,
        skinning_weights: file.skinning_weights(vertices, joints)?,
        joints: JointBasis {
            template: regressed(&|at| template[at], 1.0),
            directions: used().map(|column| regressed(&|at| directions[at * stride + column], 0.0)).collect(),
        },
        shapes: BlendShapes::from_columns(&directions, stride, used()),
        expressions: used_expressions,
        template: points(&template),
        correctives: correctives(file, vertices, joints)?,
        hands: hands(file)?,
        skeleton: skeleton(parents, names(file, joints)?),
    })
}

/// The entries of a row that are not zero, with their places.
fn nonzero(row: &[f64]) -> Vec<(usize, f64)> {
    row.iter().copied().enumerate().filter(|(_, weight)| *weight != 0.0).collect()
}

/// A scalar as an array of a file.
pub(crate) fn scalar(value: usize) -> Array {
    Array { shape: vec![1], data: xavatar_formats::ArrayData::I64(vec![value as i64]) }
}
