//! The metrics of a sequence: means, a table for people and JSON for scripts.
//!
//! A mean is over the frames in which the part could be measured; how many could not is counted and said.

use std::fmt;

use serde::ser::{Serialize, Serializer};

use super::metrics::{FrameMetrics, PartMetrics, Parts};
use super::pictures::{Likeness, Pictures};
use super::regions::{RegionMetrics, Regions};
use super::smplx_d::SMPLX_D;
use crate::body::{Region, Role};

/// The metrics of one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameReport {
    /// The frame, as `split/sequence/number`.
    pub frame: String,
    /// Of the prediction.
    pub metrics: FrameMetrics,
    /// Of the baseline, if one was asked for.
    pub baseline: Option<FrameMetrics>,
    /// Of the prediction by region, if they were asked for.
    pub regions: Option<Regions>,
    /// How like the prediction looks, if that was asked for and both meshes have colours.
    pub pictures: Option<Pictures>,
}

/// The metrics of all frames. `Display` prints the table; serde writes
/// `{"frames", "mean": {"all", "hands", "face"}, "baseline": {…}, "per_frame": [{"frame", "all", "hands", "face"}]}`, where a part
/// is `null` if no frame had it and absent if the skeleton has none such, `baseline` is absent if none was asked for, and
/// `"missing": {"all", "hands", "face"}` counts the frames without a part if there are any. `"regions": {"feet", ..., "off_body"}`,
/// of the mean and in each frame, is there if it was asked for; a region that neither surface has is absent. So is `"pictures": {"all",
/// "hands", "face"}`, with `psnr_db` and `ssim`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Frame by frame, in the order of evaluation.
    pub per_frame: Vec<FrameReport>,
}

impl Report {
    /// The mean of each part over the frames that have it.
    pub fn mean(&self) -> FrameMetrics {
        mean(self.per_frame.iter().map(|frame| &frame.metrics))
    }

    /// The baseline's mean; none if no frame has one.
    pub fn baseline_mean(&self) -> Option<FrameMetrics> {
        let measured: Vec<_> = self.per_frame.iter().filter_map(|frame| frame.baseline.as_ref()).collect();
        (!measured.is_empty()).then(|| mean(measured.into_iter()))
    }

    /// The mean of each region over the frames that have it; none if they were not asked for.
    pub fn region_means(&self) -> Option<Regions> {
        let frames = || self.per_frame.iter().filter_map(|frame| frame.regions.as_ref());
        frames().next().is_some().then(|| RegionMetrics::means(frames()))
    }

    /// The mean likeness of each part over the frames that have it; none if no frame has one.
    pub fn picture_means(&self) -> Option<Pictures> {
        let frames = || self.per_frame.iter().filter_map(|frame| frame.pictures.as_ref());
        let first = frames().next()?;
        let of_role = |role: Role| Likeness::mean(frames().filter_map(move |pictures| pictures.of(role)));
        Some(Parts {
            all: Likeness::mean(frames().filter_map(|pictures| pictures.all)),
            by_role: first.by_role.keys().map(|role| (*role, of_role(*role))).collect(),
        })
    }

    /// The frames with the smallest and the largest chamfer distance of the whole body; none if none has one.
    pub fn best_and_worst(&self) -> Option<(&FrameReport, &FrameReport)> {
        let distance = |frame: &&FrameReport| frame.metrics.all.map_or(f64::NAN, |all| all.cd_mm);
        let measured = || self.per_frame.iter().filter(|frame| frame.metrics.all.is_some());
        let order = |a: &&FrameReport, b: &&FrameReport| distance(a).total_cmp(&distance(b));
        measured().min_by(order).zip(measured().max_by(order))
    }

    /// In how many frames each part of the prediction could not be measured.
    pub fn missing(&self) -> Parts<usize> {
        let frames = || self.per_frame.iter().map(|frame| &frame.metrics);
        let count = |role: Role| frames().filter(|metrics| metrics.of(role).is_none()).count();
        Parts {
            all: frames().filter(|metrics| metrics.all.is_none()).count(),
            by_role: roles(frames()).map(|role| (role, count(role))).collect(),
        }
    }
}

