//! Which lattice points may change sides without a change of topology: simple points (Bertrand & Malandain 1994).
//!
//! Marching cubes here joins inside points along edges of the lattice (6-connected) and outside points across faces too (18-connected).
//! For that pair a point is simple if, among the 26 points around it, one piece of the inside and one of the outside touch it. A
//! neighbourhood is a mask of 27 bits, bit 9 (z + 1) + 3 (y + 1) + x + 1 for the point at (x, y, z) from the centre: inside or not.

use std::sync::LazyLock;

use glam::IVec3;

/// The bit of the point itself.
const CENTRE: usize = 13;
const ALL: u32 = (1 << 27) - 1;

/// Where the point of a bit is, from the centre.
pub(super) fn place(bit: usize) -> IVec3 {
    IVec3::new(bit as i32 % 3 - 1, bit as i32 / 3 % 3 - 1, bit as i32 / 9 - 1)
}

/// Neighbours at most so many axes apart: 1 for 6 of them, 2 for 18, 3 for 26.
struct Adjacency([u32; 27]);

impl Adjacency {
    fn of(axes: i32) -> Self {
        let is_beside = |a: usize, b: usize| {
            let apart = (place(a) - place(b)).abs();
            a != b && apart.max_element() == 1 && apart.element_sum() <= axes
        };
        Self(std::array::from_fn(|a| (0..27).filter(|b| is_beside(a, *b)).fold(0, |mask, b| mask | 1 << b)))
    }

    /// The points of a set and those beside them.
    fn widened(&self, set: u32) -> u32 {
        bits(set).fold(set, |mask, bit| mask | self.0[bit])
    }

    /// How many connected pieces a set has, up to two.
    fn pieces(&self, set: u32) -> usize {
        let mut left = set;
        let mut count = 0;
        while left != 0 && count < 2 {
            let mut piece = left & left.wrapping_neg();
            loop {
                let wider = self.widened(piece) & left;
                if wider == piece {
                    break;
                }
                piece = wider;
            }
            left &= !piece;
            count += 1;
        }
        count
    }
}

fn bits(mut set: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = set.trailing_zeros();
        set &= set.wrapping_sub(1);
        (bit < 32).then_some(bit as usize)
    })
}

/// Whether the centre of a neighbourhood may change sides.
pub(super) fn is_simple(inside: u32) -> bool {
    static BESIDE: LazyLock<[Adjacency; 2]> = LazyLock::new(|| [1, 2].map(Adjacency::of));
    let [six, eighteen] = &*BESIDE;
    let around = ALL & !(1 << CENTRE);
    let (inside, outside) = (inside & around, !inside & around);
    // What is reached in three steps along edges, and in two steps that may go across faces.
    let first = inside & six.0[CENTRE];
    let second = six.widened(first) & inside;
    let third = six.widened(second) & inside;
    let near = outside & eighteen.0[CENTRE];
    let beyond = eighteen.widened(near) & outside;
    six.pieces(third) == 1 && eighteen.pieces(beyond) == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(inside: impl Fn(IVec3) -> bool) -> u32 {
        (0..27).filter(|bit| inside(place(*bit))).fold(0, |mask, bit| mask | 1 << bit)
    }

    #[test]
    fn points_of_a_flat_side_are_simple_and_links_are_not() {
        assert!(is_simple(mask(|p| p.z < 0)), "above a plane");
        assert!(is_simple(mask(|p| p.z <= 0)), "of a plane");
        assert!(!is_simple(mask(|p| p.z < 0 || (p.x == 0 && p.y == 0))), "a post's foot");
        assert!(!is_simple(mask(|p| p.x.abs() == 1 && p.y == 0 && p.z == 0)), "a bridge");
        assert!(!is_simple(mask(|p| p.z != 0)), "a gap between two plates");
        assert!(!is_simple(mask(|_| true)) && !is_simple(mask(|_| false)), "alone");
        assert!(is_simple(mask(|p| p == IVec3::X)), "an end");
    }

    // Inside points that meet at an edge of the lattice's cells are apart, outside points are one.
    #[test]
    fn diagonals_separate_the_inside_and_join_the_outside() {
        let corner = IVec3::new(1, 1, 0);
        assert!(!is_simple(mask(|p| p == corner)), "it would be a piece of its own");
        assert!(!is_simple(mask(|p| p != corner && p != -corner)), "two outside pieces would be joined");
        assert!(is_simple(mask(|p| p != corner)), "beside the outside");
    }
}
