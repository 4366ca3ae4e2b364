//! `xavatar train`: from a subject's scans or RGB-D frames to an avatar, in a run folder that can be resumed.

mod watched;

use std::path::PathBuf;

use anyhow::bail;
use xavatar::avatar::Avatar;
use xavatar::config::Config;
use xavatar::report::{REPORT_FILE, Report, dancing_rig, machine};
use xavatar::runs::{Ending, Run};

use crate::cli::options::captured::{Captured, Kind};
use crate::cli::options::inputs::{AcceptArguments, SubjectArguments};
use crate::cli::options::training::TrainingArguments;
use crate::cli::output::progress::Progress;
use crate::cli::output::{files, report};
use crate::cli::verbs::register::registered_first;
use crate::cli::{Outcome, WrongUsage, stop, wrong_usage};

/// Train an avatar from a subject's scans, or from the pictures of an RGB-D camera
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar train data/00016 --body models/smplx --out runs/00016 --minutes 30\n  \
    xavatar train data/00016 --body models/smplx --out runs/00016 --resume\n  \
    xavatar train data/00016 --body models/smplx --from rgbd --out runs/rgbd --minutes 10\n  \
    xavatar train data/00016 --body models/smplx --out runs/00016 --view\n  \
    xavatar train data/00016 --body models/smplx --out runs/slow --set optimiser.learning_rate=3e-4\n\n\
    Ctrl-C stops after the step, saves, and says how to go on.")]
pub struct Train {
    #[command(flatten)]
    subject: SubjectArguments,
    /// The run's folder: new or empty, unless it is resumed
    #[arg(long, value_name = "RUN")]
    out: PathBuf,
    /// What to learn from [default: scans; RGB-D where there are no scans]
    #[arg(long, value_enum, value_name = "KIND")]
    from: Option<Kind>,
    /// Where scans or pictures have no bodies: MediaPipe's package, as for `register`
    #[arg(long, value_name = "PACKAGE")]
    models: Option<PathBuf>,
    #[command(flatten)]
    training: TrainingArguments,
    #[command(flatten)]
    accepted: AcceptArguments,
    /// Serve a page with losses, previews and the avatar as it is, to this machine, while training goes on [default port: 8383]
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, default_missing_value = "8383")]
    view: Option<u16>,
    /// Go on with the run in RUN from its newest checkpoint
    #[arg(long)]
    resume: bool,
}

impl Train {
    pub fn run(mut self) -> anyhow::Result<Outcome> {
        let (config, kind) = if self.resume {
            let config = self.configuration_of_run()?;
            let kind = Kind::of_run(&config);
            (config, kind)
        } else {
            let kind = Kind::of(&self.subject, self.from);
            (self.new_configuration(kind)?, kind)
        };
        match registered_first(&self.subject, kind, &self.out, self.models.take())? {
            Some(data) => self.subject.data = data,
            None => return Ok(Outcome::Stopped),
        }
        let opened = Captured::open(&self.subject, kind)?;
        let stop = stop::on_interrupt()?;
        let mut progress = Progress::new();
        log::info!("part labels: {}", opened.labels.source);
        let source = opened.checked(&self.accepted);
        let run = Run::open(&self.out, opened.spec(&config, &source))?;
        let ending = match self.view {
            Some(port) => watched::train(&run, &opened.body, port, stop, &mut progress)?,
            None => run.train(stop, &mut progress)?,
        };
        progress.finish();
        let (data, body, out) = (self.subject.data.display(), self.subject.body.display(), self.out.display());
        if ending == Ending::Stopped {
            log::info!("stopped; go on with\n  xavatar train {data} --body {body} --out {out} --resume");
            return Ok(Outcome::Stopped);
        }
        stop::set_training(false);
        files::print(&format!("{}\n", self.out.join(Avatar::FILE).display()))?;
        let report = self.write_report(&run.avatar()?, &opened)?;
        log::info!("report: {}", report.display());
        log::info!(
            "try next\n  xavatar eval {out} {data} --body {body} --split test --baseline smplx+d\n  \
             xavatar extract {out} --out canonical.ply\n  \
             xavatar animate {out} {data}/test/SEQUENCE --body {body} --out {out}/animation"
        );
        Ok(Outcome::Done)
    }

    fn write_report(&self, avatar: &Avatar, opened: &Captured) -> anyhow::Result<PathBuf> {
        let path = self.out.join(REPORT_FILE);
        let rig = dancing_rig(avatar, &opened.body)?;
        Report {
            title: report::title(&self.out),
            command: report::command_line(),
            avatar,
            rig: rig.as_ref(),
            run: Some(&self.out),
            evaluation: None,
            frames: Vec::new(),
            pictures: Vec::new(),
            facts: [report::data_facts(&self.subject, &opened.body, &opened.labels), machine()].concat(),
        }
        .write(&path)?;
        Ok(path)
    }

    fn new_configuration(&self, kind: Kind) -> anyhow::Result<Config> {
        let preset = kind.preset(self.training.preset());
        let config = Config::preset_with(preset, &self.training.settings()).map_err(WrongUsage::from)?;
        if !files::is_new_or_empty(&self.out)? {
            bail!(
                "{}: the folder is not empty; give a new --out, or --resume to go on with the run in it",
                self.out.display()
            );
        }
        Ok(config)
    }

    /// The run's own. Settings other than those that it was started with are refused: they would have no effect.
    fn configuration_of_run(&self) -> anyhow::Result<Config> {
        let run = Run::configuration(&self.out)?;
        let kind = Kind::of_run(&run);
        if self.from.is_some_and(|from| from != kind) {
            wrong_usage!(
                "{}: the run was started from other frames; leave --from away to resume it",
                self.out.display()
            );
        }
        let named = self.training.preset.as_deref().map(|preset| kind.preset(preset));
        if let Some(preset) = named.filter(|preset| *preset != run.preset) {
            wrong_usage!("{}: the run has the preset {}, not {preset}", self.out.display(), run.preset);
        }
        let asked = Config::preset_with(&run.preset, &self.training.settings()).map_err(WrongUsage::from)?;
        let (settled, asked) = (run.to_toml()?.parse()?, asked.to_toml()?.parse()?);
        for (key, _) in self.training.settings() {
            let (found, wanted) = (value_of(&settled, &key), value_of(&asked, &key));
            if let Some((found, wanted)) = found.zip(wanted).filter(|(found, wanted)| found != wanted) {
                wrong_usage!(
                    "{}: the run was started with {key} = {found}, not {wanted}; leave it away to resume, or start a new run",
                    self.out.display()
                );
            }
        }
        Ok(run)
    }
}

fn value_of<'a>(table: &'a toml::Table, key: &str) -> Option<&'a toml::Value> {
    let (first, rest) = key.split_once('.').map_or((key, None), |(first, rest)| (first, Some(rest)));
    match (table.get(first)?, rest) {
        (toml::Value::Table(inner), Some(rest)) => value_of(inner, rest),
        (value, None) => Some(value),
        _ => None,
    }
}
