//! One axis of a rectilinear grid: sorted coordinates, unevenly spaced, found again by a table in constant time.
//!
//! The table has a bin for every half of the smallest spacing, so that a bin holds one coordinate at most and a look-up
//! is one load of one record and one comparison. Metres.

use xavatar_network::Real;

use crate::{Error, Result};

/// Most bins of a table: enough for a millimetre in 30 m.
const MOST_BINS: usize = 1 << 16;

/// The coordinates of a grid's nodes along one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis<T> {
    nodes: Vec<T>,
    bins: Vec<Bin<T>>,
    /// Bins per metre.
    bin_density: T,
}

/// What a look-up needs of a bin: the cell that its lower end is in and the one after it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bin<T> {
    /// Where the second cell begins; infinite if there is none.
    border: T,
    /// The cells' lower coordinates.
    starts: [T; 2],
    /// 1 / width of the cells.
    densities: [T; 2],
    /// The first cell's number.
    cell: u32,
}

/// Where a coordinate is on an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place<T> {
    pub cell: usize,
    /// Where in the cell, in [0, 1].
    pub fraction: T,
}

impl<T: Real> Axis<T> {
    /// An axis with these coordinates, in metres.
    ///
    /// # Errors
    /// If there are fewer than two, they do not rise, are not finite, or lie closer than a 2^15th of their extent.
    pub fn new(nodes: Vec<T>) -> Result<Self> {
        let fault = |found: String| Error::Value {
            name: "a grid's axis",
            found,
            expected: "two or more finite, rising coordinates, none closer than a 2^15th of the extent".to_owned(),
        };
        let (&[lowest, ..], &[.., highest]) = (&nodes[..], &nodes[..]) else {
            return Err(fault("empty".to_owned()));
        };
        let extent = highest - lowest;
        let smallest = nodes.windows(2).map(|pair| pair[1] - pair[0]).fold(T::infinity(), |smallest, width| {
            // A NaN becomes zero here, and is refused.
            if width > T::zero() { smallest.min(width) } else { T::zero() }
        });
        let count = (T::of(2.0) * extent / smallest).to_usize().map_or(usize::MAX, |count| count.saturating_add(2));
        if !(smallest > T::zero() && extent.is_finite()) || nodes.len() < 2 || count > MOST_BINS {
            return Err(fault(format!("{} coordinates from {lowest:?} to {highest:?}", nodes.len())));
        }
        let bin_density = T::of(2.0) / smallest;
        let last = nodes.len() - 2;
        let density = |cell: usize| T::one() / (nodes[cell + 1] - nodes[cell]);
        let bins = (0..count).map(|bin| {
            let lower = lowest + T::of(bin as f64) / bin_density;
            let cell = (nodes.partition_point(|&node| node <= lower).max(1) - 1).min(last);
            let next = (cell + 1).min(last);
            Bin {
                border: if next > cell { nodes[next] } else { T::infinity() },
                starts: [nodes[cell], nodes[next]],
                densities: [density(cell), density(next)],
                cell: cell as u32,
            }
        });
        Ok(Self { bins: bins.collect(), nodes, bin_density })
    }

    /// An axis of `count` coordinates from `lowest` to `highest`, both included.
    ///
    /// # Errors
    /// As [`Axis::new`].
    pub fn regular(lowest: T, highest: T, count: usize) -> Result<Self> {
        let steps = count.saturating_sub(1).min(MOST_BINS);
        Self::new(divided(lowest, highest, steps).chain([highest]).collect())
    }

    /// An axis from `lowest` to `highest` whose cells are at most `spacing` wide, and where a range (from, to, spacing)
    /// says so finer. Of overlapping ranges the finest counts.
    ///
    /// # Errors
    /// If a spacing is not positive; otherwise as [`Axis::new`].
    pub fn refined(lowest: T, highest: T, spacing: T, finer: &[(T, T, T)]) -> Result<Self> {
        let mut spacings = finer.iter().map(|range| range.2).chain([spacing]);
        if let Some(wrong) = spacings.find(|spacing| spacing.is_nan() || *spacing <= T::zero()) {
            let expected = "a positive number of metres".to_owned();
            return Err(Error::Value { name: "a grid's spacing", found: format!("{wrong:?}"), expected });
        }
        let inside = |value: &T| *value > lowest && *value < highest;
        let mut ends: Vec<T> = finer.iter().flat_map(|range| [range.0, range.1]).filter(inside).collect();
        ends.extend([lowest, highest]);
        ends.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        // Ends closer than half the finest spacing are one: they would only add needlessly thin cells.
        let thin = finer.iter().map(|range| range.2).fold(spacing, T::min) * T::of(0.5);
        ends.dedup_by(|next, kept| *next - *kept < thin);
        if let Some(last) = ends.last_mut() {
            *last = highest;
        }
        let pieces = ends.windows(2).flat_map(|pair| {
            let middle = (pair[0] + pair[1]) * T::of(0.5);
            let covering = finer.iter().filter(|range| range.0 <= middle && middle <= range.1);
            let width = covering.map(|range| range.2).fold(spacing, T::min);
            let steps = ((pair[1] - pair[0]) / width - T::of(1e-3)).ceil().max(T::one());
            divided(pair[0], pair[1], steps.to_usize().unwrap_or(0).min(MOST_BINS))
        });
        Self::new(pieces.chain([highest]).collect())
    }

