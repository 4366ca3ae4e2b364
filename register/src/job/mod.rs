//! A subject from scans to data that can be trained on, in a folder that a run which was stopped goes on with.
//!
//! Key frames first, together, for shape and clothing; then every other frame alone; then doubtful ones again, from their neighbours;
//! then the data: X-Humans' layout with `clothing.npz` and `register.json`. What fails is left out and named.

mod coordinates;
mod detection;
mod free;
mod motion;
mod record;
mod recorded;
mod report;
mod scored;
mod shared;
mod smooth;
mod starts;
mod write;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;
use xavatar_body::{BodyModel, BodyParameters, Gender, PartLabels, smplx};
use xavatar_data::{FrameId, LimbCheck, ScanFrame, Split};
use xavatar_formats::{Error, FolderLock, Result};
use xavatar_mesh::Note;

pub use coordinates::{FileCoordinates, Up};
pub use detection::find_landmarks;
pub use free::OFFSETS_FOLDER;
pub use recorded::Recordings;
pub use report::{FrameReport, REPORT_FILE, RegistrationReport, Verdict};
pub use scored::score_registration;
pub use shared::CLOTHING_FILE;
pub use starts::StartPoses;

use self::record::{Circumstances, Record};
use self::recorded::{Recording, scan};
use crate::fit::{
    Fitter, Frame, FrameQuality, Known, Sequence, Shaped, Start, doubtful, from_landmarks, onto_landmarks,
};
use crate::landmarks::{LandmarkFiles, Seen, believed};
use crate::linear::FramePose;
use crate::surface_model::Density;

/// Frames that shape and clothing are found from, spread over all for training.
const KEY_FRAMES: usize = 40;
/// The folder of records in the data's.
const RECORDS: &str = "register";
/// Good frames before and after a doubtful one that it is started from.
const NEIGHBOURS: usize = 2;

/// What a subject is registered with.
pub struct Job<'a> {
    /// The frames.
    pub recordings: &'a Recordings,
    /// Which body model fits the person.
    pub gender: Gender,
    /// The body.
    pub body: &'a BodyModel,
    /// The part of each of its vertices.
    pub labels: &'a PartLabels,
    /// Landmarks; without, poses are guessed from the scans' shapes.
    pub landmarks: Option<&'a LandmarkFiles>,
    /// Poses that other programs found, to start from where they lie better than what is found here.
    pub starts: Option<&'a StartPoses>,
    /// The axis of the files that points up.
    pub up: Up,
    /// What is known of the subject.
    pub known: Known,
    /// The sequence that shape is found from, if not all.
    pub shape_from: Option<String>,
    /// How fast frames of a sequence follow each other, if that is known and they do.
    pub frames_per_second: Option<f64>,
    /// Whether each body is also written as moved vertex by vertex onto its scan.
    pub offsets: bool,
    /// The folder for the data.
    pub out: PathBuf,
}

/// What a job is doing: the phase, how much of it is done, and on what.
pub type Observer<'a> = dyn FnMut(&'static str, f64, &str) + 'a;

/// A frame as it was read.
struct Read {
    frame: Frame,
    /// Landmarks that are not believed.
    dropped: Vec<String>,
    /// What was noted of its scan.
    notes: Vec<Note>,
}

/// A frame that is fitted, and where its fit begins.
struct Prepared {
    read: Read,
    start: Option<Start>,
}

