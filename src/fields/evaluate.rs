//! What the fields are at N canonical points: values, gradients, normals, colours and skinning weights.
//!
//! Points are evaluated in blocks, in parallel; a point's result does not depend on the threads.
//! n_d = normalise(+-J^-T grad f), c = texture(x_c, n_d); J is the Jacobian of the pose's warp. J joints; metres.

use glam::Vec3;
use rayon::prelude::*;
use xavatar_deformer::{Jacobian, deformed_normals};
use xavatar_network::{SkinningTrace, TextureField, Trace};

use super::Fields;
use crate::Result;

/// Rows a thread evaluates at a time: their activations stay in the cache.
pub const BLOCK_ROWS: usize = 256;
const IDENTITY: Jacobian<f32> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// What a point of a surface looks like.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shade {
    /// Outward, of unit length; zero where the field has no gradient.
    pub normal: Vec3,
    /// sRGB.
    pub colour: [u8; 3],
}

/// An avatar's fields under one condition.
#[derive(Clone, Debug)]
pub struct FieldEvaluator<'a> {
    fields: &'a Fields<f32>,
    embedded: Vec<f32>,
}

impl<'a> FieldEvaluator<'a> {
    /// The fields under a condition, as [`Condition`](super::Condition) makes it; zeros for none.
    pub fn new(fields: &'a Fields<f32>, condition: &[f32]) -> Self {
        Self { fields, embedded: fields.geometry.mlp.embed(condition) }
    }

    /// The fields.
    pub fn fields(&self) -> &'a Fields<f32> {
        self.fields
    }

    /// The geometry field's values (N).
    #[must_use]
    pub fn values(&self, points: &[[f32; 3]]) -> Vec<f32> {
        let mut values = vec![0.0; points.len()];
        let blocks = values.par_chunks_mut(BLOCK_ROWS).zip(points.par_chunks(BLOCK_ROWS));
        blocks.for_each_init(Trace::default, |trace, (values, points)| {
            self.fields.geometry.mlp.evaluate(trace, points.as_flattened(), &self.embedded, &[]);
            values.copy_from_slice(trace.output());
        });
        values
    }

    /// The geometry field's values (N) and gradients (N).
    #[must_use]
    pub fn values_and_gradients(&self, points: &[[f32; 3]]) -> (Vec<f32>, Vec<[f32; 3]>) {
        let mut values = vec![0.0; points.len()];
        let mut gradients = vec![[0.0; 3]; points.len()];
        let results = values.par_chunks_mut(BLOCK_ROWS).zip(gradients.par_chunks_mut(BLOCK_ROWS));
        results.zip(points.par_chunks(BLOCK_ROWS)).for_each_init(
            Trace::default,
            |trace, ((values, gradients), points)| {
                self.geometry(trace, points);
                values.copy_from_slice(trace.output());
                gradients.copy_from_slice(trace.gradient().as_chunks().0);
            },
        );
        (values, gradients)
    }

    /// Normals and colours (N) in the canonical pose.
    ///
    /// # Errors
    /// As [`FieldEvaluator::posed_shades`].
    pub fn shades(&self, points: &[[f32; 3]]) -> Result<Vec<Shade>> {
        self.posed_shades(points, &vec![IDENTITY; points.len()])
    }

    /// Normals and colours (N) where the pose's warp has the Jacobians `jacobians` (N).
    ///
    /// # Errors
    /// If there is not one Jacobian a point.
    pub fn posed_shades(&self, points: &[[f32; 3]], jacobians: &[Jacobian<f32>]) -> Result<Vec<Shade>> {
        let mut shades = vec![Shade::default(); points.len()];
        let blocks = points.par_chunks(BLOCK_ROWS).zip(jacobians.par_chunks(BLOCK_ROWS));
        shades.par_chunks_mut(BLOCK_ROWS).zip(blocks).try_for_each_init(
            Default::default,
            |(geometry, texture), (shades, (points, jacobians))| {
                self.shade(geometry, texture, points, jacobians, shades)
            },
        )?;
        Ok(shades)
    }

    fn shade(
        &self,
        geometry: &mut Trace<f32>,
        texture: &mut Trace<f32>,
        points: &[[f32; 3]],
        jacobians: &[Jacobian<f32>],
        shades: &mut [Shade],
    ) -> Result<()> {
        let fields = self.fields;
        self.geometry(geometry, points);
        let mut normals = vec![[0.0; 3]; points.len()];
        deformed_normals(geometry.gradient().as_chunks().0, jacobians, fields.gradient_side(), &mut normals)?;
        let inputs: Vec<f32> = match fields.texture.sees_normals() {
            true => points.iter().zip(&normals).flat_map(|(point, normal)| [*point, *normal]).flatten().collect(),
            false => points.as_flattened().to_vec(),
        };
        let features = fields.texture.seen(geometry.features(&fields.geometry.mlp));
        fields.texture.mlp.forward(texture, &inputs, &self.embedded, features);
        let mut colours = vec![0.0; 3 * points.len()];
        TextureField::colours(texture.output(), &mut colours);
        for ((shade, normal), colour) in shades.iter_mut().zip(normals).zip(colours.as_chunks::<3>().0) {
            let colour = colour.map(|channel| (channel * 255.0).round() as u8);
            *shade = Shade { normal: Vec3::from_array(normal), colour };
        }
        Ok(())
    }

    /// Values and gradients of the geometry field at the points of one block, into its trace.
    fn geometry(&self, trace: &mut Trace<f32>, points: &[[f32; 3]]) {
        let network = &self.fields.geometry.mlp;
        network.forward(trace, points.as_flattened(), &self.embedded, &[]);
        network.input_gradient(trace, &vec![1.0; points.len()]);
    }

    /// Skinning weights (N, J).
    #[must_use]
    pub fn weights(&self, points: &[[f32; 3]]) -> Vec<f32> {
        let skinning = &self.fields.skinning;
        let joints = skinning.joints();
        let mut weights = vec![0.0; points.len() * joints];
        let blocks = weights.par_chunks_mut(BLOCK_ROWS * joints).zip(points.par_chunks(BLOCK_ROWS));
        blocks.for_each_init(SkinningTrace::default, |trace, (weights, points)| {
            skinning.weights(trace, points, weights);
        });
        weights
    }

    /// Skinning weights (N, J) and their derivatives along x, y and z (N, 3, J).
    #[must_use]
    pub fn weights_and_gradients(&self, points: &[[f32; 3]]) -> (Vec<f32>, Vec<f32>) {
        let skinning = &self.fields.skinning;
        let joints = skinning.joints();
        let (mut weights, mut gradients) = (vec![0.0; points.len() * joints], vec![0.0; 3 * points.len() * joints]);
        let rows = weights.par_chunks_mut(BLOCK_ROWS * joints).zip(gradients.par_chunks_mut(3 * BLOCK_ROWS * joints));
        rows.zip(points.par_chunks(BLOCK_ROWS)).for_each_init(
            SkinningTrace::default,
            |trace, ((weights, gradients), points)| {
                skinning.weights_and_gradients(trace, points, weights, gradients);
            },
        );
        (weights, gradients)
    }
}
