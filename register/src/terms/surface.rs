//! The distance between body and scan, both ways, over clothing D of known thickness.
//!
//! body -> scan: n_q . (q - v - D n), q the scan's nearest to v + D n; scan -> body: n . (s - v - D n), v the nearest to a scan point s, summed at v before
//! rows are built. Of what one camera saw, v takes part if it can be seen; in the open it is drawn out of it, n being the way. Weights: Geman-McClure of the distance, times the cosine between the normals, over the deviation squared. Metres.

use glam::DVec3;
use xavatar_body::Part;
use xavatar_formats::Result;

use super::robust;
use crate::linear::{Basis, Linkage, NormalEquations, Row, Unknowns};
use crate::surface_model::{PosedSurface, SurfaceModel, TOTAL_WEIGHT};
use crate::target::{IndexedTarget, OrientedIndex, Seekers};
use crate::view::Sight;

/// How a stage compares body and scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceTerm {
    /// What turning a normal by a radian counts as in the search, metres.
    pub normal_weight: f64,
    /// Distance at which a match counts a quarter, metres.
    pub reach: f64,
    /// Deviation that costs 1, metres.
    pub deviation: f64,
    /// How many of the scan's points look for their place on the body.
    pub seekers: Seekers,
    /// What a deviation along the surface counts, of one across it.
    pub along: f64,
}

/// Reach and deviation of what sticks out of a scan that does not show it, for it shows all that is outside, or of what a camera saw, metres.
const HIDDEN: (f64, f64) = (0.05, 0.006);

/// The body that is compared.
#[derive(Clone, Copy)]
pub struct Dressed<'a> {
    /// Its skeleton.
    pub linkage: &'a Linkage,
    /// Its vertices (N).
    pub model: &'a SurfaceModel,
    /// How far its clothing stands off each, metres (N).
    pub clothing: &'a [f64],
    /// Parts that the scan does not show: they are inside of it.
    pub unseen: &'a [Part],
}

impl SurfaceTerm {
    /// Adds the term of a posed body to a frame's equations.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) if the body is not finite.
    pub fn add(
        &self,
        body: Dressed<'_>,
        posed: &PosedSurface,
        scan: &IndexedTarget,
        unknowns: &Unknowns,
        equations: &mut NormalEquations,
    ) -> Result<()> {
        let mut adder = Adder { term: self, body, posed, unknowns, equations, row: Row::default() };
        adder.body_to_scan(scan);
        adder.scan_to_body(scan)
    }
}

struct Adder<'a> {
    term: &'a SurfaceTerm,
    body: Dressed<'a>,
    posed: &'a PosedSurface,
    unknowns: &'a Unknowns,
    equations: &'a mut NormalEquations,
    row: Row,
}

impl Adder<'_> {
    /// The outside of the clothing over a vertex.
    fn outside(&self, vertex: usize) -> DVec3 {
        self.posed.points.positions[vertex] + self.posed.normals[vertex] * self.body.clothing[vertex]
    }

    fn body_to_scan(&mut self, scan: &IndexedTarget) {
        for vertex in 0..self.body.model.len() {
            let (outside, normal) = (self.outside(vertex), self.posed.normals[vertex]);
            match scan.target.sight(outside, normal) {
                Sight::Seen(_) => {}
                Sight::Hidden => continue,
                Sight::Open(way) => {
                    let (reach, deviation) = (self.term.reach.max(HIDDEN.0), self.term.deviation.max(HIDDEN.1));
                    let weight = weight((reach, deviation), way.length(), 1.0) * self.body.model.weights[vertex];
                    self.add_rows(vertex, way.normalize_or_zero(), way, weight);
                    continue;
                }
            }
            let (nearest, _) = scan.index.nearest(outside, normal);
            let (q, n) = (scan.target.points()[nearest], scan.target.normals()[nearest]);
            let (way, cosine) = (q - outside, normal.dot(n));
            let weight = match self.is_unseen(vertex) {
                false => self.weight(way.length(), cosine),
                true if n.dot(way) < 0.0 => weight(HIDDEN, way.length(), cosine),
                true => 0.0,
            };
            self.add_rows(vertex, n, way, weight * self.body.model.weights[vertex]);
        }
    }

    fn scan_to_body(&mut self, scan: &IndexedTarget) -> Result<()> {
        let count = self.body.model.len();
        let outsides: Vec<DVec3> = (0..count).map(|vertex| self.outside(vertex)).collect();
        let index = OrientedIndex::new(&outsides, &self.posed.normals, self.term.normal_weight)?;
        let mut sums = vec![(0.0, DVec3::ZERO); count];
        let seekers = scan.target.seekers(self.term.seekers);
        let share = TOTAL_WEIGHT / seekers.len() as f64;
        for (point, normal) in seekers {
            let (vertex, _) = index.nearest(point, normal);
            let way = point - outsides[vertex];
            let weight = self.weight(way.length(), normal.dot(self.posed.normals[vertex])) * share;
            sums[vertex].0 += weight;
            sums[vertex].1 += way * weight;
        }
        for (vertex, (weight, sum)) in sums.into_iter().enumerate().filter(|(_, (weight, _))| *weight > 0.0) {
            if self.is_unseen(vertex) {
                continue;
            }
            self.add_rows(vertex, self.posed.normals[vertex], sum / weight, weight);
        }
        Ok(())
    }

    fn weight(&self, distance: f64, cosine: f64) -> f64 {
        weight((self.term.reach, self.term.deviation), distance, cosine)
    }

    fn is_unseen(&self, vertex: usize) -> bool {
        self.body.unseen.contains(&self.body.model.parts[vertex])
    }

    /// Rows of a vertex that should move by `way`: along n, and a little along the axes.
    fn add_rows(&mut self, vertex: usize, n: DVec3, way: DVec3, weight: f64) {
        // Nothing of a match that far away is left in the sums.
        const NOTHING: f64 = 1e-9;
        if weight < NOTHING {
            return;
        }
        let basis = Basis { linkage: self.body.linkage, chain: &self.posed.chain, unknowns: self.unknowns };
        let mut add = |n: DVec3, weight: f64| {
            self.body.model.points().row(basis, &self.posed.points, vertex, n, &mut self.row);
            self.equations.add(&self.row, -n.dot(way), weight);
        };
        add(n, weight);
        if self.term.along > 0.0 {
            DVec3::AXES.into_iter().for_each(|axis| add(axis, weight * self.term.along));
        }
    }
}

fn weight((reach, deviation): (f64, f64), distance: f64, cosine: f64) -> f64 {
    robust::weight(distance, reach) * cosine.max(0.0) / deviation.powi(2)
}
