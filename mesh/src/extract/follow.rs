//! Finding the cells that the surface crosses: coarse search, bisection of crossed edges, then from cell to cell.

use std::collections::BTreeSet;

use glam::{IVec3, UVec3};

use super::lattice::{Box3, SparseLattice, corner};
use super::samples::Samples;
use xavatar_formats::Result;

/// Fewest cells along the longest side with which the search starts (X-Avatar's `resolution_0`).
const COARSEST: u32 = 32;
/// Refinements of the search, each of which looks one cell beyond the crossed ones.
const REFINEMENTS: u32 = 1;

/// The unit cells that the surface crosses, in lattice order: z, then y, then x.
pub(super) fn follow_surface(samples: &mut Samples) -> Result<Vec<UVec3>> {
    let edges = find_crossed_edges(samples)?;
    let seeds = bisect(edges, samples)?;
    follow(&seeds, samples)
}

/// A cube of `step` lattice points a side, cut off at the box.
#[derive(Clone, Copy)]
struct CoarseCell {
    origin: UVec3,
    step: u32,
}

impl CoarseCell {
    fn corner(self, index: u8, lattice: Box3) -> UVec3 {
        (self.origin + corner(UVec3::ZERO, index) * self.step).min(lattice.cells)
    }

    fn crossed_edges(self, samples: &Samples) -> impl Iterator<Item = CrossedEdge> {
        let corners: [UVec3; 8] = std::array::from_fn(|c| self.corner(c as u8, samples.lattice()));
        let inside = corners.map(|point| samples.is_inside(point));
        (0..8usize).flat_map(move |a| [a | 1, a | 2, a | 4].into_iter().map(move |b| (a, b))).filter_map(
            move |(a, b)| match (inside[a], inside[b]) {
                (true, false) => Some(CrossedEdge { inside: corners[a], outside: corners[b] }),
                (false, true) => Some(CrossedEdge { inside: corners[b], outside: corners[a] }),
                _ => None,
            },
        )
    }
}

/// Lattice points on one line parallel to an axis, with the surface between them.
#[derive(Clone, Copy)]
struct CrossedEdge {
    inside: UVec3,
    outside: UVec3,
}

fn find_crossed_edges(samples: &mut Samples) -> Result<Vec<CrossedEdge>> {
    let cells = samples.lattice().cells;
    let longest = cells.max_element();
    let mut step = 1;
    while longest / (2 * step) >= COARSEST {
        step *= 2;
    }
    let last_step = (step >> REFINEMENTS).max(1);
    let along = cells.map(|n| n.div_ceil(step));
    let mut searched: BTreeSet<[u32; 3]> = boxes(UVec3::ZERO, along).map(|c| c.to_array()).collect();
    loop {
        let coarse = |cell: &[u32; 3]| CoarseCell { origin: UVec3::from_array(*cell) * step, step };
        for cell in searched.iter().map(coarse) {
            (0..8).for_each(|c| samples.ask(cell.corner(c, samples.lattice())));
        }
        samples.evaluate()?;
        // Where everything is inside, only the cap would be found: the box itself.
        let worthwhile = samples.saw_both_sides();
        let is_crossed = |cell: &&[u32; 3]| worthwhile && coarse(cell).crossed_edges(samples).next().is_some();
        if step == last_step {
            return Ok(searched.iter().filter(is_crossed).flat_map(|c| coarse(c).crossed_edges(samples)).collect());
        }
        let crossed: Vec<UVec3> = searched.iter().filter(is_crossed).map(|&c| UVec3::from_array(c)).collect();
        step /= 2;
        let along = cells.map(|n| n.div_ceil(step));
        searched = if crossed.is_empty() {
            boxes(UVec3::ZERO, along).map(|c| c.to_array()).collect()
        } else {
            let around = |c: UVec3| boxes((c * 2).saturating_sub(UVec3::splat(2)), (c * 2 + 4).min(along));
            crossed.into_iter().flat_map(around).map(|c| c.to_array()).collect()
        };
    }
}

/// All cells from `low` up to, not including, `high`.
fn boxes(low: UVec3, high: UVec3) -> impl Iterator<Item = UVec3> {
    (low.x..high.x)
        .flat_map(move |x| (low.y..high.y).flat_map(move |y| (low.z..high.z).map(move |z| UVec3::new(x, y, z))))
}

/// Halves all edges together until they are unit edges; a unit cell at each.
fn bisect(mut edges: Vec<CrossedEdge>, samples: &mut Samples) -> Result<Vec<UVec3>> {
    let length = |edge: &CrossedEdge| edge.inside.as_ivec3().distance_squared(edge.outside.as_ivec3());
    let middle = |edge: &CrossedEdge| (edge.inside + edge.outside) / 2;
    loop {
        let long = edges.iter().filter(|e| length(e) > 1);
        let middles: Vec<UVec3> = long.map(middle).collect();
        if middles.is_empty() {
            // An inside point is never on the boundary, so the cell above the edge's lower end is in the box.
            return Ok(edges.iter().map(|e| e.inside.min(e.outside)).collect());
        }
        middles.into_iter().for_each(|m| samples.ask(m));
        samples.evaluate()?;
        for edge in edges.iter_mut().filter(|e| length(e) > 1) {
            let middle = middle(edge);
            *(if samples.is_inside(middle) { &mut edge.inside } else { &mut edge.outside }) = middle;
        }
    }
}

/// Every cell that the surface reaches from `seeds`: it goes on through each cube face with corners of both kinds.
fn follow(seeds: &[UVec3], samples: &mut Samples) -> Result<Vec<UVec3>> {
    let mut reached = SparseLattice::new(samples.lattice().cells, false);
    let mut crossed = Vec::new();
    let mut front = Vec::new();
    for &seed in seeds {
        if !std::mem::replace(reached.entry(seed), true) {
            front.push(seed);
        }
    }
    while !front.is_empty() {
        for &cell in &front {
            (0..8).for_each(|c| samples.ask(corner(cell, c)));
        }
        samples.evaluate()?;
        let mut next = Vec::new();
        for &cell in &front {
            for direction in crossed_faces(samples.case(cell)) {
                // Boundary points are outside, so the surface never leaves the box.
                let neighbour = (cell.as_ivec3() + direction).as_uvec3();
                if !std::mem::replace(reached.entry(neighbour), true) {
                    next.push(neighbour);
                }
            }
        }
        crossed.append(&mut front);
        front = next;
    }
    crossed.sort_unstable_by_key(|cell| (cell.z, cell.y, cell.x));
    Ok(crossed)
}

/// Directions out of a cell through its faces with both inside and outside corners.
fn crossed_faces(case: u8) -> impl Iterator<Item = IVec3> {
    // Corners whose bit of the axis is zero.
    const LOW: [u8; 3] = [0b0101_0101, 0b0011_0011, 0b0000_1111];
    (0..3).flat_map(move |axis| {
        [(LOW[axis], -1), (!LOW[axis], 1)]
            .into_iter()
            .filter(move |(corners, _)| case & corners != 0 && case & corners != *corners)
            .map(move |(_, side)| IVec3::AXES[axis] * side)
    })
}
