//! Poses of a camera as text, camera to world: a line `time x y z qx qy qz qw` each (TUM), a matrix of 3 x 4 or 4 x 4 a line (KITTI,
//! Replica), or a matrix in four lines (7-Scenes, ScanNet: one a file; Open3D's `.log`: one after the other, with a line of three
//! numbers before each). `#` begins a comment.
//!
//! A pose that is not finite is one that the camera's tracking lost.

use std::path::Path;

use glam::{DMat4, DQuat, DVec3};
use xavatar_formats::{Result, excerpt, read_bytes};

use super::malformed;

/// The camera's place at one moment.
pub(super) struct Pose {
    /// Seconds, if the file says.
    pub(super) time: Option<f64>,
    pub(super) camera_to_world: DMat4,
}

/// Reads a file of poses; at least one.
///
/// # Errors
/// [`Error::Io`]; [`Error::Malformed`] naming the line.
pub(super) fn read(path: &Path) -> Result<Vec<Pose>> {
    let bytes = read_bytes(path)?;
    let mut poses = Vec::new();
    let mut rows: Vec<f64> = Vec::new();
    for (index, line) in String::from_utf8_lossy(&bytes).lines().enumerate() {
        let place = || format!("line {}", index + 1);
        let line = line.split('#').next().unwrap_or_default();
        let numbers = line.split(|c: char| c.is_ascii_whitespace() || c == ',').filter(|word| !word.is_empty());
        let numbers = numbers
            .map(|word| word.parse().map_err(|_| malformed(path, place(), excerpt(word), "a number")))
            .collect::<Result<Vec<f64>>>()?;
        match numbers[..] {
            [] => {}
            [time, x, y, z, qx, qy, qz, qw] => {
                let rotation = DQuat::from_xyzw(qx, qy, qz, qw).normalize();
                let camera_to_world = DMat4::from_rotation_translation(rotation, DVec3::new(x, y, z));
                poses.push(Pose { time: Some(time), camera_to_world });
            }
            // Which pictures a pose of a `.log` is of.
            [_, _, _] if rows.is_empty() => {}
            [_, _, _, _] => {
                rows.extend(&numbers);
                if rows.len() == 16 {
                    poses.push(Pose { time: None, camera_to_world: of_rows(&rows) });
                    rows.clear();
                }
            }
            _ if matches!(numbers.len(), 12 | 16) && rows.is_empty() => {
                poses.push(Pose { time: None, camera_to_world: of_rows(&numbers) });
            }
            _ => {
                let expected = "8 (time, position, quaternion), 12 or 16, or 4 of a matrix' row";
                return Err(malformed(path, place(), format!("{} numbers", numbers.len()), expected));
            }
        }
    }
    if rows.len() == 12 && poses.is_empty() {
        poses.push(Pose { time: None, camera_to_world: of_rows(&rows) });
        rows.clear();
    }
    if poses.is_empty() || !rows.is_empty() {
        return Err(malformed(path, "the end of the file", "before the end of a pose", "whole poses, at least one"));
    }
    Ok(poses)
}

/// The matrix of these entries, row by row; its last row need not be there.
fn of_rows(entries: &[f64]) -> DMat4 {
    let last = [0.0, 0.0, 0.0, 1.0];
    let whole: [f64; 16] = std::array::from_fn(|place| entries.get(place).copied().unwrap_or(last[place % 4]));
    DMat4::from_cols_array(&whole).transpose()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};

    use super::*;

    fn read(text: &str) -> Result<Vec<Pose>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("poses.txt");
        std::fs::write(&path, text).unwrap();
        super::read(&path)
    }

    // A quarter turn about y, then a move by (1, 2, 3): the camera's x is the world's -z.
    #[test]
    fn every_layout_says_the_same() {
        let rows = "0 0 1 1\n0 1 0 2\n-1 0 0 3\n";
        let line = rows.replace('\n', " ");
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for text in [
            format!("# time x y z qx qy qz qw\n12.5 1 2 3 0 {half} 0 {half}\n"),
            format!("{line}\n"),
            format!("{line} 0 0 0 1"),
            format!("{rows}0 0 0 1\n"),
            rows.to_owned(),
            format!("0 0 1\n{rows}0 0 0 1\n"),
        ] {
            let poses = read(&text).unwrap();
            assert_eq!(poses.len(), 1, "{text}");
            let found = poses[0].camera_to_world.transform_point3(DVec3::X);
            assert!(found.abs_diff_eq(DVec3::new(1.0, 2.0, 2.0), 1e-9), "{text}: {found}");
            assert_eq!(poses[0].time, text.starts_with('#').then_some(12.5));
        }
        assert_eq!(read(&format!("0 0 1\n{rows}0 0 0 1\n1 1 2\n{rows}0 0 0 1\n")).unwrap().len(), 2);
        assert!(!read(&rows.replace("-1", "-inf")).unwrap()[0].camera_to_world.is_finite(), "tracking was lost");
    }

    #[test]
    fn mutations_never_panic() {
        let text = b"# t x y z\n12.5 1 2 3 0 0.7 0 0.7\n0 0 1\n0 0 1 1\n0 1 0 2\n-1 0 0 3\n0 0 0 1\n";
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        for _ in 0..2000 {
            let mut bytes = text.to_vec();
            let place = random.random_range(0..bytes.len());
            bytes[place] = random.random();
            let _either = read(&String::from_utf8_lossy(&bytes));
        }
    }

    #[test]
    fn what_is_no_pose_is_named_with_its_line() {
        for (text, words) in [
            ("1 2 3 4 5\n", "line 1"),
            ("# nothing\n", "at least one"),
            ("1 0 0 0\n0 1 0 0\n", "whole poses"),
            ("1 0 0 0\n1 2 3\n", "line 2"),
            ("timestamp x y\n", "\"timestamp\""),
        ] {
            let error = read(text).err().unwrap().to_string();
            assert!(error.contains(words) && error.contains("poses.txt"), "{error}");
        }
    }
}
