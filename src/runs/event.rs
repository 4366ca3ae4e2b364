//! What whoever watches a run is told.

use std::path::Path;

use crate::avatar::Avatar;
use crate::train::{Refined, StepRecord};

/// Whoever watches a run.
pub trait Observer {
    /// Is told what happened.
    fn event(&mut self, event: Event<'_>);

    /// Whether it would have the avatar as it is now, for which the training waits some milliseconds. Asked after each step on frames.
    fn wants_avatar(&mut self) -> bool {
        false
    }
}

/// A closure that takes events; `|_: Event<'_>| {}` watches nothing.
impl<F: FnMut(Event<'_>)> Observer for F {
    fn event(&mut self, event: Event<'_>) {
        self(event);
    }
}

/// What happens in a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// Captures are read, checked and stored.
    Preparing {
        /// Captures done.
        done: usize,
        /// Captures there are.
        total: usize,
    },
    /// A step of either stage is done.
    Step {
        /// Share of the whole run that is done, 0 to 1.
        progress: f64,
        /// What was measured.
        record: &'a StepRecord,
    },
    /// The frames' poses are refined.
    Refining {
        /// Frames done.
        done: usize,
        /// Frames there are.
        total: usize,
    },
    /// They were refined.
    Refined {
        /// What that did.
        refined: Refined,
    },
    /// A checkpoint was written.
    Checkpoint {
        /// Where.
        path: &'a Path,
    },
    /// A preview picture was written.
    Preview {
        /// Where.
        path: &'a Path,
    },
    /// The avatar as it is now, for an observer that wants it.
    Avatar {
        /// It.
        avatar: Box<Avatar>,
    },
    /// A frame was measured.
    Measured {
        /// Frames done.
        done: usize,
        /// Frames there are.
        total: usize,
        /// This one, as `split/sequence/number`.
        frame: &'a str,
    },
    /// Something the user should know.
    Warning {
        /// What.
        message: String,
    },
}
