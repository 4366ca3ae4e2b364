//! The gradient of all three fields: a thread's, the threads' sum, and the step against it.

use xavatar_network::{Adam, MlpGradient, NetworkUpdate, ParameterGroup, Real, SummedGradient};

use super::{Fields, PerField, SkinningGradient, SummedSkinning};

/// One thread's gradient.
#[derive(Debug)]
pub struct FieldGradients<T> {
    /// Of the geometry field.
    pub geometry: MlpGradient<T>,
    /// Of the texture field.
    pub texture: MlpGradient<T>,
    /// Of the skinning field.
    pub skinning: SkinningGradient<T>,
}

/// The gradient, summed over threads. Borrows the threads' gradients, which are zero again once the step is done.
#[derive(Debug)]
pub struct SummedGradients<'a, T> {
    geometry: SummedGradient<'a, T>,
    texture: SummedGradient<'a, T>,
    skinning: SummedSkinning<'a, T>,
}

/// How the fields are moved in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldRates {
    /// The networks' layers.
    pub networks: ParameterGroup,
    /// The geometry's hash grid.
    pub geometry_grid: ParameterGroup,
    /// The texture's hash grid.
    pub texture_grid: ParameterGroup,
    /// The logits of a skinning field that is a grid.
    pub logits: ParameterGroup,
}

impl<T: Real> FieldGradients<T> {
    /// A gradient that nothing has been added to yet.
    pub fn zero(fields: &Fields<T>) -> Self {
        Self {
            geometry: fields.geometry.mlp.zero_gradient(),
            texture: fields.texture.mlp.zero_gradient(),
            skinning: fields.skinning.zero_gradient(),
        }
    }
}

impl<'a, T: Real> SummedGradients<'a, T> {
    /// Sums the gradients of at least one thread, in their order; `logits` is that of a skinning field that is a grid.
    pub fn of_threads(
        fields: &Fields<T>,
        threads: impl IntoIterator<Item = &'a mut FieldGradients<T>>,
        logits: &'a mut [T],
    ) -> Self {
        let (mut geometry, mut texture, mut skinning) = (Vec::new(), Vec::new(), Vec::new());
        for thread in threads {
            geometry.push(&mut thread.geometry);
            texture.push(&mut thread.texture);
            skinning.push(&mut thread.skinning);
        }
        Self {
            geometry: fields.geometry.mlp.sum_gradients(geometry),
            texture: fields.texture.mlp.sum_gradients(texture),
            skinning: fields.skinning.sum_gradients(skinning, logits),
        }
    }

    /// The joint norm of all entries; not finite if an entry is not.
    pub fn norm(&self) -> f64 {
        let networks = self.geometry.squared_norm() + self.texture.squared_norm();
        (networks + self.skinning.squared_norm()).sqrt()
    }

    /// Each field's gradient, flat, in the order of [`Fields::parameters`].
    pub fn to_vecs(&self) -> PerField<Vec<T>> {
        PerField { geometry: self.geometry.to_vec(), texture: self.texture.to_vec(), skinning: self.skinning.to_vec() }
    }

    /// Moves the parameters against `factor` times the gradient, and sets it to zero.
    pub fn step(self, fields: &mut Fields<T>, adam: &mut PerField<Adam<T>>, rates: &FieldRates, factor: f64) {
        let update = |grid: ParameterGroup| NetworkUpdate { network: rates.networks, grid, factor };
        adam.geometry.step_network(&update(rates.geometry_grid), self.geometry, &mut fields.geometry.mlp);
        adam.texture.step_network(&update(rates.texture_grid), self.texture, &mut fields.texture.mlp);
        fields.skinning.step(self.skinning, &mut adam.skinning, (rates.networks, rates.logits), factor);
    }
}
