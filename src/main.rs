//! The `xavatar` command: trains, measures, poses and exports animatable avatars. `xavatar --help` shows the verbs.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
