//! The correspondence search alone: points at the built-in subject's posed surface, nine starts each.
//!
//! A root here is a start that converged, before roots of one point are merged; the skinning field is the paper's, trained on the
//! canonical body for some steps, so that a start takes about as many evaluations as in a real run.

use std::sync::atomic::AtomicBool;

use super::Seconds;
use crate::avatar::Avatar;
use crate::config::{Config, SearchedField, Starts};
use crate::fields::{PosedWarp, bone_rows, start_groups};
use crate::runs::{Event, Run};
use crate::synthetic::{BuiltInSubject, Split};
use crate::train::TrainingSpec;
use crate::{InputError, Result};

/// The avatar of a posed body, and points to search for.
pub struct PosedSubject {
    avatar: Avatar,
    bones: Vec<[f32; 12]>,
    points: Vec<[f32; 3]>,
}

/// How fast a search is.
#[derive(Clone, Debug)]
pub struct SearchSpeed {
    /// Starts that converged.
    pub roots: usize,
    /// All starts.
    pub starts: usize,
    /// Evaluations of the skinning field, those that polish roots included.
    pub evaluations: usize,
    /// Time of one search.
    pub seconds: Seconds,
}

impl PosedSubject {
    /// The grid of the baked search.
    pub const BAKED: SearchedField = SearchedField::Baked { nodes: [96, 96, 48], refresh_steps: 1 };

    /// Trains the skinning field for `steps` on the canonical body, and takes `points` points.
    ///
    /// # Errors
    /// If there is no folder for temporary files.
    pub fn new(steps: u64, points: usize) -> Result<Self> {
        let steps = steps.to_string();
        let settings = [
            // The search never asks the geometry field: a small one shortens the training.
            ("fields.geometry.width", "64"),
            ("schedule.pretraining_steps", &steps),
            ("schedule.steps", "1"),
            ("schedule.preview_steps", "0"),
            ("sampling.points", "600"),
            ("optimiser.batch_frames", "1"),
        ];
        let settings = settings.map(|(key, value)| (key.to_owned(), value.to_owned()));
        let config = Config::preset_with("paper-scan", &settings)?;
        let subject = BuiltInSubject::new()?;
        let folder = tempfile::tempdir().map_err(InputError::io(std::env::temp_dir()))?;
        let (frame, model, labels) = (subject.film(Split::Train, 1)?, subject.model(), subject.part_labels());
        let run = Run::open(folder.path(), TrainingSpec { config: &config, source: &frame, body: model, labels })?;
        run.train(&AtomicBool::new(false), &mut |_: Event<'_>| {})?;
        let avatar = run.avatar()?;
        let pose = model.resolve(&frame.frames()[0].parameters)?;
        let vertices = model.pose(&pose)?.vertices.into_iter().cycle().take(points);
        Ok(Self {
            avatar,
            bones: bone_rows(&model.canonical_to_posed(&pose)?),
            points: vertices.map(|vertex| (vertex - pose.translation).to_array()).collect(),
        })
    }

    /// Searches on a field, once unmeasured and `repeats` times.
    ///
    /// # Errors
    /// If the field cannot be baked on such a grid.
    pub fn search(&self, searched: SearchedField, repeats: usize) -> Result<SearchSpeed> {
        let Avatar { fields, config, subject, .. } = &self.avatar;
        let baked = fields.skinning.bake(searched, subject.bounds)?;
        let warp = match &baked {
            None => fields.skinning.warp(None, &self.bones, None)?,
            Some(baked) => PosedWarp::sampled(baked, &self.bones)?,
        };
        let groups = start_groups(Starts::Body, &subject.skeleton)?;
        let labels = vec![0; self.points.len()];
        let search = || warp.candidates(&groups, &config.search, &self.points, &labels);
        let found = search()?.statistics;
        let seconds = Seconds::of(repeats, || drop(search()));
        Ok(SearchSpeed {
            roots: found.converged,
            starts: found.starts,
            evaluations: found.evaluations + found.polish_evaluations,
            seconds,
        })
    }
}
