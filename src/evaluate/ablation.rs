//! What each part of the method is worth: the ablations of the thesis (table 5.1), as settings and as a table.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::metrics::FrameMetrics;
use super::part_columns::PartColumns;

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

/// One variant's training and metrics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AblationRow {
    /// The variant.
    pub ablation: Ablation,
    /// Steps on frames that it was trained for.
    pub steps: u64,
    /// Mean wall time of such a step.
    pub seconds_per_step: Option<f64>,
    /// Frames it was measured on.
    pub frames: usize,
    /// The mean of the metrics over those frames.
    pub mean: FrameMetrics,
}

/// The variants side by side. `Display` prints it for a terminal, [`AblationTable::markdown`] for a document.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct AblationTable {
    /// One row a variant.
    pub rows: Vec<AblationRow>,
}

impl AblationRow {
    fn seconds(&self) -> String {
        self.seconds_per_step.map_or_else(|| "-".into(), |seconds| format!("{seconds:.3}"))
    }
}

impl AblationTable {
    /// The table in Markdown; distances in millimetres.
    pub fn markdown(&self) -> String {
        let columns = PartColumns::of(self.rows.iter().map(|row| &row.mean));
        let ends = ["steps".to_owned(), "s/step".into()];
        let head: Vec<String> =
            ["variant".to_owned()].into_iter().chain(columns.markdown_heads()).chain(ends).collect();
        let rule = vec!["---".to_owned(); head.len()];
        let rows = self.rows.iter().map(|row| {
            let ends = [row.steps.to_string(), row.seconds()];
            [row.ablation.name().to_owned()].into_iter().chain(columns.values(&row.mean)).chain(ends).collect()
        });
        [head, rule].into_iter().chain(rows).map(|cells| format!("| {} |\n", cells.join(" | "))).collect()
    }
}

impl fmt::Display for AblationTable {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let columns = PartColumns::of(self.rows.iter().map(|row| &row.mean));
        let [first, second] = columns.heads();
        writeln!(formatter, "{:<20}{first} | {:>15}", "", "")?;
        writeln!(formatter, "{:<20}{second} | {:>7} {:>7}", "variant", "steps", "s/step")?;
        for row in &self.rows {
            write!(formatter, "{:<20}{}", row.ablation.name(), columns.cells(&row.mean))?;
            writeln!(formatter, " | {:>7} {:>7}", row.steps, row.seconds())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Role;
    use crate::config::{Config, SamplingStrategy, Starts};
    use crate::evaluate::{PartMetrics, Parts};

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

    #[test]
    fn both_tables_stand_in_columns() {
        let part = PartMetrics { cd_mm: 1.25, cd_max_mm: 40.5, nc: 0.975, iou: 0.98, iou_box: 0.9 };
        let by_role = [(Role::Hands, Some(part)), (Role::Face, None)].into();
        let mean = Parts { all: Some(part), by_role };
        let row = |ablation| {
            let mean = mean.clone();
            AblationRow { ablation, steps: 6000, seconds_per_step: Some(0.25), frames: 10, mean }
        };
        let table = AblationTable { rows: Ablation::ALL.map(row).to_vec() };
        let printed = table.to_string();
        let mut widths = printed.lines().map(|line| line.chars().count());
        let first = widths.next().unwrap();
        assert!(widths.all(|width| width == first), "{printed}");
        let markdown = table.markdown();
        assert_eq!(markdown.lines().count(), 7);
        assert!(markdown.lines().all(|line| line.matches('|').count() == 16), "{markdown}");
        assert!(markdown.contains("| A1 body-bone starts | 1.25 | 40.50 | 0.975 | 0.980 |"), "{markdown}");
    }
}
