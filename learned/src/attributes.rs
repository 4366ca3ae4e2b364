//! People of a wanted height and weight, from the shapes that a body has (Wang 6.4.2; METHOD-BODY 13).
//!
//! Shapes c have unit variance. A person is drawn from N(0, 1) and moved to what is wanted, f(c) = (height, weight), by the smallest steps
//! c += J^T (J J^T)^-1 (wanted - f(c)): were f linear, this would be a draw from exactly those who are so tall and so heavy. Measured on the mesh at
//! rest, nothing is looked up. Metres, kilograms.

use glam::{DMat2, DVec2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;
use xavatar_body::BodyModel;
use xavatar_body::anny::Measures;
use xavatar_formats::{Error, Result};

/// Steps at most.
const STEPS: usize = 30;
/// Metres and kilograms that are near enough.
const NEAR: [f64; 2] = [5e-4, 0.05];
/// Coefficients beyond this are nobody's.
const FARTHEST: f64 = 5.0;
/// Of differences, in coefficients.
const STEP: f64 = 0.05;

/// What is asked of people; what is not asked is as it comes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WantedPerson {
    /// From sole to crown, metres.
    pub height: Option<f64>,
    /// Kilograms, at the density of a body.
    pub weight: Option<f64>,
}

/// A person who was made.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MadePerson {
    /// Coefficients (S).
    pub shape: Vec<f64>,
    /// What they measure.
    #[serde(flatten)]
    pub measures: Measures,
}

/// People by the shapes of a body.
pub struct People<'a> {
    body: &'a BodyModel,
}

impl<'a> People<'a> {
    /// Of a body.
    pub fn of(body: &'a BodyModel) -> Self {
        Self { body }
    }

    /// The person with a number: another one for each, the same in every call.
    ///
    /// # Errors
    /// [`Error::Value`] if nobody of the body's shapes is so tall and so heavy.
    pub fn person(&self, wanted: WantedPerson, seed: u64, number: u64) -> Result<MadePerson> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(number);
        let shapes = self.body.shape_coefficients();
        let mut shape: Vec<f64> = (0..shapes).map(|_| StandardNormal.sample(&mut random)).collect();
        for _ in 0..STEPS {
            let person = self.measured(&shape)?;
            let missing = wanted.missing(&person);
            if missing.x.abs() <= NEAR[0] && missing.y.abs() <= NEAR[1] {
                return Ok(person);
            }
            self.step(&mut shape, wanted, missing)?;
        }
        let Measures { height, weight, .. } = self.measured(&shape)?.measures;
        Err(Error::Value {
            name: "the wanted person".into(),
            found: format!("nearest at {height:.2} m and {weight:.1} kg"),
            expected: "a height and a weight that the body's shapes have".into(),
        })
    }

    /// A person's measures.
    ///
    /// # Errors
    /// Those of posing a body.
    pub fn measured(&self, shape: &[f64]) -> Result<MadePerson> {
        let mut pose = self.body.skeleton().rest_pose();
        pose.shape = shape.iter().map(|value| *value as f32).collect();
        let mesh = self.body.mesh(self.body.rest_vertices(&pose)?);
        Ok(MadePerson { shape: shape.to_vec(), measures: Measures::of_mesh(&mesh) })
    }

    /// Moves coefficients by the smallest step that would bring what is missing.
    fn step(&self, shape: &mut [f64], wanted: WantedPerson, missing: DVec2) -> Result<()> {
        let mut rows: Vec<DVec2> = Vec::with_capacity(shape.len());
        for index in 0..shape.len() {
            let beside = |step: f64| {
                let mut moved = shape.to_vec();
                moved[index] += step;
                self.measured(&moved).map(|person| -wanted.missing(&person))
            };
            rows.push((beside(STEP)? - beside(-STEP)?) / (2.0 * STEP));
        }
        let sum = |of: fn(&DVec2) -> f64| rows.iter().map(of).sum::<f64>();
        // What is not asked for has no row: a one keeps the matrix invertible.
        let diagonal = |asked: bool, sum: f64| if asked { sum } else { 1.0 };
        let across = sum(|row| row.x * row.y);
        let normal = DMat2::from_cols(
            DVec2::new(diagonal(wanted.height.is_some(), sum(|row| row.x * row.x)), across),
            DVec2::new(across, diagonal(wanted.weight.is_some(), sum(|row| row.y * row.y))),
        );
        let share = normal.inverse() * missing;
        if share.is_finite() {
            for (value, row) in shape.iter_mut().zip(&rows) {
                *value = (*value + row.dot(share)).clamp(-FARTHEST, FARTHEST);
            }
        }
        Ok(())
    }
}

impl WantedPerson {
    /// What a person lacks of what is asked for; nothing of what is not.
    fn missing(self, person: &MadePerson) -> DVec2 {
        let lacks = |wanted: Option<f64>, found: f64| wanted.map_or(0.0, |wanted| wanted - found);
        DVec2::new(lacks(self.height, person.measures.height), lacks(self.weight, person.measures.weight))
    }
}
