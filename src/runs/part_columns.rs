//! The columns that tables of measured runs share: CD, CD-MAX, NC and IoU of the whole body and of each finer role.

use crate::body::Role;
use crate::evaluate::{FrameMetrics, PartMetrics, row_name};

/// Which parts have columns.
pub(super) struct PartColumns {
    roles: Vec<Role>,
}

impl PartColumns {
    /// Those of the parts that any of the rows has.
    pub(super) fn of<'a>(rows: impl Iterator<Item = &'a FrameMetrics>) -> Self {
        let mut roles: Vec<Role> = rows.flat_map(|row| row.by_role.keys().copied()).collect();
        roles.sort();
        roles.dedup();
        Self { roles }
    }

    fn names(&self) -> impl Iterator<Item = &'static str> {
        std::iter::once("All").chain(self.roles.iter().copied().map(row_name))
    }

    fn of_row(&self, row: &FrameMetrics) -> impl Iterator<Item = [String; 4]> {
        std::iter::once(row.all).chain(self.roles.iter().map(|role| row.of(*role))).map(texts)
    }

    /// The two lines above the cells, for a terminal.
    pub(super) fn heads(&self) -> [String; 2] {
        let values = format!(" | {:>7} {:>9} {:>5} {:>5}", "CD mm", "CD-MAX mm", "NC", "IoU");
        [self.names().map(|name| format!(" | {name:^29}")).collect(), self.names().map(|_| values.as_str()).collect()]
    }

    /// A row's cells, for a terminal.
    pub(super) fn cells(&self, row: &FrameMetrics) -> String {
        self.of_row(row).map(|[cd, maximum, nc, iou]| format!(" | {cd:>7} {maximum:>9} {nc:>5} {iou:>5}")).collect()
    }

    /// The columns' heads for Markdown.
    pub(super) fn markdown_heads(&self) -> impl Iterator<Item = String> {
        self.names().flat_map(|name| ["CD", "CD-MAX", "NC", "IoU"].map(|value| format!("{name} {value}")))
    }

    /// A row's values for Markdown.
    pub(super) fn values(&self, row: &FrameMetrics) -> impl Iterator<Item = String> {
        self.of_row(row).flatten()
    }
}

/// CD, CD-MAX, NC and IoU as text.
fn texts(metrics: Option<PartMetrics>) -> [String; 4] {
    match metrics {
        Some(PartMetrics { cd_mm, cd_max_mm, nc, iou, .. }) => {
            [format!("{cd_mm:.2}"), format!("{cd_max_mm:.2}"), format!("{nc:.3}"), format!("{iou:.3}")]
        }
        None => std::array::from_fn(|_| "-".into()),
    }
}
