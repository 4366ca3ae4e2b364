//! Subjects in the layouts that people have them in: every frame's scan and body come out as they are, whatever the files look like.

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use glam::{Mat3, Vec3};
use xavatar::body::{BodyParameters, Gender, HandPose, PoseAxisAngle, PosedBody, smplx};
use xavatar::data::{FrameFiles, Layout, ScanFrame, Subject, check, read_frame, write_subject};
use xavatar::formats::{Array, ArrayMap, write_npz, write_pickle};
use xavatar::mesh::{write_obj, write_ply};
use xavatar::synthetic::{BuiltInSubject, Split};

static SUBJECT: LazyLock<BuiltInSubject> = LazyLock::new(|| BuiltInSubject::new().unwrap());
static FRAMES: LazyLock<Vec<ScanFrame>> =
    LazyLock::new(|| (0..2).map(|index| SUBJECT.frame(Split::Train, index, 2).unwrap()).collect());

/// Coefficients of a bent hand.
const PCA: [f32; 12] = [1.2, -0.7, 0.4, 0.0, 0.9, -0.3, 0.2, 0.0, 0.1, -0.2, 0.3, 0.5];

fn vector(values: &[f32]) -> Array {
    Array::from_f32(&[values.len()], values.to_vec())
}

fn numbers(rotations: &[PoseAxisAngle]) -> Vec<f32> {
    rotations.iter().flat_map(|rotation| rotation.0.to_array()).collect()
}

fn hand(pose: &HandPose) -> Vec<f32> {
    match pose {
        HandPose::RelativeToMean(rotations) | HandPose::Flat(rotations) => numbers(rotations),
        HandPose::Pca(coefficients) => coefficients.clone(),
    }
}

/// The parameters under smplx's names.
fn arrays(parameters: &smplx::Parameters) -> ArrayMap {
    [
        ("betas", parameters.betas.clone()),
        ("expression", parameters.expression.clone()),
        ("global_orient", numbers(&[parameters.global_orient])),
        ("body_pose", numbers(&parameters.body_pose)),
        ("jaw_pose", numbers(&[parameters.jaw_pose])),
        ("leye_pose", numbers(&[parameters.left_eye_pose])),
        ("reye_pose", numbers(&[parameters.right_eye_pose])),
        ("left_hand_pose", hand(&parameters.left_hand_pose)),
        ("right_hand_pose", hand(&parameters.right_hand_pose)),
        ("transl", parameters.transl.to_array().to_vec()),
    ]
    .into_iter()
    .map(|(name, values)| (name.to_owned(), vector(&values)))
    .collect()
}

fn with_pca_hands(parameters: &smplx::Parameters) -> smplx::Parameters {
    let hand = || HandPose::Pca(PCA.to_vec());
    smplx::Parameters { left_hand_pose: hand(), right_hand_pose: hand(), ..parameters.clone() }
}

/// Rotation vectors of an array as row-major matrices.
fn matrices(array: &Array) -> Array {
    let values = array.to_f32().unwrap();
    let rows = values.chunks_exact(3).flat_map(|vector| {
        let turn = Vec3::from_slice(vector);
        let matrix = match turn.try_normalize() {
            Some(axis) => Mat3::from_axis_angle(axis, turn.length()),
            None => Mat3::IDENTITY,
        };
        matrix.transpose().to_cols_array()
    });
    Array::from_f32(&[values.len() / 3, 3, 3], rows.collect())
}

fn json(arrays: &ArrayMap) -> String {
    let entries = arrays.iter().map(|(name, array)| format!("\"{name}\": {:?}", array.to_f32().unwrap()));
    format!("{{{}}}", entries.collect::<Vec<_>>().join(", "))
}

fn folder_of(path: &Path) -> &Path {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    path
}

fn write_scan(path: &Path, frame: &ScanFrame) {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("obj") => write_obj(folder_of(path), &frame.scan).unwrap(),
        _ => write_ply(folder_of(path), &frame.scan).unwrap(),
    }
}

fn open(folder: &Path) -> Subject {
    Subject::open(folder).unwrap().settled(SUBJECT.model()).unwrap()
}

