//! Which of the three SMPL-X models a subject was registered with.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use xavatar_formats::{Error, Result};

/// The gender of a body model, as `gender.txt` and the file names `SMPLX_{GENDER}.npz` give it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gender {
    /// The model fitted to all subjects.
    #[default]
    Neutral,
    /// The female model.
    Female,
    /// The male model.
    Male,
}

impl Gender {
    /// All genders.
    pub const ALL: [Self; 3] = [Self::Neutral, Self::Female, Self::Male];

    /// The gender that a file's name states as a word of its own, as in `SMPLX_MALE.npz`; `None` if it states none.
    pub fn of_file_name(path: &Path) -> Option<Self> {
        let name = path.file_stem()?.to_str()?;
        name.split(|letter: char| !letter.is_ascii_alphanumeric()).find_map(|word| word.parse().ok())
    }
}

impl fmt::Display for Gender {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Neutral => "neutral",
            Self::Female => "female",
            Self::Male => "male",
        })
    }
}

impl FromStr for Gender {
    type Err = Error;

    /// Reads `neutral`, `female` or `male` in any case, surrounding white space ignored.
    fn from_str(text: &str) -> Result<Self> {
        let word = text.trim();
        Self::ALL.into_iter().find(|gender| word.eq_ignore_ascii_case(&gender.to_string())).ok_or_else(|| {
            Error::Value {
                name: "gender".into(),
                found: format!("{:?}", word.chars().take(20).collect::<String>()),
                expected: "neutral, female or male".into(),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_state_their_gender_as_a_word() {
        let gender = |name: &str| Gender::of_file_name(Path::new(name));
        assert_eq!(gender("models/SMPLX_MALE.npz"), Some(Gender::Male));
        assert_eq!(gender("SMPLX_FEMALE.pkl"), Some(Gender::Female));
        assert_eq!(gender("non_watertight_neutral_vertex_labels.pkl"), Some(Gender::Neutral));
        assert_eq!(gender("male/model.npz"), None);
        assert_eq!(gender("tamales.npz"), None);
    }

    #[test]
    fn text_round_trips() {
        for gender in Gender::ALL {
            assert_eq!(format!(" {gender}\n").parse::<Gender>().unwrap(), gender);
        }
        assert!("unknown".parse::<Gender>().is_err());
    }
}
