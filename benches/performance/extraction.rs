//! Meshes of a `fast` avatar of the built-in subject: canonical, posed, and of fixed topology.

use std::sync::atomic::AtomicBool;

use xavatar::avatar::{Animator, FixedTopology};
use xavatar::config::Config;
use xavatar::doctor::Seconds;
use xavatar::runs::Run;
use xavatar::synthetic::{BuiltInSubject, Split};
use xavatar::train::TrainingSpec;

use crate::report::Report;
use crate::steps::Timings;

/// Enough for a surface of the right area.
const TRAINING: [(&str, &str); 3] =
    [("schedule.pretraining_steps", "60"), ("schedule.steps", "20"), ("schedule.preview_steps", "0")];

/// Measures extraction at several resolutions, and a frame of an animation.
pub fn measure(report: &mut Report) -> Result<(), Box<dyn std::error::Error>> {
    report.section("meshes of a fast avatar");
    let config = Config::preset_with("fast", &TRAINING.map(|(key, value)| (key.into(), value.into())))?;
    let subject = BuiltInSubject::new()?;
    let (source, folder, mut timings) = (subject.film(Split::Train, 1)?, tempfile::tempdir()?, Timings::default());
    let (model, labels) = (subject.model(), subject.part_labels());
    let run = Run::open(folder.path(), TrainingSpec { config: &config, source: &source, body: model, labels })?;
    run.train(&AtomicBool::new(false), &mut timings)?;
    let avatar = run.avatar()?;
    let canonical = avatar.subject.skeleton.canonical_pose(&avatar.subject.betas);
    for (resolution, repeats) in [(128, 5), (256, 5), (512, 3)] {
        avatar.extract_canonical(&canonical, resolution)?;
        let seconds = Seconds::of(repeats, || drop(avatar.extract_canonical(&canonical, resolution)));
        report.seconds(&format!("extract_fast_{resolution}_s"), &seconds);
    }
    let pose = model.resolve(&source.frames()[0].parameters)?;
    let animator = Animator::new(&avatar, model, labels)?;
    animator.extract(&pose, 256)?;
    report.seconds("animate_fast_256_s", &Seconds::of(3, || drop(animator.extract(&pose, 256))));
    let fixed = FixedTopology::new(&avatar, model, 256)?;
    report.seconds("animate_fast_256_fixed_topology_s", &Seconds::of(5, || drop(fixed.pose(&pose))));
    Ok(())
}