/// That a frame's scan lies where `wanted` has it and its body is the same, to `tolerance`, metres.
#[track_caller]
fn assert_frame(files: &FrameFiles, subject: &Subject, scan: &[Vec3], wanted: &smplx::Parameters, tolerance: f32) {
    let frame = read_frame(files, &subject.betas).unwrap();
    let apart = |one: &[Vec3], other: &[Vec3]| {
        assert_eq!(one.len(), other.len());
        one.iter().zip(other).map(|(one, other)| one.distance(*other)).fold(0.0, f32::max)
    };
    let body = |parameters: BodyParameters| posed(&parameters).vertices;
    let of_scan = apart(&frame.scan.vertices, scan);
    let of_body = apart(&body(frame.parameters), &body(wanted.clone().into()));
    assert!(of_scan < tolerance && of_body < tolerance, "{}: scan {of_scan} m, body {of_body} m", files.id);
}

fn posed(parameters: &BodyParameters) -> PosedBody {
    SUBJECT.model().pose(&SUBJECT.model().resolve(parameters).unwrap()).unwrap()
}

#[track_caller]
fn assert_frames(subject: &Subject, wanted: impl Fn(&smplx::Parameters) -> smplx::Parameters) {
    let files: Vec<&FrameFiles> = subject.train.iter().chain(&subject.test).collect();
    assert_eq!(files.len(), FRAMES.len());
    for (files, frame) in files.into_iter().zip(FRAMES.iter()) {
        assert_frame(files, subject, &frame.scan.vertices, &wanted(of(frame)), 1e-4);
    }
}

fn of(frame: &ScanFrame) -> &smplx::Parameters {
    frame.parameters.smplx().unwrap()
}

#[test]
fn scans_and_fits_in_two_folders_are_a_subject_whatever_the_fits_are_stored_as() {
    type Write = fn(&Path, &ArrayMap);
    let kinds: [(&str, Write); 3] = [
        ("pkl", |path, arrays| write_pickle(path, arrays).unwrap()),
        ("npz", |path, arrays| write_npz(path, arrays).unwrap()),
        ("json", |path, arrays| fs::write(path, json(arrays)).unwrap()),
    ];
    for (extension, write) in kinds {
        let folder = tempfile::tempdir().unwrap();
        for frame in FRAMES.iter() {
            let number = frame.id.number;
            write_scan(&folder.path().join(format!("scans/anna_{number:03}.obj")), frame);
            let fit = folder.path().join(format!("fits/anna_{number:03}.{extension}"));
            write(folder_of(&fit), &arrays(of(frame)));
        }
        // Which of the models, no file says.
        let error = Subject::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("subject.toml") && error.contains("gender = \"neutral\""), "{error}");
        fs::write(folder.path().join("subject.toml"), "gender = \"neutral\"\n").unwrap();
        let subject = open(folder.path());
        assert_eq!((subject.layout, subject.gender), (Layout::Plain, Gender::Neutral), "{extension}");
        assert!(subject.betas.iter().zip(SUBJECT.betas()).all(|(found, right)| (found - right).abs() < 1e-6));
        assert_frames(&subject, smplx::Parameters::clone);
    }
}

