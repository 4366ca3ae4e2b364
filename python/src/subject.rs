//! `xavatar.Subject`: a subject's scans with the bodies registered to them.

use std::path::PathBuf;

use pyo3::prelude::*;
use xavatar::data::{Source, read_frame};
use xavatar::synthetic::BuiltInSubject;

use crate::avatar::BodyArgument;
use crate::body::Body;
use crate::errors::{Raise, refused};
use crate::evaluation::SPLITS;
use crate::meshes::python_mesh;
use crate::motion::one_of;
use crate::poses::python_pose;
use crate::python_classes;
use crate::watch::python_report;

/// A subject's scans, in any layout of docs/formats.md, with the bodies registered to them. Frames are read when they are asked for.
#[pyclass(frozen, module = "xavatar")]
pub struct Subject {
    subject: xavatar::data::Subject,
    body: Body,
}

#[pymethods]
impl Subject {
    /// Finds the frames in a folder. ``body`` is as in ``train``.
    #[staticmethod]
    fn open(py: Python<'_>, folder: PathBuf, body: BodyArgument) -> PyResult<Self> {
        py.detach(|| {
            let subject = xavatar::data::Subject::open(&folder)?;
            let body = body.read(subject.gender)?;
            Ok::<_, xavatar::Error>(Self { subject: subject.settled(&body.model)?, body })
        })
        .or_raise()
    }

    /// The names of the frames of ``"train"`` or ``"test"``: ``"train/Take1/f00001"``.
    fn frames(&self, split: &str) -> PyResult<Vec<String>> {
        let split = one_of("split", split, &SPLITS)?;
        Ok(self.subject.frames(split).ids().iter().map(ToString::to_string).collect())
    }

    /// Reads a frame: an ``xavatar.Frame`` with the scan and the registered pose.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let files = self.subject.train.iter().chain(&self.subject.test).find(|files| files.id.to_string() == name);
        let files = files.ok_or_else(|| refused("a frame", name, "one of Subject.frames(...)"))?;
        let read = || {
            let frame = read_frame(files, &self.subject.betas)?;
            let pose = self.body.model.resolve(&frame.parameters)?;
            Ok::<_, xavatar::Error>((frame.scan, pose))
        };
        let (scan, pose) = py.detach(read).or_raise()?;
        python_classes::frame(py)?.call1((name, python_mesh(py, scan)?, python_pose(py, &pose)?))
    }

    /// Reads and inspects every frame, and returns what ``xavatar check`` finds: ``{"problems": [...], "warnings": [...], ...}``.
    fn check<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let check = || xavatar::data::check(&self.subject, &self.body.model, &self.body.labels, &|| {});
        let report = py.detach(check).or_raise()?;
        python_report(py, &report)
    }

    /// ``"neutral"``, ``"female"`` or ``"male"``.
    #[getter]
    fn gender(&self) -> String {
        self.subject.gender.to_string()
    }

    /// The subject's shape coefficients.
    #[getter]
    fn betas(&self) -> Vec<f32> {
        self.subject.betas.clone()
    }

    /// The body model.
    #[getter]
    fn body(&self) -> Body {
        self.body.clone()
    }
}

/// Writes the built-in subject as a data set, to try the other functions on: scans in ``folder``, the body model in ``folder/body``.
#[pyfunction]
#[pyo3(signature = (folder, training_frames = 24, unseen_frames = 5))]
pub fn write_built_in_subject(
    py: Python<'_>,
    folder: PathBuf,
    training_frames: usize,
    unseen_frames: usize,
) -> PyResult<()> {
    py.detach(|| BuiltInSubject::new()?.write_data(&folder, training_frames, unseen_frames)).or_raise()
}
