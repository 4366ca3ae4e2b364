//! The training frames of a run: checked and stored once under the run's `cache/`, then streamed.
//!
//! Each frame is one npz, whatever format it came in. Prepared frames stay in memory up to a limit; beyond it the longest unused
//! one makes room, so a subject of any length trains in bounded memory.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::captured::{CapturedFrame, TrainingFrames};
use super::prepared::{PreparedFrame, Supervision};
use super::{Event, Observer, stored};
use crate::body::{BodyModel, PartLabels};
use crate::config::Config;
use crate::data::{FrameId, FrameNotes};
use crate::formats::{Array, ArrayData, ArrayMap, read_npz, write_npz};
use crate::formats::{Choice, Remedy};
use crate::{Error, InputError, Result};

pub(super) const FOLDER: &str = "cache";
/// Which of the body's vertices some RGB-D frame shows: a byte each, under this name in this file of the cache.
const SEEN: &str = "seen";
const SEEN_FILE: &str = "seen_vertices.npz";
/// Prepared frames in memory are kept below this.
const MEMORY_LIMIT: usize = 1 << 30;

pub(super) struct FrameStore<'a> {
    body: &'a BodyModel,
    labels: &'a PartLabels,
    config: &'a Config,
    files: Vec<PathBuf>,
    ids: Vec<FrameId>,
    /// Which of the body's vertices (V) some RGB-D frame shows; all of them for scans.
    seen: Vec<bool>,
    /// Most recently used last.
    loaded: VecDeque<(usize, Arc<PreparedFrame<'a>>)>,
}

impl<'a> FrameStore<'a> {
    /// Stores every frame of `frames` under `run`, or continues where an earlier command stopped.
    pub fn open(
        config: &'a Config,
        frames: TrainingFrames,
        body: &'a BodyModel,
        labels: &'a PartLabels,
        run: &Path,
        observer: &mut dyn Observer,
    ) -> Result<Self> {
        let folder = run.join(FOLDER);
        std::fs::create_dir_all(&folder).map_err(InputError::io(&folder))?;
        let seen_file = folder.join(SEEN_FILE);
        let mut store = Self {
            body,
            labels,
            config,
            files: Vec::new(),
            ids: Vec::new(),
            seen: Vec::new(),
            loaded: VecDeque::new(),
        };
        let is_complete = seen_file.is_file();
        let mut seen = vec![config.rgbd.is_none(); body.vertex_count()];
        let mut notes = FrameNotes::default();
        let total = frames.ids().len();
        for (index, id) in frames.ids().iter().enumerate() {
            observer.event(Event::Preparing { done: index, total });
            let path = folder.join(format!("{}.npz", id.to_string().replace('/', "_")));
            if !path.is_file() {
                match frames.read(index).and_then(|frame| store.check(frame, &mut seen)) {
                    Ok(frame) => {
                        notes.add(id, frame.notes());
                        stored::write(&path, &frame)?;
                    }
                    Err(error) if config.skip_bad_frames => {
                        observer.event(Event::Warning { message: format!("left out: {error}") });
                        continue;
                    }
                    Err(error) => return Err(error),
                }
            } else if config.rgbd.is_some() && !is_complete {
                store.check(stored::read(&path, id)?, &mut seen)?;
            }
            store.files.push(path);
            store.ids.push(id.clone());
        }
        observer.event(Event::Preparing { done: total, total });
        notes.lines().for_each(|message| observer.event(Event::Warning { message }));
        if store.ids.is_empty() {
            return Err(Error::from(InputError::Missing {
                path: run.into(),
                what: "a usable training frame".into(),
                remedy: Remedy::choosing(Choice::CheckData, "check the data"),
            }));
        }
        store.seen = match config.rgbd {
            Some(_) if is_complete => read_seen(&seen_file, body)?,
            Some(_) => {
                write_seen(&seen_file, &seen)?;
                seen
            }
            None => seen,
        };
        Ok(store)
    }

    /// A frame that can be prepared can be trained on; its pose is resolved. Adds the vertices (V) that it shows to `seen`.
    fn check(&self, frame: CapturedFrame, seen: &mut [bool]) -> Result<CapturedFrame> {
        let id = frame.id().to_string();
        let frame = frame.resolved(self.body).map_err(|error| error.in_frame(id))?;
        let prepared = PreparedFrame::new(frame.clone(), self.body, self.labels, self.config)?;
        if let Supervision::Camera(view) = &prepared.supervision {
            view.add_seen_vertices(seen);
        }
        Ok(frame)
    }

    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Which of the body's vertices (V) were captured.
    pub fn seen_vertices(&self) -> &[bool] {
        &self.seen
    }

    /// A frame as it was captured.
    pub fn read(&self, index: usize) -> Result<CapturedFrame> {
        stored::read(&self.files[index], &self.ids[index])
    }

    /// A prepared frame, from memory if it is there.
    pub fn prepared(&mut self, index: usize) -> Result<Arc<PreparedFrame<'a>>> {
        if let Some(place) = self.loaded.iter().position(|(loaded, _)| *loaded == index)
            && let Some(entry) = self.loaded.remove(place)
        {
            let frame = entry.1.clone();
            self.loaded.push_back(entry);
            return Ok(frame);
        }
        let frame = PreparedFrame::new(self.read(index)?, self.body, self.labels, self.config)?;
        let frame = Arc::new(frame);
        self.loaded.push_back((index, frame.clone()));
        let mut held: usize = self.loaded.iter().map(|(_, frame)| frame.size()).sum();
        while held > MEMORY_LIMIT && self.loaded.len() > 1 {
            held -= self.loaded.pop_front().map_or(0, |(_, frame)| frame.size());
        }
        Ok(frame)
    }
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
