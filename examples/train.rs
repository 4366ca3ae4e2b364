//! Trains an avatar from code: the built-in subject for a few steps, into a run's folder.
//!
//!     cargo run --release --example train -- runs/example
//!
//! With your own data, `xavatar::data::training_captures` opens a subject's folder; anything else that can hand out scans or RGB-D pictures
//! with the body registered to them implements `Source`, as `FilmedTake` here does.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use xavatar::avatar::Avatar;
use xavatar::config::Config;
use xavatar::runs::{Event, Run};
use xavatar::synthetic::{BuiltInSubject, Split};
use xavatar::train::{Stage, TrainingSpec};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let run = PathBuf::from(std::env::args().nth(1).ok_or("give a new folder for the run")?);

    // Every setting has a value in the preset; configs/fast.toml explains them. Far too few steps for a good avatar.
    let settings = [("schedule.steps", "40"), ("schedule.pretraining_steps", "40"), ("sampling.points", "1500")];
    let settings = settings.map(|(key, value)| (key.to_owned(), value.to_owned()));
    let config = Config::preset_with("demo", &settings)?;

    let subject = BuiltInSubject::new()?;
    let frames = subject.film(Split::Train, 4)?;

    let mut watch = |event: Event<'_>| {
        if let Event::Step { record, .. } = event
            && record.stage == Stage::Frames
            && record.step % 10 == 0
        {
            println!("step {:3}  loss {:.4}", record.step, record.losses["total"]);
        }
    };
    // Set from another thread, this stops the run after the step; the same calls again go on with it.
    let stop = AtomicBool::new(false);
    let (body, labels) = (subject.model(), subject.part_labels());
    let spec = TrainingSpec { config: &config, source: &frames, body, labels };
    Run::open(&run, spec)?.train(&stop, &mut watch)?;

    println!("{}", run.join(Avatar::FILE).display());
    Ok(())
}
