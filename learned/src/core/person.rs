//! A body with one subject's template and joints: no shapes are left, expressions and correctives are the body's.

use xavatar_body::{Anatomy, BlendShapes, BodyModel, Correctives, JointBasis};
use xavatar_formats::Result;

use super::{FittedBody, Identity};

/// One subject's body, ready to be fitted.
pub struct Person {
    /// At rest.
    pub identity: Identity,
    /// As it is fitted.
    pub body: FittedBody,
}

impl Person {
    /// Of a body with this identity.
    ///
    /// # Errors
    /// Those of [`BodyModel::assemble`].
    pub fn new(model: &BodyModel, identity: Identity) -> Result<Self> {
        let body = FittedBody::of(&with_identity(model, &identity)?);
        Ok(Self { identity, body })
    }
}

/// A body with this template and these joints instead of its shapes.
///
/// # Errors
/// Those of [`BodyModel::assemble`].
pub fn with_identity(model: &BodyModel, identity: &Identity) -> Result<BodyModel> {
    let anatomy = model.anatomy();
    let shapes = anatomy.shape_coefficients();
    let expressions: Vec<Vec<f32>> = anatomy.shapes.directions().skip(shapes).map(<[f32]>::to_vec).collect();
    let personal = Anatomy {
        template: identity.template.iter().map(|place| place.as_vec3()).collect(),
        shapes: BlendShapes::from_directions(expressions),
        joints: JointBasis {
            template: identity.joints.clone(),
            directions: anatomy.joints.directions[shapes..].to_vec(),
        },
        correctives: undriven(&anatomy.correctives),
        ..anatomy.clone()
    };
    BodyModel::assemble(model.path(), personal)
}

/// The correctives without the one that a coefficient of shape drives: at zero, which is where a personal body has it, it does nothing.
pub fn undriven(correctives: &Correctives) -> Correctives {
    match correctives {
        Correctives::Quaternions { first_joint, coefficient: Some(_), shapes } => {
            let turned = shapes.directions().take(shapes.count() - 1).map(<[f32]>::to_vec).collect();
            let shapes = BlendShapes::from_directions(turned);
            Correctives::Quaternions { first_joint: *first_joint, coefficient: None, shapes }
        }
        other => other.clone(),
    }
}
