//! `xavatar completions`: the script that lets a shell complete verbs and options.

use clap::Command;
use clap_complete::{Shell, generate};

use crate::cli::Outcome;
use crate::cli::output::files;

/// Print a script that completes verbs and options in your shell
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar completions bash > ~/.local/share/bash-completion/completions/xavatar\n  \
    xavatar completions zsh > \"${fpath[1]}/_xavatar\"\n  \
    xavatar completions fish > ~/.config/fish/completions/xavatar.fish")]
pub struct Completions {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    shell: Shell,
}

impl Completions {
    pub fn run(self, command: &mut Command) -> anyhow::Result<Outcome> {
        let mut script = Vec::new();
        let name = command.get_name().to_owned();
        generate(self.shell, command, name, &mut script);
        files::print(&String::from_utf8(script)?)?;
        Ok(Outcome::Done)
    }
}
