//! The field's values at lattice points, each evaluated once.

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use super::lattice::{Box3, SparseLattice, corner};
use xavatar_formats::{Error, Result};

use super::{ExtractionError, ExtractionGrid, Sign};

/// Points in one call of the field.
const BATCH: usize = 8192;

pub(super) struct Samples<'a> {
    field: &'a (dyn Fn(&[Vec3], &mut [f32]) + Sync),
    level: f32,
    inside_is: Sign,
    lattice: Box3,
    /// How far above the surface's level, positive inside; NaN where not evaluated, infinite where asked for.
    depths: SparseLattice<f32>,
    asked: Vec<UVec3>,
    minimum: f32,
    maximum: f32,
}

impl<'a> Samples<'a> {
    pub(super) fn new(field: &'a (dyn Fn(&[Vec3], &mut [f32]) + Sync), grid: &ExtractionGrid, lattice: Box3) -> Self {
        Self {
            field,
            level: grid.level,
            inside_is: grid.inside_is,
            lattice,
            depths: SparseLattice::new(lattice.points(), f32::NAN),
            asked: Vec::new(),
            minimum: f32::INFINITY,
            maximum: f32::NEG_INFINITY,
        }
    }

    pub(super) fn lattice(&self) -> Box3 {
        self.lattice
    }

    /// Asks for the value at a point; [`Self::evaluate`] brings it.
    pub(super) fn ask(&mut self, point: UVec3) {
        let depth = self.depths.entry(point);
        if depth.is_nan() {
            *depth = f32::INFINITY;
            self.asked.push(point);
        }
    }

    /// Evaluates the field at all points asked for.
    pub(super) fn evaluate(&mut self) -> Result<()> {
        let positions: Vec<Vec3> = self.asked.iter().map(|&p| self.lattice.position(p)).collect();
        let mut values = vec![f32::NAN; positions.len()];
        positions.par_chunks(BATCH).zip(values.par_chunks_mut(BATCH)).for_each(|(p, v)| (self.field)(p, v));
        for (point, value) in self.asked.drain(..).zip(values) {
            let depth = match self.inside_is {
                Sign::Positive => value - self.level,
                Sign::Negative => self.level - value,
            };
            if !depth.is_finite() {
                return Err(Error::Value {
                    name: format!("field at {}", self.lattice.position(point)),
                    found: value.to_string(),
                    expected: "a finite number".into(),
                });
            }
            self.minimum = self.minimum.min(value);
            self.maximum = self.maximum.max(value);
            // Nothing is inside on the boundary, so that the surface is closed there.
            let capped = if self.lattice.is_on_boundary(point) { depth.min(0.0) } else { depth };
            *self.depths.entry(point) = capped;
        }
        Ok(())
    }

    /// The depth below the surface at a point that was evaluated, positive inside.
    pub(super) fn depth(&self, point: UVec3) -> f32 {
        self.depths.get(point)
    }

    /// Puts a point that was evaluated on a side, as deep as it was on its own.
    pub(super) fn take_to(&mut self, point: UVec3, inside: bool) {
        if self.is_inside(point) != inside {
            let depth = self.depths.entry(point);
            let magnitude = depth.abs().max(f32::MIN_POSITIVE);
            *depth = if inside { magnitude } else { -magnitude };
        }
    }

    pub(super) fn is_inside(&self, point: UVec3) -> bool {
        self.depth(point) > 0.0
    }

    /// Which corners of a unit cell are inside, one bit each.
    pub(super) fn case(&self, cell: UVec3) -> u8 {
        (0..8).filter(|&c| self.is_inside(corner(cell, c))).fold(0, |case, c| case | 1 << c)
    }

    /// Whether values on both sides of the level were seen, before capping.
    pub(super) fn saw_both_sides(&self) -> bool {
        match self.inside_is {
            Sign::Positive => self.maximum > self.level && self.minimum <= self.level,
            Sign::Negative => self.minimum < self.level && self.maximum >= self.level,
        }
    }

    pub(super) fn no_surface(&self) -> ExtractionError {
        ExtractionError::NoSurface { minimum: self.minimum, maximum: self.maximum, level: self.level }
    }
}
