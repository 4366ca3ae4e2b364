//! `xavatar demo`: the whole path on the built-in subject, which needs no data: train, extract, measure, picture.

mod gallery;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, bail};
use xavatar::avatar::{Animator, Avatar};
use xavatar::config::Config;
use xavatar::data::{ScanFrame, Source};
use xavatar::evaluate::{Evaluation, SmplxD};
use xavatar::mesh::{TriangleMesh, write_ply};
use xavatar::render::write_png;
use xavatar::report::{Fact, REPORT_FILE, Report, dancing_rig, machine};
use xavatar::runs::{Ending, Run};
use xavatar::synthetic::{BuiltInSubject, FilmedTake, Split};
use xavatar::synthetic::{FilmedScans, Turntable};
use xavatar::train::TrainingSpec;

use self::gallery::{Gallery, sheet_of_pictures};
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;
use crate::cli::output::{files, report};
use crate::cli::{Outcome, stop};

/// Train an avatar of a built-in subject, with no data, and show it in poses it has never seen
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar demo\n  \
    xavatar demo --rgbd --out runs/demo-rgbd\n  \
    xavatar demo --write-data mannequin && xavatar check mannequin --body mannequin/body\n\n\
    A demo that was stopped goes on when the same command is given again.")]
pub struct Demo {
    /// Do the same with far fewer steps, frames and cells, to see that everything works
    #[arg(long)]
    smoke: bool,
    /// Learn from the pictures of an RGB-D camera that goes around the subject once, instead of from scans
    #[arg(long)]
    rgbd: bool,
    /// The folder for the run, the meshes and the pictures: new or empty
    #[arg(long, value_name = "DIR", default_value = "runs/demo")]
    out: PathBuf,
    /// Only write the subject as a data set, to try the other verbs on: scans in DIR, the body model in DIR/body
    #[arg(long, value_name = "DIR", conflicts_with_all = ["out", "json"])]
    write_data: Option<PathBuf>,
    /// How many frames that data set has to train on; there are a fifth as many to measure on
    #[arg(long, value_name = "N", requires = "write_data", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: Option<u32>,
    #[command(flatten)]
    json: JsonArgument,
}

/// How large a demo is.
struct Size {
    training_frames: usize,
    unseen_frames: usize,
    /// Cells along the longest side of the box around the body.
    resolution: usize,
    /// Points per surface that are measured.
    samples: usize,
    /// Rows of one picture, pixels.
    picture: u32,
    /// Columns and rows of what the RGB-D camera takes, pixels.
    filmed: [u32; 2],
    /// What differs from the preset.
    settings: &'static [(&'static str, &'static str)],
}

const FULL: Size = Size {
    training_frames: 24,
    unseen_frames: 5,
    resolution: 224,
    samples: Evaluation::SAMPLES,
    picture: 520,
    filmed: [800, 1200],
    settings: &[],
};

const SMOKE: Size = Size {
    training_frames: 3,
    unseen_frames: 1,
    resolution: 64,
    samples: 2000,
    picture: 200,
    filmed: [200, 300],
    settings: &[
        ("schedule.steps", "12"),
        ("schedule.pretraining_steps", "20"),
        ("schedule.checkpoint_steps", "10"),
        ("sampling.points", "600"),
    ],
};

/// Why a baseline without learning can win here.
const BASELINE_NOTE: &str = "bare hands are the body model's own, so SMPLX+D is exact there, as on no real subject";

impl Demo {
    pub fn run(self) -> anyhow::Result<Outcome> {
        let size = if self.smoke { &SMOKE } else { &FULL };
        if let Some(folder) = &self.write_data {
            let frames = match self.frames.map(|frames| frames as usize) {
                Some(frames) => (frames, frames.div_ceil(5)),
                None => (size.training_frames, size.unseen_frames),
            };
            return write_data(folder, frames);
        }
        self.json.check()?;
        let resumes = self.resumes()?;
        let subject = BuiltInSubject::new()?;
        let scans = subject.film(Split::Train, size.training_frames)?;
        let table = Turntable { size: size.filmed, steps_per_turn: size.training_frames as u32 };
        let pictures = if self.rgbd { Some(FilmedScans::new(&scans, table)?) } else { None };
        let source: &dyn Source = match &pictures {
            Some(pictures) => pictures,
            None => &scans,
        };
        let stop = stop::on_interrupt()?;
        let (body, labels) = (subject.model(), subject.part_labels());
        let mut progress = Progress::new();
        let config = if resumes {
            log::info!("going on with the demo in {}", self.out.display());
            Run::configuration(&self.out)?
        } else {
            let settings = size.settings.iter().map(|(key, value)| (key.to_string(), value.to_string()));
            Config::preset_with(self.preset(), &settings.collect::<Vec<_>>())?
        };
        let run = Run::open(&self.out, TrainingSpec { config: &config, source, body, labels })?;
        if let Some(pictures) = &pictures {
            write_png(self.out.join("pictures.png"), &sheet_of_pictures(pictures, size.picture)?)?;
        }
        let shown = match run.train(stop, &mut progress)? {
            Ending::Finished => self.show(&run.avatar()?, &subject, &scans, size, stop, &mut progress)?,
            Ending::Stopped => Ending::Stopped,
        };
        match shown {
            Ending::Finished => Ok(Outcome::Done),
            Ending::Stopped => {
                progress.finish();
                log::info!("stopped; the same command again goes on");
                Ok(Outcome::Stopped)
            }
        }
    }

