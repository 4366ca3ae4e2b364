//! Line plots: several series over one pair of linear axes, with ticks, a legend and a marker a point.
//!
//! Series differ by colour and marker, so that a plot can be read without colours. Points that are not finite are gaps.

use glam::DVec2;
use image::{Rgb, RgbImage};

use super::colour_map::NAMED_COLOURS;
use super::text::{Size, blend, draw_text};
use xavatar_formats::{Error, Result};

const INK: [u8; 3] = [40, 40, 40];
const GRID: [u8; 3] = [226, 226, 226];
/// Between things, pixels.
const GAP: u32 = 10;
/// Half the width of a line, pixels.
const LINE: f32 = 1.2;
/// Half the width of a marker, pixels.
const MARKER: f32 = 4.0;
/// Length of a line in the legend, pixels.
const SWATCH: u32 = 30;
/// About how far apart ticks are, pixels.
const TICK_SPACING: f64 = 80.0;
/// Least room for a marker along x, pixels: more points than that make them a smear, and then there are none.
const MARKER_ROOM: usize = 14;
/// Smallest and largest side of a plot, pixels.
const SIDES: std::ops::RangeInclusive<u32> = 240..=8192;

/// A line.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// (x, y), in the order of the line; a point that is not finite interrupts it.
    pub points: Vec<(f64, f64)>,
}

/// A line plot.
#[derive(Clone, Debug)]
pub struct Plot {
    /// One line above the plot.
    pub title: String,
    /// What x is, with its unit.
    pub x_label: String,
    /// What y is, with its unit.
    pub y_label: String,
    /// Whether the y axis begins at 0 though all values lie above; lengths of errors should.
    pub from_zero: bool,
    /// The lines.
    pub series: Vec<Series>,
    /// Columns and rows, pixels.
    pub size: (u32, u32),
}

impl Plot {
    /// Draws it.
    ///
    /// # Errors
    /// [`Error::Value`] if no point is finite, or a side is not within 240 to 8192 pixels.
    pub fn draw(&self) -> Result<RgbImage> {
        let (width, height) = self.size;
        if !(SIDES.contains(&width) && SIDES.contains(&height)) {
            return Err(Error::Value {
                name: "size of a plot".into(),
                found: format!("{width} x {height} pixels"),
                expected: format!("{} to {} pixels a side", SIDES.start(), SIDES.end()),
            });
        }
        let mut points =
            self.series.iter().flat_map(|series| &series.points).filter(|(x, y)| x.is_finite() && y.is_finite());
        let Some(&first) = points.next() else {
            return Err(Error::Value {
                name: format!("points of the plot `{}`", self.title),
                found: format!("{} series without a finite point", self.series.len()),
                expected: "at least one".into(),
            });
        };
        let (mut low, mut high) = (DVec2::from(first), DVec2::from(first));
        for &point in points {
            (low, high) = (low.min(point.into()), high.max(point.into()));
        }
        if self.from_zero {
            (low.y, high.y) = (low.y.min(0.0), high.y.max(0.0));
        }
        let mut picture = RgbImage::from_pixel(width, height, Rgb([255; 3]));
        let top = self.draw_head(&mut picture);
        let bottom = height - 2 * GAP - Size::Small.height() * 2;
        let y_axis = Axis::new(low.y, high.y, f64::from(bottom), f64::from(top), true);
        let left =
            GAP + y_axis.ticks.iter().map(|tick| Size::Small.width(&y_axis.text(*tick))).max().unwrap_or(0) + GAP;
        let x_axis = Axis::new(low.x, high.x, f64::from(left), f64::from(width - 2 * GAP), false);
        self.draw_axes(&mut picture, &x_axis, &y_axis);
        for (index, series) in self.series.iter().enumerate() {
            let places: Vec<DVec2> =
                series.points.iter().map(|&(x, y)| DVec2::new(x_axis.place(x), y_axis.place(y))).collect();
            Style::of(index).draw(&mut picture, &places);
        }
        Ok(picture)
    }

