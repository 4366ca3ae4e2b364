//! BLSM-spiral: a BLSM body whose flesh is an auto-decoder's, V = template + c_b P_bc + D(c_s) (METHOD-BODY 9.3 and 9.4 f).
//!
//! Around a code c_0, D(c) is D(c_0) + J (c - c_0): a [`BlsmBody`] with shapes J that is exact at c_0. So what takes such bodies, posing, fitting, export, takes
//! this one at a code; fits are found by going where the last one led, some times. Its file is that of the body at the mean code, with the auto-decoder's arrays beside: a
//! reader that knows nothing of them has linear shapes. K codes, V vertices; metres.

use std::path::Path;

use glam::DVec3;
use xavatar_formats::{ArrayMap, Error, Result};

use super::{BlsmBody, BlsmFit, BlsmParameters};
use crate::descent::Descent;
use crate::kept::Kept;
use crate::spiral::{Autodecoder, AutodecoderTraining, FACTORS, levels};

/// The part of the network that is learned.
const NETWORK: &str = "network";
/// Rounds of a fit.
const ROUNDS: usize = 3;

/// How the flesh is trained.
#[derive(Clone, Copy, Debug)]
pub struct SpiralTraining {
    /// Codes at most; people that are not more than codes give as many as they are, less one.
    pub codes: usize,
    /// Times that all people's flesh is seen.
    pub epochs: usize,
    /// Of everything random.
    pub seed: u64,
}

/// A BLSM body whose flesh is an auto-decoder's.
#[derive(Debug)]
pub struct SpiralBody {
    /// Without shapes.
    bare: BlsmBody,
    flesh: Autodecoder,
}

impl SpiralTraining {
    /// The body with this skeleton and this mean flesh whose shapes are learned from what people's flesh (N, V) has beside the mean; and the
    /// people's codes. None if that was stopped, and what is kept is gone on with. `progress` is told the share that is done.
    ///
    /// # Errors
    /// [`Error::Value`] for fewer than two people; those of reading what is kept; what `progress` returns.
    pub fn train(
        &self,
        body: BlsmBody,
        flesh: &[Vec<DVec3>],
        kept: &mut Kept<'_>,
        mut progress: impl FnMut(f64) -> Result<()>,
    ) -> Result<Option<(SpiralBody, Vec<Vec<f64>>)>> {
        if flesh.len() < 2 {
            let (name, found) = ("people".into(), flesh.len().to_string());
            return Err(Error::Value { name, found, expected: "at least two, whose flesh differs".into() });
        }
        let levels = levels(&body.bent(), &FACTORS)?;
        let training = AutodecoderTraining::new(levels, flesh, self.codes, self.seed)?;
        let mut descent = match kept.part(NETWORK)? {
            Some((path, arrays)) => Descent::resumed(&training, &path, &arrays)?,
            None => Descent::new(&training, self.seed)?,
        };
        while descent.epochs() < self.epochs as u64 {
            progress(descent.epochs() as f64 / self.epochs as f64)?;
            descent.epoch(&training)?;
            if kept.pause(NETWORK, || descent.to_arrays(&training))? {
                return Ok(None);
            }
        }
        let (flesh, people) = training.finished()?;
        Ok(Some((SpiralBody { bare: BlsmBody { shape_basis: Vec::new(), ..body }, flesh }, people)))
    }
}

impl SpiralBody {
    /// Whether arrays are those of such a body.
    pub fn is_in(arrays: &ArrayMap) -> bool {
        BlsmBody::is_in(arrays) && Autodecoder::is_in(arrays)
    }

    /// K.
    pub fn code_count(&self) -> usize {
        self.flesh.code_count()
    }

    /// The body whose flesh is that of a code (K) where its shape is that code, and follows shapes near it to first order.
    ///
    /// # Errors
    /// [`Error::Value`] if there are not K numbers.
    pub fn at(&self, code: &[f64]) -> Result<BlsmBody> {
        let decoded = self.flesh.decoded(code)?;
        let mut template = self.bare.template.clone();
        template.iter_mut().zip(&decoded.shape).for_each(|(place, offset)| *place += *offset);
        for (direction, coefficient) in decoded.directions.iter().zip(code) {
            template.iter_mut().zip(direction).for_each(|(place, offset)| *place -= *offset * *coefficient);
        }
        Ok(BlsmBody { template, shape_basis: decoded.directions, ..self.bare.clone() })
    }

    /// The parameters nearest to registrations (V) of one person, and the body at the person's code; a coefficient that is 1 costs `held` square metres.
    ///
    /// # Errors
    /// As [`at`](Self::at).
    pub fn person(&self, registrations: &[Vec<DVec3>], held: f64) -> Result<(Vec<BlsmParameters>, BlsmBody)> {
        let mut body = self.at(&vec![0.0; self.code_count()])?;
        let mut best: Option<(Vec<BlsmParameters>, BlsmBody, f64)> = None;
        for _ in 0..ROUNDS {
            let start = best.as_ref().map(|(frames, ..)| frames.as_slice());
            let frames = BlsmFit::new(&body, held).person(registrations, start);
            let Some(first) = frames.first() else { break };
            body = self.at(&first.shape)?;
            let exact = BlsmFit::new(&body, held);
            let distance = frames.iter().zip(registrations).map(|(frame, target)| exact.distance(frame, target)).sum();
            if best.as_ref().is_some_and(|(.., least)| *least <= distance) {
                break;
            }
            best = Some((frames, body.clone(), distance));
        }
        Ok(best.map_or((Vec::new(), body), |(frames, body, _)| (frames, body)))
    }

    /// The arrays of its file.
    ///
    /// # Errors
    /// As [`at`](Self::at).
    pub fn to_arrays(&self) -> Result<ArrayMap> {
        let mut arrays = self.at(&vec![0.0; self.code_count()])?.to_arrays();
        arrays.extend(self.flesh.to_arrays()?);
        Ok(arrays)
    }

    /// A body of the arrays of its file; `path` is named in errors.
    ///
    /// # Errors
    /// [`Error::Malformed`] naming the array that is missing, has another shape, or holds numbers that cannot be.
    pub fn from_arrays(path: &Path, arrays: &ArrayMap) -> Result<Self> {
        let mut bare = BlsmBody::from_arrays(path, arrays)?;
        let flesh = Autodecoder::from_arrays(path, arrays)?;
        bare.shape_basis = Vec::new();
        let mean = flesh.decoded(&vec![0.0; flesh.code_count()])?.shape;
        if mean.len() != bare.template.len() {
            return Err(Error::Malformed {
                path: path.into(),
                format: "file of a BLSM body",
                place: "`spiral.mean`".into(),
                found: format!("{} vertices", mean.len()),
                expected: format!("the body's {}", bare.template.len()),
            });
        }
        bare.template.iter_mut().zip(&mean).for_each(|(place, offset)| *place -= *offset);
        Ok(Self { bare, flesh })
    }
}
