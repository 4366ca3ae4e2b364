//! Frequency encoding of a point (thesis fig. A.5): e(x) = [x, sin 2^0 x, cos 2^0 x, ..., sin 2^(F-1) x, cos 2^(F-1) x].
//!
//! Each entry depends on one coordinate only, so first and second derivatives are diagonal per block:
//! e' = [1, w cos, -w sin, ...], e'' = [0, -w^2 sin, -w^2 cos, ...] with w = 2^f. D coordinates, E = D (1 + 2 F) entries.

use crate::Real;

/// The encoding of D-dimensional points with F frequencies; F = 0 is the identity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrequencyEncoding {
    pub dimensions: usize,
    pub frequencies: usize,
}

impl FrequencyEncoding {
    /// E.
    pub fn width(self) -> usize {
        self.dimensions * (1 + 2 * self.frequencies)
    }

    /// Writes e(x), (E).
    pub fn encode<T: Real>(self, point: &[T], encoded: &mut [T]) {
        let (identity, waves) = encoded.split_at_mut(self.dimensions);
        identity.copy_from_slice(point);
        self.for_each_wave(point, waves, |_, sine, cosine, wave| *wave = (sine, cosine));
    }

    /// Writes e'(x) v for a direction v (D), (E).
    pub fn push_forward<T: Real>(self, point: &[T], direction: &[T], tangent: &mut [T]) {
        let (identity, waves) = tangent.split_at_mut(self.dimensions);
        identity.copy_from_slice(direction);
        let dimensions = self.dimensions;
        let mut index = 0;
        self.for_each_wave(point, waves, |frequency, sine, cosine, wave| {
            let speed = frequency * direction[index % dimensions];
            index += 1;
            *wave = (speed * cosine, -(speed * sine));
        });
    }

    /// Adds e'(x)^T c to `gradient` (D) for a cotangent c (E).
    pub fn pull_back<T: Real>(self, point: &[T], cotangent: &[T], gradient: &mut [T]) {
        for (gradient, cotangent) in gradient.iter_mut().zip(cotangent) {
            *gradient += *cotangent;
        }
        self.for_each_derivative(point, cotangent, |axis, frequency, (sine, cosine), (along_sine, along_cosine)| {
            gradient[axis] += frequency * (along_sine * cosine - along_cosine * sine);
        });
    }

    /// Adds d/dx of (c . e'(x) v) to `gradient` (D): v e''(x)^T c.
    pub fn pull_back_second<T: Real>(self, point: &[T], direction: &[T], cotangent: &[T], gradient: &mut [T]) {
        self.for_each_derivative(point, cotangent, |axis, frequency, (sine, cosine), (along_sine, along_cosine)| {
            gradient[axis] -= frequency * frequency * (along_sine * sine + along_cosine * cosine) * direction[axis];
        });
    }

    /// Visits the (sin, cos) pairs of `waves` by frequency, then coordinate.
    fn for_each_wave<T: Real>(self, point: &[T], waves: &mut [T], mut visit: impl FnMut(T, T, T, &mut (T, T))) {
        for (octave, block) in waves.chunks_exact_mut(2 * self.dimensions).enumerate() {
            let frequency = T::of((1u64 << octave) as f64);
            let (sines, cosines) = block.split_at_mut(self.dimensions);
            for ((x, sine), cosine) in point.iter().zip(sines).zip(cosines) {
                let (sin, cos) = (frequency * *x).sin_cos();
                let mut wave = (T::zero(), T::zero());
                visit(frequency, sin, cos, &mut wave);
                (*sine, *cosine) = wave;
            }
        }
    }

    fn for_each_derivative<T: Real>(
        self,
        point: &[T],
        cotangent: &[T],
        mut visit: impl FnMut(usize, T, (T, T), (T, T)),
    ) {
        for (octave, block) in cotangent[self.dimensions..].chunks_exact(2 * self.dimensions).enumerate() {
            let frequency = T::of((1u64 << octave) as f64);
            for axis in 0..self.dimensions {
                let wave = (frequency * point[axis]).sin_cos();
                visit(axis, frequency, wave, (block[axis], block[self.dimensions + axis]));
            }
        }
    }
}
