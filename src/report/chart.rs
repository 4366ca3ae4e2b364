//! Curves and dots over numbered steps, laid out for an inline SVG: places and texts, which `chart.html` draws.
//!
//! Coordinates are the SVG's own units, from the top left. Long series are binned: the mean as a line, what lies between the
//! smallest and the largest as a band, so that no outlier is lost.

use std::fmt::Write;

use serde::Serialize;

/// Room for the tick labels, and above and beside the plot.
const LEFT: f64 = 46.0;
const BOTTOM: f64 = 22.0;
const TOP: f64 = 6.0;
const RIGHT: f64 = 8.0;
/// Most points of a line.
const BINS: usize = 240;
/// A series whose largest value is this many times its smallest is shown on a logarithmic scale.
const LOGARITHMIC_FROM: f64 = 12.0;

/// A chart with all that its template needs.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Chart {
    width: f64,
    height: f64,
    /// What it shows, for those who do not see it.
    label: String,
    /// The plot's edges: left, right, top, bottom.
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    x_ticks: Vec<Tick>,
    y_ticks: Vec<Tick>,
    marks: Vec<Mark>,
}

/// A place on an axis, and its text.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Tick {
    at: f64,
    text: String,
}

/// Something drawn; the class says of what and how.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
enum Mark {
    /// SVG path data.
    Path { class: &'static str, data: String },
    /// A dot and its explanation.
    Dot { class: &'static str, x: f64, y: f64, title: String },
}

/// One of the values of a row of dots.
#[derive(Clone, Debug)]
pub(super) struct Dot {
    pub(super) class: &'static str,
    pub(super) value: f64,
    pub(super) title: String,
}

impl Chart {
    /// A curve of (step, value), at least one; values that are not finite are left out.
    pub(super) fn curve(label: String, points: &[(f64, f64)]) -> Option<Self> {
        let points: Vec<_> = points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
        let first = points.first()?.0;
        let last = points.iter().fold(first + 1.0, |last, point| last.max(point.0));
        let values: Vec<f64> = points.iter().map(|point| point.1).collect();
        let mut chart = Self::empty(label, 340.0, 190.0);
        let y = Scale::of(&values, chart.bottom, chart.top);
        let x = Scale { low: first, high: last, logarithmic: false, from: chart.left, to: chart.right };
        chart.y_ticks = y.ticks(4);
        chart.x_ticks = x.ticks(4);
        let bins: Vec<Bin> = points.chunks(points.len().div_ceil(BINS)).map(Bin::of).collect();
        if points.len() > BINS {
            let upper = bins.iter().map(|bin| (x.place(bin.step), y.place(bin.largest)));
            let lower = bins.iter().rev().map(|bin| (x.place(bin.step), y.place(bin.smallest)));
            chart.marks.push(Mark::Path { class: "band", data: path(upper.chain(lower)) });
        }
        let line = bins.iter().map(|bin| (x.place(bin.step), y.place(bin.mean)));
        chart.marks.push(Mark::Path { class: "line", data: path(line) });
        Some(chart)
    }

    /// Columns of dots, one a name, from zero; none if there is no column.
    pub(super) fn dots(label: String, columns: &[(String, Vec<Dot>)]) -> Option<Self> {
        let values: Vec<f64> = columns.iter().flat_map(|(_, dots)| dots).map(|dot| dot.value).collect();
        if values.is_empty() {
            return None;
        }
        let mut chart = Self::empty(label, 720.0, 200.0);
        let largest = values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let y = Scale::from_zero(largest, chart.bottom, chart.top);
        chart.y_ticks = y.ticks(4);
        let spacing = (chart.right - chart.left) / columns.len() as f64;
        let labelled = columns.len().div_ceil(12);
        for (index, (name, dots)) in columns.iter().enumerate() {
            let x = chart.left + (index as f64 + 0.5) * spacing;
            if index.is_multiple_of(labelled) {
                chart.x_ticks.push(Tick { at: round(x), text: name.clone() });
            }
            for dot in dots {
                let Dot { class, value, title } = dot.clone();
                chart.marks.push(Mark::Dot { class, x: round(x), y: round(y.place(value)), title });
            }
        }
        Some(chart)
    }

    /// Lines with a dot at each place, from zero, each with its class; values that are not finite are left out.
    pub(super) fn lines(label: String, lines: &[(&'static str, &[(f64, f64)])]) -> Self {
        let finite = |points: &[(f64, f64)]| -> Vec<_> {
            points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
        };
        let lines: Vec<_> = lines.iter().map(|(class, points)| (*class, finite(points))).collect();
        let largest = |value: fn(&(f64, f64)) -> f64| {
            lines.iter().flat_map(|(_, points)| points).map(value).fold(f64::MIN_POSITIVE, f64::max)
        };
        let mut chart = Self::empty(label, 720.0, 360.0);
        let x = Scale::from_zero(largest(|point| point.0), chart.left, chart.right);
        let y = Scale::from_zero(largest(|point| point.1), chart.bottom, chart.top);
        chart.x_ticks = x.ticks(6);
        chart.y_ticks = y.ticks(4);
        for (class, points) in lines {
            let places = || points.iter().map(|point| (x.place(point.0), y.place(point.1)));
            chart.marks.push(Mark::Path { class, data: path(places()) });
            chart.marks.extend(places().zip(&points).map(|((across, up), point)| Mark::Dot {
                class,
                x: round(across),
                y: round(up),
                title: format!("{}: {}", number(point.0), number(point.1)),
            }));
        }
        chart
    }

    fn empty(label: String, width: f64, height: f64) -> Self {
        Self {
            width,
            height,
            label,
            left: LEFT,
            right: width - RIGHT,
            top: TOP,
            bottom: height - BOTTOM,
            x_ticks: Vec::new(),
            y_ticks: Vec::new(),
            marks: Vec::new(),
        }
    }
}

/// Neighbouring points taken together.
struct Bin {
    step: f64,
    mean: f64,
    smallest: f64,
    largest: f64,
}

impl Bin {
    fn of(points: &[(f64, f64)]) -> Self {
        let mean = |value: fn(&(f64, f64)) -> f64| points.iter().map(value).sum::<f64>() / points.len() as f64;
        Self {
            step: mean(|point| point.0),
            mean: mean(|point| point.1),
            smallest: points.iter().map(|point| point.1).fold(f64::INFINITY, f64::min),
            largest: points.iter().map(|point| point.1).fold(f64::NEG_INFINITY, f64::max),
        }
    }
}

/// From values to places.
struct Scale {
    low: f64,
    high: f64,
    logarithmic: bool,
    /// Where `low` and `high` are drawn.
    from: f64,
    to: f64,
}

impl Scale {
    /// From zero to a little more than the largest value.
    fn from_zero(largest: f64, from: f64, to: f64) -> Self {
        Self { low: 0.0, high: largest * 1.05, logarithmic: false, from, to }
    }

    /// From zero if that shows the values well, else logarithmic or around them.
    fn of(values: &[f64], from: f64, to: f64) -> Self {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if low > 0.0 && high >= LOGARITHMIC_FROM * low {
            return Self { low: low * 0.9, high: high * 1.1, logarithmic: true, from, to };
        }
        let low = low.min(0.0);
        let high = if high > low { high + 0.05 * (high - low) } else { low + 1.0 };
        Self { low, high, logarithmic: false, from, to }
    }

    fn place(&self, value: f64) -> f64 {
        let share = if self.logarithmic {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        self.from + share.clamp(0.0, 1.0) * (self.to - self.from)
    }

    /// About `count` round values.
    fn ticks(&self, count: usize) -> Vec<Tick> {
        let values = if self.logarithmic { self.decades(count) } else { self.multiples(count) };
        values.into_iter().map(|value| Tick { at: round(self.place(value)), text: number(value) }).collect()
    }

    fn multiples(&self, count: usize) -> Vec<f64> {
        let rough = (self.high - self.low) / count as f64;
        let power = 10.0_f64.powf(rough.log10().floor());
        let step =
            [1.0, 2.0, 5.0, 10.0].map(|round| round * power).into_iter().find(|step| *step >= rough).unwrap_or(rough);
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        (first..=last).map(|multiple| multiple as f64 * step).collect()
    }

    /// Powers of ten, thinned out; with their doubles and quintuples where there are few.
    fn decades(&self, count: usize) -> Vec<f64> {
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let between: &[f64] = if (last - first) as usize > 2 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let stride = ((last - first) as usize / (count + 1)).max(1);
        let powers = (first..=last).step_by(stride);
        let values = powers.flat_map(|power| between.iter().map(move |factor| factor * 10.0_f64.powi(power)));
        values.filter(|value| (self.low..=self.high).contains(value)).collect()
    }
}

fn path(points: impl Iterator<Item = (f64, f64)>) -> String {
    let mut data = String::new();
    for (x, y) in points {
        let command = if data.is_empty() { 'M' } else { 'L' };
        let _ = write!(data, "{command}{} {}", round(x), round(y));
    }
    data
}

/// A tenth of a unit is finer than what is seen.
fn round(place: f64) -> f64 {
    (place * 10.0).round() / 10.0
}

/// A number with three digits that matter, and thousands told apart.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    if size >= 1000.0 {
        return grouped(value.round() as i64);
    }
    if size != 0.0 && size < 1e-3 {
        return format!("{value:.0e}").replace('-', "\u{2212}");
    }
    let digits = if size == 0.0 { 0 } else { (2 - size.log10().floor() as i32).clamp(0, 5) as usize };
    let text = format!("{value:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    text.replace('-', "\u{2212}")
}

/// An integer with a thin space between thousands.
pub(super) fn grouped(value: i64) -> String {
    let digits = value.unsigned_abs().to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    if value < 0 { format!("\u{2212}{text}") } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(ticks: &[Tick]) -> Vec<&str> {
        ticks.iter().map(|tick| tick.text.as_str()).collect()
    }

    #[test]
    fn numbers_are_short_and_exact() {
        let texts = [0.0, 1.0, 0.05, 1234567.0, 12.34, 123.4, -0.5, 2e-5].map(number);
        assert_eq!(texts, ["0", "1", "0.05", "1\u{202f}234\u{202f}567", "12.3", "123", "\u{2212}0.5", "2e\u{2212}5"]);
    }

    #[test]
    fn a_falling_loss_is_shown_on_a_logarithmic_scale_with_round_ticks() {
        let points: Vec<_> = (1..=1000).map(|step| (f64::from(step), 10.0 / f64::from(step))).collect();
        let chart = Chart::curve("loss".into(), &points).unwrap();
        assert_eq!(texts(&chart.y_ticks), ["0.01", "0.1", "1", "10"]);
        assert!(chart.y_ticks.windows(2).all(|pair| pair[0].at > pair[1].at), "larger is higher");
        assert_eq!(texts(&chart.x_ticks), ["500", "1\u{202f}000"]);
        let inside = |tick: &Tick| (chart.left..=chart.right).contains(&tick.at);
        assert!(chart.x_ticks.iter().all(inside));
    }

    // The band of a noisy series reaches its extremes; its line is the mean.
    #[test]
    fn no_outlier_is_lost_in_a_long_series() {
        let value = |step: u32| if step == 777 { 4.0 } else { 1.0 };
        let points: Vec<_> = (0..5000).map(|step| (f64::from(step), value(step))).collect();
        let chart = Chart::curve("loss".into(), &points).unwrap();
        let paths: Vec<&str> = chart
            .marks
            .iter()
            .map(|mark| match mark {
                Mark::Path { data, .. } => data.as_str(),
                Mark::Dot { .. } => unreachable!("a curve"),
            })
            .collect();
        let highest = |path: &str| {
            let heights = path.split(['M', 'L']).filter_map(|point| point.split(' ').nth(1)?.parse::<f64>().ok());
            heights.fold(f64::INFINITY, f64::min)
        };
        let top = Scale::of(&[1.0, 4.0], chart.bottom, chart.top).place(4.0);
        assert!((highest(paths[0]) - top).abs() < 0.2);
        assert!(highest(paths[1]) > top + 20.0);
    }

    #[test]
    fn odd_series_are_drawn_or_left_out_but_never_nan() {
        for points in
            [vec![(1.0, 2.0)], vec![(1.0, 0.0), (2.0, 0.0)], vec![(0.0, -1.0), (1.0, 1.0)], vec![(1.0, 5.0); 900]]
        {
            let chart = serde_json::to_string(&Chart::curve(String::new(), &points).unwrap()).unwrap();
            assert!(!chart.contains("NaN") && !chart.contains("null") && !chart.contains("inf"), "{chart}");
        }
        assert!(Chart::curve(String::new(), &[]).is_none());
        assert!(Chart::curve(String::new(), &[(1.0, f64::NAN)]).is_none());
        assert!(Chart::dots(String::new(), &[]).is_none());
    }
}
