//! Facial actions as named morphs of a rigged avatar. In the bind pose, with H the head's turn in it, an action moves a vertex x of the avatar by
//!
//! ```text
//! sum_k e_k d_k(x) + sum_b w_b(x) (H r_b) x (x - p_b) + w_head(x) H rest(y)
//! ```
//!
//! with e and r what the body's fit found ([`FittedUnit`]), d the rig's expressions, w its weights, p its joints, and y the point of the
//! body's surface closest to x. So what the body's expressions can do is done as the avatar has learned it, and the rest is the body's. Metres.

use std::fmt::{self, Display, Formatter};

use glam::{DVec3, Mat3A, Vec3};
use serde::Serialize;

use super::rig::{Morph, RiggedMesh};
use crate::avatar::Subject;
use crate::body::{BodyModel, FaceUnits, FittedUnit, SurfaceMap, UnitError};
use crate::{Error, InputError, Result};

/// Vertices that follow the head less than this have no part in a face.
const FOLLOWS: f32 = 0.05;
/// In a metre.
const MILLIMETRES: f64 = 1e3;

/// How far facial actions are from what they should be.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FaceUnitReport {
    /// One a row.
    pub units: Vec<FaceUnitErrors>,
}

/// An action's.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FaceUnitErrors {
    /// ARKit's name.
    pub name: String,
    /// On the body, by its expressions, jaw and eyes alone.
    pub fit: UnitError,
    /// On the avatar, of the morph that is written, against the action of the body's closest point.
    pub morph: UnitError,
}

impl RiggedMesh {
    /// Adds facial actions as morphs of their names, which the clip leaves alone; `body` is the model that the avatar was rigged with.
    ///
    /// # Errors
    /// [`InputError::Mismatch`] for a body model without a head; as [`FaceUnits::fitted`] and [`BodyModel::canonical_vertices`].
    pub fn with_face_units(
        mut self,
        subject: &Subject,
        body: &BodyModel,
        units: &FaceUnits,
    ) -> Result<(Self, FaceUnitReport)> {
        let fitted = units.fitted(body, &subject.betas)?;
        let face = Face::of(&self, subject, body)?;
        let (mut morphs, mut report) = (Vec::new(), FaceUnitReport { units: Vec::new() });
        for unit in fitted {
            let offsets = face.offsets(&self, &unit);
            let wanted = face.carried(&unit.offsets);
            let apart = face
                .vertices
                .iter()
                .zip(&wanted)
                .map(|(vertex, wanted)| (f64::from(wanted.length()), f64::from(wanted.distance(offsets[*vertex]))));
            report.units.push(FaceUnitErrors { name: unit.name.clone(), fit: unit.error, morph: UnitError::of(apart) });
            morphs.push(Morph::new(unit.name, offsets));
        }
        let (count, added) = (self.morphs.len(), morphs.len());
        let rows = self.animation.morph_weights.chunks(count.max(1)).map(<[f32]>::to_vec);
        let rows: Vec<Vec<f32>> = match count {
            0 => vec![Vec::new(); self.animation.frames()],
            _ => rows.collect(),
        };
        self.animation.morph_weights =
            rows.into_iter().flat_map(|row| row.into_iter().chain(std::iter::repeat_n(0.0, added))).collect();
        self.morphs.extend(morphs);
        Ok((self, report))
    }

    /// How strongly a joint holds a vertex.
    fn weight(&self, vertex: usize, joint: usize) -> f32 {
        let row = vertex * self.influences..(vertex + 1) * self.influences;
        let held = self.skin_joints[row.clone()].iter().zip(&self.skin_weights[row]);
        held.filter(|(held, _)| usize::from(**held) == joint).map(|(_, weight)| *weight).sum()
    }
}

/// The vertices that follow the head, and where they are on the body (N).
struct Face {
    vertices: Vec<usize>,
    follows: Vec<f32>,
    map: SurfaceMap,
    turn: Mat3A,
}

