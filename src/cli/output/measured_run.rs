//! A run that is one row of a table: trained, then measured, as far as that is not done.

use std::sync::atomic::AtomicBool;

use xavatar::runs::{Ending, Run, RunMetrics, Yardstick};

use crate::cli::output::progress::Progress;

/// Trains and measures a run; none if it was stopped. `name` is for messages.
pub fn finish(run: &Run, name: &str, yardstick: &Yardstick, stop: &AtomicBool) -> anyhow::Result<Option<RunMetrics>> {
    let doing = if run.is_finished() { "trained already" } else { "training" };
    log::info!("{name}: {doing}");
    let mut progress = Progress::new();
    let metrics = match run.train(stop, &mut progress)? {
        Ending::Finished => run.measure(yardstick, stop, &mut progress)?,
        Ending::Stopped => None,
    };
    progress.finish();
    Ok(metrics)
}
