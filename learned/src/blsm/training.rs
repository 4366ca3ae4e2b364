//! A BLSM body of registrations (METHOD-BODY 9.4): bones, then flesh, then weights, twice.
//!
//! (a) Every person's poses, bones, each free, and flesh T; (b) the modes of the bones' lengths; (c) poses and flesh again with bones of these modes;
//! (d) template and correctives are least squares of all people's T on [1 | c_b]; (f) shapes are principal components of what is left; (g) weights, by
//! what each joint alone would do to T. Takes of a person, each a folder, share bones; flesh each has its own, as clothes are other ones. V vertices; metres.

use glam::DVec3;
use nalgebra::DMatrix;
use rayon::prelude::*;
use xavatar_body::BodyModel;
use xavatar_formats::Result;

use super::bones::{BoneModes, bone_modes};
use super::own_bones::Person;
use super::people_bones::{SaidOfBones, bones_of_people};
use super::state::Steps;
use super::takes::{Take, takes_of};
use super::{Atoms, BlsmBody, BlsmFit, BlsmParameters, ScaledSkeleton};
use crate::core::{Grown, Identity, WeightMoments, WeightRow, shapes_of, weight_rows};
use crate::kept::Kept;
use crate::registrations::Registrations;

/// Rounds.
const ROUNDS: usize = 2;
/// Deviation of a free bone's scale that costs as much as a coefficient of 1.
const FREE_BONE: f64 = 0.1;
/// Modes of bones are kept up to this share of the variance, and at most so many.
const SHARE: f64 = 0.97;
const MODES: usize = 6;
/// What holds correctives to zero, beside the people: modes have unit variance.
const RIDGE: f64 = 0.1;

/// How a body is trained.
#[derive(Clone, Copy, Debug)]
pub struct BlsmTraining {
    /// Shapes at most.
    pub shapes: usize,
    /// Leave skinning weights as they are.
    pub keep_weights: bool,
}

/// What was trained.
#[derive(Clone, Debug)]
pub struct TrainedBlsm {
    /// The body.
    pub body: BlsmBody,
    /// Each person's coefficients of bones.
    pub people: Vec<Vec<f64>>,
    /// Each take's coefficients of shape, in the order of people.
    pub takes: Vec<Vec<f64>>,
    /// The share of the variance of lengths that the modes of bones have.
    pub explained: f64,
    /// The mean distance of a vertex of the registrations after each round, metres.
    pub distances: Vec<f64>,
    /// What the flesh of each take has beside the template and what it does with the bones (N, V).
    pub flesh: Vec<Vec<DVec3>>,
}

impl BlsmTraining {
    /// Trains a body that begins as `start`: with its skeleton, weights and template; none if that was stopped, and what is kept is gone on with. `progress` is told
    /// the share that is done.
    ///
    /// # Errors
    /// Those of reading registrations and what is kept; what `progress` returns.
    pub fn train(
        &self,
        start: &BodyModel,
        registrations: &Registrations,
        kept: &mut Kept<'_>,
        mut progress: impl FnMut(f64) -> Result<()>,
    ) -> Result<Option<TrainedBlsm>> {
        let subjects = registrations.subjects.len();
        let first = BlsmBody::of(start);
        let grown = Grown::of(&first.weights, &first.faces);
        let mut steps = Steps::begun(start, subjects, kept)?;
        while steps.step < 2 * ROUNDS {
            let is_free = steps.step.is_multiple_of(2);
            let free = steps.body.with_free_bones();
            for (index, subject) in registrations.subjects.iter().enumerate() {
                if steps.found.get(index) == Some(&steps.step) {
                    continue;
                }
                if kept.is_stopped() {
                    return Ok(None);
                }
                progress((steps.step as f64 + index as f64 / subjects as f64) / (2 * ROUNDS) as f64)?;
                let before = steps.people.get(index).cloned();
                let frames = registrations.read_all(subject)?;
                let person = match before {
                    Some(mut person) if !is_free => {
                        let bones = &steps.bones[index];
                        person.frames.iter_mut().for_each(|frame| frame.bones.clone_from(bones));
                        person.find_modes(&steps.body, &frames);
                        person
                    }
                    before => Person::of(&free, &frames, before.map(|person| freed(person, &steps.body))),
                };
                steps.set_person(index, person, kept)?;
            }
            if is_free {
                let modes = modes_of(&free, steps.people.iter_mut());
                steps.explained = modes.explained.iter().take(modes.basis.len()).sum();
                steps.bones = modes.coefficients;
                steps.body.set_modes(modes.mean, modes.basis);
            } else {
                self.find_flesh(&mut steps, &grown, registrations)?;
            }
            steps.step += 1;
            steps.keep(kept)?;
        }
        let flesh = takes_of(&steps.body, registrations, &steps.people)?;
        let flesh = flesh.iter().map(|take| steps.body.own_flesh(&take.own.flesh, &steps.bones[take.person])).collect();
        let Steps { body, bones, shapes, explained, distances, .. } = steps;
        Ok(Some(TrainedBlsm { people: bones, takes: shapes, explained, distances, flesh, body }))
    }

