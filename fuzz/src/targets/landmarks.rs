//! Files of landmarks: JSON, TRC and C3D; and of networks that find some.

use std::path::Path;

use xavatar::landmarks::network::{Network, Workspace};
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

/// What is read runs, if it is small: a run of a network takes as long as its shapes say.
pub fn network(bytes: &[u8]) -> bool {
    const SMALL: usize = 1 << 12;
    let Ok(network) = Network::parse(bytes, &[0, 1]) else { return false };
    let count = network.input_shape().into_iter().product();
    if count < SMALL {
        let outputs = network.run(&vec![0.5; count], &mut Workspace::default());
        assert_eq!(outputs.len(), 2);
    }
    true
}

pub fn network_seeds() -> Vec<Vec<u8>> {
    vec![include_bytes!("../../../landmarks/tests/fixtures/small.tflite").to_vec()]
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
