//! The data that a job leaves: frames that lie on their scans, in X-Humans' layout, or on their pictures, in a plain folder, and the report
//! of all.

use std::io::Write;
use std::sync::atomic::AtomicBool;

use xavatar_body::{BodyParameters, HandPose, Pose, PoseAxisAngle, Role, smplx};
use xavatar_data::{
    DepthFormat, FrameFiles, FrameFolder, RgbdFiles, RgbdFrame, RgbdLayout, remove_rgbd_frame, write_common,
    write_rgbd_subject,
};
use xavatar_formats::{Error, Result, write_atomically};
use xavatar_mesh::{Loss, ReadMesh};

use super::record::Record;
use super::recorded::{Recording, picture, scan};
use super::report::{FrameReport, REPORT_FILE, RegistrationReport, Verdict, summary, why};
use super::{Observer, Recordings, Working};
use crate::fit::{FrameQuality, Shaped, fingers, turned_hands};
use crate::landmarks::{LANDMARKS_FILE, write_own};
use crate::linear::{FramePose, so3};

/// What depths are written as: what was read, to the bit.
const DEPTH_FORMAT: DepthFormat = DepthFormat::Tiff;

impl Working<'_> {
    /// Writes all frames that are registered, and the report; none if the job was stopped.
    pub(super) fn write_data(
        &self,
        records: &[Option<Record>],
        shaped: &Shaped,
        observe: &mut Observer<'_>,
        stop: &AtomicBool,
    ) -> Result<Option<RegistrationReport>> {
        let reports = self.reports(records);
        let betas: Vec<f32> = shaped.shape.iter().map(|value| *value as f32).collect();
        let (mut scans, mut pictures) = (Vec::new(), Vec::new());
        for (index, (record, report)) in records.iter().zip(&reports).enumerate() {
            let record = record.as_ref().filter(|_| report.verdict == Verdict::Registered);
            let pose = record.map(|record| self.pose_of(index, record, &report.missing_hands).pose(&shaped.shape));
            match self.files[index] {
                Recording::Scan(files) => scans.push((files, pose)),
                Recording::Rgbd(files) => pictures.push((files, pose)),
            }
        }
        if !scans.is_empty() {
            self.write_scans(&scans, &betas, observe)?;
        }
        if !pictures.is_empty() {
            self.write_pictures(&pictures, &betas, observe)?;
        }
        if self.job.offsets && !self.write_free_forms(records, &reports, shaped, observe, stop)? {
            return Ok(None);
        }
        self.write_report(reports, shaped).map(Some)
    }

    /// What became of every frame, in order.
    pub(super) fn reports(&self, records: &[Option<Record>]) -> Vec<FrameReport> {
        let bad = self.are_bad(records);
        let known: Vec<&FrameQuality> = records.iter().flatten().map(|record| &record.quality).collect();
        let mut turned = turned_hands(&known).into_iter();
        let report = |(index, record): (usize, &Option<Record>)| {
            let turned = record.as_ref().and_then(|_| turned.next()).unwrap_or_default();
            self.report_of(index, record.as_ref(), bad[index], &self.unseen[index], turned)
        };
        records.iter().enumerate().map(report).collect()
    }

    /// Writes the report of all frames.
    pub(super) fn write_report(&self, frames: Vec<FrameReport>, shaped: &Shaped) -> Result<RegistrationReport> {
        let report = summary(self.coordinates, shaped, &self.fitter, frames);
        let path = self.job.out.join(REPORT_FILE);
        let text = serde_json::to_string_pretty(&report).map_err(|error| Error::io(&path)(error.into()))?;
        write_atomically(&path, |writer| writeln!(writer, "{text}"))?;
        Ok(report)
    }

    /// The pose of a frame, with the fingers relaxed of hands that the scan lacks and that were fitted as if it had them.
    pub(super) fn pose_of(&self, index: usize, record: &Record, missing_hands: &[String]) -> FramePose {
        let mut pose = record.pose(self.fitter.linkage.extents());
        let skeleton = self.job.body.skeleton();
        let misled = missing_hands.iter().filter(|hand| !self.unseen[index].contains(hand));
        for part in misled.filter_map(|name| skeleton.part_named(name)) {
            for joint in fingers(skeleton, &skeleton.parts[part.index()]) {
                pose.rotations[joint] = so3::exp(self.fitter.prior.mean(joint));
            }
        }
        pose
    }

    /// Writes the landmarks that were given or found, in our own format: a point can be corrected there, and the file given.
    pub(super) fn write_landmarks(&self) -> Result<()> {
        let Some(landmarks) = self.job.landmarks else { return Ok(()) };
        let path = self.job.out.join(LANDMARKS_FILE);
        let of_frame = |index: usize| {
            let (place, count) = self.places[index];
            Ok((self.files[index].id().to_string(), landmarks.of_frame(self.files[index].id(), place, count)?))
        };
        let frames = (0..self.files.len()).map(of_frame).collect::<Result<Vec<_>>>()?;
        write_own(&path, &frames)
    }

    /// Of each frame, the hands none of whose fingers has a landmark, if in another frame one has: programs that find fingers miss no whole
    /// hand that a scan shows.
    pub(super) fn hands_without_landmarks(&self) -> Result<Vec<Vec<String>>> {
        if matches!(self.job.recordings, Recordings::Rgbd(_)) {
            // A camera that does not see a hand does not say that it is inside of anything.
            return Ok(vec![Vec::new(); self.files.len()]);
        }
        let skeleton = self.job.body.skeleton();
        let hands: Vec<(&String, Vec<&String>)> = (skeleton.parts_of(Role::Hands))
            .map(|part| &skeleton.parts[part.index()])
            .map(|part| (&part.name, fingers(skeleton, part).map(|joint| &skeleton.joints[joint]).collect()))
            .collect();
        let of_frame = |index: usize| {
            let (place, count) = self.places[index];
            let found = match self.job.landmarks {
                Some(landmarks) => landmarks.of_frame(self.files[index].id(), place, count)?,
                None => Vec::new(),
            };
            let has = |fingers: &[&String]| found.iter().any(|(name, ..)| fingers.contains(&name));
            Ok(hands.iter().map(|(_, fingers)| has(fingers)).collect())
        };
        let seen = (0..self.files.len()).map(of_frame).collect::<Result<Vec<Vec<bool>>>>()?;
        let is_ever_seen = |hand: usize| seen.iter().any(|frame| frame[hand]);
        let unseen = |frame: &Vec<bool>| {
            let unseen = (0..hands.len()).filter(|hand| !frame[*hand] && is_ever_seen(*hand));
            unseen.map(|hand| hands[hand].0.clone()).collect()
        };
        Ok(seen.iter().map(unseen).collect())
    }

    fn report_of(
        &self,
        index: usize,
        record: Option<&Record>,
        is_bad: bool,
        unseen: &[String],
        mut turned_hands: Vec<String>,
    ) -> FrameReport {
        let quality = record.map(|record| record.quality.clone());
        let good = quality.as_ref().filter(|_| !is_bad);
        let missing_hands =
            good.map(|quality| quality.missing_hands(self.job.body.skeleton(), unseen)).unwrap_or_default();
        turned_hands.retain(|hand| good.is_some() && !missing_hands.contains(hand));
        FrameReport {
            frame: self.files[index].id().to_string(),
            verdict: if is_bad { Verdict::LeftOut } else { Verdict::Registered },
            reason: if is_bad { self.reason(quality.as_ref()) } else { String::new() },
            missing_hands,
            turned_hands,
            quality,
            landmarks: record.map_or(0, |record| record.landmarks),
            notes: record.map(|record| record.notes.clone()).unwrap_or_default(),
            dropped_landmarks: record.map(|record| record.dropped.clone()).unwrap_or_default(),
        }
    }

    fn reason(&self, quality: Option<&FrameQuality>) -> String {
        match (quality, self.job.landmarks) {
            (Some(quality), _) => why(quality),
            (None, Some(_)) => {
                "no start: too few landmarks of hips, shoulders and neck, and no good frame near it".into()
            }
            (None, None) => "no start: no standing person found by shape alone, and no good frame near it".into(),
        }
    }

    /// Scans with their bodies, in X-Humans' layout; without a pose, what was written before is removed.
    fn write_scans(
        &self,
        frames: &[(&FrameFiles, Option<Pose>)],
        betas: &[f32],
        observe: &mut Observer<'_>,
    ) -> Result<()> {
        write_common(&self.job.out, self.job.gender, betas)?;
        for (done, (files, pose)) in frames.iter().enumerate() {
            observe("writing", done as f64 / frames.len() as f64, &files.id.to_string());
            let folder = FrameFolder::of(&self.job.out, &files.id);
            match pose {
                Some(pose) => self.write_frame(&folder, files, pose)?,
                None => folder.clear()?,
            }
        }
        Ok(())
    }

    /// Pictures with their bodies, in a plain folder, likewise.
    fn write_pictures(
        &self,
        frames: &[(&RgbdFiles, Option<Pose>)],
        betas: &[f32],
        observe: &mut Observer<'_>,
    ) -> Result<()> {
        let out = &self.job.out;
        for (files, _) in frames.iter().filter(|(_, pose)| pose.is_none()) {
            remove_rgbd_frame(out, DEPTH_FORMAT, &files.id)?;
        }
        let kept: Vec<(&RgbdFiles, &Pose)> =
            frames.iter().filter_map(|(files, pose)| Some((*files, pose.as_ref()?))).collect();
        let frame = |(done, (files, pose)): (usize, &(&RgbdFiles, &Pose))| {
            observe("writing", done as f64 / kept.len() as f64, &files.id.to_string());
            let frame = picture(files, self.coordinates)?;
            Ok(RgbdFrame { parameters: BodyParameters::from(self.relative_to_mean(pose)), ..frame })
        };
        let layout = RgbdLayout::Plain(DEPTH_FORMAT);
        write_rgbd_subject(out, layout, self.job.gender, betas, kept.iter().enumerate().map(frame))
    }

    fn write_frame(&self, folder: &FrameFolder, files: &FrameFiles, pose: &Pose) -> Result<()> {
        let ReadMesh { mesh: scan, notes } = scan(files, self.coordinates)?;
        let is_whole = !notes.iter().any(|note| note.lost == Loss::Surroundings);
        let is_linked = match files.scan.path().filter(|_| self.coordinates.is_plain() && is_whole) {
            Some(file) => folder.link_scan(file)?,
            None => false,
        };
        if !is_linked {
            folder.write_scan(&scan)?;
        }
        let mesh = self.job.body.mesh(self.job.body.pose(pose)?.vertices);
        folder.write_body(&BodyParameters::from(self.relative_to_mean(pose)), &mesh)
    }

    /// SMPL-X's parameters with hands as offsets from the model's mean hands, X-Humans' convention.
    pub(super) fn relative_to_mean(&self, pose: &Pose) -> smplx::Parameters {
        let parameters = smplx::Parameters::from(pose);
        let offsets = |hand: HandPose, side: usize| match (hand, self.job.body.hands().get(side)) {
            (HandPose::Flat(mut fingers), Some(space)) => {
                let means = space.mean.as_chunks::<3>().0;
                fingers
                    .iter_mut()
                    .zip(means)
                    .for_each(|(turn, mean)| *turn = PoseAxisAngle(turn.0 - glam::Vec3::from(*mean)));
                HandPose::RelativeToMean(fingers)
            }
            (hand, _) => hand,
        };
        smplx::Parameters {
            left_hand_pose: offsets(parameters.left_hand_pose.clone(), 0),
            right_hand_pose: offsets(parameters.right_hand_pose.clone(), 1),
            ..parameters
        }
    }
}
