//! Checkpoints of the released X-Avatar code: small ones that PyTorch and Lightning wrote (tests/golden/official), and what PyTorch
//! computed with their networks in float64; and archives that PyTorch would never write.

use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use glam::Vec3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use safetensors::SafeTensors;
use xavatar::avatar::{Avatar, OfficialMeta};
use xavatar::body::{BodyModel, Gender, Pose, PoseAxisAngle, smplx};
use xavatar::formats::{Array, ArrayData, ArrayMap, Value, read_npz, read_torch, write_npz};
use xavatar::{Error, InputError};
use xavatar_network::{Representation, SkinningTrace, TextureField, Trace};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Largest difference to PyTorch's answers.
const TOLERANCE: f32 = 1e-5;

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/official").join(name)
}

fn body() -> BodyModel {
    BodyModel::load(&golden("../tiny_smplx.npz"), Gender::Neutral).unwrap()
}

fn meta() -> OfficialMeta {
    OfficialMeta::read(&golden("meta_info.npz")).unwrap()
}

fn imported(name: &str) -> Avatar {
    Avatar::from_official(&golden(name), &meta(), &body()).unwrap()
}

fn assert_close(name: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{name}");
    let farthest = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(farthest < TOLERANCE, "{name} differs by {farthest}");
    assert!(expected.iter().any(|value| value.abs() > 0.1), "{name} says nothing");
}

#[test]
fn networks_answer_as_in_pytorch() {
    let bytes = fs::read(golden("expected.safetensors")).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let expected = |name: &str| -> Vec<f32> {
        let tensor = tensors.tensor(name).unwrap();
        tensor.data().as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
    };
    let points = expected("points");
    let normals = expected("normals");
    for name in ["scan.pth", "scan.ckpt"] {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("avatar.safetensors");
        imported(name).save(&file).unwrap();
        let Avatar { fields, .. } = Avatar::load(&file).unwrap();

        let embedded = fields.geometry.mlp.embed(&expected("condition"));
        let mut geometry = Trace::default();
        fields.geometry.mlp.forward(&mut geometry, &points, &embedded, &[]);
        assert_close("values", geometry.output(), &expected("values"));
        let features = geometry.features(&fields.geometry.mlp);
        assert_close("features", features, &expected("features"));

        let pairs = points.as_chunks::<3>().0.iter().zip(normals.as_chunks::<3>().0);
        let inputs: Vec<f32> = pairs.flat_map(|(point, normal)| [*point, *normal]).flatten().collect();
        let mut texture = Trace::default();
        fields.texture.mlp.forward(&mut texture, &inputs, &embedded, features);
        let mut colours = vec![0.0; points.len()];
        TextureField::colours(texture.output(), &mut colours);
        assert_close("colours", &colours, &expected("colours"));

        let mut weights = vec![0.0; points.len() / 3 * 55];
        fields.skinning.weights(&mut SkinningTrace::default(), points.as_chunks().0, &mut weights);
        assert_close("weights", &weights, &expected("weights"));
    }
}

