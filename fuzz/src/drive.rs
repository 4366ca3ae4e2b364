//! Many mutated inputs through one target, each of which can be made again from its number.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::mutation::mutated;
use crate::targets::Target;

/// How often an input is read again that took longer than all before.
const REPEATS: usize = 4;

/// What came of inputs that did no harm.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// How many there were.
    pub inputs: u64,
    /// How many of them were read; the others were refused.
    pub accepted: u64,
    /// The longest that one took.
    pub slowest: Duration,
}

/// An input over which a reader panicked.
#[derive(Clone, Debug)]
pub struct Failure {
    /// Its number, if it is no known one.
    pub index: Option<u64>,
    /// The input.
    pub bytes: Vec<u8>,
}

/// Tries the inputs that failed before, and the seeds.
///
/// # Errors
/// The first input over which the reader panics.
pub fn drive_known(target: &Target, seeds: &[Vec<u8>]) -> Result<Tally, Failure> {
    let mut tally = Tally::default();
    for known in found_before(target.name).iter().chain(seeds) {
        try_one(target, known, &mut tally).map_err(|()| Failure { index: None, bytes: known.clone() })?;
    }
    Ok(tally)
}

/// Tries mutations number `first` to `first + inputs` of the seeds.
///
/// # Errors
/// The first input over which the reader panics.
pub fn drive(target: &Target, seeds: &[Vec<u8>], seed: u64, first: u64, inputs: u64) -> Result<Tally, Failure> {
    let mut tally = Tally::default();
    for index in first..first + inputs {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(index);
        let bytes = mutated(seeds, &mut random);
        try_one(target, &bytes, &mut tally).map_err(|()| Failure { index: Some(index), bytes })?;
    }
    Ok(tally)
}

fn try_one(target: &Target, bytes: &[u8], tally: &mut Tally) -> Result<(), ()> {
    let timed = || -> Result<(bool, Duration), ()> {
        let begin = Instant::now();
        let accepted = catch_unwind(AssertUnwindSafe(|| (target.read)(bytes))).map_err(drop)?;
        Ok((accepted, begin.elapsed()))
    };
    let (accepted, mut time) = timed()?;
    // Most of a long time may be another program's: a reader that is slow is slow each time.
    for _ in 0..REPEATS {
        if time > tally.slowest {
            time = time.min(timed()?.1);
        }
    }
    tally.inputs += 1;
    tally.accepted += u64::from(accepted);
    tally.slowest = tally.slowest.max(time);
    Ok(())
}

/// The inputs over which a target failed once, in the order of their names.
pub fn found_before(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<_> = entries.map(|entry| entry.path()).collect();
    paths.sort();
    paths.iter().filter_map(|path| std::fs::read(path).ok()).collect()
}