#[test]
fn fits_go_by_the_names_of_tools_and_as_matrices_or_coefficients() {
    let folder = tempfile::tempdir().unwrap();
    let write = |convert: &dyn Fn(&smplx::Parameters) -> ArrayMap| {
        for frame in FRAMES.iter() {
            let number = frame.id.number;
            write_scan(&folder.path().join(format!("scans/{number}.ply")), frame);
            let fit = folder.path().join(format!("fits/{number}_smplx.npz"));
            write_npz(folder_of(&fit), &convert(of(frame))).unwrap();
        }
    };
    fs::write(folder.path().join("subject.toml"), "gender = \"neutral\"\n").unwrap();
    write(&|parameters| arrays(&with_pca_hands(parameters)));
    assert_frames(&open(folder.path()), with_pca_hands);

    let renamed = [("global_orient", "root_orient"), ("body_pose", "pose_body"), ("transl", "trans")];
    write(&|parameters| {
        let mut arrays = arrays(parameters);
        for (name, other) in renamed {
            let array = arrays.remove(name).unwrap();
            arrays.insert(other.into(), array);
        }
        arrays
    });
    assert_frames(&open(folder.path()), smplx::Parameters::clone);

    let flat = |parameters: &smplx::Parameters| {
        let pose = SUBJECT.model().resolve(&parameters.clone().into()).unwrap();
        smplx::Parameters::from(&pose)
    };
    write(&|parameters| {
        let mut arrays = arrays(&flat(parameters));
        for (name, array) in &mut arrays {
            if name.ends_with("_pose") || name == "global_orient" {
                *array = matrices(array);
            }
        }
        arrays
    });
    assert_frames(&open(folder.path()), smplx::Parameters::clone);
}

#[test]
fn xhumans_subjects_may_have_other_meshes_and_other_fits() {
    let folder = tempfile::tempdir().unwrap();
    write_subject(folder.path(), Gender::Neutral, SUBJECT.betas(), FRAMES.iter().cloned().map(Ok)).unwrap();
    let take = folder.path().join("train/Take1");
    for frame in FRAMES.iter() {
        let name = format!("mesh-f{:05}", frame.id.number);
        fs::remove_file(take.join(format!("meshes_ply/{name}.ply"))).unwrap();
        write_scan(&take.join(format!("meshes_ply/{name}.obj")), frame);
        let fit = take.join(format!("SMPLX/{name}_smplx.pkl"));
        let mut arrays = arrays(&with_pca_hands(of(frame)));
        arrays.insert("global_orient".into(), matrices(&arrays["global_orient"]));
        write_pickle(&fit, &arrays).unwrap();
    }
    let subject = open(folder.path());
    assert_eq!(subject.layout, Layout::XHumans);
    assert_frames(&subject, with_pca_hands);
}

#[test]
fn thuman2_scans_are_brought_to_the_size_of_their_bodies() {
    let folder = tempfile::tempdir().unwrap();
    let (scale, translation) = (0.57, Vec3::new(0.2, -0.4, 0.1));
    for frame in FRAMES.iter() {
        let name = format!("{:04}", frame.id.number);
        let mut scaled = frame.clone();
        scaled.scan.vertices.iter_mut().for_each(|vertex| *vertex = *vertex * scale + translation);
        write_scan(&folder.path().join(format!("scans_release/{name}/{name}.obj")), &scaled);
        let mut arrays = arrays(&with_pca_hands(of(frame)));
        arrays.insert("scale".into(), vector(&[scale]));
        arrays.insert("translation".into(), vector(&translation.to_array()));
        let fit = folder.path().join(format!("scans_smplx/{name}/smplx_param.pkl"));
        write_pickle(folder_of(&fit), &arrays).unwrap();
    }
    let subject = open(&folder.path().join("scans_release"));
    assert_eq!((subject.layout, subject.gender), (Layout::THuman2, Gender::Male));
    assert_frames(&subject, with_pca_hands);
    // One scan alone is a subject too.
    let alone = open(&folder.path().join("scans_release/0002"));
    assert_frame(&alone.train[0], &alone, &FRAMES[1].scan.vertices, &with_pca_hands(of(&FRAMES[1])), 1e-4);
}

#[test]
fn dress_takes_are_sequences_the_last_of_them_for_tests() {
    let folder = tempfile::tempdir().unwrap();
    for (frame, take) in FRAMES.iter().zip(["Take2", "Take7"]) {
        let take = folder.path().join("Inner").join(take);
        write_scan(&take.join("Meshes_pkl/mesh-f00011.ply"), frame);
        write_pickle(folder_of(&take.join("SMPLX/mesh-f00011_smplx.pkl")), &arrays(of(frame))).unwrap();
        let info = [("gender".to_owned(), Array::from_text("female"))].into();
        write_pickle(take.join("basic_info.pkl"), &info).unwrap();
    }
    let subject = open(&folder.path().join("Inner"));
    assert_eq!((subject.layout, subject.gender), (Layout::Dress4d, Gender::Female));
    let ids: Vec<String> = subject.train.iter().chain(&subject.test).map(|files| files.id.to_string()).collect();
    assert_eq!(ids, ["train/Take2/f00011", "test/Take7/f00011"]);
    assert_frames(&subject, smplx::Parameters::clone);
    // Several outfits are several subjects.
    fs::create_dir(folder.path().join("notes")).unwrap();
    let error = Subject::open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("give one of Inner") && !error.contains("notes"), "{error}");
}

