//! How far a training has come, and how far it is to go: in steps, passes over the frames, or time.

use std::time::Instant;

use super::Stage;
use super::refinement::RefinedPose;
use crate::config::Config;

/// Weight of the past in the running mean of the loss.
const LOSS_MEMORY: f64 = 0.98;
/// Largest share of a time limit that stage 0 may take.
const PRETRAINING_SHARE: f64 = 0.15;

/// Where a training stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Steps of stage 0 done.
    pub pretraining_steps: u64,
    /// Steps on frames done.
    pub steps: u64,
    /// Seconds of all commands that worked on it.
    pub seconds: f64,
    /// Running mean of the total loss; infinite before the first step.
    pub running_loss: f64,
    /// The smallest running mean at which the state was kept.
    pub best_loss: f64,
    /// How often the frames' poses were refined.
    pub refinements: u64,
    /// What they were refined to, a pose a frame; empty before.
    pub poses: Vec<RefinedPose>,
}

impl Default for Progress {
    fn default() -> Self {
        Self {
            pretraining_steps: 0,
            steps: 0,
            seconds: 0.0,
            running_loss: f64::INFINITY,
            best_loss: f64::INFINITY,
            refinements: 0,
            poses: Vec::new(),
        }
    }
}

impl Progress {
    /// Steps of both stages done.
    pub fn all_steps(&self) -> u64 {
        self.pretraining_steps + self.steps
    }

    /// Takes the total loss of a step into the mean.
    pub(super) fn add_loss(&mut self, total: f64) {
        self.running_loss = match self.running_loss {
            mean if mean.is_finite() => LOSS_MEMORY * mean + (1.0 - LOSS_MEMORY) * total,
            _ => total,
        };
    }
}

/// What ends a training.
pub(super) struct Pace<'a> {
    pub config: &'a Config,
    /// Frames there are.
    pub frames: usize,
    pub started: Instant,
    /// Seconds that earlier commands spent.
    pub earlier_seconds: f64,
    /// When all was prepared and steps could begin.
    pub prepared: Instant,
}

impl Pace<'_> {
    pub fn seconds(&self) -> f64 {
        self.earlier_seconds + self.started.elapsed().as_secs_f64()
    }

    /// The time limit, seconds; none if steps end the training.
    pub fn limit(&self) -> Option<f64> {
        (self.config.schedule.minutes > 0.0).then_some(60.0 * self.config.schedule.minutes)
    }

    /// The stage of the next step.
    pub fn stage(&self, progress: &Progress) -> Stage {
        // Not the preparation's time: a field without stage 0 begins so far off that a short training does not make up for it.
        let spent = self.prepared.elapsed().as_secs_f64();
        let late = self.limit().is_some_and(|limit| spent > PRETRAINING_SHARE * limit);
        // Once on the frames, a resumed training does not go back.
        if progress.steps > 0 || late || progress.pretraining_steps >= self.config.schedule.pretraining_steps {
            Stage::Frames
        } else {
            Stage::Pretraining
        }
    }

    /// Steps that a stage has; none if time ends it.
    pub fn steps(&self, stage: Stage) -> Option<u64> {
        match (stage, self.limit()) {
            (Stage::Pretraining, _) => Some(self.config.schedule.pretraining_steps),
            (Stage::Frames, None) => Some(self.config.schedule.steps),
            (Stage::Frames, Some(_)) => None,
        }
    }

    /// Share that is done; of its time if that is limited, else of its steps on frames.
    pub fn share_done(&self, progress: &Progress) -> f64 {
        match self.limit() {
            Some(limit) => (self.seconds() / limit).max(self.share_of_epochs(progress)),
            None => progress.steps as f64 / self.config.schedule.steps.max(1) as f64,
        }
    }

    /// Whether the frames' poses are to be refined before the next step: first when half of the training is done, for an earlier surface is
    /// farther off than they are, then whenever half of the rest is.
    pub fn is_refinement_due(&self, progress: &Progress) -> bool {
        let done = progress.refinements;
        done < self.config.schedule.pose_refinements && self.share_done(progress) >= 1.0 - 0.5_f64.powi(done as i32 + 1)
    }

    /// Share that is done of the passes over the frames that end a training early; 0 where there is no such bound.
    fn share_of_epochs(&self, progress: &Progress) -> f64 {
        let most_frames = self.config.schedule.most_epochs * self.frames as u64;
        let done = progress.steps * self.config.optimiser.batch_frames as u64;
        if most_frames > 0 { done as f64 / most_frames as f64 } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn stage_0_has_its_share_of_the_time_however_long_the_preparation_took() {
        let config = Config::preset_with("fast", &[("schedule.minutes".into(), "1".into())]).unwrap();
        let now = Instant::now();
        let stage = |prepared: u64, progress: &Progress| {
            let started = now.checked_sub(Duration::from_secs(40)).unwrap();
            let prepared = started + Duration::from_secs(prepared);
            Pace { config: &config, frames: 30, started, earlier_seconds: 0.0, prepared }.stage(progress)
        };
        let begun = Progress::default();
        assert_eq!(stage(39, &begun), Stage::Pretraining, "one second after forty of preparation");
        assert_eq!(stage(10, &begun), Stage::Frames, "half a minute is more than its share");
        assert_eq!(stage(39, &Progress { steps: 1, ..begun.clone() }), Stage::Frames, "there is no way back");
        assert_eq!(stage(39, &Progress { pretraining_steps: 60, ..begun }), Stage::Frames, "it is done");
    }
}
