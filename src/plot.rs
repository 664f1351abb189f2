//! Charts as SVG: a figure of one or several panels with a legend below them all, so that it hides nothing.
//!
//! ```
//! use skypose::plot::{Axis, Figure, Panel, Series};
//!
//! let panel = Panel {
//!     title: "Range".into(),
//!     x: Axis::logarithmic("distance (m)"),
//!     y: Axis::logarithmic("standard deviation (m)"),
//!     series: vec![Series::of("face on", [(1.0, 0.001), (2.0, 0.004), (4.0, 0.016)])],
//! };
//! let svg = Figure { title: "What to expect".into(), panels: vec![panel] }.svg();
//! assert!(svg.starts_with("<svg"));
//! ```
//!
//! A series keeps its colour, dash and mark through all panels of a figure: the place of its name in the legend decides.

mod axis;
mod canvas;
mod legend;
mod panel;
mod style;

pub use axis::{Axis, Limits, Scale};

use canvas::{Align, Canvas};
use style::Style;

/// Panels side by side before a new row begins.
const MAX_COLUMNS: usize = 3;

/// Size of a panel with its title, tick labels and axis labels.
const PANEL_PX: [f64; 2] = [400.0, 330.0];

/// Space around everything.
const MARGIN_PX: f64 = 14.0;

/// Height of the figure's title.
const TITLE_PX: f64 = 34.0;

/// A picture of one or several panels.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Above all panels; empty for none.
    pub title: String,
    /// From left to right, then down.
    pub panels: Vec<Panel>,
}

/// A figure among others.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// A word for files and links.
    pub name: String,
    /// For people, beside the picture.
    pub caption: String,
    /// The picture.
    pub figure: Figure,
}

/// One chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Above the chart.
    pub title: String,
    /// Below the chart.
    pub x: Axis,
    /// Left of the chart.
    pub y: Axis,
    /// What is drawn.
    pub series: Vec<Series>,
}

/// A named sequence of points.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// As in the legend. Series of one name in several panels look alike.
    pub name: String,
    /// In the order in which they are joined. `None`, or a number that the axis cannot show, breaks the line.
    pub points: Vec<Option<[f64; 2]>>,
}

impl Series {
    /// Of points without gaps.
    pub fn of(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { name: name.into(), points: points.into_iter().map(|(x, y)| Some([x, y])).collect() }
    }
}

impl Figure {
    /// The figure as an SVG document.
    #[must_use]
    pub fn svg(&self) -> String {
        let names = self.names();
        let columns = self.panels.len().clamp(1, MAX_COLUMNS);
        let rows = self.panels.len().div_ceil(columns);
        let width = columns as f64 * PANEL_PX[0] + 2.0 * MARGIN_PX;
        let top = MARGIN_PX + if self.title.is_empty() { 0.0 } else { TITLE_PX };
        let bottom = top + rows as f64 * PANEL_PX[1];
        let legend = legend::Legend::of(&names, width - 2.0 * MARGIN_PX);
        let mut canvas = Canvas::new([width, bottom + legend.height_px() + MARGIN_PX]);
        canvas.bold_text(&self.title, [width / 2.0, MARGIN_PX + 10.0], 17.0, Align::Middle);
        for (index, panel) in self.panels.iter().enumerate() {
            let (row, column) = (index / columns, index % columns);
            let corner = [MARGIN_PX + column as f64 * PANEL_PX[0], top + row as f64 * PANEL_PX[1]];
            panel::draw(&mut canvas, panel, corner, PANEL_PX, |name| style_of(&names, name));
        }
        legend.draw(&mut canvas, [MARGIN_PX, bottom]);
        canvas.into_svg()
    }

    /// The names of all series, each once, in the order in which they come.
    fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if !names.contains(&series.name.as_str()) {
                names.push(&series.name);
            }
        }
        names
    }
}

fn style_of(names: &[&str], name: &str) -> Style {
    Style::of(names.iter().position(|known| *known == name).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel(series: Vec<Series>) -> Panel {
        Panel { title: "A".into(), x: Axis::logarithmic("x (m)"), y: Axis::linear("y"), series }
    }

    #[test]
    fn a_series_looks_the_same_in_every_panel_and_stands_in_the_legend_once() {
        let one = Series::of("one", [(1.0, 1.0), (2.0, 2.0)]);
        let two = Series::of("two", [(1.0, 2.0), (2.0, 1.0)]);
        let figure =
            Figure { title: String::new(), panels: vec![panel(vec![one.clone(), two.clone()]), panel(vec![two])] };
        let svg = figure.svg();
        assert_eq!(svg.matches(">\ntwo\n<").count(), 1, "{svg}");
        let colour = Style::of(1).svg_colour();
        // A line and two marks in each panel, a line and a mark in the legend.
        assert!(svg.matches(&colour).count() >= 8, "{colour} in {svg}");
    }

    #[test]
    fn names_cannot_break_the_document() {
        let series = Series::of("<b>&\u{0}\u{8}\"'", [(1.0, 1.0), (2.0, 2.0)]);
        let svg = Figure { title: "a < b & c\u{1b}".into(), panels: vec![panel(vec![series])] }.svg();
        assert!(svg.contains("a &lt; b &amp; c") && !svg.contains("<b>"), "{svg}");
        assert!(!svg.chars().any(|c| c.is_control() && c != '\n'), "XML has no control characters");
    }

    #[test]
    fn what_an_axis_cannot_show_breaks_the_line_and_nothing_else() {
        let points =
            [Some([1.0, 0.5]), Some([2.0, f64::NAN]), None, Some([0.0, 1.0]), Some([3.0, 1.0]), Some([4.0, 0.0])];
        let broken = Series { name: "broken".into(), points: points.to_vec() };
        let svg = Figure { title: String::new(), panels: vec![panel(vec![broken])] }.svg();
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        let empty = Figure { title: String::new(), panels: vec![panel(Vec::new())] }.svg();
        assert!(empty.trim_end().ends_with("</svg>"), "{empty}");
        assert!(Figure { title: String::new(), panels: Vec::new() }.svg().trim_end().ends_with("</svg>"));
    }
}
