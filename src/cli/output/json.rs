//! `--json`: what a verb's table or figures say, for scripts. The same option with the same meaning on every verb that prints some.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::cli::output::files;

/// Where a verb's result goes as JSON.
#[derive(Default, clap::Args)]
pub struct JsonArgument {
    /// Write what is printed as JSON to FILE, too; `-` prints it instead
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl JsonArgument {
    /// Checks, before the work, that the file can be written.
    pub fn check(&self) -> anyhow::Result<()> {
        self.file().map_or(Ok(()), files::new_file)
    }

    /// Prints a result as asked: as a table, as JSON, or the one on stdout and the other in a file.
    pub fn print(&self, result: &impl Serialize, table: &impl Display) -> anyhow::Result<()> {
        if self.is_stdout() {
            files::print(&(serde_json::to_string_pretty(result)? + "\n"))?;
        } else {
            files::print(&format!("{}\n", table.to_string().trim_end()))?;
        }
        self.file().map_or(Ok(()), |file| files::write_json(file, result))
    }

    /// Whether stdout is for JSON alone.
    pub fn is_stdout(&self) -> bool {
        self.json.as_deref() == Some(Path::new("-"))
    }

    fn file(&self) -> Option<&Path> {
        self.json.as_deref().filter(|_| !self.is_stdout())
    }
}
