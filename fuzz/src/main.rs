//! The long run: so many mutated inputs for every target, or for those that are named, with what they took.
//!
//! `cargo run --release -p xavatar-fuzz -- 1000000 npz pickle`. Ends with 1 at the first panic, at an input that takes longer than
//! [`HANG`], or if a target's memory grew beyond [`MOST_MEMORY`]; the input is kept in `corpus/`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use xavatar_fuzz::{Failure, TARGETS, Tally, Target, drive, drive_known};

/// Inputs between two looks at the clock.
const ROUND: u64 = 1000;
/// Inputs of 64 KiB at most take milliseconds.
const HANG: Duration = Duration::from_secs(2);
/// How long the processor may work on a round before its reader is given up.
const ENDLESS: Duration = Duration::from_secs(120);
/// What inputs of 64 KiB may take: 64 MiB and 64 times their size (`formats`), and as much again for what is being made of it.
const MOST_MEMORY: u64 = 160 << 20;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1).peekable();
    let inputs = arguments.next_if(|argument| argument.parse::<u64>().is_ok());
    let inputs = inputs.and_then(|inputs| inputs.parse().ok()).unwrap_or(100_000);
    let named: Vec<String> = arguments.collect();
    println!(
        "{:<14} {:>10} {:>10} {:>9} {:>12} {:>10}",
        "target", "inputs", "accepted", "seconds", "slowest ms", "memory MiB"
    );
    std::thread::spawn(watch);
    let asked = |target: &&Target| named.is_empty() || named.iter().any(|name| name == target.name);
    let mut outcomes = TARGETS.iter().filter(asked).map(|target| long_run(target, inputs));
    if outcomes.all(|is_sound| is_sound) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn long_run(target: &Target, inputs: u64) -> bool {
    // What seeds are made with is not the reader's.
    let seeds = (target.seeds)();
    let begin = Instant::now();
    let memory_before = forget_peak();
    let mut total = Tally::default();
    *lock() = Some((target.name, 0, processor_time()));
    let mut outcome = drive_known(target, &seeds);
    let mut next = 0;
    loop {
        match outcome {
            Ok(tally) => {
                total.inputs += tally.inputs;
                total.accepted += tally.accepted;
                total.slowest = total.slowest.max(tally.slowest);
            }
            Err(failure) => {
                println!(
                    "{}: panics over number {:?}, kept as {}",
                    target.name,
                    failure.index,
                    keep(target, &failure).display()
                );
                return false;
            }
        }
        if next >= inputs {
            break;
        }
        *lock() = Some((target.name, next, processor_time()));
        outcome = drive(target, &seeds, 1, next, ROUND.min(inputs - next));
        next += ROUND;
    }
    let memory = peak().zip(memory_before).map(|(peak, before)| peak.saturating_sub(before));
    println!(
        "{:<14} {:>10} {:>10} {:>9.1} {:>12.1} {:>10}",
        target.name,
        total.inputs,
        total.accepted,
        begin.elapsed().as_secs_f64(),
        1e3 * total.slowest.as_secs_f64(),
        memory.map_or("-".into(), |bytes| (bytes >> 20).to_string())
    );
    total.slowest < HANG && memory.is_none_or(|bytes| bytes < MOST_MEMORY)
}

/// The round under way: its target, its first input, and what the processor had worked before.
static ROUND_UNDER_WAY: Mutex<Option<(&str, u64, Duration)>> = Mutex::new(None);

fn lock() -> std::sync::MutexGuard<'static, Option<(&'static str, u64, Duration)>> {
    ROUND_UNDER_WAY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends the process if a round does not end.
fn watch() {
    loop {
        std::thread::sleep(Duration::from_secs(1));
        if let Some((target, first, since)) = *lock()
            && processor_time().saturating_sub(since) > ENDLESS
        {
            println!("{target}: does not end over one of the inputs {first} to {}", first + ROUND);
            std::process::exit(1);
        }
    }
}

/// How long the processor has worked on the main thread, which reads; the clock's time where the system does not say.
fn processor_time() -> Duration {
    static BEGIN: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    let statistics = std::fs::read_to_string("/proc/self/schedstat").ok();
    let nanoseconds = statistics.and_then(|text| text.split(' ').next()?.parse().ok());
    nanoseconds.map_or_else(|| BEGIN.elapsed(), Duration::from_nanos)
}

/// Writes an input where it will be tried first from now on.
fn keep(target: &Target, failure: &Failure) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target.name);
    let number = failure.index.map_or("known".into(), |index| index.to_string());
    let path = folder.join(format!("panic-{number}"));
    if let Err(error) = std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&path, &failure.bytes)) {
        println!("{}: {error}", path.display());
    }
    path
}

/// The most memory that the process has had since it was last forgotten, bytes; none where the system does not say.
fn peak() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok()? << 10)
}

/// Starts to look for the peak anew, and returns what there is now.
fn forget_peak() -> Option<u64> {
    std::fs::write("/proc/self/clear_refs", "5").ok()?;
    peak()
}