    /// Template, correctives, shapes and weights of people whose poses, bones and flesh were found, and how near they are.
    fn find_flesh(&self, steps: &mut Steps, grown: &Grown, registrations: &Registrations) -> Result<()> {
        let Steps { body, people, bones, shapes, distances, .. } = steps;
        *bones = people.iter().map(|person| person.frames[0].bones.clone()).collect();
        let takes = takes_of(body, registrations, people)?;
        *shapes = body.learn_flesh(&takes, bones, self.shapes);
        if !self.keep_weights {
            body.weights = weights(body, grown, registrations, &takes)?;
        }
        distances.push(distance(body, registrations, &takes, shapes)?);
        Ok(())
    }
}

/// The modes in which people's bones differ, bones of whom registrations say little being as in others; people have these bones then.
fn modes_of<'a>(free: &BlsmBody, people: impl Iterator<Item = &'a mut Person>) -> BoneModes {
    let mut people: Vec<&mut Person> = people.collect();
    let said: Vec<SaidOfBones> = people.iter().map(|person| person.said.clone()).collect();
    for (person, bones) in people.iter_mut().zip(bones_of_people(&said, MODES).unwrap_or_default()) {
        person.frames.iter_mut().for_each(|frame| frame.bones = bones.as_slice().to_vec());
    }
    let lengths: Vec<Vec<f64>> = people.iter().map(|person| free.lengths(&person.frames[0].bones)).collect();
    bone_modes(&lengths, &free.rest_lengths(), SHARE, MODES)
}

