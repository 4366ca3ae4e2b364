//! Lines over one axis as a picture of its own: an SVG that every browser shows.

use serde::Serialize;

use super::chart::Chart;
use super::page::template;
use crate::Result;

/// A class and a colour for each line.
const LINES: [(&str, &str); 4] =
    [("first", "#0b6e66"), ("second", "#c2571a"), ("third", "#5b4bb2"), ("fourth", "#8a6d00")];

/// Lines over one axis.
#[derive(Clone, Debug)]
pub struct LineFigure {
    /// Its heading.
    pub title: String,
    /// What lies along it and what upward, with units.
    pub axes: String,
    /// Names and places (x, y); places that are not finite are left out. The first four are drawn.
    pub lines: Vec<(String, Vec<(f64, f64)>)>,
}

#[derive(Serialize)]
struct Key<'a> {
    name: &'a str,
    class: &'static str,
    colour: &'static str,
}

#[derive(Serialize)]
struct Filled<'a> {
    title: &'a str,
    axes: &'a str,
    lines: Vec<Key<'a>>,
    chart: Chart,
}

impl LineFigure {
    /// The picture as SVG.
    ///
    /// # Errors
    /// If the template cannot be filled.
    pub fn svg(&self) -> Result<String> {
        let drawn = || self.lines.iter().zip(LINES);
        let lines: Vec<_> = drawn().map(|((_, points), (class, _))| (class, points.as_slice())).collect();
        let filled = Filled {
            title: &self.title,
            axes: &self.axes,
            lines: drawn().map(|((name, _), (class, colour))| Key { name, class, colour }).collect(),
            chart: Chart::lines(format!("{}: {}", self.title, self.axes), &lines),
        };
        template("figure.xml", filled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_drawn_as_far_as_it_is_known_and_its_name_is_text() {
        let figure = LineFigure {
            title: "Error <of> the turn".into(),
            axes: "turn, degrees; CD, mm".into(),
            lines: vec![("all".into(), vec![(90.0, 2.0), (180.0, f64::NAN), (360.0, 1.0)]), ("<hands>".into(), vec![])],
        };
        let svg = figure.svg().unwrap();
        assert!(
            svg.contains("Error &lt;of&gt; the turn") && svg.contains("&lt;hands&gt;") && !svg.contains("NaN"),
            "{svg}"
        );
        assert_eq!(svg.matches("<circle").count(), 2, "{svg}");
        assert_eq!(svg.matches("class=\"first\"").count(), 1, "{svg}");
    }
}
