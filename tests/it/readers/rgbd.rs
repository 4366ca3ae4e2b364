//! RGB-D frames from files to points: layouts, formats, units, cameras, and what damaged or contradictory data is told.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;

use glam::{Mat4, Vec3};
use image::{GrayImage, Luma, RgbImage};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;
use xavatar::body::{Gender, Part, Registration, smplx};
use xavatar::data::{
    BACKGROUND, Capture, CaptureKind, DepthFormat, FrameId, NO_MEASUREMENT, PointCloud, RgbdCheckReport, RgbdFrame,
    RgbdLayout, RgbdSubject, ScanFrame, Source, check_rgbd, read_depth, read_motion, write_depth, write_motion,
    write_rgbd_subject,
};
use xavatar::formats::{Array, read_npz, write_npz};
use xavatar::mesh::TriangleMesh;
use xavatar::mesh::camera::{PinholeCamera, pixel_centre};
use xavatar::synthetic::{BuiltInSubject, Split};
use xavatar::synthetic::{FilmedScans, Turntable, film};

const FORMATS: [DepthFormat; 3] = [DepthFormat::Png, DepthFormat::Tiff, DepthFormat::Exr];
/// Pictures that are drawn in milliseconds.
const SMALL: Turntable = Turntable { size: [120, 180], steps_per_turn: 4 };

static SUBJECT: LazyLock<BuiltInSubject> = LazyLock::new(|| BuiltInSubject::new().unwrap());

/// The mannequin's scans: two training frames and a test frame, numbered from 11.
struct Scans {
    frames: Vec<ScanFrame>,
    ids: Vec<FrameId>,
}

impl Source for Scans {
    fn kind(&self) -> CaptureKind {
        CaptureKind::Scans
    }

    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, index: usize) -> xavatar::formats::Result<Capture> {
        Ok(Capture::Scan(Box::new(self.frames[index].clone())))
    }

    fn betas(&self) -> &[f32] {
        SUBJECT.betas()
    }

    fn gender(&self) -> Gender {
        Gender::Neutral
    }
}

static SCANS: LazyLock<Scans> = LazyLock::new(|| {
    let takes = [(Split::Train, 0), (Split::Train, 1), (Split::Test, 1)];
    let mut frames: Vec<ScanFrame> =
        takes.iter().map(|&(split, index)| SUBJECT.frame(split, index, 2).unwrap()).collect();
    frames.iter_mut().for_each(|frame| frame.id.number += 10);
    let ids = frames.iter().map(|frame| frame.id.clone()).collect();
    Scans { frames, ids }
});

static FRAMES: LazyLock<Vec<RgbdFrame>> = LazyLock::new(|| {
    let filmed = FilmedScans::new(&*SCANS, SMALL).unwrap();
    (0..filmed.ids().len()).map(|index| filmed.picture(index).unwrap()).collect()
});

/// The frames, written in a layout.
fn written(layout: RgbdLayout) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), layout);
    folder
}

fn write(folder: &Path, layout: RgbdLayout) {
    write_rgbd_subject(folder, layout, Gender::Neutral, SUBJECT.betas(), FRAMES.iter().cloned().map(Ok)).unwrap();
}

fn replace(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(path, text.replace(from, to)).unwrap();
}

fn assert_alike(found: &RgbdFrame, frame: &RgbdFrame, tolerance: f32) {
    assert_eq!(found.id, frame.id);
    assert_eq!(found.colour, frame.colour);
    assert_eq!(found.parameters, frame.parameters);
    assert!(found.camera.extrinsic().abs_diff_eq(frame.camera.extrinsic(), 1e-6));
    let numbers = |camera: &PinholeCamera| [camera.fx, camera.fy, camera.cx, camera.cy];
    assert_eq!(numbers(&found.camera), numbers(&frame.camera));
    for (found, depth) in found.depth.iter().zip(&frame.depth) {
        assert!(found == depth || (found - depth).abs() <= tolerance, "{found} was {depth}");
    }
}

#[test]
fn frames_survive_every_layout_and_format() {
    let plain = FORMATS.map(RgbdLayout::Plain);
    for layout in plain.into_iter().chain([RgbdLayout::XHumans]) {
        let tolerance = if layout == RgbdLayout::Plain(DepthFormat::Png) { 1.01e-4 } else { 0.0 };
        let folder = written(layout);
        assert!(RgbdSubject::is_in(folder.path()));
        let subject = RgbdSubject::open(folder.path()).unwrap();
        assert_eq!((subject.train.len(), subject.test.len()), (2, 1));
        assert_eq!((subject.gender, subject.betas.as_slice()), (Gender::Neutral, SUBJECT.betas()));
        let (train, test) = (subject.training_frames(), subject.test_frames());
        for (source, index, frame) in [(&train, 0, &FRAMES[0]), (&train, 1, &FRAMES[1]), (&test, 0, &FRAMES[2])] {
            assert_alike(&source.picture(index).unwrap(), frame, tolerance);
        }
    }
}

