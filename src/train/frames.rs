//! The prepared frames of a training, in memory up to a limit: beyond it the longest unused one makes room, so a subject of any
//! length trains in bounded memory.

use std::collections::VecDeque;
use std::sync::Arc;

use super::TrainingSpec;
use super::supervision::PreparedFrame;
use crate::Result;

/// Prepared frames in memory are kept below this, bytes.
const MEMORY_LIMIT: usize = 1 << 30;

pub(super) struct Frames<'a> {
    spec: TrainingSpec<'a>,
    /// Most recently used last.
    loaded: VecDeque<(usize, Arc<PreparedFrame<'a>>)>,
}

impl<'a> Frames<'a> {
    pub fn new(spec: TrainingSpec<'a>) -> Self {
        Self { spec, loaded: VecDeque::new() }
    }

    pub fn len(&self) -> usize {
        self.spec.source.ids().len()
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
        let frame = Arc::new(self.spec.prepare(self.spec.source.read(index)?)?);
        self.loaded.push_back((index, frame.clone()));
        let mut held: usize = self.loaded.iter().map(|(_, frame)| frame.supervision.size()).sum();
        while held > MEMORY_LIMIT && self.loaded.len() > 1 {
            held -= self.loaded.pop_front().map_or(0, |(_, frame)| frame.supervision.size());
        }
        Ok(frame)
    }
}
