//! The labels of all pictures in COCO's layout, with COCO-WholeBody's points: an image and an annotation a picture.
//!
//! Masks are uncompressed runs, as `pycocotools` reads them. A point is x, y from the upper left corner and v: 0 not labelled or outside, 1
//! hidden, 2 seen.

use serde_json::{Value, json};

use super::labels::{JointLabel, Labels, Visibility};
use crate::register::landmarks::COCO_17;

/// Pairs of the body's points that lines are drawn between, counted from 1.
const BONES: [[usize; 2]; 19] = [
    [16, 14],
    [14, 12],
    [17, 15],
    [15, 13],
    [12, 13],
    [6, 12],
    [7, 13],
    [6, 7],
    [6, 8],
    [7, 9],
    [8, 10],
    [9, 11],
    [2, 3],
    [1, 2],
    [1, 3],
    [2, 4],
    [3, 5],
    [4, 6],
    [5, 7],
];
/// Groups of points: COCO-WholeBody's name, whether they are there, and which they are.
const GROUPS: [(&str, &str, std::ops::Range<usize>); 4] = [
    ("foot_kpts", "foot_valid", 17..23),
    ("face_kpts", "face_valid", 23..91),
    ("lefthand_kpts", "lefthand_valid", 91..112),
    ("righthand_kpts", "righthand_valid", 112..133),
];

/// The annotations of pictures whose files are named by `file`.
pub(super) fn annotations(labels: &[Labels], file: impl Fn(usize) -> String) -> Value {
    let image = |labels: &Labels| {
        let [width, height] = labels.camera.size;
        json!({"id": labels.number, "file_name": file(labels.number), "width": width, "height": height})
    };
    json!({
        "info": {"description": "xavatar render-dataset"},
        "images": labels.iter().map(image).collect::<Vec<Value>>(),
        "annotations": labels.iter().map(annotation).collect::<Vec<Value>>(),
        "categories": [{"id": 1, "name": "person", "supercategory": "person", "keypoints": COCO_17, "skeleton": BONES}],
    })
}

fn annotation(labels: &Labels) -> Value {
    let [width, height] = labels.camera.size;
    let body = &labels.keypoints[..COCO_17.len()];
    let mut annotation = json!({
        "id": labels.number,
        "image_id": labels.number,
        "category_id": 1,
        "iscrowd": 0,
        "bbox": labels.bounds,
        "area": labels.area,
        "segmentation": {"size": [height, width], "counts": labels.runs},
        "keypoints": points(body),
        "num_keypoints": body.iter().flatten().filter(|point| point.visibility != Visibility::Outside).count(),
    });
    for (name, is_there, range) in GROUPS {
        let group = &labels.keypoints[range];
        annotation[name] = json!(points(group));
        annotation[is_there] = json!(group.iter().flatten().any(|point| point.visibility != Visibility::Outside));
    }
    annotation
}

fn points(points: &[Option<JointLabel>]) -> Vec<f64> {
    let point = |point: &Option<JointLabel>| match point {
        Some(JointLabel { pixel, visibility, .. }) if *visibility != Visibility::Outside => {
            [pixel[0], pixel[1], f64::from(u8::from(*visibility))]
        }
        _ => [0.0; 3],
    };
    points.iter().flat_map(point).collect()
}