#[test]
fn the_same_depth_in_any_format_gives_the_same_points() {
    let folder = tempfile::tempdir().unwrap();
    let frame = &FRAMES[0];
    let size = [frame.camera.width, frame.camera.height];
    let clouds = FORMATS.map(|format| {
        let path = folder.path().join(format!("depth.{}", format.extension()));
        write_depth(&path, &frame.depth, size, format).unwrap();
        let picture = read_depth(&path).unwrap();
        assert_eq!([picture.width, picture.height], size);
        let metres = |value: &f32| Some(value * format.metres_per_unit()).filter(|m| *m <= 10.0).unwrap_or(BACKGROUND);
        PointCloud::of(&RgbdFrame { depth: picture.values.iter().map(metres).collect(), ..frame.clone() }).unwrap()
    });
    let [png, tiff, exr] = clouds;
    assert!(tiff.points.len() > 1000);
    assert_eq!(tiff, exr);
    assert_eq!((&png.pixels, &png.colours), (&tiff.pixels, &tiff.colours));
    for (one, other) in png.points.iter().zip(&tiff.points) {
        assert!(one.distance(*other) < 1.1e-4, "half a unit of a fifth of a millimetre, along an oblique ray");
    }
}

#[test]
fn points_lie_on_the_scan_and_know_their_parts() {
    for (frame, scan) in FRAMES.iter().zip(&SCANS.frames) {
        let cloud = PointCloud::of(frame).unwrap();
        let surface = xavatar::mesh::SurfaceIndex::new(&scan.scan).unwrap();
        let farthest = cloud.points.iter().map(|point| surface.closest(*point).distance).fold(0.0, f32::max);
        // Single precision at 6 m.
        assert!(farthest < 5e-5, "{farthest} m");
        let body = SUBJECT.model().pose(&SUBJECT.model().resolve(&frame.parameters).unwrap()).unwrap();
        let registration = Registration::new(&body.vertices, SUBJECT.part_labels()).unwrap();
        let parts = cloud.parts(&registration);
        let [torso, face] = ["body", "face"].map(|name| smplx::skeleton().part_named(name).unwrap());
        assert!(parts.contains(&torso) && parts.contains(&face));
        // The head is above the belly.
        let height = |part: Part| {
            let of_part = cloud.points.iter().zip(&parts).filter(|(_, found)| **found == part);
            let heights: Vec<f32> = of_part.map(|(point, _)| point.y).collect();
            heights.iter().sum::<f32>() / heights.len() as f32
        };
        assert!(height(face) > height(torso) + 0.3);
    }
}

#[test]
fn the_camera_goes_around_once_and_looks_at_the_subject() {
    let table = Turntable { steps_per_turn: 8, ..Turntable::default() };
    let scan = &SCANS.frames[0];
    let target = scan.scan.vertices.iter().sum::<Vec3>() / scan.scan.vertices.len() as f32;
    for step in 0..=8 {
        let camera = table.camera(scan, step).unwrap();
        assert_eq!((camera.width, camera.height), (800, 1200));
        assert!((camera.vertical_field_of_view().to_degrees() - 30.0).abs() < 1e-3);
        let offset = camera.position() - target;
        assert!((Vec3::new(offset.x, 0.0, offset.z).length() - 6.0).abs() < 1e-3);
        assert!(camera.project(target).0.abs_diff_eq(glam::Vec2::new(400.0, 600.0), 0.1));
        let angle = (-offset.x).atan2(offset.z).rem_euclid(std::f32::consts::TAU);
        let expected = (step % 8) as f32 * std::f32::consts::FRAC_PI_4;
        assert!(
            (angle - expected).abs() < 1e-3 || (angle - expected).abs() > std::f32::consts::TAU - 5e-3,
            "{step}: {angle}"
        );
    }
    assert!(Turntable { steps_per_turn: 0, ..table }.camera(scan, 0).is_err());
}

