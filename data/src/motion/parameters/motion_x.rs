//! Motion-X: rows of 322 numbers, without names.

use xavatar_formats::{Array, ArrayMap};

/// The columns' names, and how many each has.
const COLUMNS: [(&str, usize); 8] = [
    ("root_orient", 3),
    ("pose_body", 63),
    ("pose_hand", 90),
    ("pose_jaw", 3),
    ("face_expr", 50),
    ("face_shape", 100),
    ("trans", 3),
    ("betas", 10),
];
const WIDTH: usize = 322;

/// The columns of rows by name; `None` for an array of another shape.
pub(in crate::motion) fn columns(rows: &Array) -> Option<ArrayMap> {
    let values = rows.to_f32().filter(|values| !values.is_empty() && rows.shape.last() == Some(&WIDTH))?;
    let mut start = 0;
    let column = |&(name, width): &(&str, usize)| {
        let part = start..start + width;
        start += width;
        let values: Vec<f32> = values.chunks_exact(WIDTH).flat_map(|row| row[part.clone()].to_vec()).collect();
        (name.to_owned(), Array::from_f32(&[values.len() / width, width], values))
    };
    Some(COLUMNS.iter().map(column).collect())
}
