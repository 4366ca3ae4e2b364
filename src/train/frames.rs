//! The prepared frames of a training, in memory up to a limit: beyond it the longest unused one makes room, so a subject of any
//! length trains in bounded memory.

use std::collections::VecDeque;
use std::sync::Arc;

use super::TrainingSpec;
use super::refinement::RefinedPose;
use super::supervision::PreparedFrame;
use crate::Result;
use crate::body::Pose;
use crate::data::Capture;

/// Prepared frames in memory are kept below this, bytes.
const MEMORY_LIMIT: usize = 1 << 30;

pub(super) struct Frames<'a> {
    spec: TrainingSpec<'a>,
    /// Most recently used last.
    loaded: VecDeque<(usize, Arc<PreparedFrame<'a>>)>,
    /// What the frames' poses were refined to; empty for the registered ones.
    poses: Vec<RefinedPose>,
}

impl<'a> Frames<'a> {
    pub fn new(spec: TrainingSpec<'a>) -> Self {
        Self { spec, loaded: VecDeque::new(), poses: Vec::new() }
    }

    pub fn len(&self) -> usize {
        self.spec.source.ids().len()
    }

    /// Takes other poses (F) from here on, or the registered ones again if there are none.
    pub fn take_poses(&mut self, poses: Vec<RefinedPose>) {
        self.poses = poses;
        self.loaded.clear();
    }

    /// A capture, and its registered pose.
    pub fn registered(&self, index: usize) -> Result<(Capture, Pose)> {
        let capture = self.spec.source.read(index)?;
        let pose = self.spec.body.resolve(capture.parameters())?;
        Ok((capture, pose))
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
        let capture = match self.poses.get(index) {
            None => self.spec.source.read(index)?,
            Some(refined) => {
                let (capture, registered) = self.registered(index)?;
                capture.posed(refined.of(&registered))
            }
        };
        let frame = Arc::new(self.spec.prepare(capture)?);
        self.loaded.push_back((index, frame.clone()));
        let mut held: usize = self.loaded.iter().map(|(_, frame)| frame.supervision.size()).sum();
        while held > MEMORY_LIMIT && self.loaded.len() > 1 {
            held -= self.loaded.pop_front().map_or(0, |(_, frame)| frame.supervision.size());
        }
        Ok(frame)
    }
}
