//! What a run shows while it goes: a bar on a terminal, else a line every ten seconds, plain or JSON. Always on stderr.

use std::fmt::Write;
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use xavatar::formats::Shown;
use xavatar::runs::{Event, Observer};
use xavatar::train::{Stage, StepRecord};

use crate::cli::output::messages::{self, BARS, ProgressLine};
use crate::cli::stop;

/// Between plain lines.
const LINE_EVERY: Duration = Duration::from_secs(10);
/// Positions of a bar.
const BAR: u64 = 1000;

/// Shows a task that goes through phases, one after the other.
pub struct Progress {
    /// Hidden, and never drawn, unless stderr is a terminal and bars are wanted on it.
    bar: ProgressBar,
    phase: &'static str,
    phase_began: Instant,
    /// How much of the phase was done when it was first heard of: a resumed run starts in the middle.
    phase_share: f64,
    last_line: Option<Instant>,
}

impl Progress {
    pub fn new() -> Self {
        let bar = BARS.add(ProgressBar::new(BAR));
        if let Ok(style) = ProgressStyle::with_template("{prefix:>10} {bar:24} {wide_msg}") {
            bar.set_style(style);
        }
        Self { bar, phase: "", phase_began: Instant::now(), phase_share: 0.0, last_line: None }
    }

    /// `share` (0..1) of `phase` is done.
    pub fn show(&mut self, phase: &'static str, share: f64, message: &str) {
        stop::set_training(false);
        if phase != self.phase {
            (self.phase, self.phase_began, self.phase_share, self.last_line) = (phase, Instant::now(), share, None);
            self.bar.set_prefix(phase);
        }
        let left = self.time_left(share);
        if self.bar.is_hidden() {
            let is_due = self.last_line.is_none_or(|last| last.elapsed() >= LINE_EVERY);
            if is_due || share >= 1.0 {
                let seconds_left = left.map(|left| left.as_secs_f64());
                messages::progress(&ProgressLine { phase, share, seconds_left, message });
                self.last_line = Some(Instant::now());
            }
        } else {
            let left = left.map_or_else(String::new, |left| format!("  ETA {}", HumanDuration(left)));
            self.bar.set_position((share * BAR as f64) as u64);
            self.bar.set_message(format!("{}{left}", Shown(message)));
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
        BARS.remove(&self.bar);
    }

    fn time_left(&self, share: f64) -> Option<Duration> {
        let gained = share - self.phase_share;
        let seconds = self.phase_began.elapsed().as_secs_f64() * (1.0 - share) / gained;
        // The first steps say little, and warm up caches.
        (gained > 0.005 && share < 1.0).then(|| Duration::try_from_secs_f64(seconds.round()).ok()).flatten()
    }
}

impl Observer for Progress {
    fn event(&mut self, event: Event<'_>) {
        let share = |done: u64, total: u64| done as f64 / total.max(1) as f64;
        match event {
            Event::Preparing { done, total } => {
                self.show("frames", share(done as u64, total as u64), &format!("{done} of {total} prepared"));
            }
            Event::Step { progress, record } => {
                let StepRecord { step, steps, seconds, .. } = record;
                let mut message = match steps {
                    Some(steps) => format!("step {step} of {steps}"),
                    None => format!("step {step}"),
                };
                let points = record.points as f64 / 1000.0 / seconds.max(1e-9);
                let _ = write!(message, "  {seconds:.2} s  {points:.0}k points/s");
                for (name, loss) in &record.losses {
                    let _ = write!(message, "  {name} {loss:.4}");
                }
                match record.stage {
                    Stage::Pretraining => self.show("body", share(*step, steps.unwrap_or(*step)), &message),
                    Stage::Frames => self.show("avatar", progress, &message),
                }
                stop::set_training(true);
            }
            Event::Measured { done, total, frame } => {
                self.show("measuring", share(done as u64, total as u64), frame);
            }
            Event::Checkpoint { .. } | Event::Avatar { .. } => {}
            Event::Refining { done, total } => {
                self.show("poses", share(done as u64, total as u64), &format!("{done} of {total} refined"));
            }
            Event::Refined { refined } => log::info!("poses refined: {refined}"),
            Event::Preview { path } => log::info!("preview: {}", path.display()),
            Event::Warning { message } => log::warn!("{message}"),
        }
    }
}
