//! A phenotype: what a body is like in nine numbers from 0 to 1, and the targets whose weighted sum makes it.
//!
//! Between the values at which there are targets, each number shares its weight linearly among the two nearest; a target's weight is the
//! product of those of all that it is named after: `universal-female-young-averagemuscle-maxweight`. Age is 0 for a baby, 1/3 a child, 2/3 a young
//! adult, 1 old, and -1/3 a newborn; gender is 0 for male, 1 for female.

use std::fmt;
use std::str::FromStr;

use super::wrong_value;
use xavatar_formats::Error;

/// What a body is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phenotype {
    /// 0 male, 1 female.
    pub gender: f64,
    /// -1/3 newborn, 0 baby, 1/3 child, 2/3 young, 1 old.
    pub age: f64,
    /// Of the muscles, 0 to 1.
    pub muscle: f64,
    /// From thin to heavy, 0 to 1.
    pub weight: f64,
    /// From short to tall, 0 to 1.
    pub height: f64,
    /// 0 ideal, 1 uncommon.
    pub proportions: f64,
    /// Shares of looks by origin, which are divided by their sum.
    pub african: f64,
    /// As `african`.
    pub asian: f64,
    /// As `african`.
    pub caucasian: f64,
}

impl Default for Phenotype {
    /// A young adult, average in all else.
    fn default() -> Self {
        Self {
            gender: 0.5,
            age: 2.0 / 3.0,
            muscle: 0.5,
            weight: 0.5,
            height: 0.5,
            proportions: 0.5,
            african: 0.5,
            asian: 0.5,
            caucasian: 0.5,
        }
    }
}

/// A target's part in a phenotype.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Share {
    /// Its path below the data folder.
    pub target: String,
    pub weight: f64,
    /// Whether it is a baby's that has to be made a newborn's.
    pub is_newborn: bool,
}

/// A name and how much it counts; never zero.
type Part = (&'static str, f64);

const AGES: [&str; 5] = ["newborn", "baby", "child", "young", "old"];
const YOUNGEST: f64 = -1.0 / 3.0;
const NAMES: [&str; 9] =
    ["gender", "age", "muscle", "weight", "height", "proportions", "african", "asian", "caucasian"];

impl Phenotype {
    /// A number by its name.
    fn entry(&mut self, name: &str) -> Option<&mut f64> {
        match name {
            "gender" => Some(&mut self.gender),
            "age" => Some(&mut self.age),
            "muscle" => Some(&mut self.muscle),
            "weight" => Some(&mut self.weight),
            "height" => Some(&mut self.height),
            "proportions" => Some(&mut self.proportions),
            "african" => Some(&mut self.african),
            "asian" => Some(&mut self.asian),
            "caucasian" => Some(&mut self.caucasian),
            _ => None,
        }
    }

    /// The same with another value of an entry.
    pub(super) fn with(mut self, name: &str, value: f64) -> Self {
        if let Some(entry) = self.entry(name) {
            *entry = value;
        }
        self
    }

    /// The targets and their weights.
    pub(super) fn shares(&self) -> Vec<Share> {
        let genders = between(&["male", "female"], 0.0, self.gender);
        let ages = between(&AGES, YOUNGEST, self.age);
        let muscles = between(&["minmuscle", "averagemuscle", "maxmuscle"], 0.0, self.muscle);
        let weights = between(&["minweight", "averageweight", "maxweight"], 0.0, self.weight);
        let heights = between(&["minheight", "maxheight"], 0.0, self.height);
        let proportions = between(&["idealproportions", "uncommonproportions"], 0.0, self.proportions);
        let mut shares = Vec::new();
        for gender in &genders {
            for age in &ages {
                let is_newborn = age.0 == "newborn";
                let looks = if is_newborn { "baby" } else { age.0 };
                let mut add = |name: String, weight: f64| {
                    let target = format!("mpfb2/targets/macrodetails/{name}.target.gz");
                    shares.push(Share { target, weight: gender.1 * age.1 * weight, is_newborn });
                };
                for origin in self.origins() {
                    add(format!("{}-{}-{looks}", origin.0, gender.0), origin.1);
                }
                for muscle in &muscles {
                    for weight in &weights {
                        let (both, name) =
                            (muscle.1 * weight.1, format!("{}-{looks}-{}-{}", gender.0, muscle.0, weight.0));
                        add(format!("universal-{name}"), both);
                        heights.iter().for_each(|height| add(format!("height/{name}-{}", height.0), both * height.1));
                        // There are none of babies.
                        let kinds = proportions.iter().filter(|_| looks != "baby");
                        kinds.for_each(|kind| add(format!("proportions/{name}-{}", kind.0), both * kind.1));
                    }
                }
            }
        }
        shares
    }

    fn origins(&self) -> Vec<Part> {
        let shares = [("african", self.african), ("asian", self.asian), ("caucasian", self.caucasian)];
        let sum: f64 = shares.iter().map(|(_, share)| share).sum();
        let equal = 1.0 / shares.len() as f64;
        let share = |share: f64| if sum > 0.0 { share / sum } else { equal };
        shares.map(|(name, own)| (name, share(own))).into_iter().filter(|(_, share)| *share != 0.0).collect()
    }
}

/// How a value from `first` to 1 shares its weight among names at even distances.
fn between(names: &[&'static str], first: f64, value: f64) -> Vec<Part> {
    let place = (value - first) / (1.0 - first) * (names.len() - 1) as f64;
    let weight = |index: usize| (1.0 - (place - index as f64).abs()).max(0.0);
    names.iter().enumerate().map(|(index, name)| (*name, weight(index))).filter(|(_, weight)| *weight > 0.0).collect()
}

impl FromStr for Phenotype {
    type Err = Error;

    /// Reads `age=0.6,weight=0.7`; what is left out is an average young adult's.
    fn from_str(text: &str) -> Result<Self, Error> {
        let mut phenotype = Self::default();
        for entry in text.split(',').map(str::trim).filter(|entry| !entry.is_empty()) {
            let (name, value) = entry.split_once('=').unwrap_or((entry, ""));
            let least = if name.trim() == "age" { YOUNGEST } else { 0.0 };
            let number = value.trim().parse().ok().filter(|value: &f64| (least..=1.0).contains(value));
            let Some(own) = phenotype.entry(name.trim()) else {
                return Err(wrong_value("a phenotype", name, format!("one of {}", NAMES.join(", "))));
            };
            *own = number
                .ok_or_else(|| wrong_value(name, format!("{value:?}"), format!("a number from {least:.2} to 1")))?;
        }
        Ok(phenotype)
    }
}

impl fmt::Display for Phenotype {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut shown = *self;
        let entries = NAMES.map(|name| format!("{name}={:.3}", shown.entry(name).copied().unwrap_or_default()));
        formatter.write_str(&entries.join(","))
    }
}
