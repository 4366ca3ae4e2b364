//! The captures of a run: checked and stored once under its `cache/`, then a source of their own.
//!
//! Each capture is one npz, whatever format it came in; a run goes on without what it was started from. V vertices of the body.

mod stored;

use std::path::{Path, PathBuf};

use super::event::{Event, Observer};
use crate::body::{BodyModel, Gender};
use crate::data::{Capture, CaptureKind, FrameId, FrameNotes, Source};
use crate::formats::{
    self, Array, ArrayData, ArrayMap, Choice, Remedy, create_folder, read_npz, remove_partial, write_npz,
};
use crate::train::TrainingSpec;
use crate::{Error, InputError, Result};

const FOLDER: &str = "cache";
/// Which of the body's vertices some capture shows: a byte each, under this name in this file of the cache.
const SEEN: &str = "seen";
const SEEN_FILE: &str = "seen_vertices.npz";

/// A run's captures.
pub(super) struct Cache {
    kind: CaptureKind,
    betas: Vec<f32>,
    gender: Gender,
    files: Vec<PathBuf>,
    ids: Vec<FrameId>,
    /// Which of the body's vertices (V) some capture shows.
    seen: Vec<bool>,
}

impl Cache {
    /// Stores every capture of the specification under `run`, or continues where an earlier command stopped.
    pub fn open(spec: TrainingSpec, run: &Path, observer: &mut dyn Observer) -> Result<Self> {
        let TrainingSpec { config, source, body, .. } = spec;
        let folder = run.join(FOLDER);
        create_folder(&folder)?;
        remove_partial(&folder)?;
        let seen_file = folder.join(SEEN_FILE);
        let is_complete = seen_file.is_file();
        let mut seen = vec![false; body.vertex_count()];
        let (mut files, mut ids, mut notes) = (Vec::new(), Vec::new(), FrameNotes::default());
        let total = source.ids().len();
        for (index, id) in source.ids().iter().enumerate() {
            observer.event(Event::Preparing { done: index, total });
            let path = folder.join(format!("{}.npz", id.to_string().replace('/', "_")));
            if !path.is_file() {
                let read = source.read(index).map_err(Error::from);
                match read.and_then(|capture| check(spec, capture, &mut seen)) {
                    Ok(capture) => {
                        notes.add(id, capture.notes());
                        stored::write(&path, &capture)?;
                    }
                    Err(error) if config.skip_bad_frames => {
                        observer.event(Event::Warning { message: format!("left out: {error}") });
                        continue;
                    }
                    Err(error) => return Err(error),
                }
            } else if !is_complete {
                check(spec, stored::read(&path, id)?, &mut seen)?;
            }
            files.push(path);
            ids.push(id.clone());
        }
        observer.event(Event::Preparing { done: total, total });
        notes.lines().for_each(|message| observer.event(Event::Warning { message }));
        if ids.is_empty() {
            return Err(Error::from(InputError::Missing {
                path: run.into(),
                what: "a usable training frame".into(),
                remedy: Remedy::choosing(Choice::CheckData, "check the data"),
            }));
        }
        if is_complete {
            seen = read_seen(&seen_file, body)?;
        } else {
            write_seen(&seen_file, &seen)?;
        }
        Ok(Self { kind: source.kind(), betas: source.betas().to_vec(), gender: source.gender(), files, ids, seen })
    }

    /// Which of the body's vertices (V) were captured.
    pub fn seen_vertices(&self) -> &[bool] {
        &self.seen
    }
}

impl Source for Cache {
    fn kind(&self) -> CaptureKind {
        self.kind
    }

    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, index: usize) -> formats::Result<Capture> {
        stored::read(&self.files[index], &self.ids[index])
    }

    fn betas(&self) -> &[f32] {
        &self.betas
    }

    fn gender(&self) -> Gender {
        self.gender
    }
}

/// Adds the vertices (V) that a capture shows to `seen`. One that can be prepared can be trained on; its pose is resolved.
fn check(spec: TrainingSpec, capture: Capture, seen: &mut [bool]) -> Result<Capture> {
    let capture = capture.resolved(spec.body)?;
    spec.prepare(capture.clone())?.supervision.add_seen_vertices(seen);
    Ok(capture)
}

fn write_seen(path: &Path, seen: &[bool]) -> Result<()> {
    let data = ArrayData::U8(seen.iter().map(|seen| u8::from(*seen)).collect());
    Ok(write_npz(path, &ArrayMap::from([(SEEN.to_owned(), Array { shape: vec![seen.len()], data })]))?)
}

fn read_seen(path: &Path, body: &BodyModel) -> Result<Vec<bool>> {
    let arrays = read_npz(path)?;
    match arrays.get(SEEN).map(|array| &array.data) {
        Some(ArrayData::U8(bytes)) if bytes.len() == body.vertex_count() => {
            Ok(bytes.iter().map(|byte| *byte != 0).collect())
        }
        _ => Err(Error::from(InputError::Malformed {
            path: path.into(),
            format: "list of seen vertices",
            place: format!("`{SEEN}`"),
            found: arrays.get(SEEN).map_or("absent".into(), Array::description),
            expected: format!("u8 ({}); delete the run's cache folder and resume", body.vertex_count()),
        })),
    }
}
