//! Motions of any format, as poses of an avatar or a body.

use std::collections::BTreeMap;
use std::path::PathBuf;

use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use xavatar::body::{BodyModel, Skeleton};
use xavatar::data::{Coordinates, HandConvention, MotionOptions, PosedClip, RestPose, Translation, UpAxis, Warning};
use xavatar::synthetic::load_poses;

use crate::avatar::Avatar;
use crate::body::Body;
use crate::errors::{Raise, argument, refused};
use crate::poses::python_pose;
use crate::python_classes;

/// Whom a motion is read for.
#[derive(FromPyObject)]
pub enum Target {
    /// An avatar, with its body where that is known.
    Avatar(Py<Avatar>),
    /// A body model.
    Body(Py<Body>),
}

/// Reads a motion for an avatar or a body: an ``xavatar.Motion``.
///
/// ``path`` is a file of any format of docs/motion.md, a folder of one file a frame, or ``"dance"`` for the built-in one. What is not
/// declared is detected; doubts are Python warnings.
///
/// ``up``: ``"Y"``, ``"Z"``, ``"X"`` or one of them with ``"-down"``. ``coordinates``: ``"camera"`` or ``"world"``. ``hands``:
/// ``"flat"``, ``"relative"`` or ``"pca"``. ``source_rate``: frames a second of the file. ``rate``: those wanted. ``frames``: the first
/// and the last, counted from 1. ``smoothing``: seconds. ``translation``: ``"keep"``, ``"origin"`` or ``"none"``. ``bones``: which bone
/// of a BVH is which joint.
#[pyfunction]
#[pyo3(signature = (
    path, target, *, up = None, coordinates = None, hands = None, source_rate = None, rate = None, frames = None, smoothing = None,
    translation = "keep", bones = None
))]
#[allow(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub fn read_motion<'py>(
    py: Python<'py>,
    path: PathBuf,
    target: Target,
    up: Option<&str>,
    coordinates: Option<&str>,
    hands: Option<&str>,
    source_rate: Option<f32>,
    rate: Option<f32>,
    frames: Option<(usize, Option<usize>)>,
    smoothing: Option<f32>,
    translation: &str,
    bones: Option<BTreeMap<String, String>>,
) -> PyResult<Bound<'py, PyAny>> {
    let options = MotionOptions {
        up: up.map(up_axis).transpose()?,
        coordinates: coordinates.map(|name| one_of("coordinates", name, &COORDINATES)).transpose()?,
        hands: hands.map(|name| one_of("hands", name, &HANDS)).transpose()?,
        source_rate,
        rate,
        frames,
        smoothing,
        translation: one_of("translation", translation, &TRANSLATIONS)?,
        bone_map: bones,
        ..MotionOptions::default()
    };
    let clip = py.detach(|| match &target {
        Target::Avatar(avatar) => {
            let subject = &avatar.get().avatar().subject;
            let rest = RestPose::of_canonical(&subject.skeleton, &subject.joints);
            let body = avatar.get().body_model().ok();
            let body = body.as_ref().map(|body| &*body.model);
            load_poses(&path, &MotionOptions { rest, ..options }, &subject.skeleton, body)
        }
        Target::Body(body) => of_body(&path, options, &body.get().model),
    });
    python_motion(py, &clip.or_raise()?)
}

fn of_body(path: &std::path::Path, options: MotionOptions, body: &BodyModel) -> xavatar::Result<PosedClip> {
    let skeleton: &Skeleton = body.skeleton();
    let rest = RestPose::of_canonical(skeleton, &body.canonical_joints(&[])?);
    load_poses(path, &MotionOptions { rest, ..options }, skeleton, Some(body))
}

fn python_motion<'py>(py: Python<'py>, clip: &PosedClip) -> PyResult<Bound<'py, PyAny>> {
    let described = |warning: &Warning| match warning.choice {
        Some(choice) => format!("{warning} ({})", argument(choice)),
        None => warning.to_string(),
    };
    let warnings: Vec<String> = clip.warnings.iter().map(described).collect();
    for warning in &warnings {
        let message = std::ffi::CString::new(warning.replace('\0', " "))?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &message, 1)?;
    }
    let poses = clip.poses.iter().map(|pose| python_pose(py, pose)).collect::<PyResult<Vec<_>>>()?;
    python_classes::motion(py)?.call1((poses, clip.frames_per_second, clip.report.clone(), warnings))
}

const COORDINATES: [(&str, Coordinates); 2] = [("camera", Coordinates::Camera), ("world", Coordinates::World)];
const HANDS: [(&str, HandConvention); 3] =
    [("flat", HandConvention::Flat), ("relative", HandConvention::RelativeToMean), ("pca", HandConvention::Pca)];
const TRANSLATIONS: [(&str, Translation); 3] =
    [("keep", Translation::Keep), ("origin", Translation::FromOrigin), ("none", Translation::None)];

fn up_axis(name: &str) -> PyResult<UpAxis> {
    let known = UpAxis::ALL.map(|axis| axis.to_string()).join(", ");
    UpAxis::named(name).ok_or_else(|| refused("up", name, format!("one of {known}")))
}

/// The value of a name.
pub fn one_of<T: Copy>(argument: &str, name: &str, known: &[(&str, T)]) -> PyResult<T> {
    let found = known.iter().find(|(word, _)| *word == name);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = known.iter().map(|(word, _)| *word).collect();
        refused(argument, name, format!("one of {}", names.join(", ")))
    })
}