#[test]
fn normals_of_a_rendered_sphere_are_within_three_degrees() {
    let (centre, radius) = (Vec3::new(0.2, 1.1, -0.1), 0.25);
    let (rings, segments) = (256, 512);
    let place = |ring: u32, segment: u32| {
        let (down, around) = (
            std::f32::consts::PI * ring as f32 / rings as f32,
            std::f32::consts::TAU * segment as f32 / segments as f32,
        );
        centre + radius * Vec3::new(down.sin() * around.sin(), down.cos(), down.sin() * around.cos())
    };
    let vertices = (0..=rings).flat_map(|ring| (0..segments).map(move |segment| place(ring, segment))).collect();
    let corner = |ring: u32, segment: u32| ring * segments + segment % segments;
    let quads = (0..rings).flat_map(|ring| (0..segments).map(move |segment| (ring, segment)));
    let faces = quads.flat_map(|(ring, segment)| {
        let [a, b] = [corner(ring, segment), corner(ring + 1, segment)];
        let [c, d] = [corner(ring + 1, segment + 1), corner(ring, segment + 1)];
        [[a, b, c], [a, c, d]]
    });
    let scan = ScanFrame {
        id: FRAMES[0].id.clone(),
        scan: TriangleMesh { vertices, faces: faces.collect(), ..TriangleMesh::default() },
        parameters: smplx::Parameters::default().into(),
        unseen_parts: Vec::new(),
        notes: Vec::new(),
    };
    let camera = PinholeCamera::looking_at(centre + Vec3::new(0.7, 0.4, 2.8), centre, 0.4, [400, 600]).unwrap();
    let cloud = PointCloud::of(&film(&scan, camera).unwrap()).unwrap();
    let mut inside = 0;
    for (point, normal) in cloud.points.iter().zip(&cloud.normals) {
        let outward = (*point - centre).normalize();
        if outward.dot((camera.position() - *point).normalize()) > 0.2 {
            let degrees = normal.dot(outward).min(1.0).acos().to_degrees();
            assert!(degrees < 3.0, "{degrees} degrees at {outward}");
            inside += 1;
        }
    }
    assert!(inside > 10_000, "{inside}");
}

#[test]
fn pictures_are_numbered_by_their_place_unless_one_was_removed() {
    let folder = written(RgbdLayout::XHumans);
    let take = folder.path().join("train/Take1");
    assert!(take.join("render/image/color_000001.png").is_file());
    assert!(take.join("SMPLX/mesh-f00011_smplx.pkl").is_file());
    let numbers = || {
        let subject = RgbdSubject::open(folder.path()).unwrap();
        subject.train.iter().map(|files| files.id.number).collect::<Vec<_>>()
    };
    assert_eq!(numbers(), [11, 12]);
    fs::remove_file(take.join("SMPLX/mesh-f00011_smplx.pkl")).unwrap();
    assert_eq!(numbers(), [1, 2], "no longer one file a picture");
    let error = RgbdSubject::open(folder.path()).unwrap().training_frames().picture(0).unwrap_err().to_string();
    assert!(error.contains("train/Take1/f00001") && error.contains("mesh-f00001_smplx.pkl"), "{error}");
}

/// What reading the first training frame says after `change` to a plain folder of TIFFs.
fn error_after(change: impl Fn(&Path)) -> String {
    let folder = written(RgbdLayout::Plain(DepthFormat::Tiff));
    change(folder.path());
    let frame = RgbdSubject::open(folder.path()).and_then(|subject| subject.training_frames().picture(0));
    frame.unwrap_err().to_string()
}

#[test]
fn frames_that_cannot_be_used_are_named_with_the_reason() {
    let take = |folder: &Path| folder.join("train/Take1");
    let depth = |folder: &Path| take(folder).join("depth/depth_000011.tiff");
    type Change<'a> = &'a dyn Fn(&Path);
    let changes: [(Change, &[&str]); 7] = [
        (&|folder| fs::remove_file(depth(folder)).unwrap(), &["depth picture not found"]),
        (&|folder| fs::remove_file(take(folder).join("cameras.npz")).unwrap(), &["cameras.npz", "not found"]),
        (
            &|folder| {
                let path = take(folder).join("cameras.npz");
                let mut arrays = read_npz(&path).unwrap();
                arrays.insert("extrinsic".into(), Array::from_f32(&[1, 4, 4], vec![2.0; 16]));
                write_npz(&path, &arrays).unwrap();
            },
            &["extrinsic", "world to camera"],
        ),
        (
            &|folder| RgbImage::new(10, 10).save(take(folder).join("colour/color_000011.png")).unwrap(),
            &["120 x 180 pixels", "10 x 10", "depth_000011.tiff", "align"],
        ),
        (
            &|folder| {
                write_depth(depth(folder), &vec![NO_MEASUREMENT; 120 * 180], [120, 180], DepthFormat::Tiff).unwrap()
            },
            &["no valid depth"],
        ),
        (
            &|folder| {
                let thousand: Vec<f32> = FRAMES[0].depth.iter().map(|depth| (depth * 1000.0).min(9e5)).collect();
                write_depth(depth(folder), &thousand, [120, 180], DepthFormat::Tiff).unwrap();
            },
            &["no depth within 10 m", "declare"],
        ),
        (
            &|folder| {
                RgbImage::new(120, 180)
                    .save(folder.join("grey.png"))
                    .and_then(|()| {
                        fs::rename(folder.join("grey.png"), depth(folder)).map_err(image::ImageError::IoError)
                    })
                    .unwrap()
            },
            &["Rgb8", "16-bit grey"],
        ),
    ];
    for (change, words) in changes {
        let error = error_after(change);
        assert!(words.iter().all(|word| error.contains(word)) && error.contains("train/Take1/f00011"), "{error}");
    }
}

