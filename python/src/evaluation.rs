//! `xavatar.evaluate`: an avatar against the scans of unseen frames.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use pyo3::prelude::*;
use xavatar::avatar::Animator;
use xavatar::data::{Source, Split, Subject};
use xavatar::evaluate::{Evaluation, SmplxD};

use crate::avatar::{Avatar, BodyArgument};
use crate::errors::Raise;
use crate::motion::one_of;
use crate::watch::{Watch, python_report};

/// The splits by their names.
pub const SPLITS: [(&str, Split); 2] = [("train", Split::Train), ("test", Split::Test)];

/// Measures an avatar against scans, and returns the metrics as the command line's JSON has them: ``{"frames", "mean", "per_frame", ...}``,
/// distances in millimetres.
///
/// ``avatar`` is an ``xavatar.Avatar``, its file or its run's folder; ``data`` and ``body`` are as in ``train``. ``split``: ``"test"`` or
/// ``"train"``. ``resolution``: cells along the longest side of the box around the body. ``baseline``: whether the body with the mean
/// offset of each vertex is measured too. ``regions``: whether each region of the body is; ``pictures``: whether
/// pictures are compared. ``callback`` is called with an ``xavatar.Event`` for every frame. Ctrl-C stops after the frame.
#[pyfunction]
#[pyo3(signature = (avatar, data, body, *, split = "test", resolution = 512, baseline = false, regions = false, pictures = false, callback = None))]
#[allow(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub fn evaluate<'py>(
    py: Python<'py>,
    avatar: AvatarArgument,
    data: PathBuf,
    body: BodyArgument,
    split: &str,
    resolution: usize,
    baseline: bool,
    regions: bool,
    pictures: bool,
    callback: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let split = one_of("split", split, &SPLITS)?;
    let stop = AtomicBool::new(false);
    let mut watch = Watch::new(callback, &stop);
    let measured = py.detach(|| {
        let loaded;
        let avatar = match &avatar {
            AvatarArgument::Loaded(avatar) => avatar.get().avatar(),
            AvatarArgument::Path(path) => {
                loaded = xavatar::avatar::Avatar::load(path)?;
                &loaded
            }
        };
        let subject = Subject::open(&data)?;
        let body = body.read(subject.gender)?;
        let subject = subject.settled(&body.model)?;
        let frames = subject.frames(split);
        let baseline = baseline.then(|| SmplxD::fit(&body.model, subject.training_frames().iter())).transpose()?;
        let evaluation = Evaluation {
            body: &body.model,
            labels: &body.labels,
            baseline: baseline.as_ref(),
            regions,
            pictures,
            samples: Evaluation::SAMPLES,
            seed: 0,
        };
        let animator = Animator::new(avatar, &body.model, &body.labels)?;
        let (mut done, total) = (0, frames.ids().len());
        evaluation.run(
            frames.iter().take_while(|_| !stop.load(Ordering::Relaxed)),
            |_, pose| Ok(animator.extract(pose, resolution)?.mesh),
            |frame| {
                done += 1;
                let share = f64::from(done) / total as f64;
                watch.tell("measured", share, |fields| fields.set_item("message", &frame.frame));
            },
        )
    });
    watch.finish()?;
    python_report(py, &measured.or_raise()?)
}

/// An avatar that a caller gives: the object, or where it is.
#[derive(FromPyObject)]
pub enum AvatarArgument {
    /// One that is loaded.
    Loaded(Py<Avatar>),
    /// A file or a run's folder.
    Path(PathBuf),
}
