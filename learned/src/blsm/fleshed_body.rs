//! A BLSM body of a file, whichever way its flesh was learned: linear shapes, or a network's.

use std::borrow::Cow;
use std::path::Path;

use glam::DVec3;
use xavatar_formats::{ArrayMap, Result, read_npz};

use super::{BlsmBody, BlsmFit, BlsmParameters, SpiralBody};

/// A body, by what makes its flesh.
#[derive(Debug)]
pub enum FleshedBody {
    /// Sums of shapes.
    Linear(Box<BlsmBody>),
    /// An auto-decoder.
    Spiral(Box<SpiralBody>),
}

impl FleshedBody {
    /// Reads a file.
    ///
    /// # Errors
    /// Those of [`from_arrays`](Self::from_arrays) and of reading an npz.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_arrays(path, &read_npz(path)?)
    }

    /// A body of the arrays of its file; `path` is named in errors.
    ///
    /// # Errors
    /// [`Error::Malformed`](xavatar_formats::Error::Malformed) naming the array that is missing, has another shape, or holds numbers that cannot be.
    pub fn from_arrays(path: &Path, arrays: &ArrayMap) -> Result<Self> {
        if SpiralBody::is_in(arrays) {
            Ok(Self::Spiral(Box::new(SpiralBody::from_arrays(path, arrays)?)))
        } else {
            Ok(Self::Linear(Box::new(BlsmBody::from_arrays(path, arrays)?)))
        }
    }

    /// The body near people of no coefficients.
    ///
    /// # Errors
    /// Those of [`SpiralBody::at`].
    pub fn mean(&self) -> Result<Cow<'_, BlsmBody>> {
        match self {
            Self::Linear(body) => Ok(Cow::Borrowed(body)),
            Self::Spiral(body) => Ok(Cow::Owned(body.at(&vec![0.0; body.code_count()])?)),
        }
    }

    /// The body that is exact where its shape is this one.
    ///
    /// # Errors
    /// Those of [`SpiralBody::at`].
    pub fn at(&self, shape: &[f64]) -> Result<Cow<'_, BlsmBody>> {
        match self {
            Self::Linear(body) => Ok(Cow::Borrowed(body)),
            Self::Spiral(body) => Ok(Cow::Owned(body.at(shape)?)),
        }
    }

    /// The parameters nearest to registrations (V) of one person, and the body that they are of; a coefficient that is 1 costs `held` square metres.
    ///
    /// # Errors
    /// Those of [`SpiralBody::at`].
    pub fn person(&self, frames: &[Vec<DVec3>], held: f64) -> Result<(Vec<BlsmParameters>, Cow<'_, BlsmBody>)> {
        match self {
            Self::Linear(body) => Ok((BlsmFit::new(body, held).person(frames, None), Cow::Borrowed(body))),
            Self::Spiral(body) => {
                let (parameters, body) = body.person(frames, held)?;
                Ok((parameters, Cow::Owned(body)))
            }
        }
    }
}
