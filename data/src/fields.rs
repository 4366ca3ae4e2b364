//! Named arrays of one file, taken by name with their shape and finiteness checked.

use std::path::Path;

use xavatar_body::PoseAxisAngle;
use xavatar_formats::{Array, ArrayMap, Error, Result};

/// The arrays of a file, and how messages refer to it.
pub(super) struct Fields<'a> {
    pub(super) path: &'a Path,
    pub(super) format: &'static str,
    pub(super) arrays: &'a ArrayMap,
}

impl Fields<'_> {
    pub(super) fn malformed(&self, key: &str, found: impl ToString, expected: impl ToString) -> Error {
        Error::Malformed {
            path: self.path.to_path_buf(),
            format: self.format,
            place: format!("`{key}`"),
            found: found.to_string(),
            expected: expected.to_string(),
        }
    }

    pub(super) fn array(&self, key: &str) -> Result<&Array> {
        self.arrays.get(key).ok_or_else(|| {
            let keys: Vec<&str> = self.arrays.keys().map(String::as_str).collect();
            self.malformed(key, "missing", format_args!("an array beside {}", keys.join(", ")))
        })
    }

    /// The finite numbers of an array of `count` elements, whatever their arrangement: (N), (1, N), (N/3, 3).
    pub(super) fn numbers(&self, key: &str, count: usize) -> Result<Vec<f32>> {
        let array = self.array(key)?;
        let wrong = || self.malformed(key, array.description(), format_args!("{count} numbers"));
        let values = array.to_f32().ok_or_else(wrong)?;
        self.check_finite(key, &values)?;
        if values.len() == count { Ok(values) } else { Err(wrong()) }
    }

    /// As [`numbers`](Self::numbers), of an array of one element.
    pub(super) fn number(&self, key: &str) -> Result<f32> {
        Ok(self.numbers(key, 1)?[0])
    }

    /// The finite numbers of an array of shape (rows, `width`).
    pub(super) fn rows(&self, key: &str, width: usize) -> Result<Vec<f32>> {
        let array = self.array(key)?;
        let values = array.to_f32().filter(|_| matches!(array.shape[..], [_, found] if found == width));
        let values = values
            .ok_or_else(|| self.malformed(key, array.description(), format_args!("numbers in {width} columns")))?;
        self.check_finite(key, &values)?;
        Ok(values)
    }

    fn check_finite(&self, key: &str, values: &[f32]) -> Result<()> {
        match values.iter().position(|value| !value.is_finite()) {
            Some(index) => {
                Err(self.malformed(key, format_args!("{} at element {index}", values[index]), "finite numbers"))
            }
            None => Ok(()),
        }
    }
}

/// The rotations of `J` joints from their components, three a joint.
pub(super) fn rotations<const J: usize>(components: &[f32]) -> [PoseAxisAngle; J] {
    let (joints, _) = components.as_chunks::<3>();
    std::array::from_fn(|joint| PoseAxisAngle(joints[joint].into()))
}

/// The components of rotations, three a joint.
pub(super) fn components(rotations: &[PoseAxisAngle]) -> impl Iterator<Item = f32> {
    rotations.iter().flat_map(|rotation| rotation.0.to_array())
}
