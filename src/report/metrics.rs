//! The metrics of an evaluation, as the page's table with bars and as dots frame by frame.

use serde::Serialize;

use super::chart::{Chart, Dot, number};
use crate::body::Role;
use crate::evaluate::{FrameMetrics, PartMetrics, RegionMetrics, Report, SMPLX_D, region_name};

/// The metrics as the template takes them.
#[derive(Clone, Debug, Serialize)]
pub(super) struct MetricsTable {
    caption: String,
    columns: Vec<Column>,
    parts: Vec<PartRows>,
    by_frame: Option<ByFrame>,
}

#[derive(Clone, Debug, Serialize)]
struct Column {
    name: &'static str,
    unit: &'static str,
}

#[derive(Clone, Debug, Serialize)]
struct PartRows {
    name: &'static str,
    rows: Vec<Row>,
}

#[derive(Clone, Debug, Serialize)]
struct Row {
    class: &'static str,
    name: &'static str,
    cells: Vec<Cell>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct Cell {
    text: String,
    /// Of the column's longest bar, 0 to 1.
    share: f64,
}

#[derive(Clone, Debug, Serialize)]
struct ByFrame {
    caption: String,
    chart: Chart,
}

/// A metric: its name, its unit, its value as text, and its error, of which less is better.
type Metric = (&'static str, &'static str, fn(f64) -> String, fn(f64) -> f64);

const METRICS: [Metric; 4] = [
    ("CD", "mm", |value| format!("{value:.2}"), |value| value),
    ("CD-MAX", "mm", |value| format!("{value:.1}"), |value| value),
    ("NC", "", |value| format!("{value:.3}"), |value| 1.0 - value),
    ("IoU", "", |value| format!("{value:.3}"), |value| 1.0 - value),
];

/// A row's metrics, as far as it has them.
type Values = [Option<f64>; METRICS.len()];

fn values_of_part(metrics: Option<PartMetrics>) -> Values {
    metrics.map_or([None; 4], |part| [part.cd_mm, part.cd_max_mm, part.nc, part.iou].map(Some))
}

/// A region has no volume of its own.
fn values_of_region(metrics: &RegionMetrics) -> Values {
    [Some(metrics.cd_mm), Some(metrics.cd_max_mm), Some(metrics.nc), None]
}

/// The metrics of a role's parts, or of the whole body, and the name of their rows.
fn of_part(metrics: &FrameMetrics, role: Option<Role>) -> Option<PartMetrics> {
    role.map_or(metrics.all, |role| metrics.of(role))
}

fn name_of(role: Option<Role>) -> &'static str {
    match role {
        None => "Whole body",
        Some(Role::Body) => "Body",
        Some(Role::Hands) => "Hands",
        Some(Role::Face) => "Face",
    }
}

/// The class and the name of a surface that was measured, and its values.
type Measured = (&'static str, &'static str, Values);

