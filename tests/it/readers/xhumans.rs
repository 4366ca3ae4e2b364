//! Subjects in the X-Humans layout: raw and preprocessed frames, round trips, and what is said about damaged ones.

use std::fs;
use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};
use xavatar::InputError;
use xavatar::body::{BodyParameters, Gender, HandPose, PoseAxisAngle, smplx};
use xavatar::data::{FrameId, ScanFrame, Subject, read_frame, read_motion, write_subject};
use xavatar::formats::{Array, ArrayData, ArrayMap, write_pickle};
use xavatar::mesh::{Colouring, TriangleMesh};

const BETAS: [f32; 10] = [0.5, -1.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.25, 1.0];

fn parameters(seed: f32) -> smplx::Parameters {
    let rotation = |joint: usize| PoseAxisAngle(Vec3::new(seed, 0.01 * joint as f32, -0.1));
    smplx::Parameters {
        betas: BETAS.to_vec(),
        expression: (0..10).map(|index| seed + index as f32).collect(),
        global_orient: rotation(0),
        body_pose: std::array::from_fn(|joint| rotation(1 + joint)),
        jaw_pose: rotation(22),
        left_eye_pose: rotation(23),
        right_eye_pose: rotation(24),
        left_hand_pose: HandPose::RelativeToMean(std::array::from_fn(|joint| rotation(25 + joint))),
        right_hand_pose: HandPose::RelativeToMean(std::array::from_fn(|joint| rotation(40 + joint))),
        transl: Vec3::new(seed, 1.0, -2.0),
    }
}

fn tetrahedron() -> TriangleMesh {
    TriangleMesh {
        vertices: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
        faces: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        normals: None,
        colouring: Colouring::Vertex(vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [1, 2, 3]]),
    }
}

fn frame(split: &str, sequence: &str, number: u32) -> ScanFrame {
    let id = FrameId { split: split.into(), sequence: sequence.into(), number };
    let parameters = parameters(number as f32).into();
    ScanFrame { id, scan: tetrahedron(), parameters, unseen_parts: Vec::new(), notes: Vec::new() }
}

/// A subject of three frames, preprocessed.
fn subject(folder: &Path) -> Subject {
    let frames = [
        frame("train", "Take2", 1),
        frame("train", "Take1", 10),
        frame("train", "Take1", 2),
        frame("test", "Take3", 7),
    ];
    write_subject(folder, Gender::Female, &BETAS, frames.into_iter().map(Ok)).unwrap();
    Subject::open(folder).unwrap()
}

fn raw_scan() -> ArrayMap {
    let float = |columns: usize, values: &[f32]| Array::from_f32(&[values.len() / columns, columns], values.to_vec());
    ArrayMap::from([
        ("vertices".into(), float(3, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0])),
        ("normals".into(), float(3, &[0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0])),
        ("uvs".into(), float(2, &[-0.1, 0.5, 1.0, 1.25, 0.25, 0.75])),
        ("faces".into(), Array { shape: vec![1, 3], data: ArrayData::I64(vec![0, 1, 2]) }),
    ])
}

/// Adds a raw scan and atlas to the subject's test frame; the paths of both.
fn add_raw_scan(folder: &Path) -> (PathBuf, PathBuf) {
    let scans = folder.join("test/Take3/meshes_pkl");
    fs::create_dir_all(&scans).unwrap();
    let (mesh, atlas) = (scans.join("mesh-f00007.pkl"), scans.join("atlas-f00007.pkl"));
    write_pickle(&mesh, &raw_scan()).unwrap();
    fs::write(&atlas, atlas_pickle(2, 1, &[10, 20, 30, 40, 50, 60])).unwrap();
    (mesh, atlas)
}

/// A pickled u8 array (height, width, 3) that is not inside a dict, as atlases are.
fn atlas_pickle(width: u8, height: u8, texels: &[u8]) -> Vec<u8> {
    let mut pickle =
        b"\x80\x03cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\0\x85C\x01b\x87R(K\x01K".to_vec();
    pickle.extend([height, b'K', width, b'K', 3]);
    pickle.extend(b"\x87cnumpy\ndtype\nU\x02u1\x85R\x89C");
    pickle.push(texels.len() as u8);
    pickle.extend(texels);
    pickle.extend(b"tb.");
    pickle
}

#[test]
fn a_written_subject_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let subject = subject(folder.path());
    assert_eq!((subject.gender, subject.betas.as_slice()), (Gender::Female, &BETAS[..]));
    let ids: Vec<String> = subject.train.iter().chain(&subject.test).map(|files| files.id.to_string()).collect();
    assert_eq!(ids, ["train/Take1/f00002", "train/Take1/f00010", "train/Take2/f00001", "test/Take3/f00007"]);
    for files in subject.train.iter().chain(&subject.test) {
        let read = read_frame(files, &subject.betas).unwrap();
        assert_eq!(read.parameters, parameters(files.id.number as f32).into());
        assert_eq!(read.scan.vertices, tetrahedron().vertices);
        assert_eq!(read.scan.faces, tetrahedron().faces);
        let (Colouring::Vertex(read), Colouring::Vertex(written)) = (read.scan.colouring, tetrahedron().colouring)
        else {
            panic!("colours are per vertex");
        };
        assert_eq!(read, written);
    }
}

#[test]
fn a_sequence_is_a_motion() {
    let folder = tempfile::tempdir().unwrap();
    subject(folder.path());
    let sequence = folder.path().join("train/Take1");
    let motion = read_motion(&sequence).unwrap();
    assert_eq!(motion.frames, read_motion(sequence.join("SMPLX")).unwrap().frames);
    let expected = [2.0, 10.0].map(|seed| smplx::Parameters { betas: Vec::new(), ..parameters(seed) });
    assert_eq!(motion.frames, expected);
}

