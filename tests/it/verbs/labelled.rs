//! `render-dataset`: what is in its folder, and that it can be gone on with.

use std::path::Path;

use serde_json::Value;

use super::tool::{assert_outcome, data, text, trained};

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// A folder with one picture.
fn rooms(folder: &Path) -> String {
    let rooms = folder.join("rooms");
    std::fs::create_dir(&rooms).unwrap();
    image::RgbImage::from_fn(64, 48, |x, y| image::Rgb([4 * x as u8, 5 * y as u8, 90]))
        .save(rooms.join("a.png"))
        .unwrap();
    text(&rooms).into()
}

#[test]
fn pictures_of_an_avatar_have_labels_that_agree_and_more_can_be_added() {
    let (run, (_, body)) = (trained(), data());
    let folder = tempfile::tempdir().unwrap();
    let (rooms, out) = (rooms(folder.path()), folder.path().join("pictures"));
    let size = ["--size", "96x80", "--resolution", "48", "--out", text(&out)];
    let fixed = [&["render-dataset", run, "--body", body, "--backgrounds", &rooms][..], &size].concat();
    assert_outcome(&[&fixed[..], &["--count", "2"]].concat(), 0, &["2 labelled pictures", "2 made now"]);
    let first = std::fs::read(out.join("pictures/000001.png")).unwrap();
    assert_outcome(&[&fixed[..], &["--count", "2"]].concat(), 0, &["2 of 2 pictures are there already"]);
    std::fs::remove_file(out.join("labels/000001.json")).unwrap();
    assert_outcome(&[&fixed[..], &["--count", "3"]].concat(), 0, &["3 labelled pictures", "2 made now"]);
    assert_eq!(std::fs::read(out.join("pictures/000001.png")).unwrap(), first, "the same picture again");
    assert_outcome(&[&fixed[..], &["--count", "3", "--seed", "1"]].concat(), 1, &["seed 0", "give a new folder"]);

    let names = json(&out.join("dataset.json"))["joints"].as_array().unwrap().len();
    for number in 0..3 {
        let file = |kind: &str| out.join(kind).join(format!("{number:06}.png"));
        let mask = image::open(file("masks")).unwrap().into_luma8();
        let joints = image::open(file("joints")).unwrap().into_luma8();
        let labels = json(&out.join(format!("labels/{number:06}.json")));
        let area = mask.pixels().filter(|pixel| pixel.0 == [255]).count();
        assert_eq!((labels["area"].as_u64(), mask.dimensions()), (Some(area as u64), (96, 80)));
        assert!(joints.pixels().zip(mask.pixels()).all(|(joint, mask)| (joint.0 == [0]) == (mask.0 == [0])));
        assert!(joints.pixels().all(|joint| usize::from(joint.0[0]) <= names));
        // p = f (R X + t) / z + c, by the numbers of the file alone.
        let camera = &labels["camera"];
        let (focal, centre, moved) =
            (numbers(&camera["focal"]), numbers(&camera["centre"]), numbers(&camera["translation"]));
        let rows: Vec<Vec<f64>> = camera["rotation"].as_array().unwrap().iter().map(numbers).collect();
        for joint in labels["joints"].as_array().unwrap() {
            let place = numbers(&joint["place"]);
            let along = |axis: usize| -> f64 {
                rows[axis].iter().zip(&place).map(|(entry, value)| entry * value).sum::<f64>() + moved[axis]
            };
            let pixel = numbers(&joint["pixel"]);
            for axis in 0..2 {
                let expected = focal[axis] * along(axis) / along(2) + centre[axis];
                assert!((pixel[axis] - expected).abs() < 1e-9, "{joint}: {expected}");
            }
        }
        assert_eq!(labels["joints"].as_array().unwrap().len(), names);
        assert_eq!(labels["pose"]["smplx"]["body_pose"].as_array().unwrap().len(), 63);
    }
    let coco = json(&out.join("coco.json"));
    let annotation = &coco["annotations"][2];
    assert_eq!(coco["images"][2]["file_name"], "pictures/000002.png");
    assert_eq!(numbers(&annotation["keypoints"]).len(), 51);
    assert_eq!(numbers(&annotation["righthand_kpts"]).len(), 63);
    assert_eq!((&annotation["face_valid"], &annotation["lefthand_valid"]), (&Value::from(false), &Value::from(true)));
    assert_eq!(numbers(&annotation["segmentation"]["counts"]).iter().sum::<f64>(), 96.0 * 80.0);
    assert!(image::open(out.join("sheet.png")).unwrap().width() > 300);
}

#[test]
fn scans_are_pictured_where_they_are_registered() {
    let (scans, body) = data();
    let folder = tempfile::tempdir().unwrap();
    let (rooms, out) = (rooms(folder.path()), folder.path().join("pictures"));
    let fixed =
        ["render-dataset", scans, "--backgrounds", &rooms, "--count", "1", "--size", "80x96", "--out", text(&out)];
    assert_outcome(&fixed, 2, &["--body"]);
    assert_outcome(&[&fixed[..], &["--body", body]].concat(), 0, &["1 labelled pictures"]);
    let labels = json(&out.join("labels/000000.json"));
    // Joints lie within the scan: most of them are seen on it.
    let mask = image::open(out.join("masks/000000.png")).unwrap().into_luma8();
    let joints = labels["joints"].as_array().unwrap();
    let on_person = |joint: &&Value| {
        let pixel = numbers(&joint["pixel"]);
        mask.get_pixel_checked(pixel[0] as u32, pixel[1] as u32).is_some_and(|mask| mask.0 == [255])
    };
    assert!(joints.iter().filter(on_person).count() * 10 > joints.len() * 9);
    let empty = tempfile::tempdir().unwrap();
    let new = folder.path().join("new");
    let wrong = ["render-dataset", scans, "--body", body, "--count", "1", "--out", text(&new)];
    assert_outcome(&[&wrong[..], &["--backgrounds", text(empty.path())]].concat(), 1, &["a picture", "without people"]);
}

// The same camera, light and room see nearly the same person: the body lies in its scan, and has its colours.
#[test]
fn registered_bodies_look_like_the_scans_that_they_lie_in() {
    let (scans, body) = data();
    let folder = tempfile::tempdir().unwrap();
    let rooms = rooms(folder.path());
    let pictured = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let fixed =
            ["render-dataset", scans, "--body", body, "--backgrounds", &rooms, "--count", "1", "--size", "80x96"];
        assert_outcome(&[&fixed[..], &["--out", text(&out)], more].concat(), 0, &["1 labelled pictures"]);
        let read = |place: &str| image::open(out.join(place).join("000000.png")).unwrap().into_rgb8();
        (read("pictures"), read("masks"))
    };
    let ((scan, mask), (registered, _)) = (pictured("scans", &[]), pictured("bodies", &["--registered"]));
    let of_person = |picture: &image::RgbImage| -> Vec<f64> {
        let pixels = picture.pixels().zip(mask.pixels()).filter(|(_, mask)| mask.0 == [255; 3]);
        pixels.flat_map(|(pixel, _)| pixel.0.map(f64::from)).collect()
    };
    let (scan, registered) = (of_person(&scan), of_person(&registered));
    let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / scan.len() as f64;
    let apart = mean(&mut scan.iter().zip(&registered).map(|(one, other)| (one - other).abs()));
    let level = mean(&mut scan.iter().copied());
    let spread = mean(&mut scan.iter().map(|value| (value - level).abs()));
    assert!(apart < 0.4 * spread, "{apart} of {spread}");
}
