//! The `xavatar` command: trains, measures, poses and exports animatable avatars. `xavatar --help` shows the verbs.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
