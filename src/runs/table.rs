//! Measured runs one below the other: one table for any batch. Distances in millimetres.

use std::fmt;

use serde::Serialize;

use super::measure::RunMetrics;
use super::part_columns::PartColumns;

/// What tells the rows of a table apart.
pub trait RowKey: Serialize {
    /// The columns' heads.
    const COLUMNS: &'static [&'static str];

    /// What stands in them.
    fn cells(&self) -> Vec<String>;
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunRow<K> {
    /// What it is.
    #[serde(flatten)]
    pub key: K,
    /// What came out.
    #[serde(flatten)]
    pub metrics: RunMetrics,
}

/// Measured runs. `Display` prints the table for a terminal, [`RunTable::markdown`] for a document.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunTable<K> {
    /// One row a run.
    pub rows: Vec<RunRow<K>>,
}

impl<K> Default for RunTable<K> {
    fn default() -> Self {
        Self { rows: Vec::new() }
    }
}

impl RunMetrics {
    fn seconds(&self) -> String {
        self.seconds_per_step.map_or_else(|| "-".into(), |seconds| format!("{seconds:.3}"))
    }
}

impl<K: RowKey> RunTable<K> {
    /// The table in Markdown.
    pub fn markdown(&self) -> String {
        let columns = self.columns();
        let keys = K::COLUMNS.iter().map(|column| (*column).to_owned());
        let ends = ["steps".to_owned(), "s/step".to_owned()];
        let head: Vec<String> = keys.chain(columns.markdown_heads()).chain(ends).collect();
        let rule = vec!["---".to_owned(); head.len()];
        let rows = self.rows.iter().map(|RunRow { key, metrics }| {
            let ends = [metrics.steps.to_string(), metrics.seconds()];
            key.cells().into_iter().chain(columns.values(&metrics.mean)).chain(ends).collect()
        });
        [head, rule].into_iter().chain(rows).map(|cells| format!("| {} |\n", cells.join(" | "))).collect()
    }

    fn columns(&self) -> PartColumns {
        PartColumns::of(self.rows.iter().map(|row| &row.metrics.mean))
    }

    /// The width of each of the key's columns.
    fn widths(&self) -> Vec<usize> {
        let width = |(column, head): (usize, &&str)| {
            let cells = self.rows.iter().filter_map(|row| Some(row.key.cells().get(column)?.chars().count()));
            cells.chain([head.chars().count()]).max().unwrap_or_default()
        };
        K::COLUMNS.iter().enumerate().map(width).collect()
    }
}

impl<K: RowKey> fmt::Display for RunTable<K> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widths = self.widths();
        let keys = |cells: Vec<String>| {
            let padded = cells.into_iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}"));
            padded.collect::<Vec<_>>().join(" ")
        };
        let columns = self.columns();
        let [first, second] = columns.heads();
        writeln!(formatter, "{}{first} | {:>15}", keys(vec![String::new(); widths.len()]), "")?;
        let names = keys(K::COLUMNS.iter().map(|column| (*column).to_owned()).collect());
        writeln!(formatter, "{names}{second} | {:>7} {:>7}", "steps", "s/step")?;
        for RunRow { key, metrics } in &self.rows {
            let (cells, seconds) = (columns.cells(&metrics.mean), metrics.seconds());
            writeln!(formatter, "{}{cells} | {:>7} {seconds:>7}", keys(key.cells()), metrics.steps)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Role;
    use crate::evaluate::{PartMetrics, Parts};
    use crate::runs::{Ablation, Turn, Variant};

    fn table<K: RowKey>(keys: impl IntoIterator<Item = K>) -> RunTable<K> {
        let part = PartMetrics { cd_mm: 1.25, cd_max_mm: 40.5, nc: 0.975, iou: 0.98, iou_box: 0.9 };
        let by_role = [(Role::Hands, Some(part)), (Role::Face, None)].into();
        let mean = Parts { all: Some(part), by_role };
        let metrics = RunMetrics { steps: 6000, seconds_per_step: Some(0.25), frames: 10, mean };
        RunTable { rows: keys.into_iter().map(|key| RunRow { key, metrics: metrics.clone() }).collect() }
    }

    fn check<K: RowKey>(table: &RunTable<K>, row: &str) {
        let printed = table.to_string();
        let mut widths = printed.lines().map(|line| line.chars().count());
        let first = widths.next().unwrap();
        assert!(widths.all(|width| width == first), "{printed}");
        let markdown = table.markdown();
        assert_eq!(markdown.lines().count(), 2 + table.rows.len());
        let columns = K::COLUMNS.len() + 12 + 2;
        assert!(markdown.lines().all(|line| line.matches('|').count() == columns + 1), "{markdown}");
        assert!(markdown.contains(row), "{markdown}");
    }

    #[test]
    fn tables_stand_in_columns() {
        let variants = table(Ablation::ALL.map(|ablation| Variant { ablation }));
        check(&variants, "| A1 body-bone starts | 1.25 | 40.50 | 0.975 | 0.980 |");
        let turns = table([45.0, 90.0, 180.0, 360.0].map(|turn| Turn { turn, trained_on: 12 }));
        check(&turns, "| 45° | 12 | 1.25 | 40.50 | 0.975 | 0.980 |");
    }

    #[test]
    fn rows_are_flat_in_json() {
        let json = serde_json::to_value(table([Turn { turn: 90.0, trained_on: 12 }])).unwrap();
        let row = &json["rows"][0];
        assert_eq!((row["turn"].as_f64(), row["trained_on"].as_u64()), (Some(90.0), Some(12)));
        assert_eq!((row["steps"].as_u64(), row["mean"]["all"]["cd_mm"].as_f64()), (Some(6000), Some(1.25)));
    }
}
