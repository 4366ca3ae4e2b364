//! Body models of every family: arrays with their names, apart from the archive whose checksums would keep mutations from them.

use std::path::Path;

use xavatar::body::{BodyModel, Coefficients};
use xavatar::formats::{Array, ArrayData, ArrayFile, ArrayMap, npy_bytes, parse_npy};

/// What stands between arrays: npy files, each after a line with its name.
const BETWEEN: &[u8] = b"|NPY";
/// V of the seeds; as few as make a face.
const VERTICES: usize = 3;

/// What is read must be sound: everything that follows relies on it.
pub(super) fn body(bytes: &[u8]) -> bool {
    let path = Path::new("no/such/body.npz");
    let arrays = arrays_in(bytes);
    let _with_all = BodyModel::from_arrays_with(path, &arrays, Coefficients::All);
    BodyModel::from_arrays(path, &arrays).is_ok_and(|body| {
        let anatomy = body.anatomy();
        assert!(anatomy.template.iter().all(|vertex| vertex.is_finite()));
        assert!(anatomy.faces.iter().flatten().all(|vertex| (*vertex as usize) < anatomy.template.len()));
        assert_eq!(anatomy.skinning_weights.len(), anatomy.template.len() * anatomy.skeleton.joints.len());
        true
    })
}

pub(super) fn body_seeds() -> Vec<Vec<u8>> {
    let models: [(&str, &[u8]); 7] = [
        ("flame", include_bytes!("../../../tests/golden/body/tiny_flame.npz")),
        ("mano", include_bytes!("../../../tests/golden/body/tiny_mano.npz")),
        ("smpl", include_bytes!("../../../tests/golden/body/tiny_smpl.npz")),
        ("smplh", include_bytes!("../../../tests/golden/body/tiny_smplh.npz")),
        ("smplx", include_bytes!("../../../tests/golden/body/tiny_smplx.npz")),
        ("star", include_bytes!("../../../tests/golden/body/tiny_star.npz")),
        ("supr", include_bytes!("../../../tests/golden/body/tiny_supr.npy")),
    ];
    let parsed = |(name, bytes)| ArrayFile::parse(Path::new(name), bytes).ok().flatten();
    models.into_iter().filter_map(parsed).map(|file| together(&smallest(&file.arrays))).collect()
}

/// A model of the same joints with [`VERTICES`] vertices, which the first joint moves and all joints are at.
fn smallest(arrays: &ArrayMap) -> ArrayMap {
    let vertices = arrays.get("v_template").map_or(0, |template| template.shape[0]);
    let fewer = |extent: &usize| match *extent {
        extent if extent == vertices => VERTICES,
        extent if extent == 3 * vertices + 1 => 3 * VERTICES + 1,
        extent => extent,
    };
    let smaller = |(key, array): (&String, &Array)| {
        let shape: Vec<usize> = if key == "f" { vec![1, 3] } else { array.shape.iter().map(fewer).collect() };
        let width = shape.last().copied().unwrap_or(1).max(1);
        let first_of_rows = |index: usize| u8::from(index.is_multiple_of(width));
        let byte = |index: usize| match key.as_str() {
            "f" => index as u8,
            "v_template" => index as u8 / 4,
            "weights" | "J_regressor" => first_of_rows(index),
            _ => 0,
        };
        let data = match (key.as_str(), array.to_f64()) {
            ("kintree_table", Some(values)) => ArrayData::I64(values.iter().map(|value| *value as i64).collect()),
            _ => ArrayData::U8((0..shape.iter().product()).map(byte).collect()),
        };
        (key.clone(), Array { shape, data })
    };
    arrays.iter().map(smaller).collect()
}

fn together(arrays: &ArrayMap) -> Vec<u8> {
    let mut keys: Vec<&String> = arrays.keys().collect();
    keys.sort();
    keys.into_iter().flat_map(|key| [BETWEEN, key.as_bytes(), b"\n", &npy_bytes(&arrays[key])].concat()).collect()
}

fn arrays_in(bytes: &[u8]) -> ArrayMap {
    let mut arrays = ArrayMap::new();
    let mut rest = bytes;
    while let Some(begin) = rest.windows(BETWEEN.len()).position(|window| window == BETWEEN) {
        rest = &rest[begin + BETWEEN.len()..];
        let end = rest.windows(BETWEEN.len()).position(|window| window == BETWEEN).unwrap_or(rest.len());
        let mut parts = rest[..end].splitn(2, |byte| *byte == b'\n');
        let name = parts.next().map(String::from_utf8_lossy);
        if let (Some(name), Some(Ok(array))) = (name, parts.next().map(parse_npy)) {
            arrays.insert(name.into_owned(), array);
        }
        rest = &rest[end..];
    }
    arrays
}
