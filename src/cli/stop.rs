//! Ctrl-C, a polite kill, or a scheduler's notice: the first asks the work to stop at the next good place, the second ends the process at once.
//!
//! Training steps are waited for and saved. Whatever else is under way, frames being prepared, meshes measured or drawn, has nothing to
//! lose but its time: it ends with the process after [`PATIENCE`]. What is in files by then is whole, as after any other end.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How long the work may take to stop by itself; schedulers kill after some 30 seconds.
const PATIENCE: Duration = Duration::from_secs(1);

static STOP: AtomicBool = AtomicBool::new(false);
static IS_WATCHED: AtomicBool = AtomicBool::new(false);
static IS_TRAINING: AtomicBool = AtomicBool::new(false);

/// The flag that Ctrl-C (or a polite kill) sets from now on.
pub fn on_interrupt() -> anyhow::Result<&'static AtomicBool> {
    if IS_WATCHED.swap(true, Ordering::SeqCst) {
        return Ok(&STOP);
    }
    ctrlc::set_handler(ask)?;
    #[cfg(unix)]
    on_notice()?;
    Ok(&STOP)
}

/// USR1, with which schedulers say that the time is nearly up.
#[cfg(unix)]
fn on_notice() -> std::io::Result<()> {
    use signal_hook::consts::SIGUSR1;
    use signal_hook::iterator::Signals;
    let mut notices = Signals::new([SIGUSR1])?;
    std::thread::spawn(move || notices.forever().for_each(|_| ask()));
    Ok(())
}

fn ask() {
    if STOP.swap(true, Ordering::SeqCst) {
        std::process::exit(crate::cli::EXIT_FAILED.into());
    }
    log::info!("\nstopping at the next good place; once more to end at once and lose what was not saved yet");
    std::thread::spawn(end_unless_training);
}

/// Says whether training steps are under way, which are worth waiting for.
pub fn set_training(is_training: bool) {
    IS_TRAINING.store(is_training, Ordering::SeqCst);
}

fn end_unless_training() {
    loop {
        std::thread::sleep(PATIENCE);
        if !IS_TRAINING.load(Ordering::SeqCst) {
            log::info!("stopped; the same command, with --resume where it has that, goes on");
            std::process::exit(crate::cli::EXIT_STOPPED.into());
        }
    }
}
