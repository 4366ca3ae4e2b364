//! What a verb says while it works: lines on stderr, for people or, with `--log-format json`, for programs.
//!
//! Verbs and library speak through the macros of the `log` crate: `info!` for what helps, `warn!` for what may be wrong, `error!`
//! for what ended the command. `--quiet` leaves the last two. Results are not said but printed, on stdout.

use std::sync::{LazyLock, OnceLock};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::anyhow;
use indicatif::{MultiProgress, ProgressDrawTarget};
use log::{Level, LevelFilter, Log, Metadata, Record};
use serde::Serialize;
use xavatar::formats::harmless;

/// How lines are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// Lines to read
    #[default]
    Text,
    /// One JSON object a line
    Json,
}

/// What the command line asks of everything that is said.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub struct LogArguments {
    /// Say nothing but warnings and errors
    #[arg(long, short, global = true)]
    quiet: bool,
    /// How progress, warnings and errors are written to stderr
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t = LogFormat::Text, global = true)]
    log_format: LogFormat,
}

static ASKED: OnceLock<LogArguments> = OnceLock::new();

/// The bars on the terminal: lines are written above them. Draws nothing where stderr is not a terminal.
pub static BARS: LazyLock<MultiProgress> = LazyLock::new(|| {
    let LogArguments { quiet, log_format } = asked();
    if quiet || log_format == LogFormat::Json {
        MultiProgress::with_draw_target(ProgressDrawTarget::hidden())
    } else {
        MultiProgress::new()
    }
});

/// Starts logging as the command line asks, once a process.
pub fn start(arguments: LogArguments) -> anyhow::Result<()> {
    if ASKED.set(arguments).is_ok() {
        log::set_max_level(if arguments.quiet { LevelFilter::Warn } else { LevelFilter::Info });
        log::set_logger(&Stderr).map_err(|error| anyhow!("{error}"))?;
    }
    Ok(())
}

/// A line about work under way, for those who do not see the bar.
#[derive(Serialize)]
pub struct ProgressLine<'a> {
    pub phase: &'a str,
    /// Share of the phase that is done, 0 to 1.
    pub share: f64,
    /// Estimated, until the phase ends.
    pub seconds_left: Option<f64>,
    pub message: &'a str,
}

/// Writes a line of progress, unless `--quiet`.
pub fn progress(line: &ProgressLine<'_>) {
    match asked() {
        LogArguments { quiet: true, .. } => {}
        LogArguments { log_format: LogFormat::Json, .. } => write_json("progress", line),
        LogArguments { log_format: LogFormat::Text, .. } => {
            let left = line.seconds_left.map(std::time::Duration::from_secs_f64);
            let left = left.map_or_else(String::new, |left| format!("  ETA {}", indicatif::HumanDuration(left)));
            write(&format!("{:>10} {:3.0} %  {}{left}", line.phase, line.share * 100.0, line.message));
        }
    }
}

fn asked() -> LogArguments {
    ASKED.get().copied().unwrap_or_default()
}

struct Stderr;

impl Log for Stderr {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        // What other crates have to say is for their developers.
        metadata.target().starts_with("xavatar") && metadata.level() <= log::max_level()
    }

    fn log(&self, record: &Record<'_>) {
        #[derive(Serialize)]
        struct Message {
            message: String,
        }
        if !self.enabled(record.metadata()) {
            return;
        }
        let message = record.args().to_string();
        match (asked().log_format, record.level()) {
            (LogFormat::Json, level) => write_json(kind_of(level), &Message { message }),
            (LogFormat::Text, Level::Error) => write(&format!("error: {message}")),
            (LogFormat::Text, Level::Warn) => write(&format!("warning: {message}")),
            (LogFormat::Text, _) => write(&message),
        }
    }

    fn flush(&self) {}
}

fn kind_of(level: Level) -> &'static str {
    match level {
        Level::Error => "error",
        Level::Warn => "warning",
        Level::Info | Level::Debug | Level::Trace => "info",
    }
}

fn write_json(kind: &str, content: &impl Serialize) {
    #[derive(Serialize)]
    struct Line<'a, C> {
        /// Seconds since 1970.
        time: f64,
        kind: &'a str,
        #[serde(flatten)]
        content: &'a C,
    }
    let time = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |time| time.as_millis() as f64 / 1e3);
    if let Ok(line) = serde_json::to_string(&Line { time, kind, content }) {
        write(&line);
    }
}

/// Writes to stderr, so that `--quiet` and `--log-format` hold for all that is said, and no file's control characters reach the
/// terminal.
#[allow(clippy::print_stderr, reason = "the one place that writes to stderr: `super` denies it elsewhere")]
fn write(text: &str) {
    let text = harmless(text);
    BARS.suspend(|| eprintln!("{text}"));
}