#[test]
fn a_layout_that_is_wrong_is_told_where() {
    let toml = |from: &'static str, to: &'static str| move |folder: &Path| replace(&folder.join("rgbd.toml"), from, to);
    for (from, to, words) in [
        ("depth_unit = 1.0", "depth_unit = \"inches\"", ["rgbd.toml", "millimetres"]),
        ("depth_unit = 1.0", "depth_unit = -1", ["depth_unit", "positive"]),
        ("depth_unit = 1.0\n", "", ["rgbd.toml", "depth_unit"]),
        ("pixel_origin", "pixel_origins", ["rgbd.toml", "pixel_origins"]),
        ("\"neutral\"", "\"robot\"", ["line 1", "robot"]),
        ("split = \"train\"", "split = \"validation\"", ["validation", "train"]),
        ("train/Take1", "train/Take7", ["Take7", "rgbd.toml"]),
        ("betas = [", "betas = [nan, ", ["betas", "finite numbers"]),
        ("bodies = \"bodies.npz\"", "bodies = \"absent.npz\"", ["absent.npz", "not found"]),
    ] {
        let error = error_after(toml(from, to));
        assert!(words.iter().all(|word| error.contains(word)), "{from} -> {to}: {error}");
    }
}

#[test]
fn units_masks_and_calibrations_of_a_plain_folder_are_followed() {
    let folder = written(RgbdLayout::Plain(DepthFormat::Png));
    let take = folder.path().join("train/Take1");
    // Intrinsics in the layout and in OpenCV's coordinates, extrinsics as text, JPEG colour, a mask of the upper half.
    let cameras = read_npz(take.join("cameras.npz")).unwrap();
    let camera = FRAMES[0].camera;
    let rows: Vec<Vec<Vec<f32>>> = (0..2)
        .map(|frame| {
            let values = cameras["extrinsic"].to_f32().unwrap();
            values[16 * frame..16 * frame + 12].chunks(4).map(<[f32]>::to_vec).collect()
        })
        .collect();
    fs::write(take.join("cameras.json"), serde_json::json!({ "extrinsic": rows }).to_string()).unwrap();
    fs::create_dir(take.join("masks")).unwrap();
    for (number, frame) in [(11, &FRAMES[0]), (12, &FRAMES[1])] {
        let mask = GrayImage::from_fn(120, 180, |_, row| Luma([if row < 90 { 255 } else { 0 }]));
        mask.save(take.join(format!("masks/{number}.png"))).unwrap();
        fs::remove_file(take.join(format!("colour/color_{number:06}.png"))).unwrap();
        frame.colour.save(take.join(format!("colour/{number}.jpg"))).unwrap();
    }
    let text = format!(
        "gender = \"neutral\"\nbetas = {:?}\ndepth_unit = 2e-4\n[intrinsics]\nfx = {}\nfy = {}\ncx = {}\ncy = {}\n\
         [[sequence]]\nsplit = \"train\"\nfolder = \"train/Take1\"\nname = \"walk\"\nmask = \"masks\"\n\
         cameras = \"cameras.json\"\nbodies = \"bodies.npz\"\n",
        SUBJECT.betas(),
        camera.fx,
        camera.fy,
        camera.cx - 0.5,
        camera.cy - 0.5,
    );
    fs::write(folder.path().join("rgbd.toml"), text).unwrap();
    let subject = RgbdSubject::open(folder.path()).unwrap();
    let frame = subject.training_frames().picture(0).unwrap();
    assert_eq!(frame.id.to_string(), "train/walk/f00011");
    assert!((frame.camera.cx - camera.cx).abs() < 1e-4 && (frame.camera.fy - camera.fy).abs() < 1e-3);
    let cloud = PointCloud::of(&frame).unwrap();
    assert!(cloud.pixels.iter().all(|pixel| pixel / 120 < 90));
    let whole = PointCloud::of(&FRAMES[0]).unwrap();
    for (point, pixel) in cloud.points.iter().zip(&cloud.pixels) {
        if let Ok(place) = whole.pixels.binary_search(pixel) {
            assert!(point.distance(whole.points[place]) < 2e-4);
        }
    }
}