#[test]
fn the_raw_scan_wins_because_it_has_a_texture() {
    let folder = tempfile::tempdir().unwrap();
    subject(folder.path());
    add_raw_scan(folder.path());
    let subject = Subject::open(folder.path()).unwrap();
    let scan = read_frame(&subject.test[0], &subject.betas).unwrap().scan;
    assert_eq!(scan.faces, [[0, 1, 2]]);
    assert_eq!(scan.normals.unwrap(), [Vec3::Z; 3]);
    let Colouring::Texture { uvs, image } = scan.colouring else { panic!("a raw scan is textured") };
    assert_eq!(uvs, [Vec2::new(0.0, 0.5), Vec2::new(1.0, 1.0), Vec2::new(0.25, 0.75)]);
    assert_eq!((image.dimensions(), image.get_pixel(1, 0).0), ((2, 1), [40, 50, 60]));
}

#[test]
fn a_damaged_frame_is_an_error_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    subject(folder.path());
    let (mesh, atlas) = add_raw_scan(folder.path());
    let files = Subject::open(folder.path()).unwrap().test.remove(0);
    let complaint = || {
        let error = read_frame(&files, &BETAS).unwrap_err();
        assert!(matches!(&error, InputError::Frame { frame, .. } if frame == "test/Take3/f00007"), "{error}");
        error.to_string()
    };
    let scan_with = |key: &str, array: Array| {
        let mut arrays = raw_scan();
        arrays.insert(key.into(), array);
        write_pickle(&mesh, &arrays).unwrap();
        complaint()
    };
    let integers =
        |shape: &[usize], values: &[i64]| Array { shape: shape.to_vec(), data: ArrayData::I64(values.into()) };

    assert!(scan_with("faces", integers(&[1, 3], &[0, 1, 3])).contains("`faces`"));
    assert!(scan_with("faces", integers(&[1, 3], &[0, -1, 2])).contains("`faces`"));
    assert!(scan_with("faces", integers(&[3], &[0, 1, 2])).contains("`faces`"));
    assert!(scan_with("faces", integers(&[0, 3], &[])).contains("no faces"));
    assert!(
        scan_with("vertices", Array::from_f32(&[3, 3], [[0.0; 8].as_slice(), &[f32::NAN]].concat())).contains("NaN")
    );
    assert!(
        scan_with("vertices", Array::from_f32(&[3, 3], [[0.0; 8].as_slice(), &[f32::INFINITY]].concat()))
            .contains("inf")
    );
    assert!(scan_with("normals", Array::from_f32(&[1, 3], vec![0.0; 3])).contains("normals"));
    assert!(scan_with("uvs", Array::from_f32(&[2, 2], vec![0.0; 4])).contains("texture coordinates"));

    write_pickle(&mesh, &raw_scan()).unwrap();
    fs::write(&atlas, atlas_pickle(2, 2, &[0; 6])).unwrap();
    assert!(complaint().contains("atlas-f00007.pkl"));
    fs::write(&atlas, atlas_pickle(0, 0, &[])).unwrap();
    assert!(complaint().contains("atlas-f00007.pkl"));
    fs::remove_file(&atlas).unwrap();
    assert!(complaint().contains("texture atlas not found"));

    fs::write(&atlas, atlas_pickle(1, 1, &[0; 3])).unwrap();
    assert!(read_frame(&files, &BETAS).is_ok());
    write_pickle(
        files.parameters.path().unwrap(),
        &ArrayMap::from([("transl".into(), Array::from_f32(&[3], vec![0.0; 3]))]),
    )
    .unwrap();
    assert!(complaint().contains("global_orient"));
    fs::remove_file(files.parameters.path().unwrap()).unwrap();
    assert!(complaint().contains("the frame's registration not found"));
    // Its scan alone still makes it a frame of the subject.
    assert_eq!(Subject::open(folder.path()).unwrap().test.len(), 1);
}

#[test]
fn what_a_subject_lacks_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let complaint = || Subject::open(folder).unwrap_err().to_string();
    assert!(complaint().contains("X-Humans"));
    fs::write(folder.join("gender.txt"), "unknown").unwrap();
    assert!(complaint().contains("unknown"));
    fs::write(folder.join("gender.txt"), " Male\n").unwrap();
    assert!(complaint().contains("mean shape"));
    fs::write(folder.join("mean_shape_smplx.npy"), npy("<f4", "(2,)", 8)).unwrap();
    assert!(complaint().contains("10 finite shape coefficients"));
    fs::write(folder.join("mean_shape_smplx.npy"), npy("<f8", "(1, 10)", 80)).unwrap();
    assert!(complaint().contains("a frame"));
    assert!(Subject::open(folder.join("nowhere")).unwrap_err().to_string().contains("subject folder"));
}

fn npy(element: &str, shape: &str, bytes: usize) -> Vec<u8> {
    let header = format!("{{'descr': '{element}', 'fortran_order': False, 'shape': {shape}, }}\n");
    [b"\x93NUMPY\x01\0", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), &vec![0; bytes]].concat()
}

#[test]
fn hands_of_another_convention_are_not_written_as_if_relative() {
    let folder = tempfile::tempdir().unwrap();
    let mut flat = frame("train", "Take1", 1);
    flat.parameters = BodyParameters::from(smplx::Parameters {
        left_hand_pose: HandPose::Flat(Default::default()),
        ..parameters(1.0)
    });
    let error = write_subject(folder.path(), Gender::Neutral, &BETAS, [Ok(flat)]).unwrap_err();
    assert!(
        error.to_string().contains("train/Take1/f00001") && error.to_string().contains("left_hand_pose"),
        "{error}"
    );
}
