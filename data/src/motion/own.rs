//! Our own motion format (docs/motion.md): an npz with one array a parameter, T rows each.

use std::path::Path;

use super::frames::{FrameReader, rotation};
use super::{Motion, UpAxis};
use crate::fields::{Fields, components, rotations};
use xavatar_body::{Fingers, HandPose, PoseAxisAngle, smplx};
use xavatar_formats::{Array, ArrayMap, Container, Error, Result, write_npz};

const FORMAT: &str = "motion npz";
const BODY_COLUMNS: usize = 3 * smplx::BODY_JOINTS;
const AXES: &str = "Y, Z, Y-down, Z-down, X or X-down";
const CONVENTIONS: &str = "flat, relative_to_mean or pca";

/// Every array that the format has.
const ARRAYS: [&str; 13] = [
    "body_pose",
    "global_orient",
    "transl",
    "jaw_pose",
    "left_eye_pose",
    "right_eye_pose",
    "left_hand_pose",
    "right_hand_pose",
    "hand_convention",
    "expression",
    "betas",
    "frames_per_second",
    "up",
];
/// Those that no other tool has beside them.
const MARKS: [&str; 3] = ["hand_convention", "frames_per_second", "up"];
/// Metres in front of a camera at which people are.
const IN_FRONT: f32 = 1.0;

pub(super) fn recognised(container: Container, arrays: &ArrayMap) -> std::result::Result<(), String> {
    if container != Container::Npz {
        return Err("it is no npz".into());
    }
    let Some(body) = arrays.get("body_pose") else { return Err("no `body_pose`".into()) };
    if let Some(other) = arrays.keys().find(|key| !ARRAYS.contains(&key.as_str())) {
        return Err(format!("`{other}` is none of its arrays"));
    }
    if !matches!(body.shape[..], [_, BODY_COLUMNS]) {
        return Err(format!("`body_pose` is {}, not (T, {BODY_COLUMNS})", body.description()));
    }
    is_y_up(arrays)
}

/// Whether the arrays are ours by their marks or, since estimators save the same names, by hands that need none and a body that is not
/// in a camera's coordinates.
fn is_y_up(arrays: &ArrayMap) -> std::result::Result<(), String> {
    let numbers = |key: &str| arrays.get(key).and_then(Array::to_f32);
    let Some(roots) = numbers("global_orient").filter(|_| !is_marked(arrays)) else { return Ok(()) };
    if let Some(hand) = ["left_hand_pose", "right_hand_pose"].into_iter().find(|hand| arrays.contains_key(*hand)) {
        return Err(format!("`{hand}` is without `{}`", MARKS[0]));
    }
    let turned = |root: &[f32; 3]| smplx::Parameters { global_orient: rotation(*root), ..smplx::Parameters::default() };
    let body = Motion { frames: roots.as_chunks().0.iter().map(turned).collect(), ..Motion::default() };
    match body.standing_axis() {
        Some(UpAxis::Y) => Ok(()),
        Some(axis) => Err(format!("its body stands along {axis}, and it has none of `{}`", MARKS.join("`, `"))),
        None => {
            let places = numbers("transl").unwrap_or_default();
            let is_seen = !places.is_empty() && places.as_chunks::<3>().0.iter().all(|[_, _, depth]| *depth > IN_FRONT);
            if is_seen { Err("its body is in front of a camera".into()) } else { Ok(()) }
        }
    }
}

fn is_marked(arrays: &ArrayMap) -> bool {
    MARKS.iter().any(|key| arrays.contains_key(*key))
}

pub(super) fn read(path: &Path, arrays: &ArrayMap) -> Result<Motion> {
    let mut reader = FrameReader::new(Fields { path, format: FORMAT, arrays }, "body_pose", BODY_COLUMNS)?;
    let body = reader.rows::<BODY_COLUMNS>("body_pose")?;
    let betas = reader.betas("betas")?;
    let expression = reader.rows::<{ smplx::EXPRESSIONS }>("expression")?;
    let (global, transl) = (reader.rows("global_orient")?, reader.rows::<3>("transl")?);
    let jaw = reader.rows("jaw_pose")?;
    let (left_eye, right_eye) = (reader.rows("left_eye_pose")?, reader.rows("right_eye_pose")?);
    let (left_hand, right_hand) = hands(&mut reader)?;
    let frame = |((index, left_hand_pose), right_hand_pose): ((usize, HandPose), HandPose)| smplx::Parameters {
        betas: betas[index].clone(),
        expression: expression[index].to_vec(),
        global_orient: rotation(global[index]),
        body_pose: rotations(&body[index]),
        jaw_pose: rotation(jaw[index]),
        left_eye_pose: rotation(left_eye[index]),
        right_eye_pose: rotation(right_eye[index]),
        left_hand_pose,
        right_hand_pose,
        transl: transl[index].into(),
    };
    let frames = left_hand.into_iter().enumerate().zip(right_hand).map(frame).collect();
    let frames_per_second = reader.frames_per_second(&["frames_per_second"])?;
    let up = match reader.text("up")? {
        None => UpAxis::Y,
        Some(name) => UpAxis::named(name).ok_or_else(|| reader.malformed("up", name, AXES))?,
    };
    let source = format!("{} ({FORMAT})", path.display());
    let up_is_certain = is_marked(arrays) || !arrays.contains_key("global_orient");
    Ok(Motion { frames, frames_per_second, up, up_is_certain, source, zeroed: reader.zeroed(), ..Motion::default() })
}

