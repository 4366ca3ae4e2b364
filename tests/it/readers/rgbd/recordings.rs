//! Folders as recorders leave them: pictures and poses by number or time, cameras of other programs.

use std::fs;
use std::path::Path;

use tempfile::TempDir;
use xavatar::data::{DepthFormat, RgbdFrame, RgbdLayout, RgbdSubject, Source, read_motion, write_motion};
use xavatar::mesh::camera::PinholeCamera;

use super::{FRAMES, SUBJECT, assert_alike, written};

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
