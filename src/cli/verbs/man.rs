//! `xavatar man`: the manual, one page for the command and one for each verb.

use std::path::PathBuf;

use anyhow::Context;
use clap::Command;
use clap_mangen::Man;

use crate::cli::Outcome;
use crate::cli::output::files;

/// Write manual pages, to be read with man
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar man --out man1 && man -l man1/xavatar-train.1\n  \
    xavatar man --out ~/.local/share/man/man1 && man xavatar")]
pub struct Manual {
    /// The folder that gets xavatar.1, xavatar-train.1 and so on; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Manual {
    pub fn run(self, command: Command) -> anyhow::Result<Outcome> {
        files::existing_folder(&self.out)?;
        let mut command = command.disable_help_subcommand(true);
        command.build();
        self.write(&command)?;
        command.get_subcommands().try_for_each(|verb| self.write(verb))?;
        files::print(&format!("{}\n", self.out.display()))?;
        Ok(Outcome::Done)
    }

    fn write(&self, command: &Command) -> anyhow::Result<()> {
        // `xavatar-train` of `xavatar train`.
        let page = command.get_display_name().unwrap_or(command.get_name());
        let path = self.out.join(format!("{page}.1"));
        files::new_file(&path)?;
        let mut text = Vec::new();
        Man::new(command.clone()).render(&mut text).with_context(|| path.display().to_string())?;
        files::write_text(&path, &String::from_utf8(text)?)
    }
}
