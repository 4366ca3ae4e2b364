//! `xavatar.register`: from scans alone to data that can be trained on.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use xavatar::body::Gender;
use xavatar::data::Scans;
use xavatar::register::fit::Known;
use xavatar::register::job::{Job, Recordings, Up};
use xavatar::register::landmarks::LandmarkFiles;
use xavatar::report::write_registration_page;

use crate::avatar::BodyArgument;
use crate::errors::Raise;
use crate::motion::one_of;
use crate::watch::{Watch, python_report};

const UP: [(&str, Up); 3] = [("y", Up::Y), ("-y", Up::MinusY), ("z", Up::Z)];

/// Registers a body model to scans: writes poses, shape and clothing as data to train on, and returns the report, that of
/// ``register.json``: every frame with its verdict, the worst first.
///
/// ``scans`` is a folder of one person's meshes, ``body`` an SMPL-X model as in ``train``, ``out`` the folder for the data. ``landmarks`` is
/// a file or a folder of docs/registration.md; without, people who stand are found by the scans' shapes. ``shape``: the subject's betas,
/// to be held fixed. ``minimal``: a sequence in tight or no clothes. ``test``: sequences that are for tests. ``up``: ``"y"``, ``"-y"`` or
/// ``"z"``, of the scans' files. ``callback`` is called with an ``xavatar.Event``.
///
/// The same call again goes on with one that was stopped. Ctrl-C, or an exception that the callback raises, stops after the frame.
#[pyfunction]
#[pyo3(signature = (
    scans, body, out, *, landmarks = None, shape = None, minimal = None, test = Vec::new(), up = "y", gender = None, callback = None
))]
#[allow(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub fn register<'py>(
    py: Python<'py>,
    scans: PathBuf,
    body: BodyArgument,
    out: PathBuf,
    landmarks: Option<PathBuf>,
    shape: Option<Vec<f64>>,
    minimal: Option<String>,
    test: Vec<String>,
    up: &str,
    gender: Option<&str>,
    callback: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let up = one_of("up", up, &UP)?;
    let gender: Option<Gender> = gender.map(str::parse).transpose().or_raise()?;
    let stop = AtomicBool::new(false);
    let mut watch = Watch::new(callback, &stop);
    let registered = py.detach(|| {
        let recordings = Recordings::Scans(Scans::open(&scans, &test)?);
        let gender = gender.or(recordings.gender()).unwrap_or_default();
        let body = body.read(gender)?;
        let landmarks = landmarks.as_deref().map(LandmarkFiles::read).transpose()?;
        let job = Job {
            recordings: &recordings,
            gender,
            body: &body.model,
            labels: &body.labels,
            landmarks: landmarks.as_ref(),
            starts: None,
            up,
            known: Known { shape, bare: false },
            shape_from: minimal,
            frames_per_second: None,
            offsets: false,
            out: out.clone(),
        };
        let mut observe = |phase: &'static str, share: f64, message: &str| {
            watch.tell(phase, share, |fields| fields.set_item("message", message));
        };
        let Some(report) = job.run(&mut observe, &stop)? else { return Ok(None) };
        write_registration_page(&out, &report, &body.model, "xavatar.register".into())?;
        Ok::<_, xavatar::Error>(Some(report))
    });
    watch.finish()?;
    match registered.or_raise()? {
        Some(report) => python_report(py, &report),
        None => Err(PyKeyboardInterrupt::new_err("the registration was stopped")),
    }
}
