//! What tells made meshes from real ones (Wang eq. 4.9 to 4.12): an autoencoder that learns to make real ones again and made ones not.
//!
//! N real meshes in the order of the pictures that the made ones are of.

use std::cell::{Cell, RefCell};

use candle_core::{DType, Result, Tensor};
use glam::DVec3;
use xavatar_formats::Result as Read;

use super::Balance;
use crate::descent::{Learner, Parameters, Rate};
use crate::spiral::{Autoencoder, Level};

/// An autoencoder of real meshes, with the made ones that it is shown beside.
#[derive(Debug)]
pub struct Judge {
    network: Autoencoder,
    made: RefCell<Option<Tensor>>,
    balance: Cell<Balance>,
}

impl Judge {
    /// Of real meshes (N, V) with these levels; begun from a seed.
    ///
    /// # Errors
    /// Those of [`Autoencoder::new`].
    pub fn new(levels: &[Level], shapes: &[Vec<DVec3>], codes: usize, seed: u64) -> Read<Self> {
        let network = Autoencoder::new(levels, shapes, codes, seed)?;
        Ok(Self { network, made: RefCell::default(), balance: Cell::default() })
    }

    /// Shows it meshes (N, V, 3) that were made, standardised.
    pub(super) fn show(&self, made: &Tensor) {
        self.made.replace(Some(made.detach()));
    }

    /// How badly it makes meshes (B, V, 3) again, standardised.
    pub(super) fn loss_of(&self, meshes: &Tensor) -> Result<Tensor> {
        self.network.loss_of(meshes)
    }
}

impl Learner for Judge {
    const BATCH: usize = 16;
    const FALLS: f64 = 0.99;

    fn parameters(&self) -> &Parameters {
        self.network.parameters()
    }

    fn rate_of(name: &str) -> Rate {
        Autoencoder::rate_of(name)
    }

    fn examples(&self) -> usize {
        self.network.examples()
    }

    fn loss(&self, batch: &Tensor) -> Result<Tensor> {
        let real = self.network.loss(batch)?;
        let made = self.made.borrow();
        let Some(made) = made.as_ref() else { return Ok(real) };
        let made = self.network.loss_of(&made.index_select(batch, 0)?)?;
        let number = |loss: &Tensor| loss.to_dtype(DType::F64)?.to_scalar::<f64>();
        let share = self.balance.get().share();
        self.balance.set(self.balance.get().after(number(&real)?, number(&made)?));
        real - made * share
    }
}