/// The training frames as 16-bit PNGs, with another layout: settings of all sequences and of the one, and what `change` does to its
/// folder.
fn laid_out(settings: &str, sequence: &str, change: impl Fn(&Path)) -> TempDir {
    let folder = written(RgbdLayout::Plain(DepthFormat::Png));
    let camera = FRAMES[0].camera;
    let known =
        format!("intrinsics = {{ fx = {}, fy = {}, cx = {}, cy = {} }}", camera.fx, camera.fy, camera.cx, camera.cy);
    let text = format!(
        "gender = \"neutral\"\nbetas = {:?}\ndepth_unit = 2e-4\npixel_origin = \"corner\"\n{}\n\
         [[sequence]]\nsplit = \"train\"\nfolder = \"train/Take1\"\nbodies = \"bodies.npz\"\n{sequence}\n",
        SUBJECT.betas(),
        if settings.is_empty() { &known } else { settings },
    );
    fs::write(folder.path().join("rgbd.toml"), text).unwrap();
    change(&folder.path().join("train/Take1"));
    folder
}

/// The frames of a folder are the training frames, whatever their numbers are.
fn assert_same_frames(folder: &Path, numbers: [u32; 2]) {
    let source = RgbdSubject::open(folder).unwrap().training_frames();
    assert_eq!(source.ids().iter().map(|id| id.number).collect::<Vec<_>>(), numbers);
    for (index, number) in numbers.into_iter().enumerate() {
        let mut frame = FRAMES[index].clone();
        frame.id.number = number;
        assert_alike(&source.picture(index).unwrap(), &frame, 1.01e-4);
    }
}

/// Camera to world, row by row.
fn pose(frame: &RgbdFrame) -> [[f64; 4]; 4] {
    frame.camera.extrinsic().as_dmat4().inverse().transpose().to_cols_array_2d()
}

fn lines(matrix: [[f64; 4]; 4]) -> String {
    matrix.map(|row| row.map(|entry| entry.to_string()).join(" ") + "\n").concat()
}

fn rename(folder: &Path, from: &str, to: &str) {
    fs::rename(folder.join(from), folder.join(to)).unwrap();
}

// 7-Scenes: all in one folder, numbers in the middle of names, poses as text beside the pictures.
#[test]
fn one_folder_of_colour_depth_and_poses_is_read() {
    let folder = laid_out("", "colour = \".\"\ndepth = \".\"\ncameras = \".\"", |take| {
        for (number, frame) in [11, 12].into_iter().zip(&*FRAMES) {
            rename(take, &format!("colour/color_{number:06}.png"), &format!("frame-{number:06}.color.png"));
            rename(take, &format!("depth/depth_{number:06}.png"), &format!("frame-{number:06}.depth.png"));
            fs::write(take.join(format!("frame-{number:06}.pose.txt")), lines(pose(frame))).unwrap();
        }
    });
    assert_same_frames(folder.path(), [11, 12]);
}

// TUM: colour, depth and poses are each named by their own times.
#[test]
fn pictures_and_poses_of_the_nearest_times_are_frames() {
    let start = 1305031102.175304;
    // Which picture is taken when.
    let lay_out = |colour: &[(u32, f64)], depth: [f64; 2]| {
        laid_out("", "colour = \"rgb\"\ncameras = \"groundtruth.txt\"", |take| {
            fs::create_dir(take.join("rgb")).unwrap();
            for (number, time) in colour {
                let source = format!("colour/color_{number:06}.png");
                fs::copy(take.join(source), take.join(format!("rgb/{:.6}.png", start + time))).unwrap();
            }
            for (number, time) in [11, 12].into_iter().zip(depth) {
                rename(take, &format!("depth/depth_{number:06}.png"), &format!("depth/{:.6}.png", start + time));
            }
            let mut text = "# timestamp tx ty tz qx qy qz qw\n".to_owned();
            for (frame, time) in FRAMES.iter().zip([0.004, 0.0371]) {
                let (_, rotation, place) =
                    frame.camera.extrinsic().as_dmat4().inverse().to_scale_rotation_translation();
                let [x, y, z] = place.to_array();
                let [i, j, k, w] = rotation.to_array();
                text += &format!("{} {x} {y} {z} {i} {j} {k} {w}\n", start + time);
            }
            fs::write(take.join("groundtruth.txt"), text).unwrap();
        })
    };
    let (both, depth) = ([(11, 0.0), (12, 0.0333)], [-0.0149, 0.0184]);
    assert_same_frames(lay_out(&both, depth).path(), [1, 2]);
    // 4 s before there is a colour picture without depth: still two frames, with a body each, or one for each colour picture.
    let folder = lay_out(&[(12, -4.0), both[0], both[1]], depth);
    assert_same_frames(folder.path(), [1, 2]);
    let bodies = folder.path().join("train/Take1/bodies.npz");
    let mut motion = read_motion(&bodies).unwrap();
    motion.frames.insert(0, motion.frames[1].clone());
    write_motion(&bodies, &motion).unwrap();
    assert_same_frames(folder.path(), [1, 2]);
    let error = RgbdSubject::open(lay_out(&both, [1.0, 2.0]).path()).unwrap_err().to_string();
    assert!(error.contains("20 ms") && error.contains("rgb"), "{error}");
    // The poses are there, but not at that moment.
    let late = lay_out(&[(11, 0.08), (12, 0.1)], [0.08, 0.1]);
    let error = RgbdSubject::open(late.path()).unwrap().training_frames().read(0).unwrap_err().to_string();
    assert!(error.contains("groundtruth.txt: the pose of") && error.contains("leave the frame out"), "{error}");
}

