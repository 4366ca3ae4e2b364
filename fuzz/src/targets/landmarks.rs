//! Files of landmarks: JSON, TRC and C3D.

use std::path::Path;

use xavatar::register::landmarks::parse_landmarks;

/// What is read has as many points in every frame as names.
pub fn landmarks(bytes: &[u8]) -> bool {
    match parse_landmarks(Path::new("landmarks"), bytes) {
        Ok(Some(track)) => {
            assert!(track.frames.iter().all(|frame| frame.points.len() == track.names.len()));
            true
        }
        Ok(None) | Err(_) => false,
    }
}

pub fn landmarks_seeds() -> Vec<Vec<u8>> {
    let own = r#"{"names": ["pelvis", "neck"], "frames": {"f00001": [[0, 1, 0, 1], null]}}"#;
    let openpose = format!(r#"{{"people": [{{"pose_keypoints_3d": [{}]}}]}}"#, ["0.5"; 100].join(","));
    let trc = "PathFileType\t4\t(X/Y/Z)\ta.trc\nNumFrames\tUnits\n1\tmm\nFrame#\tTime\tLKnee\n\t\tX1\tY1\tZ1\n1\t0\t4\t5\t6\n";
    vec![own.into(), openpose.into_bytes(), trc.into(), c3d()]
}

/// One frame of one point.
fn c3d() -> Vec<u8> {
    let mut bytes = vec![0_u8; 1024];
    bytes[..2].copy_from_slice(&[2, 0x50]);
    for (word, value) in [(2, 1_u16), (4, 1), (5, 1), (9, 3)] {
        bytes[2 * (word - 1)..2 * word].copy_from_slice(&value.to_le_bytes());
    }
    bytes[12..16].copy_from_slice(&(-1.0_f32).to_le_bytes());
    bytes[512..516].copy_from_slice(&[0, 0, 1, 84]);
    for value in [1.0_f32, 2.0, 3.0, 0.0] {
        bytes.extend(value.to_le_bytes());
    }
    bytes
}