// n = -grad f / |grad f| for an occupancy; the gradient by central differences of the values.
#[test]
fn points_are_queried_one_by_one() {
    let avatar = imported("scan.pth");
    let mut pose = Pose { expression: vec![0.5; 10], ..smplx::skeleton().rest_pose() };
    pose.rotations[22] = PoseAxisAngle(Vec3::X * 0.2);
    let points = [Vec3::new(0.3, -0.2, 0.4), Vec3::new(-0.5, 0.6, 0.1), Vec3::new(1.0, 1.0, -1.0)];
    let samples = avatar.query(&points, &pose).unwrap();
    let value = |point: Vec3| f64::from(avatar.query(&[point], &pose).unwrap()[0].value);
    const STEP: f32 = 1e-2;
    for (sample, point) in samples.iter().zip(points) {
        assert_eq!(f64::from(sample.value), value(point));
        let slope =
            |axis: Vec3| ((value(point + STEP * axis) - value(point - STEP * axis)) / f64::from(2.0 * STEP)) as f32;
        let gradient = Vec3::new(slope(Vec3::X), slope(Vec3::Y), slope(Vec3::Z));
        assert!(sample.normal.dot(-gradient.normalize()) > 0.99, "{} against {gradient}", sample.normal);
        assert!((sample.weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
    }
    assert!(matches!(avatar.query(&[Vec3::NAN], &pose), Err(Error::Input(InputError::Value { .. }))));
}

#[test]
fn the_subject_is_the_meta_files() {
    let avatar = imported("scan.ckpt");
    assert_eq!(avatar.subject.gender, Gender::Neutral);
    assert_eq!((avatar.subject.betas[0], avatar.subject.betas[9]), (-1.0, 1.5));
    assert_eq!(avatar.subject.joints, body().canonical_joints(&avatar.subject.betas).unwrap());
    assert_eq!(avatar.steps, 1, "Lightning counts steps");
    assert_eq!(avatar.config.fields.representation, Representation::Occupancy);
    let meta = OfficialMeta { representation: Representation::SignedDistance, ..meta() };
    let distances = Avatar::from_official(&golden("scan.pth"), &meta, &body()).unwrap();
    assert_eq!(distances.fields.geometry.representation, Representation::SignedDistance);
}

#[test]
fn a_file_from_before_the_archives_is_told_from_a_broken_one() {
    let error = read_torch(golden("legacy.pth")).unwrap_err();
    assert!(
        matches!(&error, InputError::Mismatch { remedy, .. } if remedy.words().contains("torch.save(torch.load(")),
        "{error}"
    );
    let error = read_torch(golden("meta_info.npz")).unwrap_err();
    assert!(matches!(&error, InputError::Malformed { found, .. } if found.contains("data.pkl")), "{error}");
    let error = read_torch(golden("make_official.py")).unwrap_err();
    assert!(matches!(&error, InputError::Malformed { expected, .. } if expected.contains("zip")), "{error}");
}

#[test]
fn other_checkpoints_are_told_what_they_lack() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.pth");
    let refused = |bytes: &[u8], word: &str| {
        fs::write(&path, bytes).unwrap();
        let error = Avatar::from_official(&path, &meta(), &body()).unwrap_err();
        assert!(
            matches!(error, Error::Input(InputError::Mismatch { .. })) && error.to_string().contains(word),
            "{error}"
        );
        assert!(error.to_string().contains("other.pth"), "{error}");
    };
    refused(&archive(b"}.", &[]), "shapenet_state_dict");
    refused(&archive(&dict("state_dict", b"}"), &[]), "shape_net.");
    refused(&archive(&dict("state_dict", b"K\x01"), &[]), "dict");
    // Names of the same length, so that the archive's offsets hold; its checksums are made anew.
    let rewritten = |from: &str, to: &str| {
        let mut members = members(&fs::read(golden("scan.pth")).unwrap());
        let pickle = &mut members.iter_mut().find(|(name, _)| name.ends_with("data.pkl")).unwrap().1;
        *pickle = replaced(pickle, from.as_bytes(), to.as_bytes());
        zipped(&members, CompressionMethod::Stored)
    };
    refused(&rewritten("lin_p0.bias", "lin_p1.bias"), "lin_p0.bias");
    refused(&rewritten("lin2.weight_v", "lin2.weight_w"), "no `geometry.lin2.weight_v`");
    refused(&rewritten("lin_p0.weight", "lin_p0.wait__"), "lin_p0.weight");
}

#[test]
fn meta_files_are_told_what_they_lack() {
    let whole = read_npz(golden("meta_info.npz")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("meta.npz");
    let refused = |change: &dyn Fn(&mut ArrayMap), word: &str| {
        let mut arrays = whole.clone();
        change(&mut arrays);
        write_npz(&path, &arrays).unwrap();
        let error = OfficialMeta::read(&path).unwrap_err();
        assert!(
            matches!(error, Error::Input(InputError::Mismatch { .. })) && error.to_string().contains(word),
            "{error}"
        );
    };
    let text = |text: &str| Array::from_text(text);
    refused(&|arrays| drop(arrays.remove("betas")), "no `betas`");
    refused(&|arrays| drop(arrays.insert("betas".into(), Array::from_f32(&[2], vec![0.0; 2]))), "`betas` f32 (2)");
    refused(&|arrays| drop(arrays.insert("betas".into(), Array::from_f32(&[10], vec![f32::NAN; 10]))), "finite");
    refused(&|arrays| drop(arrays.insert("gender".into(), text("unknown"))), "unknown");
    refused(&|arrays| drop(arrays.insert("representation".into(), text("nerf"))), "nerf");
}

#[test]
fn tensors_of_every_type_and_layout_are_read() {
    let floats: Vec<u8> = (0..6u8).flat_map(|value| f32::from(value).to_le_bytes()).collect();
    let halves = [0x3c00u16, 0xc000].map(u16::to_le_bytes).concat();
    let read = |class: &str, storage: &[u8], count: u8, view: &[u8]| -> Array {
        let (_folder, read) = read_archive(&archive(&tensor_pickle(class, count, view), &[("0", storage)]));
        match read.unwrap() {
            Value::Array(array) => Array::clone(&array),
            other => panic!("{}", other.kind()),
        }
    };
    // offset, extents, strides
    let whole = read("FloatStorage", &floats, 6, b"K\x00K\x02K\x03\x86K\x03K\x01\x86");
    assert_eq!((whole.shape, whole.data), (vec![2, 3], ArrayData::F32(vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0])));
    let transposed = read("FloatStorage", &floats, 6, b"K\x00K\x03K\x02\x86K\x01K\x03\x86");
    assert_eq!(transposed.data, ArrayData::F32(vec![0.0, 3.0, 1.0, 4.0, 2.0, 5.0]));
    let part = read("FloatStorage", &floats, 6, b"K\x04K\x02\x85K\x01\x85");
    assert_eq!(part.data, ArrayData::F32(vec![4.0, 5.0]));
    let expanded = read("FloatStorage", &floats, 6, b"K\x05K\x03\x85K\x00\x85");
    assert_eq!(expanded.data, ArrayData::F32(vec![5.0; 3]));
    let scalar = read("FloatStorage", &floats, 6, b"K\x02))");
    assert_eq!((scalar.shape, scalar.data), (vec![], ArrayData::F32(vec![2.0])));
    let empty = read("FloatStorage", &[], 0, b"K\x00K\x00\x85K\x01\x85");
    assert_eq!(empty.data, ArrayData::F32(vec![]));
    assert_eq!(read("HalfStorage", &halves, 2, b"K\x00K\x02\x85K\x01\x85").data, ArrayData::F32(vec![1.0, -2.0]));
    let brain = [0x80, 0x3f, 0x00, 0xc0];
    assert_eq!(read("BFloat16Storage", &brain, 2, b"K\x00K\x02\x85K\x01\x85").data, ArrayData::F32(vec![1.0, -2.0]));
    assert_eq!(read("BoolStorage", &[1, 0], 2, b"K\x00K\x02\x85K\x01\x85").data, ArrayData::U8(vec![1, 0]));
    let long = (-5i64).to_le_bytes();
    assert_eq!(read("LongStorage", &long, 1, b"K\x00K\x01\x85K\x01\x85").data, ArrayData::I64(vec![-5]));
}

#[test]
fn hostile_archives_are_refused() {
    let refused = |bytes: &[u8], word: &str| {
        let (_folder, read) = read_archive(bytes);
        let error = read.unwrap_err();
        assert!(matches!(error, InputError::Refused { .. }) && error.to_string().contains(word), "{error}");
    };
    let malformed = |bytes: &[u8], word: &str| {
        let (_folder, read) = read_archive(bytes);
        let error = read.unwrap_err();
        assert!(matches!(error, InputError::Malformed { .. }) && error.to_string().contains(word), "{error}");
    };
    let storage: &[(&str, &[u8])] = &[("0", &[0; 8])];
    let tensor = |view: &[u8]| archive(&tensor_pickle("FloatStorage", 2, view), storage);
    refused(&archive(b"cposix\nsystem\n(X\x04\x00\x00\x00truetR.", &[]), "posix.system");
    refused(&archive(b"ctorch.hub\nload\n(X\x01\x00\x00\x00xtR.", &[]), "torch.hub.load");
    refused(&archive(b"comegaconf.x\nY\n)R0cos\nsystem\n)R.", &[]), "os.system");
    refused(&archive(&tensor_pickle("UntypedStorage", 2, b"K\x00K\x02\x85K\x01\x85"), storage), "torch.UntypedStorage");
    // A view that repeats two numbers 2^40 times.
    let (_folder, read) = read_archive(&tensor(b"K\x00J\x00\x00\x10\x00J\x00\x00\x10\x00\x86K\x00K\x00\x86"));
    assert!(matches!(read.unwrap_err(), InputError::TooLarge { .. }));
    malformed(&tensor(b"K\x01K\x02\x85K\x01\x85"), "within its storage");
    malformed(&tensor(b"K\x00K\x02\x85J\xff\xff\xff\x7f\x85"), "within its storage");
    malformed(&tensor(b"J\xff\xff\xff\xffK\x02\x85K\x01\x85"), "offset");
    malformed(&tensor(b"K\x00K\x02\x85K\x01K\x01\x86"), "within its storage");
    malformed(&archive(&tensor_pickle("FloatStorage", 9, b"K\x00K\x02\x85K\x01\x85"), storage), "9 elements");
    malformed(&archive(&tensor_pickle("FloatStorage", 2, b"K\x00K\x02\x85K\x01\x85"), &[]), "missing");
    malformed(&archive(b"K\x01Q.", &[]), "tuple");
    let packed = zipped(&[("archive/data.pkl".into(), b"}.".to_vec())], CompressionMethod::Deflated);
    refused(&packed, "unpacked");
    malformed(&zipped(&[("data.pkl".into(), b"}.".to_vec())], CompressionMethod::Stored), "no data.pkl");
    // Persistent ids mean something only beside storages.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.pkl");
    fs::write(&path, tensor_pickle("FloatStorage", 2, b"K\x00K\x02\x85K\x01\x85")).unwrap();
    assert!(matches!(xavatar::formats::read_pickle(&path), Err(InputError::Refused { .. })));
}

// With the checksums made anew, so that the pickle itself is what is damaged.
#[test]
fn damaged_pickles_of_tensors_are_read_or_refused() {
    let mut members = members(&fs::read(golden("scan.ckpt")).unwrap());
    let place = members.iter().position(|(name, _)| name.ends_with("data.pkl")).unwrap();
    let whole = members[place].1.clone();
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for _ in 0..150 {
        let damaged = random.random_range(0..whole.len());
        members[place].1[damaged] ^= random.random_range(1..=255u8);
        let (_folder, read) = read_archive(&zipped(&members, CompressionMethod::Stored));
        if let Err(error) = read {
            assert!(error.to_string().contains("x.pth"), "{error}");
        }
        members[place].1[damaged] = whole[damaged];
    }
    for length in (0..whole.len()).step_by(499) {
        members[place].1 = whole[..length].to_vec();
        let (_folder, read) = read_archive(&zipped(&members, CompressionMethod::Stored));
        assert!(read.is_err(), "cut at {length}");
    }
}

/// A pickle of one tensor; `view` pushes its offset, extents and strides.
fn tensor_pickle(class: &str, count: u8, view: &[u8]) -> Vec<u8> {
    let mut pickle = b"\x80\x02ctorch._utils\n_rebuild_tensor_v2\n((X\x07\x00\x00\x00storagectorch\n".to_vec();
    pickle.extend(class.as_bytes());
    pickle.extend(b"\nX\x01\x00\x00\x000X\x03\x00\x00\x00cpuK");
    pickle.push(count);
    pickle.extend(b"tQ");
    pickle.extend(view);
    pickle.extend(b"\x89}tR.");
    pickle
}

/// A pickle of a dict with one entry.
fn dict(key: &str, value: &[u8]) -> Vec<u8> {
    [b"}X".as_slice(), &(key.len() as u32).to_le_bytes(), key.as_bytes(), value, b"s."].concat()
}

fn archive(pickle: &[u8], storages: &[(&str, &[u8])]) -> Vec<u8> {
    let mut members = vec![("archive/data.pkl".to_owned(), pickle.to_vec())];
    members.extend(storages.iter().map(|(key, bytes)| (format!("archive/data/{key}"), bytes.to_vec())));
    zipped(&members, CompressionMethod::Stored)
}

fn zipped(members: &[(String, Vec<u8>)], method: CompressionMethod) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in members {
        archive.start_file(name.as_str(), SimpleFileOptions::default().compression_method(method)).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

fn members(archive: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut archive = zip::ZipArchive::new(Cursor::new(archive)).unwrap();
    let count = archive.len();
    let member = |index| {
        let mut file = archive.by_index(index).unwrap();
        let mut bytes = Vec::new();
        std::io::copy(&mut file, &mut bytes).unwrap();
        (file.name().unwrap().into_owned(), bytes)
    };
    (0..count).map(member).collect()
}

fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut bytes = bytes.to_vec();
    for start in 0..bytes.len() - from.len() {
        if bytes[start..].starts_with(from) {
            bytes[start..start + from.len()].copy_from_slice(to);
        }
    }
    bytes
}

fn read_archive(bytes: &[u8]) -> (tempfile::TempDir, xavatar::formats::Result<Value>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.pth");
    fs::write(&path, bytes).unwrap();
    let read = read_torch(&path);
    (folder, read)
}
