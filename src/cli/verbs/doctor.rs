//! `xavatar doctor`: what this machine has, and whether the program is as fast on it as it should be.

use std::fmt;

use serde::Serialize;
use xavatar::doctor::{Facts, Figure, OptionalProgram, optional_programs, self_test};

use crate::cli::Outcome;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;

/// Say what this machine has and how fast it is: instructions, threads, memory, other programs, and a ten-second self-test
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  xavatar doctor\n  xavatar doctor --threads 1 --json doctor.json")]
pub struct Doctor {
    #[command(flatten)]
    json: JsonArgument,
}

/// What was found. `Display` is for people, serde for scripts.
#[derive(Serialize)]
struct Findings {
    version: &'static str,
    machine: Facts,
    programs: Vec<OptionalProgram>,
    figures: Vec<Figure>,
}

impl Doctor {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        let machine = Facts::of_this_machine();
        if !machine.optimised {
            log::warn!("built without optimisation: some twenty times slower than `cargo build --release`");
        }
        let mut progress = Progress::new();
        let figures = self_test(&mut |share, next| progress.show("self-test", share, next))?;
        progress.finish();
        let findings = Findings { version: env!("CARGO_PKG_VERSION"), machine, programs: optional_programs(), figures };
        self.json.print(&findings, &findings)?;
        Ok(Outcome::Done)
    }
}

impl fmt::Display for Findings {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Facts { processor, features, pass_instructions, product_instructions, .. } = &self.machine;
        let Facts { threads, available_threads, memory_bytes, free_memory_bytes, .. } = &self.machine;
        let gibibytes = |bytes: &Option<u64>| match bytes {
            Some(bytes) => format!("{:.1} GiB", *bytes as f64 / (1u64 << 30) as f64),
            None => "unknown".into(),
        };
        writeln!(formatter, "xavatar {}", self.version)?;
        writeln!(formatter, "processor        {}", processor.as_deref().unwrap_or("unknown"))?;
        writeln!(formatter, "instructions     {}", features.join(" "))?;
        writeln!(formatter, "  in products    {product_instructions}")?;
        writeln!(formatter, "  in passes      {pass_instructions}")?;
        writeln!(formatter, "threads          {threads} of {available_threads}")?;
        writeln!(formatter, "memory           {}, {} free", gibibytes(memory_bytes), gibibytes(free_memory_bytes))?;
        writeln!(formatter, "\nother programs; nothing but what is said needs them")?;
        for OptionalProgram { name, purpose, path } in &self.programs {
            let path = path.as_ref().map_or_else(|| "not found".into(), |path| path.display().to_string());
            writeln!(formatter, "  {name:<14} {path:<28} {purpose}")?;
        }
        writeln!(formatter, "\n{:<38} {:>10} {:>12}", "self-test", "here", "documented")?;
        for Figure { name, unit, measured, documented } in &self.figures {
            let documented = documented.map_or_else(|| "-".into(), number);
            writeln!(formatter, "  {name:<36} {:>10} {documented:>12}  {unit}", number(*measured))?;
        }
        writeln!(formatter, "docs/performance.md says on which machine, and what else there is to measure")
    }
}

/// Three digits, or whole thousands.
fn number(value: f64) -> String {
    match value {
        value if value >= 1000.0 => format!("{:.0}", value),
        value if value >= 10.0 => format!("{value:.1}"),
        value => format!("{value:.2}"),
    }
}
