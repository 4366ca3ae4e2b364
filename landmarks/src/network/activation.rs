//! What follows an operator in the same step.

use xavatar_formats::Fault;
use xavatar_vector::vectorised;

/// A function of each number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Activation {
    /// x.
    None,
    /// max(x, 0).
    Relu,
    /// min(max(x, 0), 6).
    Relu6,
}

impl Activation {
    /// By its number in the schema.
    pub fn of(code: u8) -> Result<Self, Fault> {
        match code {
            0 => Ok(Self::None),
            1 => Ok(Self::Relu),
            3 => Ok(Self::Relu6),
            _ => Err(Fault::malformed("an operator's activation", code, "none, ReLU or ReLU6 (0, 1, 3)")),
        }
    }

    /// Applies it.
    pub fn apply(self, values: &mut [f32]) {
        vectorised(
            #[inline(always)]
            || self.apply_inline(values),
        );
    }

    /// Applies it within a pass of vector instructions.
    #[inline(always)]
    pub fn apply_inline(self, values: &mut [f32]) {
        let most = match self {
            Self::None => return,
            Self::Relu => f32::INFINITY,
            Self::Relu6 => 6.0,
        };
        values.iter_mut().for_each(|value| *value = value.max(0.0).min(most));
    }
}