impl Job<'_> {
    /// Registers the subject, and leaves data to train on; none if it was stopped, and the same call goes on.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for a body of another family than the data's layout takes; [`Error::Unfit`] if no frame can be started;
    /// [`Error::Frame`] for a scan that cannot be read; [`Error::Io`].
    pub fn run(&self, observe: &mut Observer<'_>, stop: &AtomicBool) -> Result<Option<RegistrationReport>> {
        let _lock = FolderLock::take(&self.out)?;
        let working = Working::new(self)?;
        let Some((records, shaped)) = working.fitted_frames(observe, stop)? else { return Ok(None) };
        working.write_data(&records, &shaped, observe, stop)
    }

    /// Registers the subject, and leaves the motion of every sequence in place of data; their files are returned with the report.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn capture(
        &self,
        observe: &mut Observer<'_>,
        stop: &AtomicBool,
    ) -> Result<Option<(RegistrationReport, Vec<PathBuf>)>> {
        let _lock = FolderLock::take(&self.out)?;
        let working = Working::new(self)?;
        let Some((records, shaped)) = working.fitted_frames(observe, stop)? else { return Ok(None) };
        let reports = working.reports(&records);
        let motions = working.write_motions(&records, &reports, &shaped)?;
        Ok(Some((working.write_report(reports, &shaped)?, motions)))
    }
}

/// A job under way.
struct Working<'a> {
    job: &'a Job<'a>,
    fitter: Fitter<'a>,
    coarse: Fitter<'a>,
    limbs: LimbCheck<'a>,
    coordinates: FileCoordinates,
    files: Vec<Recording<'a>>,
    /// Of each frame: its place in its sequence, and how many that has.
    places: Vec<(usize, usize)>,
    /// Of each frame: the hands that no landmark is of, if landmarks are of hands.
    unseen: Vec<Vec<String>>,
    kept: PathBuf,
}

impl<'a> Working<'a> {
    fn new(job: &'a Job<'a>) -> Result<Self> {
        job.body.skeleton().require(smplx::skeleton(), "the body that scans are registered with")?;
        let files = job.recordings.frames();
        let of_sequence =
            |one: &FrameId, other: &FrameId| (&one.split, &one.sequence) == (&other.split, &other.sequence);
        if let Some(name) = job.shape_from.as_ref().filter(|name| files.iter().all(|one| one.id().sequence != **name)) {
            let mut known: Vec<&str> = files.iter().map(|one| one.id().sequence.as_str()).collect();
            known.dedup();
            return Err(Error::Missing {
                path: job.recordings.folder().into(),
                what: format!("the sequence {name}"),
                remedy: format!("name one of {}", known.join(", ")).into(),
            });
        }
        let place = |index: usize| {
            let others = files.iter().enumerate().filter(|(_, other)| of_sequence(files[index].id(), other.id()));
            let all: Vec<usize> = others.map(|(other, _)| other).collect();
            (all.iter().filter(|other| **other < index).count(), all.len())
        };
        let mut working = Self {
            fitter: Fitter::new(job.body, job.labels, Density::FINE),
            coarse: Fitter::new(job.body, job.labels, Density::COARSE),
            limbs: LimbCheck::new(job.body),
            coordinates: job.recordings.coordinates(job.up)?,
            places: (0..files.len()).map(place).collect(),
            unseen: Vec::new(),
            kept: job.out.join(RECORDS),
            files,
            job,
        };
        working.unseen = working.hands_without_landmarks()?;
        Ok(working)
    }

    /// The records of all frames, and what they share; none if the job was stopped.
    fn fitted_frames(
        &self,
        observe: &mut Observer<'_>,
        stop: &AtomicBool,
    ) -> Result<Option<(Vec<Option<Record>>, Shaped)>> {
        self.write_landmarks()?;
        let Some(shaped) = self.shaped(observe, stop)? else { return Ok(None) };
        let Some(records) = self.records(&shaped, observe, stop)? else { return Ok(None) };
        let Some(records) = self.tried_again(records, &shaped, observe, stop)? else { return Ok(None) };
        let Some(records) = self.smoothed(records, &shaped, observe, stop)? else { return Ok(None) };
        Ok(Some((records, shaped)))
    }

