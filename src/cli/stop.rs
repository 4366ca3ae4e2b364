//! Ctrl-C: the first asks the work to stop at the next good place, the second ends the process at once.

use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);

/// The flag that Ctrl-C (or a polite kill) sets from now on.
pub fn on_interrupt() -> anyhow::Result<&'static AtomicBool> {
    ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::SeqCst) {
            std::process::exit(super::EXIT_FAILED.into());
        }
        log::info!("\nstopping after this step; once more to end at once and lose what was not saved yet");
    })?;
    Ok(&STOP)
}
