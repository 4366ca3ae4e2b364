//! Body models of every family: arrays with their names, apart from the archive whose checksums would keep mutations from them.

use std::path::Path;

use glam::{DVec3, Vec3};
use xavatar::body::{BodyModel, Coefficients};
use xavatar::formats::{Array, ArrayData, ArrayFile, ArrayMap, Result, npy_bytes, parse_npy};
use xavatar::learned::blsm::{BlsmBody, FleshedBody};
use xavatar::learned::feet::Feet;
use xavatar::learned::spiral::{AutodecoderTraining, Level, Pooling};
use xavatar::mesh::TriangleMesh;

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

/// A body with bones and flesh apart, whichever way its flesh was learned.
pub(super) fn blsm(bytes: &[u8]) -> bool {
    let body = FleshedBody::from_arrays(Path::new("no/such/body.npz"), &arrays_in(bytes));
    body.is_ok_and(|body| {
        body.mean().is_ok_and(|body| {
            assert_eq!(body.posed(&body.rest()).vertices.len(), body.template.len());
            true
        })
    })
}

pub(super) fn blsm_seeds() -> Vec<Vec<u8>> {
    let Some(body) = smallest_smpl().map(|model| BlsmBody::of(&model)) else { return Vec::new() };
    let linear = body.to_arrays();
    let mut seeds = vec![together(&linear)];
    if let Ok(flesh) = smallest_flesh(&body) {
        seeds.push(together(&linear.into_iter().chain(flesh).collect()));
    }
    seeds
}

/// An auto-decoder of one code, on two levels of the same vertices.
fn smallest_flesh(body: &BlsmBody) -> Result<ArrayMap> {
    let vertices: Vec<Vec3> = body.template.iter().map(|place| place.as_vec3()).collect();
    let kept = (0..vertices.len() as u32).collect();
    let mesh = TriangleMesh { vertices, faces: body.faces.clone(), ..TriangleMesh::default() };
    let pooling = Pooling::new(&body.template, kept, &mesh)?;
    let level = |from_finer| Level { points: body.template.clone(), faces: body.faces.clone(), from_finer };
    let people = [-0.01, 0.01].map(|offset| vec![DVec3::splat(offset); body.template.len()]);
    let training = AutodecoderTraining::new(vec![level(None), level(Some(pooling))], &people, 1, 0)?;
    training.finished()?.0.to_arrays()
}

/// Feet beside the body that they are of.
pub(super) fn feet(bytes: &[u8]) -> bool {
    let path = Path::new("no/such/body.npz");
    let arrays = arrays_in(bytes);
    BodyModel::from_arrays(path, &arrays).is_ok_and(|body| {
        let Ok(feet) = Feet::from_arrays(path, &arrays, &body) else { return false };
        let posed = feet.posed(&body, &body.skeleton().rest_pose(), 0.0);
        assert!(posed.is_ok_and(|vertices| vertices.len() == body.vertex_count()));
        true
    })
}

/// Feet of one vertex, with a network of one layer between.
pub(super) fn feet_seeds() -> Vec<Vec<u8>> {
    let Some(model) = smallest_smpl() else { return Vec::new() };
    let mut arrays = model.to_arrays();
    let zeros = |shape: &[usize]| Array { shape: shape.to_vec(), data: ArrayData::U8(vec![0; shape.iter().product()]) };
    for (side, [ankle, toes]) in [("left", [7, 10]), ("right", [8, 11])] {
        let inputs = 4 * 2 + 2 + 1;
        let places = [("vertices", vec![1]), ("joints", vec![ankle, toes])];
        for (name, places) in places {
            arrays.insert(
                format!("foot.{side}.{name}"),
                Array { shape: vec![places.len()], data: ArrayData::I64(places) },
            );
        }
        for (name, shape) in [
            ("mean", &[1, 3][..]),
            ("directions", &[2, 1, 3]),
            ("0.W", &[2, inputs]),
            ("0.b", &[2]),
            ("1.W", &[3, 2]),
            ("1.b", &[3]),
        ] {
            arrays.insert(format!("foot.{side}.{name}"), zeros(shape));
        }
    }
    vec![together(&arrays)]
}

fn smallest_smpl() -> Option<BodyModel> {
    let bytes = include_bytes!("../../../tests/golden/body/tiny_smpl.npz");
    let file = ArrayFile::parse(Path::new("smpl"), bytes).ok()??;
    BodyModel::from_arrays(Path::new("smpl"), &smallest(&file.arrays)).ok()
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
        let mut shape = if key == "f" { vec![1, 3] } else { array.shape.clone() };
        // Joints can be as many as vertices.
        let of_vertices = if key == "J_regressor" { shape.last_mut() } else { shape.first_mut() };
        of_vertices.into_iter().for_each(|extent| *extent = fewer(extent));
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
