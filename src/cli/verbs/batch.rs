//! `xavatar batch`: many subjects from one manifest, as independent jobs of whatever starts processes.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use clap::ValueEnum;
use xavatar::cohort::emit::{kubernetes_job, slurm_script};
use xavatar::cohort::{
    INDEX_FILE, Manifest, Shard, Stage, SubjectFolder, Summary, TABLE_FILES, Watcher, Worked, work_on,
};
use xavatar::runs::{Event, Observer};

use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;
use crate::cli::{Outcome, WrongUsage, stop};

/// Register, train, measure and export many subjects, each an independent job
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar batch study.toml\n  \
    xavatar batch study.toml --emit slurm > study.sh && sbatch study.sh\n  \
    xavatar batch study.toml --status\n  \
    xavatar batch study.csv --shard 3/20\n\n\
    docs/batch.md says what a manifest holds. Subjects that are done, or that another process works on, are skipped; a subject that was\n\
    stopped is gone on with. Ctrl-C, TERM and USR1 save the training and exit with 3: the same call goes on. The exit code is 1 if a\n\
    subject failed, after all others were worked on.")]
pub struct Batch {
    /// The subjects and what is done with them, TOML or CSV
    #[arg(value_name = "MANIFEST")]
    manifest: PathBuf,
    /// Only share I of N, from 0 [default: the subject of SLURM_ARRAY_TASK_ID or JOB_COMPLETION_INDEX; all where there is neither]
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Say how far the subjects are, and do nothing
    #[arg(long, conflicts_with_all = ["shard", "emit"])]
    status: bool,
    /// Print a job for a scheduler, one task a subject, and do nothing
    #[arg(long, value_enum, conflicts_with = "shard")]
    emit: Option<Scheduler>,
    #[command(flatten)]
    json: JsonArgument,
}

/// Whose job is printed.
#[derive(Clone, Copy, ValueEnum)]
enum Scheduler {
    /// A script with an array job, for sbatch
    Slurm,
    /// An Indexed Job, for kubectl apply
    Kubernetes,
}

impl Batch {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        let manifest = Manifest::read(&self.manifest)?;
        if let Some(scheduler) = self.emit {
            let job = match scheduler {
                Scheduler::Kubernetes => kubernetes_job(&manifest),
                Scheduler::Slurm => {
                    slurm_script(&manifest, &std::env::current_exe()?, &std::path::absolute(&self.manifest)?)
                }
            };
            files::print(&job)?;
            return Ok(Outcome::Done);
        }
        if self.status {
            let summary = Summary::of(&manifest)?;
            self.json.print(&summary, &summary)?;
            return Ok(Outcome::Done);
        }
        self.work(&manifest)
    }

    fn work(&self, manifest: &Manifest) -> anyhow::Result<Outcome> {
        let shard = self.shard(manifest)?;
        let stop = stop::on_interrupt()?;
        let (mut failed, mut is_complete) = (false, true);
        let mine = manifest.subjects.iter().enumerate().filter(|(place, _)| shard.has(*place)).map(|(_, plan)| plan);
        for plan in mine {
            if stop.load(Ordering::Relaxed) {
                is_complete = false;
                break;
            }
            let name = &plan.name;
            let mut watching = Watching { name, progress: Progress::new() };
            let worked = work_on(plan, &SubjectFolder::new(&manifest.out, plan), stop, &mut watching);
            stop::set_training(false);
            watching.progress.finish();
            match worked {
                Ok(Worked::Done) => log::info!("{name}: done"),
                Ok(Worked::Already) => log::info!("{name}: done by an earlier call"),
                Ok(Worked::InUse(holder)) => {
                    log::info!("{name}: left to {holder}");
                    is_complete = false;
                }
                Ok(Worked::Stopped) => {
                    is_complete = false;
                    break;
                }
                Err(error) => {
                    log::error!("{name}: {error}");
                    failed = true;
                }
            }
        }
        let summary = Summary::write(manifest)?;
        let files = TABLE_FILES.iter().chain([&INDEX_FILE]).map(|file| manifest.out.join(file).display().to_string());
        self.json.print(&summary, &format!("{summary}\n{}\n", files.collect::<Vec<_>>().join("\n")))?;
        Ok(match (is_complete, failed) {
            (false, _) => {
                log::info!("the same call goes on with what is not done");
                Outcome::Stopped
            }
            (true, true) => Outcome::Unfit,
            (true, false) => Outcome::Done,
        })
    }

    fn shard(&self, manifest: &Manifest) -> anyhow::Result<Shard> {
        if let Some(shard) = self.shard {
            return Ok(shard);
        }
        let task = Shard::of_task(manifest.subjects.len(), |name| std::env::var(name).ok());
        let Some((shard, variable)) = task.map_err(|error| WrongUsage(error.into()))? else { return Ok(Shard::ALL) };
        log::info!("share {shard} of the subjects, by {variable}");
        Ok(shard)
    }
}

/// Shows how far a subject is.
struct Watching<'a> {
    name: &'a str,
    progress: Progress,
}

impl Observer for Watching<'_> {
    fn event(&mut self, event: Event<'_>) {
        self.progress.event(event);
    }
}

impl Watcher for Watching<'_> {
    fn stage(&mut self, stage: Stage) {
        stop::set_training(false);
        log::info!("{}: {}", self.name, stage.name());
    }

    fn phase(&mut self, phase: &'static str, share: f64, message: &str) {
        self.progress.show(phase, share, message);
    }

    fn put_aside(&mut self, folder: PathBuf) {
        log::warn!(
            "{}: its data or settings have changed; what was made of those before is kept in {}",
            self.name,
            Path::new(&folder).display()
        );
    }
}
