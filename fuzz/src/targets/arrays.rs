//! Arrays and tensors: npy, npz, pickle, PyTorch archives, safetensors.
//!
//! Members of archives are mutated apart from the archive too, since checksums keep mutations of the whole from reaching them.

use std::collections::HashMap;
use std::io::{Cursor, Write};

use xavatar::formats::{
    Array, ArrayData, TensorFile, npy_bytes, parse_npy, parse_npz, parse_pickle, parse_pickle_arrays, parse_torch,
};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

pub(super) fn npy(bytes: &[u8]) -> bool {
    parse_npy(bytes).is_ok()
}

pub(super) fn npy_seeds() -> Vec<Vec<u8>> {
    let array = |shape: &[usize], data| npy_bytes(&Array { shape: shape.to_vec(), data });
    vec![
        array(&[2, 3], ArrayData::F32(vec![0.5; 6])),
        array(&[3], ArrayData::I64(vec![-1, 0, 7])),
        array(&[2, 2], ArrayData::F64(vec![1e300; 4])),
        array(&[1], ArrayData::Text("neutral".into())),
        npy_file("{'descr': '>f2', 'fortran_order': True, 'shape': (2, 3, 2), }\n", &[60; 24]),
        npy_file("{'descr': '|b1', 'fortran_order': False, 'shape': (5L,), }\n", &[1; 5]),
        npy_file("{'descr': '|S6', 'fortran_order': False, 'shape': (), }\n", b"male\0\0"),
    ]
}

fn npy_file(header: &str, data: &[u8]) -> Vec<u8> {
    [b"\x93NUMPY\x01\0", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
}

pub(super) fn npz(bytes: &[u8]) -> bool {
    parse_npz(bytes).is_ok()
}

pub(super) fn npz_seeds() -> Vec<Vec<u8>> {
    let deflated =
        archive(CompressionMethod::Deflated, &[("zeros.npy", &npy_bytes(&Array::from_f32(&[999], vec![0.0; 999])))]);
    vec![
        include_bytes!("../../../tests/golden/motions/own.npz").to_vec(),
        include_bytes!("../../../tests/golden/motions/smpler_x.npz").to_vec(),
        include_bytes!("../../../tests/golden/official/meta_info.npz").to_vec(),
        deflated,
    ]
}

pub(super) fn npz_member(bytes: &[u8]) -> bool {
    npz(&archive(CompressionMethod::Stored, &[("member.npy", bytes)]))
}

pub(super) fn npz_member_seeds() -> Vec<Vec<u8>> {
    let header = "{'descr': '|O', 'fortran_order': False, 'shape': (), }";
    let objects = pickle_seeds().into_iter().map(|pickle| npy_file(header, &pickle));
    npy_seeds().into_iter().chain(objects).collect()
}

pub(super) fn pickle(bytes: &[u8]) -> bool {
    let _either = parse_pickle_arrays(bytes);
    parse_pickle(bytes).is_ok()
}

pub(super) fn pickle_seeds() -> Vec<Vec<u8>> {
    vec![
        include_bytes!("../../../tests/golden/pickles/varied-p0.pkl").to_vec(),
        include_bytes!("../../../tests/golden/pickles/varied-p1.pkl").to_vec(),
        include_bytes!("../../../tests/golden/pickles/varied-p2.pkl").to_vec(),
        include_bytes!("../../../tests/golden/pickles/varied-p5.pkl").to_vec(),
        include_bytes!("../../../tests/golden/pickles/smplx-p2.pkl").to_vec(),
        include_bytes!("../../../tests/golden/pickles/smplx-p4.pkl").to_vec(),
        include_bytes!("../../../tests/golden/motions/pymaf_x.pkl").to_vec(),
        // After the header of an npy: tensors.
        include_bytes!("../../../tests/fixtures/motions/tram.npy")[128..].to_vec(),
    ]
}

pub(super) fn torch(bytes: &[u8]) -> bool {
    parse_torch(bytes).is_ok()
}

pub(super) fn torch_seeds() -> Vec<Vec<u8>> {
    torch_pickle_seeds().iter().map(|pickle| torch_archive(pickle)).collect()
}

pub(super) fn torch_pickle(bytes: &[u8]) -> bool {
    torch(&torch_archive(bytes))
}

/// A dict of two tensors: one of floats, one a transposed view of bfloat16.
pub(super) fn torch_pickle_seeds() -> Vec<Vec<u8>> {
    let text = |text: &str| [b"X", &(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
    let integer = |value: u8| vec![b'K', value];
    let global = |module: &str, name: &str| format!("c{module}\n{name}\n").into_bytes();
    let tuple = |items: &[Vec<u8>]| [b"(", &items.concat()[..], b"t"].concat();
    let tensor = |class: &str, key: &str, extents: [u8; 2], strides: [u8; 2]| {
        let storage = tuple(&[text("storage"), global("torch", class), text(key), text("cpu"), integer(6)]);
        let view = [tuple(&extents.map(integer)), tuple(&strides.map(integer)), b"\x89N".to_vec()].concat();
        let arguments = tuple(&[storage, b"Q".to_vec(), integer(0), view]);
        [global("torch._utils", "_rebuild_tensor_v2"), arguments, b"R".to_vec()].concat()
    };
    let entries = [
        text("a"),
        tensor("FloatStorage", "0", [2, 3], [3, 1]),
        text("b"),
        tensor("BFloat16Storage", "1", [3, 2], [1, 3]),
    ];
    vec![[b"\x80\x02}(", &entries.concat()[..], b"u."].concat()]
}

fn torch_archive(pickle: &[u8]) -> Vec<u8> {
    let members: [(&str, &[u8]); 4] = [
        ("archive/data.pkl", pickle),
        ("archive/byteorder", b"little"),
        ("archive/data/0", &[63; 24]),
        ("archive/data/1", &[63; 12]),
    ];
    archive(CompressionMethod::Stored, &members)
}

pub(super) fn safetensors(bytes: &[u8]) -> bool {
    TensorFile::parse(bytes).is_ok()
}

pub(super) fn safetensors_seeds() -> Vec<Vec<u8>> {
    let file = TensorFile {
        text: HashMap::from([("step".into(), "12".into()), ("config".into(), "seed = 1".into())]),
        tensors: HashMap::from([
            ("a".into(), (vec![2, 3], vec![0.5, -1.0, 2.0, 3.0, 4.0, 5.0])),
            ("b".into(), (vec![0], Vec::new())),
        ]),
    };
    let mut whole = Vec::new();
    // Writing to memory does not fail.
    let _ = file.write_to(&mut whole);
    // Without its checksum, what is mutated is read.
    let place = whole.windows(5).position(|window| window == b"crc32");
    let mut unchecked = whole.clone();
    place.into_iter().for_each(|place| unchecked[place] = b'x');
    vec![whole, unchecked]
}

/// A zip archive; empty if a member is too large for one.
fn archive(compression: CompressionMethod, members: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(compression);
    for (name, bytes) in members {
        if archive.start_file(*name, options).is_err() || archive.write_all(bytes).is_err() {
            return Vec::new();
        }
    }
    archive.finish().map(Cursor::into_inner).unwrap_or_default()
}
