//! Growing one side of the lattice without a change of topology, what is deepest first.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::neighbourhood::{is_simple, place};
use super::solid::Solid;

/// Has points of `grown` change to the side `to`, where that changes no topology, if they are `wanted`; those of the largest `depth` first.
pub(super) fn grow<Depth: Ord + Copy>(
    grown: &mut Solid,
    to: bool,
    wanted: impl Fn(usize) -> bool,
    depth: impl Fn(usize) -> Depth,
) {
    let around = grown.steps(3);
    let neighbourhood: Vec<(isize, u32)> = (0..27).map(|bit| (grown.step(place(bit)), 1 << bit)).collect();
    let is_waiting = |grown: &Solid, index: usize| grown.inside[index] != to && wanted(index);
    let mut line: BinaryHeap<(Depth, Reverse<usize>)> = BinaryHeap::new();
    // A point stands in line once: a second time would come right after the first, and change nothing.
    let mut is_in_line = vec![false; grown.inside.len()];
    for index in 0..grown.inside.len() {
        if is_waiting(grown, index) && Solid::around(index, &around).any(|next| grown.inside[next] == to) {
            is_in_line[index] = true;
            line.push((depth(index), Reverse(index)));
        }
    }
    while let Some((_, Reverse(index))) = line.pop() {
        is_in_line[index] = false;
        let is_inside = |(step, bit): &(isize, u32)| {
            if grown.inside[(index as isize + step) as usize] { *bit } else { 0 }
        };
        if !is_simple(neighbourhood.iter().map(is_inside).sum()) {
            continue;
        }
        grown.inside[index] = to;
        for next in Solid::around(index, &around) {
            if !is_in_line[next] && is_waiting(grown, next) {
                is_in_line[next] = true;
                line.push((depth(next), Reverse(next)));
            }
        }
    }
}