    /// Title, legend and the name of y, above each other; returns where the axes may begin.
    fn draw_head(&self, picture: &mut RgbImage) -> u32 {
        let mut top = GAP;
        if !self.title.is_empty() {
            draw_text(picture, &self.title, [i64::from(GAP), i64::from(top)], Size::Large, INK);
            top += Size::Large.height() + GAP / 2;
        }
        let mut left = GAP;
        for (index, series) in self.series.iter().enumerate().filter(|(_, series)| !series.name.is_empty()) {
            let needed = SWATCH + GAP + Size::Small.width(&series.name) + 2 * GAP;
            if left > GAP && left + needed > picture.width() {
                (left, top) = (GAP, top + Size::Small.height() + 2);
            }
            let middle = f64::from(top + Size::Small.height() / 2);
            let line = [0, SWATCH / 2, SWATCH].map(|offset| DVec2::new(f64::from(left + offset), middle));
            let style = Style::of(index);
            style.draw_line(picture, &line);
            style.draw_marker(picture, line[1]);
            let place = [i64::from(left + SWATCH + GAP), i64::from(top)];
            draw_text(picture, &series.name, place, Size::Small, INK);
            left += needed;
        }
        if left > GAP {
            top += Size::Small.height() + GAP / 2;
        }
        draw_text(picture, &self.y_label, [i64::from(GAP), i64::from(top)], Size::Small, INK);
        top + Size::Small.height() + GAP
    }

    fn draw_axes(&self, picture: &mut RgbImage, x_axis: &Axis, y_axis: &Axis) {
        let [left, right] = x_axis.pixels.map(|place| place.round() as i64);
        let [bottom, top] = y_axis.pixels.map(|place| place.round() as i64);
        let letter = i64::from(Size::Small.height());
        for &tick in &y_axis.ticks {
            let y = y_axis.place(tick).round() as i64;
            (left..=right).for_each(|x| blend(picture, [x, y], GRID, 1.0));
            let text = y_axis.text(tick);
            let place = [left - i64::from(GAP / 2 + Size::Small.width(&text)), y - letter / 2];
            draw_text(picture, &text, place, Size::Small, INK);
        }
        for &tick in &x_axis.ticks {
            let x = x_axis.place(tick).round() as i64;
            (top..=bottom).for_each(|y| blend(picture, [x, y], GRID, 1.0));
            let text = x_axis.text(tick);
            let half = i64::from(Size::Small.width(&text)) / 2;
            let last = i64::from(picture.width()) - 2 * half;
            draw_text(picture, &text, [(x - half).clamp(0, last.max(0)), bottom + 4], Size::Small, INK);
        }
        (left..=right).for_each(|x| blend(picture, [x, bottom], INK, 1.0));
        (top..=bottom).for_each(|y| blend(picture, [left, y], INK, 1.0));
        let middle = (left + right - i64::from(Size::Small.width(&self.x_label))) / 2;
        draw_text(picture, &self.x_label, [middle.max(0), bottom + 6 + letter], Size::Small, INK);
    }
}

/// A linear axis: values at its ends and at its ticks, and where the ends lie.
struct Axis {
    ends: [f64; 2],
    pixels: [f64; 2],
    ticks: Vec<f64>,
    /// Digits behind the point that tell ticks apart.
    digits: usize,
}

impl Axis {
    /// From the pixel `from` to the pixel `to`; `whole` ticks at both ends, or only between them.
    fn new(low: f64, high: f64, from: f64, to: f64, whole: bool) -> Self {
        // A single value gets room around it.
        let room = if high > low { 0.0 } else { low.abs().max(1.0) * 0.5 };
        let (low, high) = (low - room, high + room);
        let step = round_step((high - low) * TICK_SPACING / (to - from).abs().max(1.0));
        let (first, last) = ((low / step).floor(), (high / step).ceil());
        let ends = if whole { [first * step, last * step] } else { [low, high] };
        // Rounding must not lose a tick at an end.
        let slack = step * 1e-6;
        let ticks = (0..=(last - first) as usize)
            .map(|index| (first + index as f64) * step)
            .filter(|tick| (ends[0] - slack..=ends[1] + slack).contains(tick))
            .collect();
        let digits = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
        Self { ends, pixels: [from, to], ticks, digits }
    }