impl Face {
    fn of(rigged: &RiggedMesh, subject: &Subject, body: &BodyModel) -> Result<Self> {
        let head = rigged.joints.iter().position(|joint| joint.name == "head").ok_or_else(|| {
            Error::from(InputError::Mismatch {
                path: body.path().into(),
                found: "a body without a head".into(),
                expected: "one with a face".into(),
                remedy: "leave the facial actions out".into(),
            })
        })?;
        let mut below = vec![false; rigged.joints.len()];
        for (joint, of) in rigged.joints.iter().enumerate() {
            below[joint] = joint == head || of.parent.is_some_and(|parent| below[parent]);
        }
        let follows = |vertex: usize| -> f32 {
            (0..below.len()).filter(|joint| below[*joint]).map(|joint| rigged.weight(vertex, joint)).sum()
        };
        let all = (0..rigged.mesh.vertices.len()).map(|vertex| (vertex, follows(vertex)));
        let (vertices, follows): (Vec<usize>, Vec<f32>) = all.filter(|(_, follows)| *follows > FOLLOWS).unzip();
        let body = body.in_canonical_pose_of(&subject.skeleton)?;
        let surface = body.canonical_vertices(&subject.betas, &[])?;
        let surface: Vec<DVec3> = surface.iter().map(|vertex| vertex.as_dvec3()).collect();
        let normals = rigged.mesh.vertex_normals();
        let of_face =
            |values: &[Vec3]| vertices.iter().map(|vertex| values[*vertex].as_dvec3()).collect::<Vec<DVec3>>();
        let (points, normals) = (of_face(&rigged.mesh.vertices), of_face(&normals));
        let map = SurfaceMap::new(&points, &surface, body.faces(), Some(&normals))?;
        Ok(Self { vertices, follows, map, turn: rigged.joints[head].inverse_bind.matrix3.transpose() })
    }

    /// Offsets of the body's vertices at rest, at the avatar's, in the bind pose (N).
    fn carried(&self, offsets: &[Vec3]) -> Vec<Vec3> {
        let offsets: Vec<DVec3> = offsets.iter().map(|offset| offset.as_dvec3()).collect();
        let found = self.map.points(&offsets);
        found.iter().zip(&self.follows).map(|(offset, follows)| self.turn * offset.as_vec3() * *follows).collect()
    }

    /// What an action moves the avatar's vertices by (V).
    fn offsets(&self, rigged: &RiggedMesh, unit: &FittedUnit) -> Vec<Vec3> {
        let mut offsets = vec![Vec3::ZERO; rigged.mesh.vertices.len()];
        let expressions = rigged.morphs.iter().filter(|morph| morph.is_expression());
        for (morph, amount) in expressions.zip(&unit.expression) {
            offsets.iter_mut().zip(&morph.offsets).for_each(|(sum, offset)| *sum += *offset * *amount);
        }
        for (joint, turn) in &unit.turns {
            let (axis, place) = (self.turn * *turn, rigged.joints[*joint].inverse_bind.inverse().translation);
            for vertex in &self.vertices {
                let arm = rigged.mesh.vertices[*vertex] - Vec3::from(place);
                offsets[*vertex] += axis.cross(arm) * rigged.weight(*vertex, *joint);
            }
        }
        for (vertex, rest) in self.vertices.iter().zip(self.carried(&unit.rest)) {
            offsets[*vertex] += rest;
        }
        offsets
    }
}

impl Display for FaceUnitReport {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "facial actions, mm:      moves   by the body's expressions, off (rms, max)   as written, off (rms, max)"
        )?;
        for FaceUnitErrors { name, fit, morph } in &self.units {
            let [size, fit_mean, fit_max, mean, max] =
                [fit.size, fit.root_mean_square, fit.max, morph.root_mean_square, morph.max]
                    .map(|metres| metres * MILLIMETRES);
            write!(formatter, "\n  {name:<20} {size:7.2} {fit_mean:28.2} {fit_max:8.2} {mean:21.2} {max:8.2}")?;
        }
        Ok(())
    }
}