// Open3D: matrices of 9 and 16 numbers, column after column; its trajectories as JSON (world to camera) and text (camera to world).
#[test]
fn cameras_of_open3d_are_read() {
    let intrinsic = |frame: &RgbdFrame| {
        let PinholeCamera { fx, fy, cx, cy, width, height, .. } = frame.camera;
        serde_json::json!({
            "width": width, "height": height,
            "intrinsic_matrix": [fx, 0.0, 0.0, 0.0, fy, 0.0, cx, cy, 1.0],
        })
    };
    let trajectory = laid_out("", "cameras = \"trajectory.json\"", |take| {
        let camera = |frame: &RgbdFrame| {
            let extrinsic = frame.camera.extrinsic().to_cols_array();
            serde_json::json!({
                "class_name": "PinholeCameraParameters", "extrinsic": extrinsic, "intrinsic": intrinsic(frame),
            })
        };
        let cameras = FRAMES[..2].iter().map(camera).collect::<Vec<_>>();
        let text = serde_json::json!({ "class_name": "PinholeCameraTrajectory", "parameters": cameras }).to_string();
        fs::write(take.join("trajectory.json"), text).unwrap();
    });
    assert_same_frames(trajectory.path(), [11, 12]);
    let log = laid_out("intrinsics = \"camera.json\"", "cameras = \"trajectory.log\"", |take| {
        fs::write(take.join("../../camera.json"), intrinsic(&FRAMES[0]).to_string()).unwrap();
        let block =
            |(place, frame): (usize, &RgbdFrame)| format!("{place} {place} {}\n{}", place + 1, lines(pose(frame)));
        fs::write(take.join("trajectory.log"), FRAMES[..2].iter().enumerate().map(block).collect::<String>()).unwrap();
    });
    assert_same_frames(log.path(), [11, 12]);
}

// ScanNet: a file of 4 x 4 numbers for each pose, and one for the intrinsics; -inf where tracking was lost.
#[test]
fn poses_of_one_file_a_frame_are_read_and_lost_ones_are_named() {
    let folder = laid_out("intrinsics = \"intrinsic_depth.txt\"", "cameras = \"pose\"", |take| {
        let camera = FRAMES[0].camera;
        let rows = [
            [camera.fx, 0.0, camera.cx, 0.0],
            [0.0, camera.fy, camera.cy, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        fs::write(take.join("../../intrinsic_depth.txt"), lines(rows.map(|row| row.map(f64::from)))).unwrap();
        fs::create_dir(take.join("pose")).unwrap();
        for (number, frame) in [11, 12].into_iter().zip(&*FRAMES) {
            fs::write(take.join(format!("pose/{number}.txt")), lines(pose(frame))).unwrap();
        }
    });
    assert_same_frames(folder.path(), [11, 12]);
    let read = || RgbdSubject::open(folder.path()).unwrap().training_frames().read(0).unwrap_err().to_string();
    let path = folder.path().join("train/Take1/pose/11.txt");
    fs::write(&path, lines([[f64::NEG_INFINITY; 4]; 4])).unwrap();
    let error = read();
    assert!(error.contains("11.txt") && error.contains("not finite") && error.contains("f00011"), "{error}");
    fs::remove_file(&path).unwrap();
    let error = read();
    assert!(error.contains("11.txt") && error.contains("not found"), "{error}");
}

#[test]
fn pictures_without_a_partner_are_said_with_their_numbers() {
    let error_after = |change: &dyn Fn(&Path)| {
        let folder = laid_out("", "", |take| change(take));
        RgbdSubject::open(folder.path()).unwrap_err().to_string()
    };
    let shifted = error_after(&|take| {
        rename(take, "depth/depth_000011.png", "depth/175304.png");
        rename(take, "depth/depth_000012.png", "depth/208304.png");
    });
    assert!(shifted.contains("frames 175304 to 208304") && shifted.contains("11 to 12"), "{shifted}");
    let unnumbered = error_after(&|take| rename(take, "colour/color_000011.png", "colour/first.png"));
    assert!(unnumbered.contains("first.png") && unnumbered.contains("number"), "{unnumbered}");
    let few = error_after(&|take| {
        fs::remove_file(take.join("depth/depth_000011.png"))
            .and(fs::remove_file(take.join("colour/color_000011.png")))
            .unwrap()
    });
    assert!(few.contains("2 registered bodies") && few.contains("each of the 1 frames"), "{few}");
}

#[test]
fn recordings_of_sensors_are_named_with_the_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.mkv");
    fs::write(&path, b"\x1a\x45\xdf\xa3").unwrap();
    for given in [&path, folder.path()] {
        assert!(RgbdSubject::is_in(given));
        let error = RgbdSubject::open(given).unwrap_err().to_string();
        assert!(error.contains("take.mkv: a recording of an Azure Kinect") && error.contains("Open3D"), "{error}");
    }
}

#[test]
fn truncated_and_mutated_pictures_are_errors_and_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let depth: Vec<f32> = (0..600).map(|pixel| 1.0 + 1e-3 * (pixel % 37) as f32).collect();
    for format in FORMATS {
        let whole = folder.path().join("whole");
        write_depth(&whole, &depth, [20, 30], format).unwrap();
        let bytes = fs::read(&whole).unwrap();
        let path = folder.path().join("damaged");
        // The last chunk of a PNG says only that it is the last.
        let needed = bytes.len() - if format == DepthFormat::Png { 12 } else { 1 };
        for length in (0..needed).step_by(1 + bytes.len() / 300) {
            fs::write(&path, &bytes[..length]).unwrap();
            let error = read_depth(&path).expect_err("truncated").to_string();
            assert!(error.contains("damaged"), "{error}");
        }
        for _ in 0..400 {
            let mut bytes = bytes.clone();
            for _ in 0..random.random_range(1..4) {
                let place = random.random_range(0..bytes.len());
                bytes[place] ^= random.random_range(1..=255u8);
            }
            fs::write(&path, &bytes).unwrap();
            match read_depth(&path) {
                Ok(picture) => assert_eq!(picture.values.len(), picture.width as usize * picture.height as usize),
                Err(error) => assert!(error.to_string().contains("damaged"), "{error}"),
            }
        }
    }
}

