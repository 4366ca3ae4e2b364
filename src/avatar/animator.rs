//! An avatar made ready for many poses: what no pose changes is made once.
//!
//! Every frame's surface is that of the union of all correspondences (thesis eq. 4.4-4.6), so that nothing is hidden in it. Most
//! of the time goes to the search: lattice points out of the registered body's reach are outside without one, and the mesh's
//! vertices take their canonical points from the lattice points they lie between.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use glam::Vec3;
use rand::Rng;
use rayon::prelude::*;

use super::{Avatar, Extraction, paint};
use crate::body::{BodyModel, PartLabels, Pose, Registration, Role};
use crate::fields::{CapturedPoints, Correspondence, FieldPose, Fields, FittedPose, PoseFit, PosedField, Poser};
use crate::mesh::{
    Component, ExtractedSurface, Pocket, SolidIndex, SurfaceSampler, TriangleMesh, extract, largest_with_pockets,
};
use crate::{Error, Result};

/// Points farther than this from the registered body are outside without a search, metres.
const REACH: f32 = 0.25;
/// Two neighbours' canonical points are on one sheet of the body if they are less than this many lattice edges apart.
const SHEET: f32 = 4.0;

/// A pocket of air is kept if it encloses more than this, m^3: smaller ones lie between folds of skin.
const POCKET: f64 = 2e-6;

/// Points of a scan that a pose is fitted to: of all of it, and of its hands besides, which are small.
const FITTED_POINTS: usize = 3000;
const FITTED_POINTS_OF_HANDS: usize = 1000;

/// An avatar with all that its poses share: the body model, the sampled skinning weights, the search's starts.
pub struct Animator<'a> {
    avatar: &'a Avatar,
    body: BodyModel,
    labels: &'a PartLabels,
    poser: Poser,
    /// The avatar's fields; skinning on a grid knows the starts that can be left out.
    fields: Fields<f32>,
}

impl<'a> Animator<'a> {
    /// Makes `avatar` ready to be posed by `body`, whose vertices' parts are `labels`.
    ///
    /// # Errors
    /// If the body is of another skeleton, or the skinning field cannot be sampled on the configured grid.
    pub fn new(avatar: &'a Avatar, body: &BodyModel, labels: &'a PartLabels) -> Result<Self> {
        let Avatar { config, subject, .. } = avatar;
        let body = body.in_canonical_pose_of(&subject.skeleton)?;
        let mut fields = avatar.fields.clone();
        let mut poser = Poser::for_surfaces(config, &body, labels, &subject.betas, subject.bounds)?;
        poser.prune_starts(&mut fields.skinning)?;
        poser.bake(&fields.skinning)?;
        Ok(Self { avatar, body, labels, poser, fields })
    }

    /// The avatar.
    pub fn avatar(&self) -> &'a Avatar {
        self.avatar
    }

    /// The surface in a pose, in the avatar's own shape: without hidden surfaces; in the world. `resolution` cells along the
    /// longest side of the box around the posed body.
    ///
    /// # Errors
    /// As [`Avatar::extract_canonical`], and if the pose does not fit the body model.
    pub fn extract(&self, pose: &Pose, resolution: usize) -> Result<Extraction> {
        let pose = pose.in_shape(&self.avatar.subject.betas);
        let vertices: Vec<Vec3> =
            self.body.pose(&pose)?.vertices.iter().map(|vertex| *vertex - pose.translation).collect();
        let field_pose = FieldPose::new(&self.body, &pose)?;
        let posed = self.poser.pose(&self.fields, &field_pose, &field_pose.condition)?;
        let queries = Queries {
            posed: &posed,
            registration: Registration::new(&vertices, self.labels)?,
            roots: Mutex::default(),
            failure: Mutex::default(),
        };
        let corner = |fold: fn(Vec3, Vec3) -> Vec3| vertices.iter().copied().reduce(fold).unwrap_or_default();
        let (minimum, maximum) = (corner(Vec3::min) - REACH, corner(Vec3::max) + REACH);
        let extracted =
            extract(&|points, values| queries.values(points, values), self.avatar.grid(minimum, maximum, resolution));
        let roots = queries.finish()?;
        let ExtractedSurface { mesh, edges } = extracted?;
        let body = self.body.mesh(vertices);
        let Component { mut mesh, vertices, others } = largest_with_pockets(&mesh, |pocket| is_worn(pocket, &body));
        let canonical: Vec<[f32; 3]> = mesh
            .vertices
            .iter()
            .zip(&vertices)
            .map(|(vertex, index)| canonical_guess(*vertex, edges[*index as usize], &roots))
            .collect();
        let (canonical, jacobians) = posed.warp.refined(&canonical, &mesh.vertices);
        paint(&mut mesh, posed.evaluator.posed_shades(&canonical, &jacobians)?);
        mesh.vertices.iter_mut().for_each(|vertex| *vertex += pose.translation);
        Ok(Extraction { mesh, dropped_components: others })
    }

    /// The pose near a registered one in which the avatar lies on a scan, in its own shape. Faces are as registered.
    ///
    /// # Errors
    /// As [`PoseFit::fit`]; if the scan has no surface.
    pub fn fitted(&self, scan: &TriangleMesh, registered: &Pose, random: &mut impl Rng) -> Result<FittedPose> {
        let registered = registered.in_shape(&self.avatar.subject.betas);
        let vertices = self.body.pose(&registered)?.vertices;
        let registration = Registration::new(&vertices, self.labels)?;
        let skeleton = self.body.skeleton();
        let is_of_hand = |face: &u32| {
            let centre = scan.corners(*face).into_iter().sum::<Vec3>() / 3.0;
            skeleton.role(registration.nearest(centre).0) == Role::Hands
        };
        let hands: Vec<u32> = (0..scan.faces.len() as u32).filter(is_of_hand).collect();
        let mut captured = CapturedPoints::default();
        for (faces, count) in [(None, FITTED_POINTS), (Some(hands.as_slice()), FITTED_POINTS_OF_HANDS)] {
            if faces.is_some_and(<[u32]>::is_empty) {
                continue;
            }
            let sampler = SurfaceSampler::new(scan, faces)?;
            for _ in 0..count {
                let point = scan.position_at(&sampler.sample(random));
                captured.points.push(point);
                captured.labels.push(registration.nearest(point).0.0);
            }
        }
        let fit = PoseFit::new(&self.body, |role| role != Role::Face);
        fit.fit((&self.poser, &self.fields), &captured, &registered, &registered)
    }
}

