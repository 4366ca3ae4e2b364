//! A surface without handles: the few lattice points change sides that make the inside one ball.
//!
//! Where cloth or skin touches itself, as in an armpit, nothing tells a field what is between, and the level set has bridges and
//! tunnels of a few cells there. Two growths find them. The inside grown from its deepest point by simple points leaves out what
//! closes a ring: cutting there opens it, at its thinnest place. The outside grown from the box leaves out what joins its own through
//! a tunnel: filling there closes it, at its narrowest. Each patch of points left out is a candidate; the lightest that raise the
//! Euler characteristic V - E + F are taken until it is 2. What the growth of the inside alone makes is always a ball, and stands in if they
//! are not enough.

mod growth;
mod neighbourhood;
mod solid;

use std::collections::BTreeSet;

use glam::{IVec3, UVec3};

use self::growth::grow;
use self::solid::{FAR, Solid};
use super::cases;
use super::lattice::corner;
use super::samples::Samples;
use xavatar_formats::Result;

/// Tunnels wider than twice this, cells, are cut open and not filled.
const WIDEST: u8 = 3;
/// 2 (V - E + F) of a surface without handles.
const BALL: i64 = 4;

/// Moves points to the other side so that the inside is one ball. The cells that its surface crosses, in lattice order.
pub(super) fn mend(samples: &mut Samples, crossed: &[UVec3]) -> Result<Vec<UVec3>> {
    let found = Solid::of(samples);
    let ball = mended(&found, samples);
    let is_changed = |index: &usize| {
        let depth = samples.depth(ball.point(*index));
        ball.inside[*index] != if depth.is_nan() { found.inside[*index] } else { depth > 0.0 }
    };
    let changed = (0..ball.inside.len()).filter(is_changed).map(|index| ball.point(index));
    let around = changed.flat_map(|point| (0..8).map(move |c| point - corner(UVec3::ZERO, c)));
    let in_order = |cell: UVec3| [cell.z, cell.y, cell.x];
    let cells: BTreeSet<[u32; 3]> = crossed.iter().copied().chain(around).map(in_order).collect();
    let cells = || cells.iter().map(|[z, y, x]| UVec3::new(*x, *y, *z));
    cells().for_each(|cell| (0..8).for_each(|c| samples.ask(corner(cell, c))));
    samples.evaluate()?;
    for point in cells().flat_map(|cell| (0..8).map(move |c| corner(cell, c))) {
        samples.take_to(point, ball.inside[ball.index(point)]);
    }
    Ok(cells().filter(|cell| !matches!(samples.case(*cell), 0 | u8::MAX)).collect())
}

fn mended(found: &Solid, samples: &Samples) -> Solid {
    let distances = found.distances(WIDEST);
    let depth = |index: usize| {
        let depth = samples.depth(found.point(index)).abs();
        // Positive numbers are in the order of their bits; points that were not evaluated have none.
        (distances[index], if depth.is_nan() { 0 } else { depth.to_bits() })
    };
    let deepest = (0..distances.len()).filter(|index| found.inside[*index]).max_by_key(|index| depth(*index));
    let Some(deepest) = deepest else { return found.clone() };
    let mut cut = found.clone();
    cut.inside.fill(false);
    cut.inside[deepest] = true;
    grow(&mut cut, true, |index| found.inside[index], depth);

    let far = found.reached_from_boundary(1, |index| !found.inside[index] && distances[index] == FAR);
    let mut filled = found.clone();
    filled.inside.iter_mut().zip(&far).for_each(|(inside, far)| *inside = !far);
    let is_near = |index: usize| !found.inside[index] && !found.is_on_boundary(index);
    grow(&mut filled, false, is_near, depth);

    let mut patches = patches(found, &cut);
    patches.extend(self::patches(found, &filled));
    let weight = |patch: &Vec<usize>| patch.iter().map(|index| usize::from(distances[*index])).sum::<usize>();
    patches.sort_by_cached_key(|patch| (weight(patch), patch.first().copied()));
    let mut mended = found.clone();
    let mut doubled = whole_characteristic(&mended);
    for patch in &patches {
        if doubled == BALL {
            break;
        }
        let before = characteristic_around(&mended, patch);
        patch.iter().for_each(|index| mended.inside[*index] ^= true);
        let gained = characteristic_around(&mended, patch) - before;
        if gained > 0 {
            doubled += gained;
        } else {
            patch.iter().for_each(|index| mended.inside[*index] ^= true);
        }
    }
    // Pieces and handles can add up to the same.
    if doubled == BALL && mended.is_one_piece() { mended } else { cut }
}

/// The points that two solids have on different sides, as patches of neighbours.
fn patches(found: &Solid, grown: &Solid) -> Vec<Vec<usize>> {
    let steps = found.steps(3);
    let mut left: BTreeSet<usize> =
        (0..found.inside.len()).filter(|index| found.inside[*index] != grown.inside[*index]).collect();
    let mut patches = Vec::new();
    while let Some(first) = left.pop_first() {
        let mut patch = vec![first];
        let mut next = 0;
        while next < patch.len() {
            patch.extend(Solid::around(patch[next], &steps).filter(|index| left.remove(index)).collect::<Vec<_>>());
            next += 1;
        }
        patches.push(patch);
    }
    patches
}

/// 2 (V - E + F) of the surface around all of a solid.
fn whole_characteristic(solid: &Solid) -> i64 {
    let steps = solid.steps(1);
    let is_beside =
        |index: &usize| solid.inside[*index] && Solid::around(*index, &steps).any(|next| !solid.inside[next]);
    let shell: Vec<usize> = (0..solid.inside.len()).filter(is_beside).collect();
    characteristic_around(solid, &shell)
}

/// The part in 2 (V - E + F) of the lattice edges and cells that have one of the points: every crossed edge is a vertex, and a closed
/// surface of F triangles has 3 F / 2 edges.
fn characteristic_around(solid: &Solid, points: &[usize]) -> i64 {
    let (mut edges, mut cells) = (BTreeSet::new(), BTreeSet::new());
    for index in points {
        let point = solid.point(*index);
        for axis in 0..3 {
            edges.insert((*index, axis));
            edges.insert((solid.index((point.as_ivec3() - IVec3::AXES[axis]).as_uvec3()), axis));
        }
        cells.extend((0..8).map(|c| solid.index(point - corner(UVec3::ZERO, c))));
    }
    let is_crossed = |(index, axis): &&(usize, usize)| {
        let end = (*index as isize + solid.step(IVec3::AXES[*axis])) as usize;
        solid.inside[*index] != solid.inside[end]
    };
    let vertices = edges.iter().filter(is_crossed).count();
    let triangles: usize = cells.iter().map(|cell| cases::triangles(case(solid, *cell)).len()).sum();
    2 * vertices as i64 - triangles as i64
}

fn case(solid: &Solid, cell: usize) -> u8 {
    let cell = solid.point(cell);
    (0..8).filter(|c| solid.inside[solid.index(corner(cell, *c))]).fold(0, |case, c| case | 1 << c)
}