#[test]
fn headers_that_lie_about_the_size_are_refused_before_anything_is_decoded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hostile");
    let refuse = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        let error = read_depth(&path).unwrap_err().to_string();
        assert!(error.len() < 400, "{error}");
    };
    let depth = vec![1.0; 600];
    let made = |format: DepthFormat| {
        write_depth(&path, &depth, [20, 30], format).unwrap();
        fs::read(&path).unwrap()
    };
    // The sides, wherever the format keeps them, become 2^24 and more.
    let png = made(DepthFormat::Png);
    for place in [16, 20] {
        let mut bytes = png.clone();
        bytes[place] = 0x7f;
        refuse(&bytes);
    }
    let tiff = made(DepthFormat::Tiff);
    let exr = made(DepthFormat::Exr);
    for whole in [&tiff, &exr] {
        for (side, wrong) in [(20u32, 0x0fff_ffffu32), (30, 0x0fff_ffff), (19, 0x7fff_fffe), (29, 0x7fff_fffe)] {
            let places = whole.windows(4).enumerate().filter(|(_, window)| *window == side.to_le_bytes());
            for (place, _) in places {
                let mut bytes = whole.clone();
                bytes[place..place + 4].copy_from_slice(&wrong.to_le_bytes());
                fs::write(&path, &bytes).unwrap();
                if let Ok(picture) = read_depth(&path) {
                    assert_eq!((picture.width, picture.height), (20, 30), "another field than the size");
                }
            }
        }
    }
    refuse(b"");
    refuse(b"GIF89a");
}

fn report(folder: &Path) -> RgbdCheckReport {
    let subject = RgbdSubject::open(folder).unwrap();
    check_rgbd(&subject, SUBJECT.model(), SUBJECT.part_labels(), &|| {}).unwrap()
}

#[test]
fn good_frames_pass_the_check() {
    let folder = written(RgbdLayout::XHumans);
    let report = report(folder.path());
    assert!(report.problems.is_empty(), "{report:#?}");
    assert_eq!(report.measured_frames, 3);
    let mut points: Vec<usize> = FRAMES.iter().map(|frame| PointCloud::of(frame).unwrap().points.len()).collect();
    points.sort();
    assert_eq!(report.points, Some(points[1]), "the median");
    assert!((report.depth_to_body.unwrap() - 1.0).abs() < 0.05, "{report:#?}");
    assert!(report.distances["all"].median_mm < 40.0, "{report:#?}");
}