fn hands(reader: &mut FrameReader) -> Result<(Vec<HandPose>, Vec<HandPose>)> {
    const KEYS: [&str; 2] = ["left_hand_pose", "right_hand_pose"];
    let convention = reader.text("hand_convention")?;
    let pose: fn(Fingers) -> HandPose = match convention {
        Some("relative_to_mean") => HandPose::RelativeToMean,
        Some("pca") => return Ok((reader.pca_hands(KEYS[0])?, reader.pca_hands(KEYS[1])?)),
        Some("flat") => HandPose::Flat,
        None if !KEYS.iter().any(|key| reader.has(key)) => HandPose::Flat,
        other => return Err(reader.malformed("hand_convention", other.unwrap_or("missing"), CONVENTIONS)),
    };
    Ok((reader.hands(KEYS[0], pose)?, reader.hands(KEYS[1], pose)?))
}

/// Writes a motion in our own format (docs/motion.md); the file appears whole or not at all.
///
/// # Errors
/// [`Error::Value`] if the motion has no frames, or if its hand poses are not all in one convention and of one
/// length; [`Error::Io`] if the file cannot be written.
pub fn write_motion(path: impl AsRef<Path>, motion: &Motion) -> Result<()> {
    let frames = &motion.frames;
    let Some(first) = frames.first() else {
        return Err(Error::Value { name: "motion".into(), found: "no frames".into(), expected: "at least one".into() });
    };
    let rows = |values: Vec<f32>| Array::from_f32(&[frames.len(), values.len() / frames.len()], values);
    let column = |value: fn(&smplx::Parameters) -> &[f32]| {
        // Coefficients that a frame leaves out are zero.
        let width = frames.iter().map(|frame| value(frame).len()).max().unwrap_or_default();
        let zeros = std::iter::repeat(0.0);
        rows(frames.iter().flat_map(|frame| value(frame).iter().copied().chain(zeros.clone()).take(width)).collect())
    };
    let rotations = |value: fn(&smplx::Parameters) -> &[PoseAxisAngle]| {
        rows(frames.iter().flat_map(|frame| components(value(frame))).collect())
    };
    let hand_convention = convention(&first.left_hand_pose);
    let hands = |value: fn(&smplx::Parameters) -> &HandPose| {
        let hands: Option<Vec<Vec<f32>>> = frames.iter().map(|frame| hand(value(frame), hand_convention)).collect();
        let hands = hands.filter(|hands| hands.iter().all(|hand| hand.len() == hands[0].len()));
        let hands = hands.ok_or_else(|| Error::Value {
            name: "hand poses of a motion".into(),
            found: "several conventions or lengths".into(),
            expected: format!("{hand_convention} in every frame, as in the first"),
        })?;
        Ok::<Array, Error>(rows(hands.concat()))
    };
    let mut arrays = ArrayMap::from([
        ("betas".into(), column(|frame| &frame.betas)),
        ("expression".into(), column(|frame| &frame.expression)),
        ("transl".into(), column(|frame| frame.transl.as_ref())),
        ("global_orient".into(), rotations(|frame| std::slice::from_ref(&frame.global_orient))),
        ("body_pose".into(), rotations(|frame| &frame.body_pose)),
        ("jaw_pose".into(), rotations(|frame| std::slice::from_ref(&frame.jaw_pose))),
        ("left_eye_pose".into(), rotations(|frame| std::slice::from_ref(&frame.left_eye_pose))),
        ("right_eye_pose".into(), rotations(|frame| std::slice::from_ref(&frame.right_eye_pose))),
        ("left_hand_pose".into(), hands(|frame| &frame.left_hand_pose)?),
        ("right_hand_pose".into(), hands(|frame| &frame.right_hand_pose)?),
        ("hand_convention".into(), Array::from_text(hand_convention)),
    ]);
    // Coefficients that no frame has are left out: an array without columns could not be told from a damaged one.
    arrays.retain(|_, array| array.shape.last() != Some(&0));
    if motion.up != UpAxis::Y {
        arrays.insert("up".into(), Array::from_text(motion.up.to_string()));
    }
    if let Some(rate) = motion.frames_per_second {
        arrays.insert("frames_per_second".into(), Array::from_f32(&[], vec![rate]));
    }
    write_npz(path, &arrays)
}

fn convention(hand: &HandPose) -> &'static str {
    match hand {
        HandPose::Flat(_) => "flat",
        HandPose::RelativeToMean(_) => "relative_to_mean",
        HandPose::Pca(_) => "pca",
    }
}

/// The numbers of a hand pose, if it is in the given convention.
fn hand(hand: &HandPose, expected: &str) -> Option<Vec<f32>> {
    (convention(hand) == expected).then(|| match hand {
        HandPose::Flat(joints) | HandPose::RelativeToMean(joints) => components(joints).collect(),
        HandPose::Pca(coefficients) => coefficients.clone(),
    })
}
