//! The vertices of a batch, block by block: blend shapes as one matrix product, skinning, and both backwards.
//!
//! A block's directions (K + F rows that move something) are laid out once and meet all frames: T (B, 3 n) = template + X D with the drives
//! X = [c f] (B, K + F). Backwards, X's cotangents are T's times D^T. Blocks run in parallel; what they add up is added in their order.

use rayon::prelude::*;
use xavatar_vector::{Matrix, MatrixMut, Scalar, Write, product};

use super::chain::{Bone, Chain, outer, rest_joints_pullback};
use super::rotation::{turned, turned_back};
use super::{PoseBatch, add};
use crate::{BodyModel, Correctives};

/// Vertices of a block: its directions and its vertices of a few frames stay in the second-level cache.
const BLOCK_VERTICES: usize = 192;

type Points<T> = Vec<[T; 3]>;

/// A model's surface as a batch sees it.
pub(super) struct Surface<'a, T> {
    model: &'a BodyModel,
    /// X: coefficients and features of each frame, in the columns of `rows` only (B, R).
    drives: Vec<T>,
    /// The directions that move something (R): their places among all, and what they move (V, 3).
    rows: Vec<(usize, &'a [f32])>,
    frames: usize,
}

/// Cotangents of all drives (B, K + F).
pub(super) struct DriveCotangents<T> {
    values: Vec<T>,
    count: usize,
}

impl<'a, T: Scalar> Surface<'a, T> {
    pub fn new(model: &'a BodyModel, batch: &PoseBatch<T>) -> Self {
        let correctives = model.anatomy.correctives.shapes();
        let all =
            model.anatomy.shapes.directions().chain(correctives.into_iter().flat_map(|shapes| shapes.directions()));
        let rows = all.enumerate().filter(|(_, direction)| !direction.is_empty()).collect();
        Self { model, drives: Vec::new(), rows, frames: batch.frames() }
    }

    /// The vertices (B, V), and what they were before they were skinned (B, V).
    pub fn skinned(mut self, chains: &[Chain<T>], batch: &PoseBatch<T>) -> (Points<T>, Points<T>) {
        self.drive(chains, batch);
        let bones: Vec<Vec<Bone<T>>> = chains.iter().map(Chain::bones).collect();
        let count = self.model.vertex_count();
        let blocks: Vec<(Points<T>, Points<T>)> = self.blocks().map(|first| self.block(first, &bones, batch)).collect();
        let mut vertices = vec![[T::zero(); 3]; self.frames * count];
        let mut rest = vertices.clone();
        for (block, (posed, unposed)) in blocks.iter().enumerate() {
            let first = block * BLOCK_VERTICES;
            let size = BLOCK_VERTICES.min(count - first);
            for frame in 0..self.frames {
                let (to, from) = (frame * count + first, frame * size);
                vertices[to..to + size].copy_from_slice(&posed[from..from + size]);
                rest[to..to + size].copy_from_slice(&unposed[from..from + size]);
            }
        }
        (vertices, rest)
    }

    /// The cotangents of each frame's bones (B, J) and of all drives, given those of the vertices (B, V).
    pub fn pullback(
        &self,
        chains: &[Chain<T>],
        rest: &[[T; 3]],
        vertices: &[[T; 3]],
    ) -> (Vec<Vec<Bone<T>>>, DriveCotangents<T>) {
        let bones: Vec<Vec<Bone<T>>> = chains.iter().map(Chain::bones).collect();
        let blocks: Vec<_> = self.blocks().map(|first| self.block_pullback(first, &bones, rest, vertices)).collect();
        let mut of_bones = vec![vec![Bone::default(); self.model.skeleton().joints.len()]; self.frames];
        let mut of_rows = vec![T::zero(); self.frames * self.rows.len()];
        for (block_bones, block_rows) in blocks {
            for (sum, bone) in of_bones.iter_mut().flatten().zip(block_bones.iter().flatten()) {
                add(&mut sum.turn, &bone.turn);
                add(&mut sum.shift, &bone.shift);
            }
            add(&mut of_rows, &block_rows);
        }
        (of_bones, self.spread(&of_rows))
    }