    /// A frame's scan and landmarks, and where its fit begins.
    fn prepared(&self, index: usize) -> Result<Prepared> {
        let read = self.read(index)?;
        let frame = &read.frame;
        let Fitter { linkage, sites, prior, .. } = &self.fitter;
        let given = self.job.starts.and_then(|starts| starts.of(self.files[index].id(), self.places[index].0));
        let start = match (self.job.landmarks, given) {
            (Some(_), None) => from_landmarks(linkage, sites, prior, &frame.landmarks).map(Start::FromLandmarks),
            (Some(_), Some(given)) => {
                let own = from_landmarks(linkage, sites, prior, &frame.landmarks);
                let given = onto_landmarks(linkage, sites, given, &frame.landmarks);
                let best = self.coarse.best_of(own.into_iter().chain(given).collect(), frame)?;
                best.map(|best| Start::FromLandmarks(best.pose))
            }
            (None, given) => {
                let guess = self.coarse.guess(frame, given)?.filter(|guess| guess.is_good());
                guess.map(|guess| Start::FromElsewhere(guess.pose))
            }
        };
        Ok(Prepared { read, start })
    }

    /// A frame's scan and the landmarks that are believed.
    fn read(&self, index: usize) -> Result<Read> {
        let (target, notes) = self.files[index].target(self.coordinates)?;
        let (landmarks, dropped) = self.landmarks(index)?;
        let skeleton = self.job.body.skeleton();
        let unseen = self.unseen[index].iter().filter_map(|hand| skeleton.part_named(hand)).collect();
        let frame = Frame { scan: Arc::new(target), landmarks, motion: None, unseen };
        Ok(Read { frame, dropped, notes })
    }

    fn landmarks(&self, index: usize) -> Result<(Vec<Seen>, Vec<String>)> {
        let Some(files) = self.job.landmarks else { return Ok((Vec::new(), Vec::new())) };
        let (place, count) = self.places[index];
        let found = files.of_frame(self.files[index].id(), place, count)?;
        let seen = found.into_iter().filter_map(|(name, place, confidence)| {
            Some(Seen { site: self.fitter.sites.named(&name)?, place: self.coordinates.place(place), confidence })
        });
        Ok(believed(&self.fitter.linkage, &self.fitter.sites, &seen.collect::<Vec<_>>()))
    }

    /// Shape and clothing, from key frames together, whose records are kept.
    fn shaped(&self, observe: &mut Observer<'_>, stop: &AtomicBool) -> Result<Option<Shaped>> {
        if let Some(shaped) = shared::read(&self.job.out, &self.fitter, self.job.known.bare)? {
            return Ok(Some(shaped));
        }
        let mut known = self.job.known.clone();
        if let Some(sequence) = &self.job.shape_from {
            let of_sequence = |index: &usize| self.files[*index].id().sequence == *sequence;
            let Some(begun) = self.begun(&self.spread(of_sequence), observe, stop)? else { return Ok(None) };
            let bare = Known { shape: None, bare: true };
            known.shape = Some(self.fitted_together(&begun, &bare, observe)?.0.shape);
        }
        let in_training = |index: &usize| self.files[*index].id().split == Split::Train.name();
        let mut chosen = self.spread(in_training);
        if chosen.is_empty() {
            chosen = self.spread(|_| true);
        }
        let Some(begun) = self.begun(&chosen, observe, stop)? else { return Ok(None) };
        let (shaped, poses) = self.fitted_together(&begun, &known, observe)?;
        let quality = |((index, prepared), pose): (&(usize, Prepared), &FramePose)| {
            self.quality(*index, pose, &prepared.read.frame, &shaped)
        };
        let qualities: Vec<FrameQuality> = begun.par_iter().zip(&poses).map(quality).collect::<Result<_>>()?;
        for (((index, prepared), pose), quality) in begun.iter().zip(&poses).zip(qualities) {
            self.record(*index, &prepared.read, pose, quality)?;
        }
        // Last: its presence says that the key frames are done.
        shared::write(&self.job.out, &self.fitter, &shaped)?;
        shared::read(&self.job.out, &self.fitter, self.job.known.bare)
    }

