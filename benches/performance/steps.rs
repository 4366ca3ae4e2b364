//! Whole training steps on the built-in subject, each case in a process of its own: time, split, peak memory.
//!
//! The process runs this same program with [`CASE`] set, and answers with one JSON map on its standard output.

use std::collections::BTreeMap;
use std::process::{Command, Stdio};
use std::sync::atomic::AtomicBool;

use xavatar::config::Config;
use xavatar::doctor::Seconds;
use xavatar::runs::{Event, Observer, Run};
use xavatar::synthetic::{BuiltInSubject, Split};
use xavatar::train::{Stage, TrainingSpec};

use crate::report::Report;

/// The environment variable that makes this program measure one case: its settings, as `key=value` joined by semicolons.
pub const CASE: &str = "XAVATAR_PERFORMANCE_CASE";

/// What every case starts from.
const SETTINGS: &str = "schedule.preview_steps=0;losses.colour_from_epoch=0";

/// Frames a step, each of P = 6000: what the preset takes, so that a step's optimiser is shared as in training.
const BATCHES: [(&str, &str, &str, f64); 2] = [
    ("paper-scan", "paper_scan", "optimiser.batch_frames=1;schedule.pretraining_steps=10;schedule.steps=6", 1.0),
    ("fast", "fast", "optimiser.batch_frames=2;schedule.pretraining_steps=40;schedule.steps=60", 2.0),
];

/// Settings of the cases that the first of paper-scan is compared with, and their threads where not all.
const VARIANTS: [(&str, &str, Option<&str>); 6] = [
    ("paper_scan_step_3000_points_s", "sampling.points=3000", None),
    ("paper_scan_step_12000_points_s", "sampling.points=12000", None),
    ("paper_scan_step_2_frames_s", "optimiser.batch_frames=2", None),
    ("paper_scan_step_9_bones_s", "starts=\"body\"", None),
    ("paper_scan_step_55_bones_s", "starts=\"all\"", None),
    ("paper_scan_step_1_thread_s", "", Some("1")),
];

/// Seconds of each step on frames, in all (`step`) and by phase.
#[derive(Default)]
pub struct Timings(BTreeMap<String, Vec<f64>>);

impl Observer for Timings {
    fn event(&mut self, event: Event<'_>) {
        if let Event::Step { record, .. } = event
            && record.stage == Stage::Frames
        {
            self.0.entry("step".into()).or_default().push(record.seconds);
            if let Some(losses) = record.split.get("losses") {
                self.0.entry("field_samples_per_s".into()).or_default().push(record.points as f64 / losses);
            }
            for (phase, seconds) in &record.split {
                self.0.entry((*phase).into()).or_default().push(*seconds);
            }
        }
    }
}

/// Measures the case that the parent process names.
pub fn child(case: &str) -> Result<(), Box<dyn std::error::Error>> {
    let settings: Vec<(String, String)> =
        case.split(';').filter_map(|setting| setting.split_once('=')).map(|(k, v)| (k.into(), v.into())).collect();
    let (_, preset) = &settings[0];
    let config = Config::preset_with(preset, &settings[1..])?;
    let subject = BuiltInSubject::new()?;
    let (source, folder, mut timings) = (subject.film(Split::Train, 1)?, tempfile::tempdir()?, Timings::default());
    let (model, labels) = (subject.model(), subject.part_labels());
    let spec = TrainingSpec { config: &config, source: &source, body: model, labels };
    Run::open(folder.path(), spec)?.train(&AtomicBool::new(false), &mut timings)?;
    let Timings(mut measured) = timings;
    measured.extend(peak_mebibytes().map(|peak| ("peak_mib".to_owned(), vec![peak])));
    println!("{}", serde_json::to_string(&measured)?);
    Ok(())
}

/// Largest resident memory of this process so far, MiB; unknown where the system does not say.
fn peak_mebibytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kibibytes| kibibytes / 1024.0)
}

/// Runs one case in a process of its own.
fn run(
    preset: &str,
    settings: &str,
    threads: Option<&str>,
) -> Result<BTreeMap<String, Vec<f64>>, Box<dyn std::error::Error>> {
    let mut command = Command::new(std::env::current_exe()?);
    command.env(CASE, format!("preset={preset};{SETTINGS};{settings}")).stderr(Stdio::inherit());
    if let Some(threads) = threads {
        command.env("RAYON_NUM_THREADS", threads);
    }
    let output = command.output()?;
    if !output.status.success() {
        return Err(format!("the case {preset:?}, {settings:?} ended with {}", output.status).into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// Measures a step of each preset, then what changes the cost of a paper-scan step.
pub fn measure(report: &mut Report) -> Result<(), Box<dyn std::error::Error>> {
    // Pretrained a little: a body to search on, as any real step has.
    for (preset, name, settings, frames) in BATCHES {
        report.section(&format!("one step of {preset}, per frame, P = 6000"));
        let mut measured = run(preset, settings, None)?;
        if let Some(peak) = measured.remove("peak_mib") {
            report.number(&format!("{name}_step_peak_mib"), peak[0], "MiB");
        }
        if let Some(rates) = measured.remove("field_samples_per_s") {
            report.number(
                &format!("{name}_field_samples_per_s"),
                Seconds::from(rates).median(),
                "points/s in the losses",
            );
        }
        let step = measured.remove("step").ok_or("no step was measured")?;
        let per_frame = |steps: Vec<f64>| Seconds::from(steps.iter().map(|step| step / frames).collect::<Vec<_>>());
        report.seconds(&format!("{name}_step_s"), &per_frame(step));
        for (phase, seconds) in measured {
            report.seconds(&format!("{name}_step_{phase}_s"), &per_frame(seconds));
        }
    }
    report.section("what changes the cost of a step of paper-scan");
    for (name, settings, threads) in VARIANTS {
        let mut measured = run("paper-scan", &format!("{};schedule.steps=3;{settings}", BATCHES[0].2), threads)?;
        let step: Seconds = measured.remove("step").ok_or("no step was measured")?.into();
        report.seconds(name, &step);
    }
    Ok(())
}
