//! The unknowns of a frame as columns, and which of them a stage solves for.
//!
//! 3 turns of each of J joints, 3 of translation, E of expression, S of the shape that all frames share. A stage holds most of them
//! fixed; those it solves for are numbered anew, the shape's last.

use std::ops::Range;

/// How many columns there are of each kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extents {
    /// J.
    pub joints: usize,
    /// S.
    pub shapes: usize,
    /// E.
    pub expressions: usize,
}

impl Extents {
    /// The first of the three columns of a joint's turn.
    pub fn turn(self, joint: usize) -> usize {
        3 * joint
    }

    /// The columns of the translation.
    pub fn translation(self) -> Range<usize> {
        3 * self.joints..3 * self.joints + 3
    }

    /// The columns of the expression.
    pub fn expression(self) -> Range<usize> {
        let first = 3 * self.joints + 3;
        first..first + self.expressions
    }

    /// The columns of the shape.
    pub fn shape(self) -> Range<usize> {
        let first = 3 * self.joints + 3 + self.expressions;
        first..first + self.shapes
    }

    /// The column of a coefficient as bodies count them: shape first, then expression.
    pub fn coefficient(self, index: usize) -> usize {
        if index < self.shapes { self.shape().start + index } else { self.expression().start + index - self.shapes }
    }

    /// All columns.
    pub fn count(self) -> usize {
        self.shape().end
    }
}

/// What a stage solves for.
#[derive(Clone, Debug)]
pub struct Unknowns {
    extents: Extents,
    /// Of each column, its number among those that are solved for.
    places: Vec<Option<u16>>,
    of_frame: usize,
    count: usize,
}

/// What else than joints' turns is solved for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Besides {
    /// The translation.
    pub translation: bool,
    /// The expression.
    pub expression: bool,
    /// The subject's shape.
    pub shape: bool,
}

impl Unknowns {
    /// The turns of some joints, and what is solved for besides.
    pub fn new(extents: Extents, joints: &[usize], besides: Besides) -> Self {
        let mut places = vec![None; extents.count()];
        let turns = joints.iter().flat_map(|joint| extents.turn(*joint)..extents.turn(*joint) + 3);
        let wanted = |wanted: bool, columns: Range<usize>| if wanted { columns } else { 0..0 };
        let of_frame = turns
            .chain(wanted(besides.translation, extents.translation()))
            .chain(wanted(besides.expression, extents.expression()));
        let mut count = 0;
        let mut take = |column: usize| {
            places[column] = Some(count as u16);
            count += 1;
        };
        of_frame.for_each(&mut take);
        let shape = wanted(besides.shape, extents.shape());
        let shapes = shape.len();
        shape.for_each(&mut take);
        Self { extents, places, of_frame: count - shapes, count }
    }

    /// The kinds of columns.
    pub fn extents(&self) -> Extents {
        self.extents
    }

    /// The number of a column among those that are solved for.
    pub fn place(&self, column: usize) -> Option<usize> {
        self.places[column].map(usize::from)
    }

    /// How many are the frame's own.
    pub fn of_frame(&self) -> usize {
        self.of_frame
    }

    /// How many there are, with the shape's.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Spreads a step of those that are solved for over all columns; the others do not move.
    pub fn spread(&self, step: &[f64]) -> Vec<f64> {
        self.places.iter().map(|place| place.map_or(0.0, |place| step[usize::from(place)])).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shape_comes_last_and_what_is_fixed_does_not_move() {
        let extents = Extents { joints: 4, shapes: 2, expressions: 3 };
        let besides = Besides { shape: true, translation: true, expression: false };
        let unknowns = Unknowns::new(extents, &[3, 1], besides);
        assert_eq!((unknowns.of_frame(), unknowns.count(), extents.count()), (9, 11, 20));
        assert_eq!(unknowns.place(extents.turn(3)), Some(0));
        assert_eq!(unknowns.place(extents.turn(0)), None);
        assert_eq!(unknowns.place(extents.coefficient(1)), Some(10));
        assert_eq!(unknowns.place(extents.coefficient(2)), None);
        let step: Vec<f64> = (1..=11).map(f64::from).collect();
        let spread = unknowns.spread(&step);
        assert_eq!(spread[extents.translation()], [7.0, 8.0, 9.0]);
        assert_eq!(spread[extents.turn(0)], 0.0);
    }
}
