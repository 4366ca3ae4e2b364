//! What damaged or contradictory data is told.

use std::fs;
use std::path::Path;

use image::RgbImage;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use xavatar::data::{DepthFormat, NO_MEASUREMENT, RgbdLayout, RgbdSubject, read_depth, write_depth};
use xavatar::formats::{Array, read_npz, write_npz};

use super::{FORMATS, FRAMES, replace, written};

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
