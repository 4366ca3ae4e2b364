//! The command line: `verbs`, the `options` that several of them take, and what they put out (`output`).
//!
//! Results go to stdout, progress and errors to stderr (see `output`). Exit codes: 0 done, 1 failed, 2 wrong usage, 3 stopped but resumable.

// What is said goes through `log`'s macros, so that --quiet and --log-format hold for it; results through `output::files::print`. Both
// let nothing pass that steers a terminal, whatever file it came from.
#![deny(clippy::print_stderr, clippy::print_stdout)]

mod options;
mod output;
mod stop;
mod verbs;

use std::borrow::Cow;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use xavatar::formats::Choice;
use xavatar::{Error, InputError};

const EXIT_FAILED: u8 = 1;
const EXIT_WRONG_USAGE: u8 = 2;
const EXIT_STOPPED: u8 = 3;

/// Animatable avatars from 3D scans: train, measure, pose and export them.
#[derive(Parser)]
#[command(
    name = "xavatar",
    version,
    after_help = "Start here:\n  xavatar demo\n\nExit codes: 0 done, 1 failed, 2 wrong usage, 3 stopped but resumable."
)]
struct CommandLine {
    #[command(subcommand)]
    verb: Verb,
    /// Threads to compute with [default: one a core]
    #[arg(long, value_name = "T", global = true, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    #[command(flatten)]
    log: output::messages::LogArguments,
}

#[derive(Subcommand)]
enum Verb {
    Demo(verbs::demo::Demo),
    Check(verbs::check::Check),
    Register(verbs::register::Register),
    Mocap(verbs::mocap::Mocap),
    Train(verbs::train::Train),
    Eval(verbs::eval::Eval),
    Batch(verbs::batch::Batch),
    Ablate(verbs::ablate::Ablate),
    Fuse(verbs::fuse::Fuse),
    Extract(verbs::extract::Extract),
    Animate(verbs::animate::Animate),
    Render(verbs::render::Render),
    Export(verbs::export::Export),
    Convert(verbs::convert::Convert),
    Body(verbs::body::Body),
    Info(verbs::info::Info),
    Doctor(verbs::doctor::Doctor),
    #[command(name = "pointcloud")]
    PointCloud(verbs::pointcloud::PointCloudOf),
    View(verbs::view::View),
    RenderRgbd(verbs::render_rgbd::RenderRgbd),
    RenderDataset(verbs::render_dataset::RenderDataset),
    Completions(verbs::completions::Completions),
    Man(verbs::man::Manual),
}

/// How a verb that did not fail ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Done,
    /// The data was looked at as asked, and is not good enough.
    Unfit,
    /// The user stopped it; it can be resumed.
    Stopped,
}

/// The arguments contradict each other, or ask for what there is not, which only shows when the work begins.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
struct WrongUsage(#[from] anyhow::Error);

impl From<xavatar::Error> for WrongUsage {
    fn from(error: xavatar::Error) -> Self {
        Self(error.into())
    }
}

/// Ends the verb with wrong usage, in the words of `format!`.
macro_rules! wrong_usage {
    ($($words:tt)*) => { return Err($crate::cli::WrongUsage(anyhow::anyhow!($($words)*)).into()) };
}
use wrong_usage;

/// Runs the command that the arguments ask for.
pub fn main() -> ExitCode {
    let command_line = CommandLine::parse();
    match run(command_line) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Unfit) => EXIT_FAILED.into(),
        Ok(Outcome::Stopped) => EXIT_STOPPED.into(),
        Err(error) => {
            log::error!("{}{}", message(&error), advice(&error));
            if error.is::<WrongUsage>() { EXIT_WRONG_USAGE } else { EXIT_FAILED }.into()
        }
    }
}

/// The error and its causes, each once: many messages quote their cause already.
fn message(error: &anyhow::Error) -> String {
    let mut message = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !message.contains(&cause) {
            message = format!("{message}: {cause}");
        }
    }
    message
}

/// The option that does what the error's remedy says, where this program has one.
fn advice(error: &anyhow::Error) -> String {
    let choice_of = |cause: &(dyn std::error::Error + 'static)| match cause.downcast_ref::<Error>() {
        Some(error) => error.choice(),
        None => cause.downcast_ref::<InputError>()?.remedy()?.choice(),
    };
    error.chain().find_map(choice_of).map_or_else(String::new, |choice| format!(" ({})", option(choice)))
}

/// What this program calls a choice.
fn option(choice: Choice) -> Cow<'static, str> {
    match choice {
        Choice::SkipBadFrames => "--skip-bad-frames".into(),
        Choice::ContinueRun => "--resume".into(),
        Choice::StartRun => "the same command without --resume".into(),
        Choice::Accept(defect) => format!("--accept {defect}").into(),
        Choice::RecordPlacement => "--fix".into(),
        Choice::CheckData => "xavatar check".into(),
        Choice::BoneMap => "--bones map.toml".into(),
        Choice::UpAxis => "--up, --from camera".into(),
        Choice::FrameRate => "--source-fps".into(),
        Choice::LearningRate => "--set optimiser.learning_rate=...".into(),
    }
}

fn run(command_line: CommandLine) -> anyhow::Result<Outcome> {
    output::messages::start(command_line.log)?;
    if let Some(threads) = command_line.threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global()?;
    }
    match command_line.verb {
        Verb::Demo(verb) => verb.run(),
        Verb::Check(verb) => verb.run(),
        Verb::Register(verb) => verb.run(),
        Verb::Mocap(verb) => verb.run(),
        Verb::Train(verb) => verb.run(),
        Verb::Eval(verb) => verb.run(),
        Verb::Batch(verb) => verb.run(),
        Verb::Ablate(verb) => verb.run(),
        Verb::Fuse(verb) => verb.run(),
        Verb::Extract(verb) => verb.run(),
        Verb::Animate(verb) => verb.run(),
        Verb::Render(verb) => verb.run(),
        Verb::Export(verb) => verb.run(),
        Verb::Convert(verb) => verb.run(),
        Verb::Body(verb) => verb.run(),
        Verb::Info(verb) => verb.run(),
        Verb::Doctor(verb) => verb.run(),
        Verb::PointCloud(verb) => verb.run(),
        Verb::View(verb) => verb.run(),
        Verb::RenderRgbd(verb) => verb.run(),
        Verb::RenderDataset(verb) => verb.run(),
        Verb::Completions(verb) => verb.run(&mut CommandLine::command()),
        Verb::Man(verb) => verb.run(CommandLine::command()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_commands_are_consistent_and_each_shows_an_example() {
        let mut command = CommandLine::command();
        command.build();
        command.clone().debug_assert();
        for verb in command.get_subcommands().filter(|verb| verb.get_name() != "help") {
            let example = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(example.contains(&format!("xavatar {}", verb.get_name())), "{}", verb.get_name());
        }
    }
}
