//! Motions as tools write them (tests/fixtures/motions): what each holds must come out, whatever its layout.

mod bvh_files;
mod file_kinematics;
mod kinematics;
mod layouts;
mod parameters;
mod people;
mod rest_poses;
mod t_pose;

use std::path::{Path, PathBuf};

use xavatar_data::{Clip, MotionOptions};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/motions").join(name)
}

/// The clip of a fixture, nothing declared.
fn clip(name: &str) -> Clip {
    Clip::load(&fixture(name), &MotionOptions::default()).unwrap()
}
