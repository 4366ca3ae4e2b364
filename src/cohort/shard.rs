//! Which subjects are one process's: every N-th, so that neighbours in a manifest, which are often alike, are spread.

use std::fmt;
use std::str::FromStr;

/// Where schedulers say which of an array's tasks this process is, counted from 0.
const VARIABLES: [&str; 2] = ["SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"];

/// Share `index` of `count`: the subjects whose places in the manifest leave this remainder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: usize,
    count: usize,
}

impl Shard {
    /// The share of the whole.
    pub const ALL: Self = Self { index: 0, count: 1 };

    /// One subject a task: the share that the scheduler's variable names, as `variable` reads it, with the variable's name; none if
    /// there is no such variable.
    ///
    /// # Errors
    /// If it is no number below the number of subjects.
    pub fn of_task(
        subjects: usize,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<Option<(Self, &'static str)>, ShardError> {
        let Some((name, value)) = VARIABLES.iter().find_map(|name| Some((*name, variable(name)?))) else {
            return Ok(None);
        };
        let shard = format!("{value}/{subjects}").parse();
        let refused =
            |_| ShardError { found: format!("{name}={value}"), expected: format!("a number below {subjects}") };
        shard.map(|shard| Some((shard, name))).map_err(refused)
    }

    /// Whether the subject at this place of the manifest is in the share.
    pub fn has(self, place: usize) -> bool {
        place % self.count == self.index
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}/{}", self.index, self.count)
    }
}

/// A share that there is not.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{found} is no share of the subjects, expected {expected}")]
pub struct ShardError {
    found: String,
    expected: String,
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let numbers = text.split_once('/').and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
        match numbers {
            Some((index, count)) if index < count => Ok(Self { index, count }),
            _ => Err(ShardError { found: text.into(), expected: "I/N with I from 0 to N - 1, such as 0/20".into() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_subject_is_in_one_share() {
        let shares: Vec<Shard> = (0..3).map(|index| format!("{index}/3").parse().unwrap()).collect();
        for place in 0..10 {
            assert_eq!(shares.iter().filter(|share| share.has(place)).count(), 1);
            assert!(Shard::ALL.has(place));
        }
        for wrong in ["3/3", "1", "a/3", "-1/3", "0/0"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_schedulers_task_is_one_subject() {
        let slurm = |name: &str| (name == "SLURM_ARRAY_TASK_ID").then(|| "7".to_owned());
        let (shard, named) = Shard::of_task(20, slurm).unwrap().unwrap();
        assert_eq!((shard.to_string().as_str(), named), ("7/20", "SLURM_ARRAY_TASK_ID"));
        let message = Shard::of_task(7, slurm).unwrap_err().to_string();
        assert!(message.contains("SLURM_ARRAY_TASK_ID=7") && message.contains("below 7"), "{message}");
        assert_eq!(Shard::of_task(7, |_| None), Ok(None));
    }
}
