//! A frame's registration as X-Humans stores it: every parameter under smplx's name, hands as offsets from the mean hand.

use std::path::Path;

use crate::fields::Fields;
use xavatar_body::{HandPose, smplx};
use xavatar_formats::{ArrayMap, Result};

const FORMAT: &str = "X-Humans frame";

/// The registered parameters of a frame, hands relative to the mean hand; shape is left out.
pub(crate) fn parameters_of(path: &Path, arrays: &ArrayMap) -> Result<smplx::Parameters> {
    let fields = Fields { path, format: FORMAT, arrays };
    smplx::Parameters::from_named(|name, count| fields.numbers(name, count), HandPose::RelativeToMean)
}
