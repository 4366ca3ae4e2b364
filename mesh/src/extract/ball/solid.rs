//! Every point of the lattice as inside or outside, one piece each, and how far it is from the other side.

use glam::{IVec3, UVec3};

use super::super::samples::Samples;
use super::neighbourhood::place;

/// Farther than any distance that is told apart.
pub(super) const FAR: u8 = u8::MAX;

/// The points around one that are at most so many axes apart from it.
fn places(axes: i32) -> impl Iterator<Item = IVec3> {
    (0..27).map(place).filter(move |place| (1..=axes).contains(&place.abs().element_sum()))
}

/// Sides of the lattice's points, in the order x, then y, then z.
#[derive(Clone, PartialEq)]
pub(super) struct Solid {
    points: UVec3,
    pub(super) inside: Vec<bool>,
}

impl Solid {
    /// Of a field whose crossed cells were evaluated: its largest piece, without cavities.
    pub(super) fn of(samples: &Samples) -> Self {
        let points = samples.lattice().points();
        let mut solid = Self { points, inside: vec![false; points.element_product() as usize] };
        // Two neighbours on different sides were both evaluated; all others are on the side of their neighbours.
        for index in 1..solid.inside.len() {
            let here = solid.point(index);
            if here.x > 0 {
                let depths = [samples.depth(here - UVec3::X), samples.depth(here)];
                let is_known = depths.iter().all(|depth| !depth.is_nan());
                solid.inside[index] = if is_known { depths[1] > 0.0 } else { solid.inside[index - 1] };
            }
        }
        solid.keep_one_piece();
        solid
    }

    pub(super) fn index(&self, point: UVec3) -> usize {
        ((point.z * self.points.y + point.y) * self.points.x + point.x) as usize
    }

    pub(super) fn point(&self, index: usize) -> UVec3 {
        let (index, row) = (index as u32, self.points.x);
        UVec3::new(index % row, index / row % self.points.y, index / row / self.points.y)
    }

    pub(super) fn is_on_boundary(&self, index: usize) -> bool {
        let point = self.point(index);
        point.cmpeq(UVec3::ZERO).any() || point.cmpeq(self.points - 1).any()
    }

    /// How far it is in `inside` from a point to another at this place from it; the box is wide enough for both.
    pub(super) fn step(&self, place: IVec3) -> isize {
        let [row, layer] = [self.points.x as isize, (self.points.x * self.points.y) as isize];
        place.x as isize + place.y as isize * row + place.z as isize * layer
    }

    /// The steps to the 26 points around, or those of them at most so many axes apart.
    pub(super) fn steps(&self, axes: i32) -> Vec<isize> {
        places(axes).map(|place| self.step(place)).collect()
    }

    /// The points around one that is not on the boundary.
    pub(super) fn around(index: usize, steps: &[isize]) -> impl Iterator<Item = usize> {
        steps.iter().map(move |step| (index as isize + step) as usize)
    }

    /// The boundary, and what is reached from it by steps over at most so many axes through points that `may_pass`.
    pub(super) fn reached_from_boundary(&self, axes: i32, may_pass: impl Fn(usize) -> bool) -> Vec<bool> {
        let places: Vec<IVec3> = places(axes).collect();
        let mut reached: Vec<bool> = (0..self.inside.len()).map(|index| self.is_on_boundary(index)).collect();
        let mut front: Vec<usize> = (0..reached.len()).filter(|index| reached[*index]).collect();
        while let Some(index) = front.pop() {
            let here = self.point(index).as_ivec3();
            for place in &places {
                let there = here + *place;
                if there.cmplt(IVec3::ZERO).any() || there.cmpge(self.points.as_ivec3()).any() {
                    continue;
                }
                let next = self.index(there.as_uvec3());
                if !reached[next] && may_pass(next) {
                    reached[next] = true;
                    front.push(next);
                }
            }
        }
        reached
    }

    /// Whether inside and outside are one piece each.
    pub(super) fn is_one_piece(&self) -> bool {
        let mut whole = self.clone();
        whole.keep_one_piece();
        whole == *self
    }

    /// Leaves the largest 6-connected piece of the inside, and fills what of the outside is not 18-connected with the boundary.
    fn keep_one_piece(&mut self) {
        let steps = self.steps(1);
        let mut piece_of = vec![0_u32; self.inside.len()];
        let mut sizes = vec![0_usize];
        for first in 0..self.inside.len() {
            if !self.inside[first] || piece_of[first] != 0 {
                continue;
            }
            let piece = sizes.len() as u32;
            sizes.push(0);
            piece_of[first] = piece;
            let mut front = vec![first];
            while let Some(index) = front.pop() {
                sizes[piece as usize] += 1;
                for next in Self::around(index, &steps) {
                    if self.inside[next] && piece_of[next] == 0 {
                        piece_of[next] = piece;
                        front.push(next);
                    }
                }
            }
        }
        let largest = (1..sizes.len()).reduce(|best, piece| if sizes[piece] > sizes[best] { piece } else { best });
        let largest = largest.unwrap_or_default() as u32;
        self.inside.iter_mut().zip(&piece_of).for_each(|(inside, piece)| *inside &= *piece == largest);
        let reached = self.reached_from_boundary(2, |index| !self.inside[index]);
        self.inside.iter_mut().zip(reached).for_each(|(inside, reached)| *inside |= !reached);
    }

    /// Steps along edges from each point to the other side, at least one; [`FAR`] beyond `farthest` outside.
    pub(super) fn distances(&self, farthest: u8) -> Vec<u8> {
        let steps = self.steps(1);
        let mut distances = vec![FAR; self.inside.len()];
        let within: Vec<usize> = (0..distances.len()).filter(|index| !self.is_on_boundary(*index)).collect();
        let is_beside =
            |index: &usize| Self::around(*index, &steps).any(|next| self.inside[next] != self.inside[*index]);
        let mut front: Vec<usize> = within.into_iter().filter(is_beside).collect();
        front.iter().for_each(|index| distances[*index] = 1);
        for distance in 2..FAR {
            let mut next = Vec::new();
            for index in front {
                let may_go_on = self.inside[index] || distance <= farthest;
                for other in Self::around(index, &steps).filter(|_| may_go_on) {
                    let is_same_side = self.inside[other] == self.inside[index];
                    if distances[other] == FAR && is_same_side && !self.is_on_boundary(other) {
                        distances[other] = distance;
                        next.push(other);
                    }
                }
            }
            front = next;
        }
        distances
    }
}