/// Weights (V) by what each joint alone would do to the flesh of takes.
fn weights(
    body: &BlsmBody,
    grown: &Grown,
    registrations: &Registrations,
    takes: &[Take<'_>],
) -> Result<Vec<WeightRow>> {
    let mut moments = WeightMoments::new(grown);
    let plain = BlsmBody { shape_basis: Vec::new(), ..body.clone() };
    for Take { files, own, .. } in takes {
        for (file, parameters) in files.iter().zip(&own.frames) {
            let skeleton = plain.posed(parameters).skeleton;
            moments.add(&registrations.read(file)?, |vertex, joint| skeleton.moved(joint, own.flesh[vertex]));
        }
    }
    Ok(moments.solve())
}

/// The mean distance of a vertex of the registrations from the body in its people's bones and the shapes of their takes.
fn distance(body: &BlsmBody, registrations: &Registrations, takes: &[Take<'_>], shapes: &[Vec<f64>]) -> Result<f64> {
    let fit = BlsmFit::new(body, 0.0);
    let mut sum = 0.0;
    for (Take { files, own, .. }, shape) in takes.iter().zip(shapes) {
        for (file, parameters) in files.iter().zip(&own.frames) {
            let parameters = BlsmParameters { shape: shape.clone(), ..parameters.clone() };
            sum += fit.distance(&parameters, &registrations.read(file)?);
        }
    }
    Ok(sum / registrations.frames() as f64)
}

/// The same person, with the modes' bones as free ones.
fn freed(mut person: Person, body: &BlsmBody) -> Person {
    for frame in &mut person.frames {
        let scales = body.scales(&frame.bones);
        let free = scales[1..].iter().zip(&body.bone_mean[1..]).map(|(scale, mean)| (scale - mean) / FREE_BONE);
        frame.bones = free.collect();
    }
    person
}

impl BlsmBody {
    /// With the skeleton, weights and mean shape of a body, mean bones and no modes.
    pub fn of(model: &BodyModel) -> Self {
        let identity = Identity::of(model);
        let skeleton = model.skeleton();
        Self {
            skeleton: ScaledSkeleton::of(&skeleton.joints, &skeleton.parents, &identity.joints),
            atoms: Atoms::of(&skeleton.joints),
            names: skeleton.joints.clone(),
            template: identity.template,
            faces: model.faces().to_vec(),
            weights: weight_rows(model),
            bone_mean: vec![1.0; skeleton.joints.len()],
            bone_basis: Vec::new(),
            bone_correctives: Vec::new(),
            shape_basis: Vec::new(),
        }
    }

    /// With a mode for every bone, and the same shapes.
    fn with_free_bones(&self) -> Self {
        let joints = self.names.len();
        let mode = |bone: usize| {
            let mut mode = vec![0.0; joints];
            mode[bone] = FREE_BONE;
            mode
        };
        Self {
            bone_basis: (1..joints).map(mode).collect(),
            bone_correctives: vec![Vec::new(); joints - 1],
            ..self.clone()
        }
    }

    /// What flesh (V) has beside the template and what it does with these bones.
    fn own_flesh(&self, flesh: &[DVec3], bones: &[f64]) -> Vec<DVec3> {
        let mut left: Vec<DVec3> = flesh.iter().zip(&self.template).map(|(place, mean)| *place - *mean).collect();
        for (corrective, coefficient) in self.bone_correctives.iter().zip(bones) {
            left.iter_mut().zip(corrective).for_each(|(left, offset)| *left -= *offset * *coefficient);
        }
        left
    }

    /// The lengths of bones (J - 1) of coefficients.
    fn lengths(&self, bones: &[f64]) -> Vec<f64> {
        self.scales(bones)[1..].iter().zip(self.rest_lengths()).map(|(scale, length)| scale * length).collect()
    }

    fn rest_lengths(&self) -> Vec<f64> {
        self.skeleton.offsets[1..].iter().map(|offset| offset.length()).collect()
    }

    /// Modes of bones (J - 1); correctives are unknown, so none.
    fn set_modes(&mut self, mean: Vec<f64>, basis: Vec<Vec<f64>>) {
        self.bone_mean = [vec![1.0], mean].concat();
        self.bone_basis = basis.into_iter().map(|mode| [vec![0.0], mode].concat()).collect();
        self.bone_correctives = vec![vec![DVec3::ZERO; self.template.len()]; self.bone_basis.len()];
    }

    /// Template, correctives and shapes of takes (N) of people with these bones (P, K); the coefficients of the takes' shapes.
    fn learn_flesh(&mut self, takes: &[Take<'_>], bones: &[Vec<f64>], shapes: usize) -> Vec<Vec<f64>> {
        let modes = self.bone_basis.len();
        let design = DMatrix::from_fn(takes.len(), modes + 1, |take, column| match column {
            0 => 1.0,
            mode => bones[takes[take].person][mode - 1],
        });
        let mut normal = design.transpose() * &design;
        (1..=modes).for_each(|mode| normal[(mode, mode)] += RIDGE);
        let Some(factor) = normal.cholesky() else { return vec![Vec::new(); takes.len()] };
        let solved = factor.solve(&design.transpose());
        let vertices = self.template.len();
        let of_column = |column: usize| -> Vec<DVec3> {
            let place = |vertex: usize| {
                takes.iter().enumerate().map(|(at, of)| of.own.flesh[vertex] * solved[(column, at)]).sum()
            };
            (0..vertices).into_par_iter().map(place).collect()
        };
        self.bone_correctives = (1..=modes).map(of_column).collect();
        self.template = of_column(0);
        let left = |take: &Take<'_>| Identity {
            template: self.own_flesh(&take.own.flesh, &bones[take.person]),
            joints: Vec::new(),
        };
        let residuals: Vec<Identity> = takes.iter().map(left).collect();
        let space = shapes_of(&residuals, shapes);
        self.template.iter_mut().zip(&space.mean).for_each(|(place, mean)| *place += *mean);
        self.shape_basis = space.directions;
        space.coefficients
    }
}
