//! `xavatar eval`: an avatar against the scans of held-out frames.

use std::path::PathBuf;

use anyhow::Context;
use clap::ValueEnum;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use xavatar::avatar::{Animator, Avatar};
use xavatar::body::Pose;
use xavatar::data::{ScanFrame, Source};
use xavatar::evaluate::{Evaluation, SmplxD};
use xavatar::report::{REPORT_FILE, Report, dancing_rig, machine};

use crate::cli::Outcome;
use crate::cli::options::inputs::{Split, SubjectArguments};
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;
use crate::cli::output::{files, report};

/// Measure an avatar against the scans of unseen frames
#[derive(clap::Args)]
#[command(after_help = "Example:\n  \
    xavatar eval runs/00016 data/00016 --body models/smplx --split test --baseline smplx+d --json metrics.json")]
pub struct Eval {
    /// A run's folder or an avatar.safetensors
    #[arg(value_name = "RUN_OR_AVATAR")]
    avatar: PathBuf,
    #[command(flatten)]
    subject: SubjectArguments,
    /// Which frames
    #[arg(long, value_enum, default_value_t = Split::Test)]
    split: Split,
    /// Measure a baseline on the same frames, learned from the training frames
    #[arg(long, value_enum)]
    baseline: Option<Baseline>,
    /// Tell feet, legs, torso, arms, head, hands, face and what is farther than 3 cm from the body apart
    #[arg(long)]
    regions: bool,
    /// Fit each frame's pose to its scan by the avatar first: what is left is not the registration's
    #[arg(long)]
    refine_pose: bool,
    /// Compare pictures too, from four sides: PSNR and SSIM of the whole body, hands and face
    #[arg(long)]
    pictures: bool,
    /// Cells along the longest side of the box around the body; with 256, the cells themselves add to the error of face and hands
    #[arg(long, value_name = "R", default_value_t = 512, value_parser = crate::cli::options::meshes::resolution)]
    resolution: usize,
    /// Write a page with metrics, pictures and the avatar to play with here [default: report.html in the run's folder, anew]
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgument,
}

#[derive(Clone, Copy, ValueEnum)]
enum Baseline {
    /// The registered body with the mean offset of each vertex
    #[value(name = "smplx+d")]
    SmplxD,
}

impl Eval {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        if let Some(page) = &self.report {
            files::new_file(page)?;
        }
        let avatar = Avatar::load(&self.avatar)?;
        let opened = self.subject.open()?;
        let subject = &opened.subject;
        let frames = subject.frames(self.split.into());
        let baseline = match self.baseline {
            Some(Baseline::SmplxD) => {
                log::info!("learning the baseline from {} training frames", subject.train.len());
                Some(SmplxD::fit(&opened.body, subject.training_frames().iter())?)
            }
            None => None,
        };
        let evaluation = Evaluation {
            body: &opened.body,
            labels: &opened.labels,
            baseline: baseline.as_ref(),
            regions: self.regions,
            pictures: self.pictures,
            samples: Evaluation::SAMPLES,
            seed: 0,
        };
        let animator = Animator::new(&avatar, &opened.body, &opened.labels)?;
        let mut progress = Progress::new();
        let (mut done, total) = (0, frames.ids().len());
        let predict = |frame: &ScanFrame, pose: &Pose| {
            let pose = match self.refine_pose {
                true => animator.fitted(&frame.scan, pose, &mut ChaCha8Rng::seed_from_u64(0))?.pose,
                false => pose.clone(),
            };
            Ok::<_, xavatar::Error>(animator.extract(&pose, self.resolution)?.mesh)
        };
        let measured = evaluation.run(frames.iter(), predict, |frame| {
            done += 1;
            let distance = frame.metrics.all.map_or_else(String::new, |all| format!("  CD {:.2} mm", all.cd_mm));
            progress.show("frames", f64::from(done) / total as f64, &format!("{}{distance}", frame.frame));
        })?;
        progress.finish();
        self.json.print(&measured, &measured)?;
        let Some(page) = self.page() else { return Ok(Outcome::Done) };
        let shown = report::best_and_worst(&measured, |name| {
            let place = frames.place(name).context("a frame that was just measured is gone")?;
            let frame = frames.scan(place)?;
            let mesh = predict(&frame, &opened.body.resolve(&frame.parameters)?)?;
            Ok((frame, mesh))
        })?;
        let rig = dancing_rig(&avatar, &opened.body)?;
        Report {
            title: report::title(&self.avatar),
            command: report::command_line(),
            avatar: &avatar,
            rig: rig.as_ref(),
            run: self.avatar.is_dir().then_some(&self.avatar),
            evaluation: Some((&measured, format!("of the {} split", self.split.name()))),
            frames: shown,
            pictures: Vec::new(),
            facts: [report::data_facts(&self.subject, &opened.body, &opened.labels), machine()].concat(),
        }
        .write(&page)?;
        log::info!("report: {}", page.display());
        Ok(Outcome::Done)
    }

    /// Where the page goes: as asked, or into the run's folder; a lone avatar gets none unasked.
    fn page(&self) -> Option<PathBuf> {
        self.report.clone().or_else(|| self.avatar.is_dir().then(|| self.avatar.join(REPORT_FILE)))
    }
}
