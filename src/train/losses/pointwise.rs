//! Losses of one number and their derivatives.

use xavatar_network::Real;

/// Binary cross-entropy of a logit z and a target o, and its derivative: max(z, 0) - z o + ln(1 + e^-|z|), sigma(z) - o.
pub(super) fn cross_entropy<T: Real>(logit: T, target: T) -> (T, T) {
    let decay = (-logit.abs()).exp();
    let sigmoid = if logit > T::zero() { T::one() } else { decay } / (T::one() + decay);
    (logit.max(T::zero()) - logit * target + decay.ln_1p(), sigmoid - target)
}

/// f - d with d truncated to +-t; zero where both are beyond the same bound.
pub(super) fn truncated_error<T: Real>(distance: T, target: T, truncation: T) -> T {
    let target = target.max(-truncation).min(truncation);
    let beyond = target.abs() >= truncation && distance.abs() >= truncation && distance * target > T::zero();
    if beyond { T::zero() } else { distance - target }
}

/// -1, 0 or 1. Unlike `signum`, zero at zero.
pub(super) fn sign<T: Real>(value: T) -> T {
    if value > T::zero() {
        T::one()
    } else if value < T::zero() {
        -T::one()
    } else {
        T::zero()
    }
}

/// `length` times `value`, in memory that is kept.
pub(super) fn clear<V: Copy>(values: &mut Vec<V>, length: usize, value: V) {
    values.clear();
    values.resize(length, value);
}
