//! One step of the `paper-scan` preset on one frame of the built-in subject, P = 6000: time, its split, peak memory, GFLOP/s.
//!
//! `cargo bench --bench paper_scan_step`. The rate counts the multiply-adds of the three networks' matrix products in the loss
//! phase alone: 6 a weight and point for geometry on the surface, 3 off it, 3 for texture, 12 for skinning with its tangents.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use xavatar::body::Gender;
use xavatar::config::Config;
use xavatar::data::{FrameId, FrameSource, ScanFrame};
use xavatar::fields::{Fields, skeleton_parents};
use xavatar::mannequin::{BuiltInSubject, Split};
use xavatar::train::{Event, Observer, Stage, Trainer};

const STEPS: &str = "6";

struct OneFrame {
    frame: ScanFrame,
    ids: Vec<FrameId>,
    betas: [f32; 10],
}

impl FrameSource for OneFrame {
    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, _: usize) -> xavatar::Result<ScanFrame> {
        Ok(self.frame.clone())
    }

    fn betas(&self) -> [f32; 10] {
        self.betas
    }

    fn gender(&self) -> Gender {
        Gender::Neutral
    }
}

/// Seconds of each step on frames, in all and by phase; points of the last.
#[derive(Default)]
struct Timings {
    seconds: Vec<f64>,
    split: BTreeMap<&'static str, Vec<f64>>,
    points: usize,
}

impl Observer for Timings {
    fn event(&mut self, event: Event<'_>) {
        if let Event::Step { record, .. } = event
            && record.stage == Stage::Frames
        {
            self.seconds.push(record.seconds);
            for (phase, seconds) in &record.split {
                self.split.entry(phase).or_default().push(*seconds);
            }
            self.points = record.points;
        }
    }
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// Largest resident memory of this process, MiB; unknown where the system does not say.
fn peak_mebibytes() -> Option<f64> {
    let status = std::fs::read_to_string(Path::new("/proc/self/status")).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kibibytes| kibibytes / 1024.0)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let settings = [
        ("optimiser.batch_frames", "1"),
        ("schedule.steps", STEPS),
        // A body to search on, as any real step has.
        ("schedule.pretraining_steps", "10"),
        ("schedule.preview_steps", "0"),
        ("losses.colour_from_epoch", "0"),
    ];
    let config = Config::preset_with("paper-scan", &settings.map(|(key, value)| (key.into(), value.into())))?;
    let subject = BuiltInSubject::new()?;
    let frame = subject.frame(Split::Train, 0, 1)?;
    let source = OneFrame { ids: vec![frame.id.clone()], betas: subject.betas(), frame };
    let folder = tempfile::tempdir()?;
    let mut timings = Timings::default();
    let labels = subject.part_labels();
    let mut trainer = Trainer::start(&config, &source, subject.model(), labels, folder.path(), &mut timings)?;
    trainer.run(&AtomicBool::new(false), &mut timings)?;

    let fields = Fields::<f32>::new(&config.fields, &skeleton_parents(), (glam::Vec3::NEG_ONE, glam::Vec3::ONE))?;
    let [geometry, texture, skinning] = fields.networks().map(|network| network.parameters().len() as f64);
    let on = (config.sampling.points as f64 * 11.0 / 12.0).round();
    let off = timings.points as f64 - on;
    let operations = 2.0 * (geometry * (6.0 * on + 3.0 * off) + 3.0 * texture * on + 12.0 * skinning * (on + off));
    println!("paper-scan, one frame, P = {}, {} threads", config.sampling.points, rayon::current_num_threads());
    println!("step        {:7.3} s (median of {})", median(&timings.seconds), timings.seconds.len());
    for (phase, seconds) in &timings.split {
        println!("  {phase:<10}{:7.3} s", median(seconds));
    }
    println!("losses      {:7.0} GFLOP/s", operations / median(&timings.split["losses"]) * 1e-9);
    if let Some(peak) = peak_mebibytes() {
        println!("peak memory {peak:7.0} MiB");
    }
    Ok(())
}