    /// Some of the frames that are wanted, evenly spread, as many as are fitted together.
    fn spread(&self, wanted: impl Fn(&usize) -> bool) -> Vec<usize> {
        let all: Vec<usize> = (0..self.files.len()).filter(wanted).collect();
        let count = all.len().min(KEY_FRAMES);
        (0..count).map(|place| all[place * all.len() / count]).collect()
    }

    /// Those of some frames whose fit can begin; none if the job was stopped.
    fn begun(
        &self,
        chosen: &[usize],
        observe: &mut Observer<'_>,
        stop: &AtomicBool,
    ) -> Result<Option<Vec<(usize, Prepared)>>> {
        let mut begun = Vec::new();
        for (done, index) in chosen.iter().enumerate() {
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            observe("starts", done as f64 / chosen.len() as f64, &self.files[*index].id().to_string());
            let prepared = self.prepared(*index)?;
            if prepared.start.is_some() {
                begun.push((*index, prepared));
            }
        }
        if begun.is_empty() {
            let message = match self.job.landmarks {
                Some(_) => format!("none of {} frames has landmarks of the torso: hips, shoulders, neck", chosen.len()),
                None => format!("in none of {} scans was a standing person found by shape alone", chosen.len()),
            };
            return Err(Error::Unfit { message, remedy: "give landmarks, or a scan of the person standing".into() });
        }
        Ok(Some(begun))
    }

    fn fitted_together(
        &self,
        begun: &[(usize, Prepared)],
        known: &Known,
        observe: &mut Observer<'_>,
    ) -> Result<(Shaped, Vec<FramePose>)> {
        let starts = begun.iter().filter_map(|(_, prepared)| prepared.start.clone()).map(Start::into_pose).collect();
        let frames: Vec<Frame> = begun.iter().map(|(_, prepared)| prepared.read.frame.clone()).collect();
        self.fitter.fit(starts, &frames, known, |stage, share| observe("shape", share, stage))
    }

    fn record(
        &self,
        index: usize,
        Read { frame, dropped, notes }: &Read,
        pose: &FramePose,
        quality: FrameQuality,
    ) -> Result<Record> {
        let circumstances = Circumstances {
            middle: frame.scan.middle(),
            landmarks: frame.landmarks.len(),
            dropped: dropped.clone(),
            notes: notes.clone(),
        };
        Record::new(pose, quality, circumstances).kept(&self.kept, self.files[index].id())
    }

    /// The records of all frames that could be started; those that are there already are taken as they are.
    fn records(
        &self,
        shaped: &Shaped,
        observe: &mut Observer<'_>,
        stop: &AtomicBool,
    ) -> Result<Option<Vec<Option<Record>>>> {
        let batch = 2 * rayon::current_num_threads();
        let mut records = Vec::new();
        for first in (0..self.files.len()).step_by(batch) {
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let name = self.files[first].id().to_string();
            observe("frames", first as f64 / self.files.len() as f64, &name);
            let last = (first + batch).min(self.files.len());
            let fitted: Vec<Option<Record>> =
                (first..last).into_par_iter().map(|index| self.fitted(index, shaped)).collect::<Result<_>>()?;
            records.extend(fitted);
        }
        Ok(Some(records))
    }

    fn fitted(&self, index: usize, shaped: &Shaped) -> Result<Option<Record>> {
        if let Some(record) = Record::read(&self.kept, self.files[index].id())? {
            return Ok(Some(record));
        }
        let prepared = self.prepared(index)?;
        let Some(start) = prepared.start.clone() else { return Ok(None) };
        let pose = self.fitter.fit_pose(start, &prepared.read.frame, shaped)?;
        let quality = self.quality(index, &pose, &prepared.read.frame, shaped)?;
        self.record(index, &prepared.read, &pose, quality).map(Some)
    }