impl MetricsTable {
    /// Of what was measured on frames that `frames_of` describes.
    pub(super) fn of(report: &Report, frames_of: &str) -> Self {
        let (mean, baseline) = (report.mean(), report.baseline_mean());
        let parts: Vec<Option<Role>> = std::iter::once(None).chain(mean.by_role.keys().copied().map(Some)).collect();
        let of_avatar = |part| ("avatar", "avatar", values_of_part(of_part(&mean, part)));
        let of_baseline =
            |part| baseline.as_ref().map(|baseline| ("baseline", SMPLX_D, values_of_part(of_part(baseline, part))));
        let of_parts = parts
            .iter()
            .map(|part| (name_of(*part), std::iter::once(of_avatar(*part)).chain(of_baseline(*part)).collect()));
        let regions = report.region_means().unwrap_or_default();
        let of_regions = regions
            .iter()
            .map(|(region, metrics)| (region_name(*region), vec![("avatar", "avatar", values_of_region(metrics))]));
        let groups: Vec<(&'static str, Vec<Measured>)> = of_parts.chain(of_regions).collect();
        let rows = || groups.iter().flat_map(|(_, rows)| rows);
        let error = |index: usize, value: f64| (METRICS[index].3)(value);
        let largest: Vec<f64> = (0..METRICS.len())
            .map(|index| {
                let errors = rows().filter_map(|(.., values)| Some(error(index, values[index]?)));
                errors.fold(f64::MIN_POSITIVE, f64::max)
            })
            .collect();
        let cell = |(index, value): (usize, &Option<f64>)| match *value {
            None => Cell { text: "\u{2013}".into(), share: 0.0 },
            Some(value) => {
                let share = (error(index, value) / largest[index]).clamp(0.0, 1.0);
                Cell { text: (METRICS[index].2)(value), share: (share * 1000.0).round() / 1000.0 }
            }
        };
        let row = |(class, name, values): &Measured| Row {
            class,
            name,
            cells: values.iter().enumerate().map(cell).collect(),
        };
        Self {
            caption: caption(report, frames_of),
            columns: METRICS.map(|(name, unit, ..)| Column { name, unit }).into(),
            parts: groups.iter().map(|(name, rows)| PartRows { name, rows: rows.iter().map(row).collect() }).collect(),
            by_frame: by_frame(report),
        }
    }
}

fn caption(report: &Report, frames_of: &str) -> String {
    let count = report.per_frame.len();
    let frames = if count == 1 { "frame" } else { "frames" };
    let mut text = format!(
        "Mean over {count} {frames} {frames_of}. CD is the chamfer distance to the scan, CD-MAX its largest value, NC the \
         agreement of normals, IoU that of volumes."
    );
    if report.baseline_mean().is_some() {
        text +=
            " SMPLX+D is the body model with the mean offset of each of its vertices: what one gets without learning.";
    }
    let missing = report.missing();
    for (role, missing) in missing.by_role {
        if missing > 0 {
            let part = name_of(Some(role)).to_lowercase();
            text += &format!(" The {part} could not be measured in {missing} of them.");
        }
    }
    text
}

fn by_frame(report: &Report) -> Option<ByFrame> {
    let dot = |class, name: &str, frame: &str, metrics: Option<PartMetrics>| {
        let value = metrics?.cd_mm;
        Some(Dot { class, value, title: format!("{frame}, {name}: {} mm", number(value)) })
    };
    let columns: Vec<(String, Vec<Dot>)> = report
        .per_frame
        .iter()
        .map(|frame| {
            let baseline =
                frame.baseline.as_ref().and_then(|metrics| dot("baseline", SMPLX_D, &frame.frame, metrics.all));
            let dots = baseline.into_iter().chain(dot("avatar", "avatar", &frame.frame, frame.metrics.all)).collect();
            (short_name(&frame.frame), dots)
        })
        .collect();
    // One column says nothing that the table does not.
    if columns.len() < 2 {
        return None;
    }
    let compared =
        if report.baseline_mean().is_some() { format!(", the avatar beside {SMPLX_D}") } else { String::new() };
    let caption = format!("Chamfer distance of each frame, mm{compared}");
    let chart = Chart::dots(caption.clone(), &columns)?;
    Some(ByFrame { caption, chart })
}

/// `test/Take4/f00012` is `12`.
fn short_name(frame: &str) -> String {
    let number = frame.rsplit('/').next().unwrap_or(frame).trim_start_matches(|letter: char| !letter.is_ascii_digit());
    let short = number.trim_start_matches('0');
    if short.is_empty() { frame.into() } else { short.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::{FrameReport, Parts};

    fn part(cd_mm: f64, nc: f64) -> Option<PartMetrics> {
        Some(PartMetrics { cd_mm, cd_max_mm: 10.0 * cd_mm, nc, iou: 0.5, iou_box: 0.75 })
    }

    fn parts(all: Option<PartMetrics>, hands: Option<PartMetrics>) -> FrameMetrics {
        Parts { all, by_role: [(Role::Hands, hands), (Role::Face, None)].into() }
    }

    #[test]
    fn bars_of_a_column_share_a_scale_and_shorter_is_better() {
        let frame = |number: u32| FrameReport {
            frame: format!("test/Take1/f{number:05}"),
            metrics: parts(part(1.0, 0.99), part(2.0, 0.98)),
            baseline: Some(parts(part(4.0, 0.96), part(3.0, 0.97))),
            regions: None,
            pictures: None,
        };
        let report = Report { per_frame: vec![frame(7), frame(120)] };
        let table = MetricsTable::of(&report, "of the test split");
        let shares = |part: usize, row: usize| -> Vec<f64> {
            table.parts[part].rows[row].cells.iter().map(|cell| cell.share).collect()
        };
        assert_eq!(shares(0, 0), [0.25, 0.25, 0.25, 1.0]);
        assert_eq!(shares(0, 1), [1.0, 1.0, 1.0, 1.0]);
        assert_eq!(shares(1, 0)[..3], [0.5, 0.5, 0.5]);
        assert_eq!(table.parts[2].rows[0].cells[0], Cell { text: "\u{2013}".into(), share: 0.0 });
        assert!(table.caption.contains("The face could not be measured in 2 of them"), "{}", table.caption);
        assert!(table.by_frame.is_some());
    }

    #[test]
    fn frames_are_named_by_their_number() {
        assert_eq!(short_name("test/Take4/f00012"), "12");
        assert_eq!(short_name("odd"), "odd");
    }
}