fn mean<'a>(frames: impl Iterator<Item = &'a FrameMetrics> + Clone) -> FrameMetrics {
    let of_role = |role: Role| PartMetrics::mean(frames.clone().filter_map(move |metrics| metrics.of(role)));
    Parts {
        all: PartMetrics::mean(frames.clone().filter_map(|metrics| metrics.all)),
        by_role: roles(frames.clone()).map(|role| (role, of_role(role))).collect(),
    }
}

/// The finer roles of the frames' skeleton, which is one.
fn roles<'a>(mut frames: impl Iterator<Item = &'a FrameMetrics>) -> impl Iterator<Item = Role> {
    frames.next().into_iter().flat_map(|metrics| metrics.by_role.keys().copied())
}

/// The name of a role's row.
pub(crate) fn row_name(role: Role) -> &'static str {
    match role {
        Role::Body => "Body",
        Role::Hands => "Hands",
        Role::Face => "Face",
    }
}

/// The name of a region's row.
pub(crate) fn region_name(region: Region) -> &'static str {
    match region {
        Region::Feet => "Feet",
        Region::Legs => "Legs",
        Region::Torso => "Torso",
        Region::Arms => "Arms",
        Region::Head => "Head",
        Region::Hands => "Hands",
        Region::Face => "Face",
        Region::OffBody => "Off body",
    }
}

impl PartMetrics {
    /// The mean of each value; none of nothing.
    fn mean(metrics: impl Iterator<Item = Self> + Clone) -> Option<Self> {
        let count = metrics.clone().count() as f64;
        let of = |value: fn(Self) -> f64| metrics.clone().map(value).sum::<f64>() / count;
        (count > 0.0).then(|| Self {
            cd_mm: of(|part| part.cd_mm),
            cd_max_mm: of(|part| part.cd_max_mm),
            nc: of(|part| part.nc),
            iou: of(|part| part.iou),
            iou_box: of(|part| part.iou_box),
        })
    }
}