    fn preset(&self) -> &'static str {
        if self.rgbd { "demo-rgbd" } else { "demo" }
    }

    /// Written last: its presence says that the demo is complete.
    fn metrics_file(&self) -> PathBuf {
        self.out.join("metrics.json")
    }

    /// Whether the folder has a demo that was stopped; it must be new otherwise.
    fn resumes(&self) -> anyhow::Result<bool> {
        if files::is_new_or_empty(&self.out)? {
            return Ok(false);
        }
        let config = self.out.join("config.toml");
        if self.metrics_file().exists() || !config.exists() || Config::read(&config)?.preset != self.preset() {
            bail!("{}: the folder is not empty; remove it, or give another --out", self.out.display());
        }
        Ok(true)
    }

    /// Meshes, metrics and pictures of poses that were not trained on.
    fn show(
        &self,
        avatar: &Avatar,
        subject: &BuiltInSubject,
        scans: &FilmedTake,
        size: &Size,
        stop: &AtomicBool,
        progress: &mut Progress,
    ) -> anyhow::Result<Ending> {
        let meshes = self.out.join("meshes");
        files::existing_folder(&meshes)?;
        let unseen = subject.film(Split::Test, size.unseen_frames)?;
        let animator = Animator::new(avatar, subject.model(), subject.part_labels())?;
        let mut gallery = Gallery::new(size.picture);
        let mut posed: Vec<TriangleMesh> = Vec::new();
        for (index, frame) in unseen.frames().iter().enumerate() {
            if stop.load(Ordering::Relaxed) {
                return Ok(Ending::Stopped);
            }
            let share = index as f64 / (unseen.frames().len() + 1) as f64;
            progress.show("meshes", share, &format!("unseen pose {}", index + 1));
            let mesh = animator.extract(&subject.model().resolve(&frame.parameters)?, size.resolution)?.mesh;
            write_ply(meshes.join(format!("unseen-f{:05}.ply", frame.id.number)), &mesh)?;
            gallery.add_pose(&frame.scan, &mesh);
            posed.push(mesh);
        }
        let canonical = subject.model().skeleton().canonical_pose(subject.betas());
        let canonical = avatar.extract_canonical(&canonical, size.resolution)?.mesh;
        write_ply(meshes.join("canonical.ply"), &canonical)?;
        let picture = self.out.join("demo.png");
        let sheet = gallery.write(&canonical, &picture)?;

        progress.show("metrics", 0.0, "measuring");
        let baseline = SmplxD::fit(subject.model(), scans.frames().iter().cloned().map(Ok))?;
        let evaluation = Evaluation {
            body: subject.model(),
            labels: subject.part_labels(),
            baseline: Some(&baseline),
            regions: false,
            pictures: false,
            samples: size.samples,
            seed: 0,
        };
        // Frames of one take are numbered from 1 in order.
        let predict = |frame: &ScanFrame| Ok(posed[frame.id.number as usize - 1].clone());
        let measured = evaluation.run(unseen.frames().iter().cloned().map(Ok), |frame, _| predict(frame), |_| {})?;
        progress.finish();
        let shown = report::best_and_worst(&measured, |name| {
            let frame = unseen.frames().iter().find(|frame| frame.id.to_string() == name);
            let frame = frame.context("a frame that was just measured is gone")?;
            Ok((frame.clone(), predict(frame)?))
        })?;
        let page = self.out.join(REPORT_FILE);
        Report {
            title: report::title(&self.out),
            command: report::command_line(),
            avatar,
            rig: dancing_rig(avatar, subject.model())?.as_ref(),
            run: Some(&self.out),
            evaluation: Some((&measured, "in poses that were not trained on".into())),
            frames: shown,
            pictures: vec![sheet],
            facts: [vec![Fact::new("Data", format!("the built-in subject; its {BASELINE_NOTE}"))], machine()].concat(),
        }
        .write(&page)?;
        files::write_json(&self.metrics_file(), &measured)?;
        let table = format!(
            "{} poses that were not trained on, against the subject's own surface\n{measured}\
             the subject's {BASELINE_NOTE}\n\
             report   {}\npictures {}\nmeshes   {}\nmetrics  {}\navatar   {}",
            posed.len(),
            page.display(),
            picture.display(),
            meshes.display(),
            self.metrics_file().display(),
            self.out.join(Avatar::FILE).display()
        );
        self.json.print(&measured, &table)?;
        Ok(Ending::Finished)
    }
}

/// Writes the subject so that the other verbs can be tried on it.
fn write_data(folder: &Path, (training, unseen): (usize, usize)) -> anyhow::Result<Outcome> {
    files::new_folder(folder, "give a new one")?;
    BuiltInSubject::new()?.write_data(folder, training, unseen)?;
    let body = folder.join(BuiltInSubject::BODY_FOLDER);
    let (data, body) = (folder.display(), body.display());
    files::print(&format!("{data}\n"))?;
    log::info!(
        "try next\n  xavatar check {data} --body {body}\n  xavatar train {data} --body {body} --out runs/mannequin --minutes 5"
    );
    Ok(Outcome::Done)
}
