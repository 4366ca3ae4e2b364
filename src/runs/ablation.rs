//! What each part of the method is worth: the ablations of the thesis (table 5.1), as settings.

use serde::{Deserialize, Serialize};

use super::table::RowKey;

/// A variant of the method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ablation {
    /// Nothing taken away.
    Full,
    /// A1: the search starts from the body's bones alone.
    BodyStarts,
    /// A2: the search starts from all bones.
    AllStarts,
    /// A3: points drawn uniformly by area.
    UniformSampling,
    /// A4: nothing holds the skinning weights.
    FreeWeights,
}

impl Ablation {
    /// All variants, in the order of the table.
    pub const ALL: [Self; 5] =
        [Self::Full, Self::BodyStarts, Self::AllStarts, Self::UniformSampling, Self::FreeWeights];

    /// The row's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::BodyStarts => "A1 body-bone starts",
            Self::AllStarts => "A2 all starts",
            Self::UniformSampling => "A3 uniform sampling",
            Self::FreeWeights => "A4 no weight losses",
        }
    }

    /// The name of its run's folder.
    pub fn folder(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::BodyStarts => "a1-body-starts",
            Self::AllStarts => "a2-all-starts",
            Self::UniformSampling => "a3-uniform-sampling",
            Self::FreeWeights => "a4-free-weights",
        }
    }

    /// What differs from the full method, for [`Config::preset_with`](crate::config::Config::preset_with).
    pub fn settings(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Self::Full => &[],
            Self::BodyStarts => &[("starts", "body")],
            Self::AllStarts => &[("starts", "all")],
            Self::UniformSampling => &[("sampling.strategy", "uniform")],
            Self::FreeWeights => &[("losses.joint", "0"), ("losses.surface", "0"), ("losses.volume", "0")],
        }
    }
}

/// The row of a variant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Variant {
    /// Which.
    pub ablation: Ablation,
}

impl RowKey for Variant {
    const COLUMNS: &'static [&'static str] = &["variant"];

    fn cells(&self) -> Vec<String> {
        vec![self.ablation.name().into()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Config, SamplingStrategy, Starts};

    #[test]
    fn each_variant_differs_from_the_full_method_in_its_settings_alone() {
        let config = |ablation: Ablation| {
            let settings: Vec<_> =
                ablation.settings().iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
            Config::preset_with("fast", &settings).unwrap()
        };
        let full = config(Ablation::Full);
        assert_eq!(config(Ablation::BodyStarts), Config { starts: Starts::Body, ..full.clone() });
        assert_eq!(config(Ablation::AllStarts), Config { starts: Starts::All, ..full.clone() });
        let mut uniform = full.clone();
        uniform.sampling.strategy = SamplingStrategy::Uniform;
        assert_eq!(config(Ablation::UniformSampling), uniform);
        let mut free = full.clone();
        (free.losses.joint, free.losses.surface, free.losses.volume) = (0.0, 0.0, 0.0);
        assert_eq!(config(Ablation::FreeWeights), free);
    }
}
