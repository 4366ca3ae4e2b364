//! Motions: arrays of any container and by any names, and BVH.

use std::path::Path;

use xavatar::data::{Clip, MotionOptions};

pub fn motion(bytes: &[u8]) -> bool {
    is_clip(bytes)
}

pub fn motion_seeds() -> Vec<Vec<u8>> {
    vec![
        include_bytes!("../../../tests/golden/motions/amass.npz").to_vec(),
        include_bytes!("../../../tests/golden/motions/grab.npz").to_vec(),
        include_bytes!("../../../tests/golden/motions/own.npz").to_vec(),
        include_bytes!("../../../tests/golden/motions/pymaf_x.pkl").to_vec(),
        include_bytes!("../../../tests/fixtures/motions/econ.npy").to_vec(),
        include_bytes!("../../../tests/fixtures/motions/gvhmr.pt").to_vec(),
        include_bytes!("../../../tests/fixtures/motions/motion_x.npy").to_vec(),
        include_bytes!("../../../tests/fixtures/motions/tram.npy").to_vec(),
        include_bytes!("../../../tests/fixtures/motions/vibe.pkl").to_vec(),
        include_bytes!("../../../tests/fixtures/motions/wham.pkl").to_vec(),
    ]
}

pub fn bvh(bytes: &[u8]) -> bool {
    is_clip(bytes)
}

pub fn bvh_seeds() -> Vec<Vec<u8>> {
    vec![
        include_bytes!("../../../tests/golden/motions/walk.bvh").to_vec(),
        include_bytes!("../../../tests/fixtures/motions/names_daz.bvh").to_vec(),
        include_bytes!("../../../tests/fixtures/motions/second_root.bvh").to_vec(),
        include_bytes!("../../../tests/fixtures/motions/t_pose.bvh").to_vec(),
    ]
}

fn is_clip(bytes: &[u8]) -> bool {
    // What is read must be sound: everything that follows relies on it.
    Clip::parse(Path::new("motion"), bytes, &MotionOptions::default()).is_ok_and(|clip| {
        assert!(!clip.frames.is_empty() && clip.frames_per_second.is_finite() && clip.frames_per_second > 0.0);
        assert!(clip.frames.iter().all(|frame| frame.transl.is_finite()));
        true
    })
}