    fn place(&self, value: f64) -> f64 {
        let share = (value - self.ends[0]) / (self.ends[1] - self.ends[0]);
        self.pixels[0] + share * (self.pixels[1] - self.pixels[0])
    }

    fn text(&self, tick: f64) -> String {
        if tick != 0.0 && (tick.abs() >= 1e7 || self.digits > 6) {
            return format!("{tick:.1e}");
        }
        let text = format!("{tick:.*}", self.digits);
        if text.trim_matches(['-', '0', '.']).is_empty() { text.trim_start_matches('-').into() } else { text }
    }
}

/// The least of 1, 2, 5 times a power of ten that is not below `least`.
fn round_step(least: f64) -> f64 {
    let power = 10_f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|digit| digit * power)
        .find(|step| *step >= least * 0.999)
        .unwrap_or(10.0 * power)
}

/// How a series is drawn.
struct Style {
    colour: [u8; 3],
    marker: fn(f32, f32) -> f32,
}

impl Style {
    fn of(index: usize) -> Self {
        /// The distance from a marker's edge, negative inside, in units of its half width.
        const MARKERS: [fn(f32, f32) -> f32; 4] = [
            |x, y| x.hypot(y) - 1.0,
            |x, y| x.abs().max(y.abs()) - 0.9,
            |x, y| (y - 0.8).max(x.abs() * 0.87 - y * 0.5 - 0.55),
            |x, y| (x.abs() + y.abs() - 1.25) * 0.71,
        ];
        Self { colour: NAMED_COLOURS[index % NAMED_COLOURS.len()], marker: MARKERS[index % MARKERS.len()] }
    }

    fn draw(&self, picture: &mut RgbImage, places: &[DVec2]) {
        for line in places.split(|place| !place.is_finite()) {
            self.draw_line(picture, line);
        }
        let finite: Vec<&DVec2> = places.iter().filter(|place| place.is_finite()).collect();
        if finite.len() * MARKER_ROOM < picture.width() as usize {
            finite.into_iter().for_each(|place| self.draw_marker(picture, *place));
        }
    }