/// Whether a pocket is enclosed by what the body wears: between face and hair, in a hood. Inside the body there is no air.
fn is_worn(Pocket { volume, centre }: Pocket, body: &TriangleMesh) -> bool {
    volume > POCKET && SolidIndex::new(body).is_ok_and(|body| !body.is_inside(centre))
}

/// Canonical points by deformed point, bit for bit.
type Roots = HashMap<[u32; 3], Vec3>;

/// One frame's field on the extraction's lattice.
struct Queries<'a> {
    posed: &'a PosedField<'a>,
    registration: Registration<'a>,
    /// Of every point that has one, the winning canonical point.
    roots: Mutex<Roots>,
    /// The first error of a search; the extraction knows values only.
    failure: Mutex<Option<Error>>,
}

impl Queries<'_> {
    /// Writes the values at points (N): the union's, or outside.
    fn values(&self, points: &[Vec3], values: &mut [f32]) {
        values.fill(self.posed.evaluator.fields().geometry.representation.outside());
        match self.correspondences(points) {
            Ok(found) => {
                let mut roots = self.roots.lock().unwrap_or_else(PoisonError::into_inner);
                for (index, found) in found {
                    values[index] = found.value;
                    roots.insert(key(points[index]), Vec3::from_array(found.canonical));
                }
            }
            Err(error) => {
                self.failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
            }
        }
    }

    /// The winning correspondences of those points that have one.
    fn correspondences(&self, points: &[Vec3]) -> Result<Vec<(usize, Correspondence)>> {
        let nearest: Vec<_> = points.par_iter().map(|point| self.registration.nearest(*point)).collect();
        let near: Vec<usize> = (0..points.len()).filter(|index| nearest[*index].1 < REACH).collect();
        let targets: Vec<_> = near.iter().map(|index| points[*index].to_array()).collect();
        let labels: Vec<_> = near.iter().map(|index| nearest[*index].0.0).collect();
        let found = self.posed.correspondences(&targets, &labels)?;
        Ok(near.into_iter().zip(found).filter_map(|(index, found)| Some((index, found?))).collect())
    }

    fn finish(self) -> Result<Roots> {
        match self.failure.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(error),
            None => Ok(self.roots.into_inner().unwrap_or_else(PoisonError::into_inner)),
        }
    }
}

fn key(point: Vec3) -> [u32; 3] {
    point.to_array().map(f32::to_bits)
}

/// About where a vertex on a lattice edge came from: between the canonical points of the edge's ends if they are on one sheet of
/// the body, else at the inside one's.
fn canonical_guess(vertex: Vec3, [inside, outside]: [Vec3; 2], roots: &Roots) -> [f32; 3] {
    let length = inside.distance(outside);
    // An inside point has a value of its own, so a correspondence.
    let from = roots.get(&key(inside)).copied().unwrap_or(vertex);
    let to = roots.get(&key(outside)).filter(|to| to.distance(from) < SHEET * length).copied().unwrap_or(from);
    from.lerp(to, inside.distance(vertex) / length).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::BuiltInSubject;

    // A pocket under a hood, one as large inside of the chest, and bubbles.
    #[test]
    fn pockets_that_clothes_enclose_are_worn_and_those_of_the_body_are_not() {
        let subject = BuiltInSubject::new().unwrap();
        let model = subject.model();
        let body = model.mesh(model.template().to_vec());
        let joints = model.pose(&model.skeleton().rest_pose()).unwrap().joints;
        let joint = |name: &str| joints[model.skeleton().joint(name).unwrap()];
        let worn = |volume: f64, centre: Vec3| is_worn(Pocket { volume, centre }, &body);
        let over_the_head = joint("head") + Vec3::Y * 0.4;
        assert!(worn(1e-5, over_the_head) && !worn(1e-6, over_the_head));
        assert!(!worn(1e-5, joint("spine2")));
    }
}
