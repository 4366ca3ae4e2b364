//! What depth sensors record and benchmarks distribute, which is no subject yet: known by name, with the way to one.

use std::path::Path;

use xavatar_formats::{Error, Result};

use super::layout::Layout;
use crate::xhumans::file_names;

/// Files of sensors: their extension, what they are, and what makes pictures of them.
const RECORDINGS: [(&str, &str, &str); 5] = [
    (
        "mkv",
        "a recording of an Azure Kinect",
        "azure_kinect_mkv_reader.py of Open3D makes aligned pictures and intrinsic.json of it",
    ),
    ("bag", "a recording of a RealSense camera, or of ROS", "rs-convert of librealsense makes pictures of it"),
    ("oni", "a recording of OpenNI", "export its colour and depth pictures, aligned"),
    ("svo", "a recording of a ZED camera", "export its colour and depth pictures with the ZED SDK"),
    ("r3d", "a recording of Record3D", "export its pictures; they are in the zip archive that it is"),
];

/// Folders of benchmarks: what is in them, what they are, and what a layout says of them.
const BENCHMARKS: [(&[&str], &str, &str); 4] = [
    (
        &["rgb", "depth", "groundtruth.txt"],
        "the TUM benchmark",
        "depth_unit = 0.0002\ncolour = \"rgb\"\ncameras = \"groundtruth.txt\"",
    ),
    (
        &["color", "depth", "pose"],
        "ScanNet",
        "depth_unit = \"millimetres\"\nintrinsics = \"intrinsic/intrinsic_depth.txt\"\ncolour = \"color\"\ncameras = \"pose\"",
    ),
    (
        &["color", "depth", "intrinsic.json"],
        "Open3D's recorders",
        "depth_unit = \"millimetres\"\nintrinsics = \"intrinsic.json\"\ncolour = \"color\"",
    ),
    (
        &["frame-000000.color.png", "frame-000000.depth.png", "frame-000000.pose.txt"],
        "7-Scenes",
        "depth_unit = \"millimetres\"\ncolour = \".\"\ndepth = \".\"\ncameras = \".\"",
    ),
];

/// Refuses a recording, or pictures without a layout, by its name.
///
/// # Errors
/// [`Error::Mismatch`] that says how to go on. What cannot be looked at is not known.
pub(super) fn refuse(path: &Path) -> Result<()> {
    let recording = |name: &str| {
        let (_, extension) = name.rsplit_once('.')?;
        RECORDINGS.iter().find(|(known, ..)| extension.eq_ignore_ascii_case(known))
    };
    let refusal = |path: &Path, found: String, expected: &str, remedy: String| {
        Err(Error::Mismatch { path: path.into(), found, expected: expected.into(), remedy: remedy.into() })
    };
    let pictures = "a folder of pictures with bodies registered to them";
    if path.is_file() {
        return match path.file_name().and_then(|name| recording(name.to_str()?)) {
            Some((_, what, way)) => refusal(path, (*what).into(), pictures, (*way).into()),
            None => Ok(()),
        };
    }
    let is_subject = [Layout::FILE, "train", "test"].iter().any(|name| path.join(name).exists());
    let names = if is_subject { Vec::new() } else { file_names(path).unwrap_or_default() };
    let benchmark =
        BENCHMARKS.iter().find(|(parts, ..)| parts.iter().all(|part| names.iter().any(|name| name == part)));
    if let Some((_, what, settings)) = benchmark {
        let remedy = format!(
            "write a {} (docs/rgbd.md) beside them, of pixel_origin and\n{settings}\nand of gender and betas, if bodies are registered to the pictures; else `xavatar register --rgbd` does that",
            Layout::FILE
        );
        return refusal(path, format!("pictures in the layout of {what}"), pictures, remedy);
    }
    match names.iter().find_map(|name| recording(name).map(|known| (name, known))) {
        Some((name, (_, what, way))) => refusal(&path.join(name), (*what).into(), pictures, (*way).into()),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_and_benchmarks_are_named_with_the_way_out() {
        for (files, words) in [
            (&["take.MKV"][..], ["Azure Kinect", "azure_kinect_mkv_reader.py"]),
            (&["rgb", "depth", "groundtruth.txt", "accelerometer.txt"], ["TUM", "groundtruth.txt\""]),
            (&["color", "depth", "pose", "intrinsic"], ["ScanNet", "cameras = \"pose\""]),
            (&["color", "depth", "intrinsic.json", "take.mkv"], ["Open3D", "intrinsic.json\""]),
            (&["frame-000000.color.png", "frame-000000.depth.png", "frame-000000.pose.txt"], ["7-Scenes", "rgbd.toml"]),
        ] {
            let folder = tempfile::tempdir().unwrap();
            files.iter().for_each(|name| std::fs::write(folder.path().join(name), "").unwrap());
            let error = refuse(folder.path()).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)), "{error}");
            std::fs::write(folder.path().join(Layout::FILE), "").unwrap();
            refuse(folder.path()).unwrap();
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("take.bag");
        std::fs::write(&path, "").unwrap();
        assert!(refuse(&path).unwrap_err().to_string().contains("RealSense"));
        refuse(&folder.path().join("absent")).unwrap();
    }
}
