//! The pickle reader against files that Python wrote (tests/golden/pickles), and against damaged ones.

use std::path::{Path, PathBuf};

use xavatar::InputError;
use xavatar::formats::{Array, ArrayData, ArrayMap, Value, read_pickle, read_pickle_arrays, write_pickle};

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/pickles").join(name)
}

fn sum(array: &Array) -> f64 {
    array.to_f64().expect("numbers").iter().sum()
}

fn assert_close(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} is not {expected}");
}

#[test]
fn frames_read_the_same_in_every_protocol() {
    let frames: Vec<ArrayMap> =
        (2..=5).map(|protocol| read_pickle_arrays(golden(&format!("smplx-p{protocol}.pkl"))).unwrap()).collect();
    for frame in &frames {
        assert_eq!(frame, &frames[0]);
        assert_close(sum(&frame["body_pose"]), 7.457_325_011_491_775, 1e-5);
    }
}

#[test]
fn atlases_read_the_same_in_every_protocol() {
    for protocol in 2..=5 {
        let Value::Array(atlas) = read_pickle(golden(&format!("atlas-p{protocol}.pkl"))).unwrap() else {
            panic!("an atlas is an array");
        };
        assert_eq!(atlas.shape, [64, 64, 3]);
        assert!(matches!(atlas.data, ArrayData::U8(_)));
        assert_eq!(sum(&atlas), 1_550_220.0);
    }
}

#[test]
fn scans_with_array_subclasses_are_read() {
    let mesh = read_pickle_arrays(golden("mesh-p5.pkl")).unwrap();
    assert_eq!(mesh["vertices"].shape, [2562, 3]);
    assert_close(sum(&mesh["vertices"]), 0.0, 1e-9);
    assert_close(sum(&mesh["uvs"]), 2_563.012_628_676_814, 1e-3);
    assert_eq!(sum(&mesh["faces"]), 19_683_780.0);
}

#[test]
fn body_models_hold_sparse_and_chumpy_arrays() {
    let model = read_pickle_arrays(golden("smpl-like-p2.pkl")).unwrap();
    assert_eq!(model["J_regressor"].shape, [55, 160]);
    assert_close(sum(&model["J_regressor"]), 55.0, 1e-9);
    assert_eq!(model["shapedirs"].shape, [160, 3, 20]);
    assert_close(sum(&model["shapedirs"]), -0.207_073_697_852_336, 1e-9);
    assert_eq!(model["bs_type"].text(), Some("lrotmin"));
}

#[test]
fn code_is_refused_by_name_and_not_run() {
    let error = read_pickle(golden("hostile.pkl")).unwrap_err();
    assert!(matches!(&error, InputError::Refused { found, .. } if found.contains("posix.system")), "{error}");
    assert!(error.to_string().contains("hostile.pkl"), "{error}");
    assert!(!Path::new("hostile-pickle-was-run").exists());
}

// make_varied.py holds the same values
#[test]
fn every_kind_of_value_reads_the_same_in_every_protocol() {
    for protocol in 0..=5 {
        let path = golden(&format!("varied-p{protocol}.pkl"));
        let arrays = read_pickle_arrays(&path).unwrap();
        for name in ["bool", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8", ">f4", ">i2", "again"] {
            let last = if name == "bool" { [1.0, 1.0, 1.0] } else { [3.0, 4.0, 127.0] };
            assert_eq!(arrays[name].shape, [2, 3], "{name}");
            assert_eq!(arrays[name].to_f64().unwrap()[3..], last, "{name}");
        }
        let rising: Vec<f64> = (0..24).map(f64::from).collect();
        assert_eq!(arrays["fortran"], Array { shape: vec![2, 3, 4], data: ArrayData::F64(rising) });
        assert_eq!(arrays["empty"].shape, [0, 3]);
        assert_eq!(arrays["zero_d"], Array { shape: vec![], data: ArrayData::F64(vec![2.5]) });
        assert_eq!(arrays["scalar"], Array { shape: vec![], data: ArrayData::F32(vec![0.5]) });
        assert_eq!(arrays["gender"].text(), Some("neutral"));
        assert_eq!(arrays["text"].text(), Some("naïve \\ \n text ☺ \u{1f600}"));
        assert_eq!(arrays["objects.inner"].to_f64().unwrap(), [0.0, 1.0, 2.0]);
        assert_eq!(arrays["nested"], Array { shape: vec![2, 2], data: ArrayData::I64(vec![1, 2, 3, 4]) });
        assert_eq!(arrays["mixed"], Array { shape: vec![2], data: ArrayData::F64(vec![1.0, 2.5]) });
        let integers = vec![0, -1, 255, 65536, -(1 << 31), 1 << 62, i64::MIN];
        assert_eq!(arrays["integers"].data, ArrayData::I64(integers));
        assert_eq!(arrays["floats"].data, ArrayData::F64(vec![0.0, -1.5, 1e300, f64::INFINITY]));
        assert_eq!(arrays["flags"].to_f64().unwrap(), [1.0, 0.0]);
        for matrix in ["csc", "csr"] {
            let dense = vec![0.0, 2.5, 0.0, 0.0, 1.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0];
            assert_eq!(arrays[matrix], Array { shape: vec![3, 4], data: ArrayData::F64(dense) }, "{matrix}");
        }
        for name in ["none", "ragged", "names", "bytes"] {
            assert!(!arrays.contains_key(name), "{name}");
        }

        let value = read_pickle(&path).unwrap();
        assert_eq!(value.get("bytes"), Some(&Value::Bytes((0..=255).collect())));
        assert_eq!(value.get("no_bytes"), Some(&Value::Bytes(vec![])));
        assert_eq!(value.get("none"), Some(&Value::None));
        assert_eq!(value.get("names"), Some(&Value::List(["pelvis", "head"].map(|t| Value::Text(t.into())).into())));
    }
}

#[test]
fn what_is_written_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.pkl");
    let arrays = ArrayMap::from([
        ("vertices".into(), Array { shape: vec![2, 3], data: ArrayData::F32(vec![0.0, -1.5, 2.0, 3.0, 4.0, 5e-30]) }),
        ("faces".into(), Array { shape: vec![1, 3], data: ArrayData::I64(vec![0, 1, i64::MAX]) }),
        ("atlas".into(), Array { shape: vec![1, 2, 3], data: ArrayData::U8(vec![0, 1, 2, 253, 254, 255]) }),
        ("scale".into(), Array { shape: vec![], data: ArrayData::F64(vec![0.1]) }),
        ("empty".into(), Array { shape: vec![0, 3], data: ArrayData::F32(vec![]) }),
        ("gender".into(), Array { shape: vec![], data: ArrayData::Text("neutral ☺".into()) }),
    ]);
    write_pickle(&path, &arrays).unwrap();
    assert_eq!(read_pickle_arrays(&path).unwrap(), arrays);
}