impl Likeness {
    /// The mean of each value; none of nothing.
    fn mean(of: impl Iterator<Item = Self> + Clone) -> Option<Self> {
        let count = of.clone().count() as f64;
        (count > 0.0).then(|| Self {
            psnr_db: of.clone().map(|likeness| likeness.psnr_db).sum::<f64>() / count,
            ssim: of.map(|likeness| likeness.ssim).sum::<f64>() / count,
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let frames = format!("{} frame{}", self.per_frame.len(), if self.per_frame.len() == 1 { "" } else { "s" });
        writeln!(
            formatter,
            "{frames:<16} {:>8} {:>10} {:>6} {:>6} {:>8}",
            "CD mm", "CD-MAX mm", "NC", "IoU", "IoU box"
        )?;
        let (mean, baseline, missing) = (self.mean(), self.baseline_mean(), self.missing());
        let all = ("All", mean.all, baseline.as_ref().map(|parts| parts.all), missing.all);
        let of_role = |(role, metrics): (&Role, &Option<PartMetrics>)| {
            (row_name(*role), *metrics, baseline.as_ref().map(|parts| parts.of(*role)), missing.of(*role))
        };
        let rows = std::iter::once(all).chain(mean.by_role.iter().map(of_role));
        for (name, metrics, baseline, missing) in rows {
            write_row(formatter, name, "avatar", metrics)?;
            if let Some(baseline) = baseline {
                write_row(formatter, "", SMPLX_D, baseline)?;
            }
            if missing > 0 {
                writeln!(formatter, "       not measurable in {missing} of {frames}, left out of the mean")?;
            }
        }
        for (region, metrics) in self.region_means().into_iter().flatten() {
            let RegionMetrics { cd_mm, cd_max_mm, nc, share } = metrics;
            let (name, percent) = (region_name(region), format!("{:.0} %", 100.0 * share));
            writeln!(formatter, "{name:<9} {percent:>6} {cd_mm:>8.2} {cd_max_mm:>10.2} {nc:>6.3} {0:>6} {0:>8}", "-")?;
        }
        let Some(pictures) = self.picture_means() else { return Ok(()) };
        writeln!(formatter, "{:<16} {:>8} {:>10} {3:>6} {3:>6} {3:>8}", "pictures", "PSNR dB", "SSIM", "")?;
        let of_role = |(role, likeness): (&Role, &Option<Likeness>)| (row_name(*role), *likeness);
        for (name, likeness) in std::iter::once(("All", pictures.all)).chain(pictures.by_role.iter().map(of_role)) {
            if let Some(Likeness { psnr_db, ssim }) = likeness {
                writeln!(formatter, "{name:<6} {:<9} {psnr_db:>8.2} {ssim:>10.3} {1:>6} {1:>6} {1:>8}", "avatar", "-")?;
            }
        }
        Ok(())
    }
}

fn write_row(formatter: &mut fmt::Formatter<'_>, part: &str, of: &str, metrics: Option<PartMetrics>) -> fmt::Result {
    write!(formatter, "{part:<6} {of:<9}")?;
    match metrics {
        Some(PartMetrics { cd_mm, cd_max_mm, nc, iou, iou_box }) => {
            writeln!(formatter, " {cd_mm:>8.2} {cd_max_mm:>10.2} {nc:>6.3} {iou:>6.3} {iou_box:>8.3}")
        }
        None => writeln!(formatter, " {0:>8} {0:>10} {0:>6} {0:>6} {0:>8}", "-"),
    }
}

impl Serialize for Report {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(serde::Serialize)]
        struct Document<'a> {
            frames: usize,
            mean: FrameMetrics,
            #[serde(skip_serializing_if = "Option::is_none")]
            baseline: Option<FrameMetrics>,
            #[serde(skip_serializing_if = "Option::is_none")]
            missing: Option<Parts<usize>>,
            #[serde(skip_serializing_if = "Option::is_none")]
            regions: Option<Regions>,
            #[serde(skip_serializing_if = "Option::is_none")]
            pictures: Option<Pictures>,
            per_frame: Vec<Frame<'a>>,
        }
        #[derive(serde::Serialize)]
        struct Frame<'a> {
            frame: &'a str,
            #[serde(flatten)]
            metrics: &'a FrameMetrics,
            #[serde(skip_serializing_if = "Option::is_none")]
            regions: Option<&'a Regions>,
            #[serde(skip_serializing_if = "Option::is_none")]
            pictures: Option<&'a Pictures>,
        }
        let missing = self.missing();
        let is_missing = missing.all > 0 || missing.by_role.values().any(|count| *count > 0);
        Document {
            frames: self.per_frame.len(),
            mean: self.mean(),
            baseline: self.baseline_mean(),
            missing: is_missing.then_some(missing),
            regions: self.region_means(),
            pictures: self.picture_means(),
            per_frame: self
                .per_frame
                .iter()
                .map(|row| Frame {
                    frame: &row.frame,
                    metrics: &row.metrics,
                    regions: row.regions.as_ref(),
                    pictures: row.pictures.as_ref(),
                })
                .collect(),
        }
        .serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(cd_mm: f64) -> Option<PartMetrics> {
        Some(PartMetrics { cd_mm, cd_max_mm: 10.0 * cd_mm, nc: 0.5, iou: 0.25, iou_box: 0.75 })
    }

    fn parts<T>(all: T, hands: T, face: T) -> Parts<T> {
        Parts { all, by_role: [(Role::Hands, hands), (Role::Face, face)].into() }
    }

    fn report(baseline: bool) -> Report {
        let baseline = baseline.then(|| parts(part(9.0), part(8.0), None));
        let frame = |number: u32, hands| FrameReport {
            frame: format!("test/Take1/f{number:05}"),
            metrics: parts(part(f64::from(number)), hands, None),
            baseline: baseline.clone(),
            regions: None,
            pictures: None,
        };
        Report { per_frame: vec![frame(1, part(4.0)), frame(2, None), frame(3, part(6.0))] }
    }

    #[test]
    fn means_leave_out_what_could_not_be_measured_and_count_it() {
        let report = report(false);
        assert_eq!(report.mean(), parts(part(2.0), part(5.0), None));
        assert_eq!(report.missing(), parts(0, 1, 3));
    }

    #[test]
    fn best_and_worst_are_told_by_the_whole_body() {
        let report = report(false);
        let (best, worst) = report.best_and_worst().unwrap();
        assert_eq!([&best.frame, &worst.frame], ["test/Take1/f00001", "test/Take1/f00003"]);
        assert!(Report::default().best_and_worst().is_none());
    }

    #[test]
    fn json_keeps_its_contract() {
        let json = serde_json::to_value(report(true)).unwrap();
        assert_eq!(json["frames"], 3);
        assert_eq!(json["mean"]["hands"]["cd_max_mm"], 50.0);
        assert!(json["mean"]["face"].is_null(), "absent is null, not zero");
        assert_eq!(json["baseline"]["all"]["cd_mm"], 9.0);
        assert_eq!(json["missing"]["face"], 3);
        assert_eq!(json["per_frame"][1]["frame"], "test/Take1/f00002");
        assert_eq!(json["per_frame"][1]["all"]["iou_box"], 0.75);
        assert!(json["per_frame"][1]["hands"].is_null());

        let mut complete = report(false);
        complete.per_frame.truncate(1);
        complete.per_frame[0].metrics.by_role.insert(Role::Face, part(1.0));
        let keys = serde_json::to_value(&complete).unwrap();
        let mut keys: Vec<_> = keys.as_object().unwrap().keys().cloned().collect();
        keys.sort();
        assert_eq!(keys, ["frames", "mean", "per_frame"], "nothing else unless asked for or missing");
    }

    #[test]
    fn a_body_without_hands_and_face_has_no_rows_of_them() {
        let metrics = Parts { all: part(1.0), by_role: Default::default() };
        let report = Report {
            per_frame: vec![FrameReport { frame: "a".into(), metrics, baseline: None, regions: None, pictures: None }],
        };
        assert_eq!(report.to_string().lines().count(), 2, "a head and one row\n{report}");
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["mean"].as_object().unwrap().keys().collect::<Vec<_>>(), ["all"]);
    }

    #[test]
    fn metrics_come_back_from_json() {
        let metrics = parts(part(1.0), None, part(2.0));
        let text = serde_json::to_string(&metrics).unwrap();
        assert!(text.find("all") < text.find("hands") && text.find("hands") < text.find("face"), "{text}");
        assert_eq!(serde_json::from_str::<FrameMetrics>(&text).unwrap(), metrics);
    }

    #[test]
    fn regions_are_told_where_they_were_asked_for() {
        let region = |cd_mm: f64| RegionMetrics { cd_mm, cd_max_mm: 9.0, nc: 0.5, share: 0.25 };
        let mut report = report(false);
        report.per_frame[0].regions = Some([(Region::Feet, region(2.0)), (Region::OffBody, region(7.0))].into());
        report.per_frame[1].regions = Some([(Region::Feet, region(4.0))].into());
        let means = report.region_means().unwrap();
        assert_eq!(means, [(Region::Feet, region(3.0)), (Region::OffBody, region(7.0))].into());
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["regions"]["off_body"]["cd_mm"], 7.0);
        assert_eq!(json["per_frame"][1]["regions"]["feet"]["cd_mm"], 4.0);
        assert!(json["per_frame"][2].get("regions").is_none(), "asked for in two frames");
    }

    #[test]
    fn looks_are_told_where_they_were_asked_for() {
        let likeness = |psnr_db: f64| Some(Likeness { psnr_db, ssim: 0.5 });
        let mut report = report(false);
        assert!(serde_json::to_value(&report).unwrap().get("pictures").is_none());
        report.per_frame[0].pictures = Some(parts(likeness(20.0), None, likeness(30.0)));
        report.per_frame[2].pictures = Some(parts(likeness(24.0), likeness(10.0), None));
        assert_eq!(report.picture_means(), Some(parts(likeness(22.0), likeness(10.0), likeness(30.0))));
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["pictures"]["all"]["psnr_db"], 22.0);
        assert_eq!(json["per_frame"][2]["pictures"]["hands"]["ssim"], 0.5);
        assert!(report.to_string().contains("22.00"), "{report}");
    }

    #[test]
    fn the_table_stands_in_columns() {
        let mut report = report(true);
        report.per_frame[0].pictures = Some(parts(Some(Likeness { psnr_db: 20.0, ssim: 0.5 }), None, None));
        let region = RegionMetrics { cd_mm: 1.0, cd_max_mm: 9.0, nc: 0.5, share: 1.0 };
        report.per_frame[0].regions = Some([(Region::OffBody, region)].into());
        let table = report.to_string();
        let rows: Vec<&str> = table.lines().filter(|line| !line.contains("left out")).collect();
        assert_eq!(
            rows.len(),
            10,
            "a head, a row each for three parts of the avatar and the baseline, a region, a head and a row of pictures\n{table}"
        );
        assert!(rows.iter().all(|row| row.chars().count() == rows[0].chars().count()), "{table}");
        assert!(table.contains("not measurable in 1 of 3 frames"), "{table}");
    }
}