#[test]
fn custom_humans_stand_with_the_pelvis_at_the_origin() {
    let folder = tempfile::tempdir().unwrap();
    let frame = &FRAMES[1];
    let hands = SUBJECT.model().hands();
    let flat_hand = |side: usize| {
        let value =
            |index: usize| PCA.iter().zip(&hands[side].components).map(|(weight, row)| weight * row[index]).sum();
        HandPose::Flat(std::array::from_fn(|joint| {
            PoseAxisAngle(Vec3::from_array(std::array::from_fn(|axis| value(3 * joint + axis))))
        }))
    };
    let wanted = smplx::Parameters {
        global_orient: PoseAxisAngle::default(),
        transl: Vec3::ZERO,
        left_hand_pose: flat_hand(0),
        right_hand_pose: flat_hand(1),
        ..of(frame).clone()
    };
    let pelvis = posed(&wanted.clone().into()).joints[0];
    let mut centred = frame.clone();
    centred.scan.vertices.iter_mut().for_each(|vertex| *vertex -= pelvis);
    write_scan(&folder.path().join("0003/mesh-f00101.obj"), &centred);
    let mut arrays = arrays(&with_pca_hands(of(frame)));
    arrays.remove("global_orient");
    arrays.remove("transl");
    fs::write(folder.path().join("0003/mesh-f00101.json"), json(&arrays)).unwrap();
    write_scan(&folder.path().join("0003/mesh-f00101_smpl.obj"), frame);
    let subject = Subject::open(folder.path().join("0003")).unwrap();
    assert_eq!((subject.layout, subject.train.len()), (Layout::CustomHumans, 1));
    let error = read_frame(&subject.train[0], &subject.betas).unwrap_err().to_string();
    assert!(error.contains("body model"), "{error}");
    let subject = subject.settled(SUBJECT.model()).unwrap();
    assert_frame(&subject.train[0], &subject, &frame.scan.vertices, &wanted, 1e-4);
}

#[test]
fn fits_of_smpl_ask_for_a_model_of_smpl() {
    let folder = tempfile::tempdir().unwrap();
    write_scan(&folder.path().join("scan.ply"), &FRAMES[0]);
    fs::write(folder.path().join("gender.txt"), "male").unwrap();
    for (count, family) in [(72, "of SMPL ("), (156, "of SMPL+H (")] {
        let fit = [
            ("pose".to_owned(), vector(&vec![0.0; count])),
            ("betas".to_owned(), vector(&[0.0; 10])),
            ("trans".to_owned(), vector(&[0.0; 3])),
        ];
        write_pickle(folder.path().join("scan_smpl.pkl"), &fit.into()).unwrap();
        let subject = Subject::open(folder.path()).unwrap();
        assert_eq!(subject.layout, Layout::Rvh);
        // The built-in model is one of SMPL-X.
        let error = subject.settled(SUBJECT.model()).unwrap_err().to_string();
        assert!(
            error.contains(family) && error.contains("scan_smpl.pkl") && error.contains("of the SMPL-X skeleton"),
            "{error}"
        );
    }
}