#[test]
fn the_check_names_units_and_camera_conventions() {
    let problem_after = |change: &dyn Fn(&Path)| {
        let folder = written(RgbdLayout::Plain(DepthFormat::Tiff));
        change(folder.path());
        let report = report(folder.path());
        assert!(!report.problems.is_empty(), "{report:#?}");
        report.problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    let unit = |unit: &'static str| {
        move |folder: &Path| replace(&folder.join("rgbd.toml"), "depth_unit = 1.0", &format!("depth_unit = {unit}"))
    };
    let small = problem_after(&unit("\"millimetres\""));
    assert!(small.contains("1.") && small.contains("mm tall") && small.contains("metres"), "{small}");
    let large = problem_after(&unit("1000.0"));
    assert!(large.contains("m tall") && large.contains("millimetres"), "{large}");

    let extrinsics = |change: fn(Mat4) -> Mat4| {
        move |folder: &Path| {
            for sequence in ["train/Take1", "test/Take2"] {
                let path = folder.join(sequence).join("cameras.npz");
                let mut arrays = read_npz(&path).unwrap();
                let values = arrays["extrinsic"].to_f32().unwrap();
                let changed = values.chunks_exact(16).flat_map(|matrix| {
                    let matrix = Mat4::from_cols_slice(matrix).transpose();
                    change(matrix).transpose().to_cols_array()
                });
                let changed: Vec<f32> = changed.collect();
                arrays.insert("extrinsic".into(), Array::from_f32(&[changed.len() / 16, 4, 4], changed));
                write_npz(&path, &arrays).unwrap();
            }
        }
    };
    let inverted = problem_after(&extrinsics(|matrix| matrix.inverse()));
    assert!(inverted.contains("are camera to world:"), "{inverted}");
    let flipped = problem_after(&extrinsics(|matrix| Mat4::from_scale(Vec3::new(1.0, -1.0, -1.0)) * matrix));
    assert!(flipped.contains("OpenGL"), "{flipped}");
    let elsewhere = problem_after(&extrinsics(|matrix| matrix * Mat4::from_translation(Vec3::X * 9.0)));
    assert!(elsewhere.contains("does not appear"), "{elsewhere}");
}

#[test]
fn broken_frames_are_listed_by_name() {
    let folder = written(RgbdLayout::XHumans);
    let depth = folder.path().join("train/Take1/render/depth/depth_000002.tiff");
    let bytes = fs::read(&depth).unwrap();
    fs::write(&depth, &bytes[..bytes.len() / 2]).unwrap();
    let report = report(folder.path());
    assert_eq!(report.unusable.iter().map(|frame| frame.frame.as_str()).collect::<Vec<_>>(), ["train/Take1/f00012"]);
    assert!(report.unusable[0].reason.contains("depth_000002.tiff"), "{report:#?}");
    assert!(report.problems.iter().any(|problem| problem.message.contains("--skip-bad-frames")), "{report:#?}");
}

#[test]
fn projected_points_fall_on_their_pixels() {
    let frame = &FRAMES[0];
    let cloud = PointCloud::of(frame).unwrap();
    for (point, pixel) in cloud.points.iter().zip(&cloud.pixels) {
        let (place, depth) = frame.camera.project(*point);
        assert!(place.abs_diff_eq(pixel_centre(pixel % 120, pixel / 120), 1e-3));
        assert!((depth - frame.depth[*pixel as usize]).abs() < 1e-5);
    }
}

#[test]
fn the_verbs_film_check_and_show() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_xavatar")).args(arguments).output().unwrap();
        let printed = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        (output.status.code(), printed)
    };
    let (data, filmed, body) = (path("mannequin"), path("filmed"), path("mannequin/body"));
    assert_eq!(run(&["demo", "--smoke", "--write-data", &data]).0, Some(0));
    let film = ["render-rgbd", &data, "--layout", "plain", "--depth", "exr", "--steps-per-turn", "4", "--out", &filmed];
    let (code, printed) = run(&film);
    assert!(code == Some(0) && printed.contains("4 frames"), "{printed}");
    assert_eq!(run(&film).0, Some(1), "nothing is overwritten");
    let (code, printed) = run(&["check", &filmed, "--body", &body]);
    assert!(code == Some(0) && printed.contains("ready to train from RGB-D"), "{printed}");
    let cloud = path("cloud.ply");
    let show = ["pointcloud", &filmed, "--frame", "test/Take2/f00001", "--parts", "--body", &body, "--out", &cloud];
    let (code, printed) = run(&show);
    assert!(code == Some(0) && printed.contains("left hand"), "{printed}");
    let points = xavatar::mesh::read_mesh(&cloud).unwrap().mesh;
    assert!(points.faces.is_empty() && points.vertices.len() > 20_000);
    let (code, printed) = run(&["pointcloud", &filmed, "--frame", "train/x/f00001", "--out", &path("other.ply")]);
    assert!(code == Some(2) && printed.contains("train/Take1/f00001 to train/Take1/f00003"), "{printed}");
}
