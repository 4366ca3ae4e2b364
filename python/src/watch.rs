//! Whoever watches long work from Python: its callback is called as things happen, and Ctrl-C, or an exception in the callback, stops the
//! work at its next good place.

use std::sync::atomic::{AtomicBool, Ordering};

use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use xavatar::runs::{Event, Observer};
use xavatar::train::Stage;

use crate::python_classes;

/// A callback, and what has to be raised when the work has stopped.
pub struct Watch<'a> {
    callback: Option<Py<PyAny>>,
    stop: &'a AtomicBool,
    raised: Option<PyErr>,
}

impl<'a> Watch<'a> {
    /// `stop` is set when the work is to stop.
    pub fn new(callback: Option<Py<PyAny>>, stop: &'a AtomicBool) -> Self {
        Self { callback, stop, raised: None }
    }

    /// Says what happened: the kind of event, the share of the work that is done, and what else its class has.
    pub fn tell(&mut self, kind: &str, progress: f64, fill: impl FnOnce(&Bound<'_, PyDict>) -> PyResult<()>) {
        if self.raised.is_some() {
            return;
        }
        let told = Python::attach(|py| {
            py.check_signals()?;
            let Some(callback) = &self.callback else { return Ok(()) };
            let fields = PyDict::new(py);
            fields.set_item("kind", kind)?;
            fields.set_item("progress", progress)?;
            fill(&fields)?;
            callback.call1(py, (python_classes::event(py)?.call((), Some(&fields))?,))?;
            Ok(())
        });
        if let Err(error) = told {
            self.raised = Some(error);
            self.stop.store(true, Ordering::Relaxed);
        }
    }

    /// What stopped the work, if something did.
    pub fn finish(self) -> PyResult<()> {
        self.raised.map_or(Ok(()), Err)
    }
}

impl Observer for Watch<'_> {
    fn event(&mut self, event: Event<'_>) {
        let share = |done: usize, total: usize| done as f64 / total.max(1) as f64;
        match event {
            Event::Preparing { done, total } => self.tell("preparing", share(done, total), |_| Ok(())),
            Event::Step { progress, record } => self.tell("step", progress, |fields| {
                fields.set_item("stage", if record.stage == Stage::Frames { "frames" } else { "pretraining" })?;
                fields.set_item("step", record.step)?;
                fields.set_item("losses", losses(fields.py(), record)?)
            }),
            Event::Checkpoint { path } => self.tell("checkpoint", 0.0, |fields| fields.set_item("path", path)),
            Event::Refining { done, total } => self.tell("refining", share(done, total), |_| Ok(())),
            Event::Refined { refined } => {
                self.tell("refined", 0.0, |fields| fields.set_item("message", refined.to_string()));
            }
            Event::Preview { path } => self.tell("preview", 0.0, |fields| fields.set_item("path", path)),
            Event::Measured { done, total, frame } => {
                self.tell("measured", share(done, total), |fields| fields.set_item("message", frame));
            }
            Event::Warning { message } => self.warn(&message),
            Event::Avatar { .. } => {}
        }
    }
}

impl Watch<'_> {
    /// As a warning of Python's.
    fn warn(&mut self, message: &str) {
        let warned = Python::attach(|py| {
            let message = std::ffi::CString::new(message.replace('\0', " "))?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &message, 1)
        });
        // A warning that is to be an error stops the work.
        if let Err(error) = warned {
            self.raised.get_or_insert(error);
            self.stop.store(true, Ordering::Relaxed);
        }
    }
}

fn losses<'py>(py: Python<'py>, record: &xavatar::train::StepRecord) -> PyResult<Bound<'py, PyDict>> {
    let losses = PyDict::new(py);
    for (name, value) in &record.losses {
        losses.set_item(name, value)?;
    }
    Ok(losses)
}

/// A report of the library as dictionaries, lists and numbers.
pub fn python_report<'py>(py: Python<'py>, report: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(report)
        .map_err(|error| pyo3::exceptions::PyRuntimeError::new_err(format!("the report: {error}")))?;
    py.import("json")?.call_method1("loads", (text,))
}