    /// How well a pose lies, by the fit's own measures and by what `train` holds against data.
    fn quality(&self, index: usize, pose: &FramePose, frame: &Frame, shaped: &Shaped) -> Result<FrameQuality> {
        let sequence = Sequence { poses: vec![pose.clone()], shape: shaped.shape.clone() };
        let frames = std::slice::from_ref(frame);
        let quality = self.fitter.qualities(&sequence, frames, &shaped.clothing.thickness)?.remove(0);
        let Recording::Scan(files) = self.files[index] else { return Ok(quality) };
        let scan = ScanFrame {
            id: files.id.clone(),
            scan: scan(files, self.coordinates)?.mesh,
            parameters: BodyParameters::from(self.relative_to_mean(&pose.pose(&shaped.shape))),
            unseen_parts: Vec::new(),
            notes: Vec::new(),
        };
        Ok(FrameQuality { slipped: self.limbs.slipped(&scan)?, ..quality })
    }

    /// Fits doubtful frames, and those without a start, again from good ones near them.
    fn tried_again(
        &self,
        mut records: Vec<Option<Record>>,
        shaped: &Shaped,
        observe: &mut Observer<'_>,
        stop: &AtomicBool,
    ) -> Result<Option<Vec<Option<Record>>>> {
        // From the neighbours of good frames outwards: what was found once helps the next.
        loop {
            let bad = self.are_bad(&records);
            let is_near_good = |index: usize| self.neighbours(index, &bad).next().is_some();
            let untried =
                |index: &usize| bad[*index] && records[*index].as_ref().is_none_or(|record| !record.tried_again);
            let Some(index) = (0..records.len()).filter(untried).find(|index| is_near_good(*index)) else { break };
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let id = self.files[index].id();
            let bad_count = bad.iter().filter(|bad| **bad).count();
            observe("again", 1.0 - bad_count as f64 / bad.len() as f64, &id.to_string());
            let read = self.read(index)?;
            let frame = &read.frame;
            let mut best = records[index].clone();
            for other in self.neighbours(index, &bad).collect::<Vec<_>>() {
                let Some(neighbour) = &records[other] else { continue };
                let mut start = neighbour.pose(self.fitter.linkage.extents());
                start.translation += frame.scan.middle() - glam::DVec3::from(neighbour.middle);
                let pose = self.fitter.fit_pose(Start::FromElsewhere(start), frame, shaped)?;
                let quality = self.quality(index, &pose, frame, shaped)?;
                if best.as_ref().is_none_or(|best| quality.misfit() < best.quality.misfit()) {
                    best = Some(match best {
                        Some(best) => best.replaced(&pose, quality),
                        None => self.record(index, &read, &pose, quality)?,
                    });
                }
            }
            let Some(best) = best else { break };
            records[index] = Some(best.marked_as_tried_again().kept(&self.kept, id)?);
        }
        Ok(Some(records))
    }

    /// Which frames are not registered, or doubtfully.
    fn are_bad(&self, records: &[Option<Record>]) -> Vec<bool> {
        let known: Vec<FrameQuality> = records.iter().flatten().map(|record| record.quality.clone()).collect();
        let mut verdicts = doubtful(&known).into_iter();
        records.iter().map(|record| record.is_none() || verdicts.next().unwrap_or(true)).collect()
    }

    /// The good frames nearest to one, before and after it in its sequence.
    fn neighbours(&self, index: usize, bad: &[bool]) -> impl Iterator<Item = usize> {
        let of_sequence = |other: &usize| {
            let (own, other) = (self.files[index].id(), self.files[*other].id());
            own.split == other.split && own.sequence == other.sequence
        };
        let good = |other: &usize| of_sequence(other) && !bad[*other];
        let before: Vec<usize> = (0..index).rev().filter(good).take(NEIGHBOURS).collect();
        let after: Vec<usize> = (index + 1..self.files.len()).filter(good).take(NEIGHBOURS).collect();
        before.into_iter().chain(after)
    }
}