    fn draw_line(&self, picture: &mut RgbImage, line: &[DVec2]) {
        // Joints are drawn once: each pixel takes the largest share of any segment.
        let mut shares = std::collections::BTreeMap::new();
        for ends in line.windows(2) {
            let [from, to] = [ends[0].as_vec2(), ends[1].as_vec2()];
            let (low, high) = (from.min(to) - LINE - 1.0, from.max(to) + LINE + 1.0);
            let along = to - from;
            for y in low.y.floor() as i64..=high.y.ceil() as i64 {
                // Only the columns near this row's part of the segment.
                let near =
                    |y: f32| if along.y.abs() < 1e-3 { None } else { Some(from.x + (y - from.y) / along.y * along.x) };
                let reach = (LINE + 1.0) * (1.0 + (along.x / along.y).abs());
                let (left, right) = match near(y as f32) {
                    Some(x) if reach.is_finite() => ((x - reach).max(low.x), (x + reach).min(high.x)),
                    _ => (low.x, high.x),
                };
                for x in left.floor() as i64..=right.ceil() as i64 {
                    let offset = glam::Vec2::new(x as f32, y as f32) - from;
                    let place = (offset.dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
                    let share = (LINE + 0.5 - offset.distance(along * place)).clamp(0.0, 1.0);
                    if share > 0.0 {
                        let most = shares.entry((x, y)).or_insert(0.0_f32);
                        *most = most.max(share);
                    }
                }
            }
        }
        for ((x, y), share) in shares {
            blend(picture, [x, y], self.colour, share);
        }
    }

    fn draw_marker(&self, picture: &mut RgbImage, place: DVec2) {
        let reach = MARKER as i64 + 2;
        let (column, row) = (place.x.round() as i64, place.y.round() as i64);
        for y in row - reach..=row + reach {
            for x in column - reach..=column + reach {
                let (dx, dy) = ((x as f64 - place.x) as f32 / MARKER, (y as f64 - place.y) as f32 / MARKER);
                blend(picture, [x, y], self.colour, (0.5 - (self.marker)(dx, dy) * MARKER).clamp(0.0, 1.0));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(points: Vec<(f64, f64)>) -> Plot {
        Plot {
            title: "error".into(),
            x_label: "angle (degrees)".into(),
            y_label: "CD (mm)".into(),
            from_zero: true,
            series: vec![Series { name: "avatar".into(), points }],
            size: (480, 320),
        }
    }

    fn columns_of(picture: &RgbImage, colour: [u8; 3], rows: std::ops::Range<u32>) -> Vec<u32> {
        let has = |x: &u32| rows.clone().any(|y| picture.get_pixel(*x, y).0 == colour);
        (0..picture.width()).filter(has).collect()
    }

    #[test]
    fn lines_run_from_the_first_to_the_last_value_and_gaps_stay_open() {
        let line: Vec<(f64, f64)> = (0..=360).map(|x| (f64::from(x), f64::from(x) / 100.0)).collect();
        let whole = plot(line.clone()).draw().unwrap();
        // Below the legend.
        let drawn = columns_of(&whole, NAMED_COLOURS[0], 80..320);
        assert!(drawn.windows(2).all(|pair| pair[1] == pair[0] + 1), "one line without gaps");
        assert!(drawn.len() > 380 && drawn[0] < 60 && drawn[drawn.len() - 1] > 450, "{} columns", drawn.len());
        let broken =
            line.into_iter().map(|(x, y)| (x, if (100.0..200.0).contains(&x) { f64::NAN } else { y })).collect();
        let broken = columns_of(&plot(broken).draw().unwrap(), NAMED_COLOURS[0], 80..320);
        assert!((80..140).contains(&(drawn.len() - broken.len())), "{} of {}", broken.len(), drawn.len());
    }

    #[test]
    fn ticks_are_round_and_enclose_the_values() {
        let axis = Axis::new(0.0, 3.7, 300.0, 20.0, true);
        assert_eq!((axis.ends, axis.ticks.len()), ([0.0, 4.0], 3));
        assert_eq!([axis.text(0.0), axis.text(2.0)], ["0", "2"]);
        let axis = Axis::new(0.012, 0.0134, 300.0, 20.0, true);
        assert!(axis.ends[0] <= 0.012 && axis.ends[1] >= 0.0134 && axis.ticks.len() >= 3, "{:?}", axis.ticks);
        assert_eq!(axis.text(axis.ticks[0]).len(), 6, "{}", axis.text(axis.ticks[0]));
        assert_eq!(Axis::new(-1.0, 1.0, 0.0, 400.0, false).text(-1e-17), "0.0");
        for least in [1e-9, 0.3, 1.0, 1.01, 4.9, 77.0, 2e12] {
            let step = round_step(least);
            assert!((0.99 * least..=2.6 * least).contains(&step), "{least}: {step}");
        }
    }

    #[test]
    fn extreme_values_are_drawn_and_nothing_is_an_error() {
        assert!(plot(vec![(5.0, 7.0)]).draw().is_ok(), "a single point");
        assert!(plot(vec![(0.0, 1e300), (1.0, -1e300), (f64::INFINITY, 0.0)]).draw().is_ok());
        assert!(plot(vec![(0.0, 1e-300), (1e-300, 0.0)]).draw().is_ok());
        assert!(plot(vec![]).draw().is_err());
        assert!(plot(vec![(f64::NAN, 1.0)]).draw().unwrap_err().to_string().contains("error"));
        assert!(Plot { size: (10, 10_000), ..plot(vec![(0.0, 0.0)]) }.draw().is_err());
        let many =
            (0..40).map(|index| Series { name: format!("number {index}"), points: vec![(0.0, f64::from(index))] });
        assert!(Plot { series: many.collect(), ..plot(vec![]) }.draw().is_ok(), "a legend higher than the plot");
    }
}
