//! EasyMocap's poses of SMPL+H and SMPL-X: the body's 66 numbers, 6 PCA coefficients a hand, and 9 of jaw and eyes (SMPL-X only).

use super::leaf;
use xavatar_formats::{Array, ArrayMap};

const BODY: usize = 66;
const HAND: usize = 6;

/// The arrays with such poses spread to whole ones of their model, and the hands in arrays of their own; `None` if there are none.
pub(super) fn spread(arrays: &ArrayMap) -> Option<ArrayMap> {
    let is_packed = |(key, array): &(&String, &Array)| {
        leaf(key) == "poses" && matches!(array.shape.last(), Some(78 | 87)) && array.to_f32().is_some()
    };
    let packed: Vec<(&String, &Array)> = arrays.iter().filter(is_packed).collect();
    let first = packed.first()?;
    let prefix = |key: &str| key[..key.len() - leaf(key).len()].to_owned();
    arrays.get(&format!("{}Rh", prefix(first.0)))?;
    let mut spread = arrays.clone();
    for (key, array) in packed {
        let width = array.shape.last().copied()?;
        let values = array.to_f32()?;
        let rows = || values.chunks_exact(width);
        let hand =
            |side: usize| rows().flat_map(|row| row[BODY + side * HAND..][..HAND].to_vec()).collect::<Vec<f32>>();
        let whole: Vec<f32> =
            rows().flat_map(|row| [&row[..BODY], &row[BODY + 2 * HAND..], &[0.0; 90]].concat()).collect();
        let count = rows().len();
        spread.insert(key.clone(), Array::from_f32(&[count, whole.len() / count.max(1)], whole));
        for (side, name) in ["left_hand_pose", "right_hand_pose"].into_iter().enumerate() {
            spread.insert(format!("{}{name}", prefix(key)), Array::from_f32(&[count, HAND], hand(side)));
        }
    }
    Some(spread)
}
