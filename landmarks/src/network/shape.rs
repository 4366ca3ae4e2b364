//! Extents of what networks compute, one picture at a time: rows, columns and channels, the channels of a place next to each other.

use xavatar_formats::Fault;

/// Most numbers of one tensor: 64 MiB of them.
const MOST: usize = 1 << 24;

/// Extents of a picture of features; vectors have one row and one column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub rows: usize,
    pub columns: usize,
    pub channels: usize,
}

impl Shape {
    /// With extents as files have them: one picture first, whatever else is missing is 1.
    pub fn of(extents: &[usize]) -> Result<Self, Fault> {
        let shape = match extents {
            [] => [1, 1, 1],
            [1, rest @ ..] if rest.len() <= 3 => {
                let mut shape = [1; 3];
                shape[3 - rest.len()..].copy_from_slice(rest);
                shape
            }
            [channels] => [1, 1, *channels],
            _ => {
                return Err(Fault::malformed(
                    "a tensor's shape",
                    format_args!("{extents:?}"),
                    "1, rows, columns, channels",
                ));
            }
        };
        Self::new(shape[0], shape[1], shape[2])
    }

    /// With these extents, if that is neither nothing nor too much.
    pub fn new(rows: usize, columns: usize, channels: usize) -> Result<Self, Fault> {
        let count = rows.checked_mul(columns).and_then(|places| places.checked_mul(channels));
        if count.is_none_or(|count| count == 0 || count > MOST) {
            let found = format_args!("{rows} x {columns} x {channels}").to_string();
            return Err(Fault::malformed("a tensor's shape", found, format_args!("1 to {MOST} numbers")));
        }
        Ok(Self { rows, columns, channels })
    }

    /// Rows times columns.
    pub fn places(self) -> usize {
        self.rows * self.columns
    }

    /// How many numbers.
    pub fn len(self) -> usize {
        self.places() * self.channels
    }
}

/// How a window of `extent` pixels walks over a side of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Walk {
    pub extent: usize,
    pub stride: usize,
    /// Pixels before the first that the window also covers.
    pub before: usize,
    /// How many places it stands at.
    pub steps: usize,
}

impl Walk {
    /// Over `size` pixels. `padded`: a place for each `stride` pixels, the window as far out on either side; else within.
    pub fn over(size: usize, extent: usize, stride: usize, padded: bool) -> Result<Self, Fault> {
        if extent == 0 || stride == 0 || (!padded && extent > size) {
            let found = format_args!("{extent} pixels, every {stride} of {size}").to_string();
            return Err(Fault::malformed("an operator's window", found, "one that fits"));
        }
        let steps = if padded { size.div_ceil(stride) } else { (size - extent) / stride + 1 };
        let reach = (steps - 1) * stride;
        let outside = reach.checked_add(extent).map_or(usize::MAX, |end| end.saturating_sub(size));
        Ok(Self { extent, stride, before: if padded { outside / 2 } else { 0 }, steps })
    }

    /// Where the window's pixels begin at a step, and which of them (first and after last) are in the picture of `size` pixels.
    pub fn window(&self, step: usize, size: usize) -> (usize, std::ops::Range<usize>) {
        let start = step * self.stride;
        let first = self.before.saturating_sub(start);
        let last = (size + self.before).saturating_sub(start).min(self.extent);
        ((start + first).saturating_sub(self.before), first..last.max(first))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn padded_windows_reach_as_far_out_before_as_after_or_one_less() {
        let walk = Walk::over(8, 3, 2, true).unwrap();
        assert_eq!((walk.before, walk.steps), (0, 4));
        assert_eq!(walk.window(3, 8), (6, 0..2));
        let walk = Walk::over(8, 5, 1, true).unwrap();
        assert_eq!((walk.before, walk.steps), (2, 8));
        assert_eq!((walk.window(0, 8), walk.window(1, 8), walk.window(7, 8)), ((0, 2..5), (0, 1..5), (5, 0..3)));
    }

    #[test]
    fn windows_within_the_picture_never_leave_it() {
        let walk = Walk::over(7, 3, 2, false).unwrap();
        assert_eq!((walk.steps, walk.window(2, 7)), (3, (4, 0..3)));
        assert!(Walk::over(2, 3, 1, false).is_err() && Walk::over(2, 1, 0, true).is_err());
    }

    #[test]
    fn shapes_of_files_are_one_picture() {
        assert_eq!(Shape::of(&[1, 4, 5, 6]).unwrap(), Shape { rows: 4, columns: 5, channels: 6 });
        assert_eq!(Shape::of(&[1, 195]).unwrap(), Shape { rows: 1, columns: 1, channels: 195 });
        assert!(Shape::of(&[2, 4, 5, 6]).is_err() && Shape::of(&[1, 0]).is_err());
        assert!(Shape::of(&[1, usize::MAX, 2, 2]).is_err());
    }
}
