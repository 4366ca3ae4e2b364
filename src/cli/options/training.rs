//! How long and with what to train: the options that `train` and `ablate` share.

use clap::builder::PossibleValuesParser;
use xavatar::config::preset_names;

/// What a run is trained with.
#[derive(clap::Args)]
pub struct TrainingArguments {
    /// Networks and constants to start from; for RGB-D frames `fast` is `fast-rgbd`, and so on [default: fast]
    #[arg(long, value_name = "P", value_parser = PossibleValuesParser::new(preset_names()))]
    pub preset: Option<String>,
    /// Wall time of a whole run, preparation included, instead of a number of steps
    #[arg(long, value_name = "M", conflicts_with = "steps", value_parser = positive_minutes)]
    minutes: Option<f64>,
    /// Steps to train [default: the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Seed of everything random [default: 0]
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Refine the frames' poses by the avatar, twice: for registrations that are some millimetres off
    #[arg(long)]
    refine_pose: bool,
    /// Override any setting of the preset (see config.toml in a run); may be given again
    #[arg(long = "set", value_name = "key=value", value_parser = setting)]
    settings: Vec<(String, String)>,
    /// Leave out frames that cannot be read or have a fault that is not accepted, and list them, instead of stopping at the first
    #[arg(long)]
    skip_bad_frames: bool,
}

impl TrainingArguments {
    /// The preset to start from.
    pub fn preset(&self) -> &str {
        self.preset.as_deref().unwrap_or("fast")
    }

    /// The settings that were given, options of their own included.
    pub fn settings(&self) -> Vec<(String, String)> {
        let own = [
            ("schedule.minutes", self.minutes.map(|minutes| minutes.to_string())),
            ("schedule.steps", self.steps.map(|steps| steps.to_string())),
            ("seed", self.seed.map(|seed| seed.to_string())),
            ("schedule.pose_refinements", self.refine_pose.then(|| "2".to_owned())),
            ("skip_bad_frames", self.skip_bad_frames.then(|| "true".to_owned())),
        ];
        let own = own.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
        self.settings.iter().cloned().chain(own).collect()
    }
}

fn setting(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("expected key=value")?;
    Ok((key.trim().into(), value.trim().into()))
}

fn positive_minutes(text: &str) -> Result<f64, String> {
    let minutes: f64 = text.parse().map_err(|_| "expected a number of minutes")?;
    if minutes.is_finite() && minutes > 0.0 { Ok(minutes) } else { Err("expected more than 0 minutes".into()) }
}
