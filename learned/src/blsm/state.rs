//! What the training of a BLSM body keeps: the body that a step starts from, and every person as soon as the step found them.
//!
//! A round has two steps, free bones and then bones of the modes. A person's file says of which step it is. F frames of a person, N people, B bones, K modes.

use glam::{DMat3, DVec3};
use nalgebra::{DMatrix, DVector};
use xavatar_body::BodyModel;
use xavatar_formats::{ArrayMap, Result};

use super::own_bones::Person;
use super::people_bones::SaidOfBones;
use super::{BlsmBody, BlsmParameters};
use crate::descent::{count_of, of_count};
use crate::kept::Kept;
use crate::named_arrays::{NamedArrays, array, flat};

/// The part of what a step starts from.
const STEP: &str = "step";

/// A training between two steps.
pub(super) struct Steps {
    /// The step that is next.
    pub step: usize,
    pub body: BlsmBody,
    pub people: Vec<Person>,
    /// The step in which each person was found last.
    pub found: Vec<usize>,
    /// Each person's coefficients of bones.
    pub bones: Vec<Vec<f64>>,
    /// Each take's coefficients of shape.
    pub shapes: Vec<Vec<f64>>,
    /// The share of the variance of lengths that the modes of bones have.
    pub explained: f64,
    /// After each round.
    pub distances: Vec<f64>,
}

impl Steps {
    /// At the beginning, or where what is kept has it.
    pub fn begun(start: &BodyModel, subjects: usize, kept: &Kept<'_>) -> Result<Self> {
        let mut steps = Self {
            step: 0,
            body: BlsmBody::of(start),
            people: Vec::new(),
            found: Vec::new(),
            bones: Vec::new(),
            shapes: Vec::new(),
            explained: 0.0,
            distances: Vec::new(),
        };
        if let Some((path, arrays)) = kept.part(STEP)? {
            let file = NamedArrays::of_state(&path, &arrays);
            steps.step = count_of(&path, &arrays, STEP)? as usize;
            steps.body = BlsmBody::from_arrays(&path, &arrays)?;
            (steps.bones, steps.shapes) = (rows(file, "people.bones")?, rows(file, "takes.shapes")?);
            steps.explained = file.numbers("explained", &[])?[0];
            steps.distances = file.list("distances")?;
        }
        for subject in 0..subjects {
            let Some((path, arrays)) = kept.part(&part_of(subject))? else { break };
            steps.people.push(Person::from_arrays(NamedArrays::of_state(&path, &arrays), steps.body.template.len())?);
            steps.found.push(count_of(&path, &arrays, STEP)? as usize);
        }
        Ok(steps)
    }

    /// Keeps what the next step starts from.
    pub fn keep(&self, kept: &mut Kept<'_>) -> Result<()> {
        kept.keep(STEP, || {
            let table = |rows: &[Vec<f64>]| array(&[rows.len(), rows.first().map_or(0, Vec::len)], rows.concat());
            let mut arrays = self.body.to_arrays();
            arrays.extend([
                (STEP.to_owned(), of_count(self.step as u64)),
                ("people.bones".to_owned(), table(&self.bones)),
                ("takes.shapes".to_owned(), table(&self.shapes)),
                ("explained".to_owned(), array(&[], vec![self.explained])),
                ("distances".to_owned(), array(&[self.distances.len()], self.distances.clone())),
            ]);
            Ok(arrays)
        })
    }

    /// A person whom this step found, or none yet.
    pub fn set_person(&mut self, subject: usize, person: Person, kept: &mut Kept<'_>) -> Result<()> {
        kept.keep(&part_of(subject), || {
            let mut arrays = person.to_arrays();
            arrays.insert(STEP.into(), of_count(self.step as u64));
            Ok(arrays)
        })?;
        if subject < self.people.len() {
            (self.people[subject], self.found[subject]) = (person, self.step);
        } else {
            self.people.push(person);
            self.found.push(self.step);
        }
        Ok(())
    }
}

fn part_of(subject: usize) -> String {
    format!("person-{subject}")
}

/// The rows of a table.
fn rows(file: NamedArrays<'_>, name: &str) -> Result<Vec<Vec<f64>>> {
    let [count, width] = file.extents(name);
    let numbers = file.numbers(name, &[count, width])?;
    Ok((0..count).map(|row| numbers[row * width..(row + 1) * width].to_vec()).collect())
}

impl Person {
    fn to_arrays(&self) -> ArrayMap {
        let frames = self.frames.len();
        let table = |of: &dyn Fn(&BlsmParameters) -> Vec<f64>| {
            let width = self.frames.first().map_or(0, |frame| of(frame).len());
            array(&[frames, width], self.frames.iter().flat_map(of).collect())
        };
        let said = &self.said;
        let bones = said.vector.len();
        [
            ("turns", table(&|frame| frame.turn.to_cols_array().to_vec())),
            ("translations", table(&|frame| frame.translation.to_array().to_vec())),
            ("atoms", table(&|frame| frame.atoms.clone())),
            ("bones", table(&|frame| frame.bones.clone())),
            ("shapes", table(&|frame| frame.shape.clone())),
            ("flesh", array(&[self.flesh.len(), 3], flat(&self.flesh))),
            ("said.matrix", array(&[bones, bones], said.matrix.as_slice().to_vec())),
            ("said.vector", array(&[bones], said.vector.as_slice().to_vec())),
        ]
        .map(|(name, array)| (name.to_owned(), array))
        .into()
    }

    fn from_arrays(file: NamedArrays<'_>, vertices: usize) -> Result<Self> {
        let [frames, _] = file.extents("turns");
        let turns = file.numbers("turns", &[frames, 9])?;
        let translations = file.points("translations", frames)?;
        let [atoms, bones, shapes] = [rows(file, "atoms")?, rows(file, "bones")?, rows(file, "shapes")?];
        if [&atoms, &bones, &shapes].iter().any(|table| table.len() != frames) {
            return Err(file.wrong("atoms", format_args!("{frames} rows, as those of `bones` and `shapes`")));
        }
        let frame = |place: usize| BlsmParameters {
            turn: DMat3::from_cols_slice(&turns[9 * place..]),
            translation: translations[place],
            atoms: atoms[place].clone(),
            bones: bones[place].clone(),
            shape: shapes[place].clone(),
        };
        let [count] = file.extents("said.vector");
        let said = SaidOfBones {
            matrix: DMatrix::from_column_slice(count, count, &file.numbers("said.matrix", &[count, count])?),
            vector: DVector::from_vec(file.numbers("said.vector", &[count])?),
        };
        let flesh: Vec<DVec3> = file.points("flesh", vertices)?;
        Ok(Self { frames: (0..frames).map(frame).collect(), flesh, said })
    }
}
