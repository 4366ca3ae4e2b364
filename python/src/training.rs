//! `xavatar.train`: from a subject's folder to an avatar.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use pyo3::prelude::*;
use xavatar::config::{Config, preset_for_rgbd};
use xavatar::data::{CaptureKind, CapturedSubject, CheckedFrames, Defect};
use xavatar::runs::Run;
use xavatar::train::TrainingSpec;

use crate::avatar::{Avatar, BodyArgument};
use crate::errors::Raise;
use crate::motion::one_of;
use crate::watch::Watch;

const KINDS: [(&str, CaptureKind); 2] = [("scans", CaptureKind::Scans), ("rgbd", CaptureKind::Rgbd)];

/// Trains an avatar and returns it, an ``xavatar.Avatar``.
///
/// ``data`` is a subject's folder in any layout of docs/formats.md, ``body`` an ``xavatar.Body``, a model's file or a folder of models,
/// ``out`` the run's folder. The same call again goes on with a run that was stopped; a finished one is loaded.
///
/// ``preset``: networks and constants to start from. ``steps`` or ``minutes``: how long. ``settings``: any of the preset's, as
/// ``{"sampling.points": 2000}``. ``kind``: ``"scans"`` or ``"rgbd"``, if not what the folder has. ``accept``: faults that ``Subject.check``
/// names, to be trained on all the same. ``callback`` is called with an ``xavatar.Event`` for every step, checkpoint and preview.
///
/// Ctrl-C, or an exception that the callback raises, stops after the step; the run is saved first.
#[pyfunction]
#[pyo3(signature = (
    data, body, out, *, preset = "fast", steps = None, minutes = None, seed = None, settings = None, kind = None, accept = Vec::new(),
    skip_bad_frames = false, callback = None
))]
#[allow(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub fn train(
    py: Python<'_>,
    data: PathBuf,
    body: BodyArgument,
    out: PathBuf,
    preset: &str,
    steps: Option<u64>,
    minutes: Option<f64>,
    seed: Option<u64>,
    settings: Option<BTreeMap<String, Bound<'_, PyAny>>>,
    kind: Option<&str>,
    accept: Vec<String>,
    skip_bad_frames: bool,
    callback: Option<Py<PyAny>>,
) -> PyResult<Avatar> {
    let kind = match kind {
        Some(name) => one_of("kind", name, &KINDS)?,
        None => CaptureKind::of(&data),
    };
    let accepted = accept.iter().map(|name| name.parse::<Defect>()).collect::<Result<Vec<_>, _>>().or_raise()?;
    let mut values = Vec::new();
    for (key, value) in settings.into_iter().flatten() {
        values.push((key, setting(&value)?));
    }
    let named = [
        ("schedule.steps", steps.map(|steps| steps.to_string())),
        ("schedule.minutes", minutes.map(|minutes| minutes.to_string())),
        ("seed", seed.map(|seed| seed.to_string())),
        ("skip_bad_frames", skip_bad_frames.then(|| "true".to_owned())),
    ];
    values.extend(named.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))));
    let preset = if kind == CaptureKind::Rgbd { preset_for_rgbd(preset) } else { preset };
    let config = Config::preset_with(preset, &values).or_raise()?;
    let stop = AtomicBool::new(false);
    let mut watch = Watch::new(callback, &stop);
    let trained = py.detach(|| {
        let subject = CapturedSubject::open(&data, kind)?;
        let body = body.read(subject.gender())?;
        let source = subject.training(&body.model)?;
        let checked = CheckedFrames::new(source.as_ref(), &body.model, accepted);
        let spec = TrainingSpec { config: &config, source: &checked, body: &body.model, labels: &body.labels };
        Run::open(&out, spec)?.train(&stop, &mut watch)?;
        Ok::<_, xavatar::Error>(body)
    });
    watch.finish()?;
    let body = trained.or_raise()?;
    py.detach(|| Avatar::read(out, Some(body))).or_raise()
}

/// A setting as a configuration's text has it.
fn setting(value: &Bound<'_, PyAny>) -> PyResult<String> {
    let text = value.str()?.to_string();
    // Python's True is TOML's true.
    Ok(if value.is_instance_of::<pyo3::types::PyBool>() { text.to_lowercase() } else { text })
}