#[test]
fn a_description_names_folders_shape_and_tests() {
    let folder = tempfile::tempdir().unwrap();
    for (frame, sequence) in FRAMES.iter().zip(["walk", "jump"]) {
        write_scan(&folder.path().join(format!("data/{sequence}/geometry/1.ply")), frame);
        let mut fit = arrays(of(frame));
        fit.remove("betas");
        write_npz(folder_of(&folder.path().join(format!("data/{sequence}/bodies/1.npz"))), &fit).unwrap();
    }
    let described = folder.path().join("anna");
    fs::create_dir(&described).unwrap();
    let write = |text: String| fs::write(described.join("subject.toml"), text).unwrap();
    let sequence = |name: &str, split: &str| {
        format!("[[sequence]]\nfolder = \"{name}\"\nsplit = \"{split}\"\nscans = \"geometry\"\nfits = \"bodies\"\n")
    };
    let head = "data = \"../data\"\ngender = \"neutral\"\n";
    write(format!("{head}{}{}", sequence("walk", "train"), sequence("jump", "test")));
    let error = Subject::open(&described).unwrap_err().to_string();
    assert!(error.contains("subject.toml") && error.contains("betas = [...]"), "{error}");
    let betas = format!("betas = {:?}\n", SUBJECT.betas());
    write(format!("{head}{betas}{}{}", sequence("walk", "train"), sequence("jump", "test")));
    let subject = open(&described);
    assert_eq!(subject.test[0].id.to_string(), "test/jump/f00001");
    assert_frames(&subject, smplx::Parameters::clone);
    for (text, word) in [
        ("gender = \"robot\"", "line 1"),
        ("colour = 1", "line 1"),
        ("betas = [nan, 0, 0, 0, 0, 0, 0, 0, 0, 0]", "betas"),
    ] {
        write(text.into());
        let error = Subject::open(&described).unwrap_err().to_string();
        assert!(error.contains(word) && error.contains("subject.toml"), "{error}");
    }
}

#[test]
fn what_is_missing_is_named_in_the_layout_that_is_there() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("subject.toml"), "gender = \"neutral\"\n").unwrap();
    for frame in FRAMES.iter() {
        let number = frame.id.number;
        write_scan(&folder.path().join(format!("scans/{number}.obj")), frame);
        write_npz(folder_of(&folder.path().join(format!("fits/{number}.npz"))), &arrays(of(frame))).unwrap();
    }
    fs::remove_file(folder.path().join("scans/1.obj")).unwrap();
    fs::remove_file(folder.path().join("fits/2.npz")).unwrap();
    let subject = open(folder.path());
    let complaint = |index: usize| read_frame(&subject.train[index], &subject.betas).unwrap_err().to_string();
    for (index, words) in [(0, ["the frame's scan", "scans", "1 as"]), (1, ["not found", "fits", "2 as"])] {
        let said = complaint(index);
        for word in words {
            assert!(said.contains(word), "{said}");
        }
        assert!(!said.contains("meshes_") && !said.contains("_smplx") && !said.contains("SMPLX"), "{said}");
    }
    let report = check(&subject, SUBJECT.model(), SUBJECT.part_labels(), &|| {}).unwrap();
    assert_eq!(report.unusable.len(), 2);

    let empty = tempfile::tempdir().unwrap();
    let error = Subject::open(empty.path()).unwrap_err().to_string();
    for layout in ["X-Humans", "4D-DRESS", "THuman2", "scans/ and fits/", "docs/formats.md"] {
        assert!(error.contains(layout), "{error}");
    }
}

#[test]
fn shapes_that_differ_are_said_with_the_figure() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("subject.toml"), "gender = \"neutral\"\n").unwrap();
    for frame in FRAMES.iter() {
        let number = frame.id.number;
        write_scan(&folder.path().join(format!("scans/{number}.obj")), frame);
        let mut parameters = of(frame).clone();
        parameters.betas[3] += number as f32;
        write_npz(folder_of(&folder.path().join(format!("fits/{number}.npz"))), &arrays(&parameters)).unwrap();
    }
    let subject = open(folder.path());
    assert!((subject.shape_spread.unwrap() - 1.0).abs() < 1e-5);
    let report = check(&subject, SUBJECT.model(), SUBJECT.part_labels(), &|| {}).unwrap();
    let said = report.warnings.iter().find(|warning| warning.name.name() == "shapes").unwrap();
    assert!(said.message.contains("1.00"), "{said}");
}