    /// The coordinates, rising.
    pub fn nodes(&self) -> &[T] {
        &self.nodes
    }

    /// The cell that holds a coordinate, or the nearest one; a NaN is in the first.
    #[inline(always)]
    pub(crate) fn place(&self, value: T) -> Place<T> {
        let from_lowest = (value - self.bins[0].starts[0]).max(T::zero());
        // Truncation saturates: a coordinate far beyond the end is in the last bin.
        let number = (from_lowest * self.bin_density).truncated() as usize;
        let bin = &self.bins[number.min(self.bins.len() - 1)];
        let is_second = value >= bin.border;
        let start = if is_second { bin.starts[1] } else { bin.starts[0] };
        let density = if is_second { bin.densities[1] } else { bin.densities[0] };
        let fraction = ((value - start) * density).max(T::zero()).min(T::one());
        Place { cell: bin.cell as usize + usize::from(is_second), fraction }
    }

    /// d fraction / d value in a cell, 1/m; zero beyond the axis' ends.
    pub(crate) fn slope(&self, cell: usize, value: T) -> T {
        let inside = value >= self.nodes[0] && value <= self.nodes[self.nodes.len() - 1];
        if inside { T::one() / (self.nodes[cell + 1] - self.nodes[cell]) } else { T::zero() }
    }
}

/// The lower ends of `steps` equal parts of an interval.
fn divided<T: Real>(from: T, to: T, steps: usize) -> impl Iterator<Item = T> {
    (0..steps).map(move |step| from + (to - from) * (T::of(step as f64) / T::of(steps as f64)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_coordinate_is_found_in_its_cell() {
        let axis =
            Axis::refined(-1.0_f32, 1.1, 0.1, &[(-0.93, -0.5, 0.013), (0.2, 0.31, 0.04), (0.3, 0.9, 0.03)]).unwrap();
        let nodes = axis.nodes();
        assert_eq!((nodes[0], nodes[nodes.len() - 1]), (-1.0, 1.1));
        for value in (-1000..=1100).map(|step| step as f32 * 1e-3).chain(nodes.iter().copied()) {
            let Place { cell, fraction } = axis.place(value);
            assert!(nodes[cell] <= value && value <= nodes[cell + 1], "{value} in {cell}");
            assert!((nodes[cell] + fraction * (nodes[cell + 1] - nodes[cell]) - value).abs() < 1e-6);
        }
        for (value, expected) in
            [(-5.0, (0, 0.0)), (f32::NAN, (0, 0.0)), (7.0, (nodes.len() - 2, 1.0)), (1e30, (nodes.len() - 2, 1.0))]
        {
            let Place { cell, fraction } = axis.place(value);
            assert_eq!((cell, fraction), expected, "{value}");
            assert_eq!(axis.slope(cell, value), 0.0);
        }
    }

    #[test]
    fn refined_axes_are_fine_where_asked_and_nowhere_finer() {
        let axis = Axis::refined(0.0_f64, 1.0, 0.1, &[(0.5, 0.7, 0.02), (0.65, 0.8, 0.05), (0.95, 3.0, 0.01)]).unwrap();
        let width_at = |value: f64| {
            let cell = axis.place(value).cell;
            axis.nodes()[cell + 1] - axis.nodes()[cell]
        };
        for (value, width) in [(0.1, 0.1), (0.55, 0.02), (0.68, 0.02), (0.75, 0.05), (0.97, 0.01)] {
            assert!(width_at(value) <= width + 1e-9 && width_at(value) > 0.8 * width, "{value}: {}", width_at(value));
        }
    }

    #[test]
    fn impossible_axes_are_refused() {
        for nodes in [
            vec![],
            vec![1.0],
            vec![1.0, 1.0],
            vec![0.0, 2.0, 1.0],
            vec![0.0, f64::NAN, 1.0],
            vec![0.0, 1e-9, 1.0],
            vec![0.0, f64::INFINITY],
        ] {
            assert!(Axis::new(nodes.clone()).is_err(), "{nodes:?}");
        }
        assert!(Axis::regular(0.0, 1.0, 1).is_err() && Axis::regular(0.0, 1.0, usize::MAX).is_err());
        for spacing in [0.0, -1.0, f64::NAN] {
            assert!(Axis::refined(0.0, 1.0, 0.1, &[(0.2, 0.3, spacing)]).is_err());
        }
    }
}
