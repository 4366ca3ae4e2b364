//! Each kind of file, read to the same points.

use std::fs;
use std::path::Path;

use glam::DVec3;
use xavatar_data::FrameId;
use xavatar_formats::{Array, ArrayMap, write_npz};

use super::LandmarkFiles;

fn id(sequence: &str, number: u32) -> FrameId {
    FrameId { split: "train".into(), sequence: sequence.into(), number }
}

/// Where the left knee is in frame 2 of 2 of Take1.
fn left_knee(path: &Path) -> Option<DVec3> {
    let files = LandmarkFiles::read(path).unwrap();
    let found = files.of_frame(&id("Take1", 2), 1, 2).unwrap();
    found.iter().find(|(name, _, _)| *name == "left_knee").map(|(_, place, _)| *place)
}

const KNEE: DVec3 = DVec3::new(0.25, 0.5, -0.75);

/// Rows of `count` points, of which one is the knee.
fn rows(count: usize, knee: usize) -> Vec<[f64; 4]> {
    let row = |index: usize| if index == knee { [KNEE.x, KNEE.y, KNEE.z, 0.9] } else { [index as f64, 1.0, 1.0, 0.5] };
    (0..count).map(row).collect()
}

#[test]
fn our_own_are_found_by_frame_and_by_sequence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("landmarks.json");
    let write = |frame: &str| {
        let text = format!(
            "{{\"names\": [\"left_knee\", \"pelvis\"], \"frames\": {{\"{frame}\": [[0.25, 0.5, -0.75, 1], null]}}}}"
        );
        fs::write(&path, text).unwrap();
    };
    for frame in ["f00002", "Take1/f00002", "train/Take1/f00002"] {
        write(frame);
        assert_eq!(left_knee(&path), Some(KNEE), "{frame}");
    }
    write("Take2/f00002");
    assert_eq!(left_knee(&path), None);
    fs::write(&path, "{\"names\": [\"pelvis\"], \"frames\": {\"f00001\": [[1, 2]]}}").unwrap();
    let error = LandmarkFiles::read(&path).unwrap_err().to_string();
    assert!(error.contains("points in pictures"), "{error}");
}

#[test]
fn folders_of_openpose_and_easymocap_have_a_file_a_frame() {
    for hands in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let take = folder.path().join("Take1");
        fs::create_dir(&take).unwrap();
        for frame in 1..=2 {
            let numbers = serde_json::to_string(rows(25, 13).as_flattened()).unwrap();
            let openpose = format!("{{\"people\": [{{\"pose_keypoints_3d\": {numbers}}}]}}");
            let easymocap =
                format!("[{{\"id\": 0, \"keypoints3d\": {}}}]", serde_json::to_string(&rows(67, 13)).unwrap());
            fs::write(take.join(format!("{frame:012}_keypoints.json")), if hands { easymocap } else { openpose })
                .unwrap();
        }
        assert_eq!(left_knee(folder.path()), Some(KNEE));
    }
}

#[test]
fn arrays_are_known_by_their_number_of_points() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("keypoints_3d.npz");
    for (count, knee, width) in [(133, 13, 4), (135, 13, 5), (136, 13, 3), (17, 13, 4)] {
        let frame: Vec<f32> = rows(count, knee)
            .iter()
            .flat_map(|[x, y, z, c]| [*x, *y, *z, *c, *c][..width].to_vec())
            .map(|value| value as f32)
            .collect();
        let array = Array::from_f32(&[2, count, width], frame.repeat(2));
        write_npz(&path, &ArrayMap::from([("points".to_owned(), array)])).unwrap();
        assert_eq!(left_knee(&path), Some(KNEE), "{count}");
    }
    let array = Array::from_f32(&[2, 33, 4], vec![1.0; 2 * 33 * 4]);
    write_npz(&path, &ArrayMap::from([("points".to_owned(), array)])).unwrap();
    assert!(LandmarkFiles::read(&path).unwrap_err().to_string().contains("MediaPipe"));
}

#[test]
fn as_many_frames_as_scans_are_needed_where_only_the_order_says_which() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("markers.trc");
    let text = "PathFileType\t4\t(X/Y/Z)\tmarkers.trc\n\
        DataRate\tNumFrames\tUnits\n30\t2\tmm\n\
        Frame#\tTime\tRKnee\t\t\tLKnee\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\
        1\t0.0\t1\t2\t3\t4\t5\t6\n2\t0.03\t\t\t\t250\t500\t-750\n";
    fs::write(&path, text).unwrap();
    assert_eq!(left_knee(&path), Some(KNEE));
    let files = LandmarkFiles::read(&path).unwrap();
    assert_eq!(files.of_frame(&id("Take1", 2), 1, 2).unwrap().len(), 1);
    assert!(files.of_frame(&id("Take1", 2), 1, 3).unwrap_err().to_string().contains("of the 3 scans of train/Take1"));
}

/// A file of two frames with one marker, in floats.
fn c3d() -> Vec<u8> {
    let mut bytes = vec![0_u8; 1024];
    bytes[..2].copy_from_slice(&[2, 0x50]);
    let words = [(2, 1_u16), (4, 1), (5, 2), (9, 3)];
    words.iter().for_each(|(word, value)| bytes[2 * (word - 1)..2 * word].copy_from_slice(&value.to_le_bytes()));
    bytes[12..16].copy_from_slice(&(-1.0_f32).to_le_bytes());
    let mut parameters = vec![0, 0, 1, 84];
    parameters.extend([5, 0xff, b'P', b'O', b'I', b'N', b'T', 3, 0, 0]);
    for (name, text) in [("LABELS", "L Knee"), ("UNITS", "m")] {
        let content = [&[0xff, 2, text.len() as u8, 1], text.as_bytes(), &[0]].concat();
        parameters.extend([name.len() as u8, 1]);
        parameters.extend(name.as_bytes());
        parameters.extend((content.len() as u16 + 2).to_le_bytes());
        parameters.extend(content);
    }
    bytes[512..512 + parameters.len()].copy_from_slice(&parameters);
    for place in [[1.0, 1.0, 1.0, -1.0], [KNEE.x, KNEE.y, KNEE.z, 0.0]] {
        place.iter().for_each(|value| bytes.extend((*value as f32).to_le_bytes()));
    }
    bytes
}

#[test]
fn markers_of_c3d_are_read_by_their_labels_and_cut_files_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.c3d");
    fs::write(&path, c3d()).unwrap();
    assert_eq!(left_knee(&path), Some(KNEE));
    let files = LandmarkFiles::read(&path).unwrap();
    assert!(files.of_frame(&id("Take1", 1), 0, 2).unwrap().is_empty());
    let whole = c3d();
    for length in 513..whole.len() {
        fs::write(&path, &whole[..length]).unwrap();
        assert!(LandmarkFiles::read(&path).is_err(), "{length}");
    }
}