    /// Those of a frame's features (F).
    pub fn feature_cotangents<'c>(&self, drives: &'c DriveCotangents<T>, frame: usize) -> &'c [T] {
        &drives.values[frame * drives.count + self.model.anatomy.shapes.count()..(frame + 1) * drives.count]
    }

    /// Those of a frame's coefficients (K): of the shapes, of the joints at rest, and of a feature that is a coefficient.
    pub fn coefficient_cotangents(&self, drives: &DriveCotangents<T>, frame: usize, rest_joints: &[[T; 3]]) -> Vec<T> {
        let shapes = self.model.anatomy.shapes.count();
        let mut cotangents = drives.values[frame * drives.count..frame * drives.count + shapes].to_vec();
        add(&mut cotangents, &rest_joints_pullback(self.model, rest_joints));
        if let Correctives::Quaternions { coefficient: Some(index), .. } = self.model.anatomy.correctives
            && let Some(last) = self.feature_cotangents(drives, frame).last()
        {
            cotangents[index] += *last;
        }
        cotangents
    }

    /// Sets X.
    fn drive(&mut self, chains: &[Chain<T>], batch: &PoseBatch<T>) {
        let shapes = self.model.anatomy.shapes.count();
        for (frame, chain) in chains.iter().enumerate() {
            let coefficients = batch.frame_coefficients(frame);
            let drive =
                |place: usize| if place < shapes { coefficients[place] } else { chain.features[place - shapes] };
            self.drives.extend(self.rows.iter().map(|(place, _)| drive(*place)));
        }
    }

    fn blocks(&self) -> impl IndexedParallelIterator<Item = usize> {
        (0..self.model.vertex_count().div_ceil(BLOCK_VERTICES)).into_par_iter().map(|block| block * BLOCK_VERTICES)
    }

    /// D of the vertices from `first` on (R, 3 n).
    fn directions(&self, first: usize, size: usize) -> Vec<T> {
        let part = |direction: &'a [f32]| {
            direction[3 * first..3 * (first + size)].iter().map(|value| T::of(f64::from(*value)))
        };
        self.rows.iter().flat_map(|(_, direction)| part(direction)).collect()
    }

    fn block(&self, first: usize, bones: &[Vec<Bone<T>>], batch: &PoseBatch<T>) -> (Points<T>, Points<T>) {
        let size = BLOCK_VERTICES.min(self.model.vertex_count() - first);
        let template =
            self.model.template()[first..first + size].iter().map(|v| v.to_array().map(|c| T::of(f64::from(c))));
        let template: Vec<[T; 3]> = template.collect();
        let mut rest = template.repeat(self.frames);
        let (rows, columns) = (self.rows.len(), 3 * size);
        if rows > 0 {
            let directions = self.directions(first, size);
            product(
                MatrixMut::new(rest.as_flattened_mut(), self.frames, columns, columns),
                Write::Add,
                Matrix::new(&self.drives, self.frames, rows, rows),
                Matrix::new(&directions, rows, columns, columns),
            );
        }
        let mut posed = Vec::with_capacity(rest.len());
        for ((bones, translation), rest) in bones.iter().zip(&batch.translations).zip(rest.chunks_exact(size)) {
            for (vertex, rest) in rest.iter().enumerate() {
                let Bone { turn, shift } = self.blended(first + vertex, bones);
                let moved = turned(&turn, *rest);
                posed.push([0, 1, 2].map(|axis| moved[axis] + shift[axis] + translation[axis]));
            }
        }
        (posed, rest)
    }

    fn block_pullback(
        &self,
        first: usize,
        bones: &[Vec<Bone<T>>],
        rest: &[[T; 3]],
        vertices: &[[T; 3]],
    ) -> (Vec<Vec<Bone<T>>>, Vec<T>) {
        let count = self.model.vertex_count();
        let size = BLOCK_VERTICES.min(count - first);
        let mut of_bones = vec![vec![Bone::default(); self.model.skeleton().joints.len()]; self.frames];
        let mut of_rest: Vec<[T; 3]> = Vec::with_capacity(self.frames * size);
        for (frame, of_bones) in of_bones.iter_mut().enumerate() {
            for vertex in first..first + size {
                let at = frame * count + vertex;
                let moment = outer(vertices[at], rest[at]);
                for (joint, weight) in self.model.influences.at(vertex) {
                    let (sum, weight) = (&mut of_bones[joint], T::of(f64::from(weight)));
                    sum.turn.iter_mut().zip(moment).for_each(|(sum, value)| *sum += weight * value);
                    sum.shift.iter_mut().zip(vertices[at]).for_each(|(sum, value)| *sum += weight * value);
                }
                of_rest.push(turned_back(&self.blended(vertex, &bones[frame]).turn, vertices[at]));
            }
        }
        let (rows, columns) = (self.rows.len(), 3 * size);
        let mut of_rows = vec![T::zero(); self.frames * rows];
        if rows > 0 {
            let directions = self.directions(first, size);
            product(
                MatrixMut::new(&mut of_rows, self.frames, rows, rows),
                Write::Replace,
                Matrix::new(of_rest.as_flattened(), self.frames, columns, columns),
                Matrix::new(&directions, rows, columns, columns).transposed(),
            );
        }
        (of_bones, of_rows)
    }

    /// sum_j w_vj of the bones.
    fn blended(&self, vertex: usize, bones: &[Bone<T>]) -> Bone<T> {
        let mut blend = Bone::default();
        for (joint, weight) in self.model.influences.at(vertex) {
            let (bone, weight) = (&bones[joint], T::of(f64::from(weight)));
            blend.turn.iter_mut().zip(bone.turn).for_each(|(sum, value)| *sum += weight * value);
            blend.shift.iter_mut().zip(bone.shift).for_each(|(sum, value)| *sum += weight * value);
        }
        blend
    }

    /// Cotangents of the rows that move something, in the places of all.
    fn spread(&self, of_rows: &[T]) -> DriveCotangents<T> {
        let anatomy = &self.model.anatomy;
        let count = anatomy.shapes.count() + anatomy.correctives.shapes().map_or(0, |shapes| shapes.count());
        let mut values = vec![T::zero(); self.frames * count];
        for (frame, of_rows) in of_rows.chunks_exact(self.rows.len().max(1)).enumerate() {
            for ((place, _), value) in self.rows.iter().zip(of_rows) {
                values[frame * count + place] = *value;
            }
        }
        DriveCotangents { values, count }
    }
}
