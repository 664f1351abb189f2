//! One panel: frame, grid, labels, and the series inside.

use super::Panel;
use super::axis::Ruler;
use super::canvas::{Align, Canvas, FAINT_GRID, FRAME, GRID};
use super::style::Style;

/// Room for the title above; tick labels and axis labels left and below; the next panel's labels right.
const TOP_PX: f64 = 30.0;
const LEFT_PX: f64 = 66.0;
const BOTTOM_PX: f64 = 52.0;
const RIGHT_PX: f64 = 16.0;

const TICK_TEXT_PX: f64 = 11.5;
const LABEL_TEXT_PX: f64 = 12.5;
const TITLE_TEXT_PX: f64 = 14.0;

/// Where numbers are on the sheet.
struct Plane {
    x: Ruler,
    y: Ruler,
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Plane {
    fn across(&self, x: f64) -> f64 {
        self.left + self.x.place(x) * (self.right - self.left)
    }

    fn up(&self, y: f64) -> f64 {
        self.bottom - self.y.place(y) * (self.bottom - self.top)
    }
}

/// Draws the panel with its upper left corner at `corner`.
pub(super) fn draw(
    canvas: &mut Canvas,
    panel: &Panel,
    [left, top]: [f64; 2],
    [width, height]: [f64; 2],
    style_of: impl Fn(&str) -> Style,
) {
    let shown = || {
        let points = panel.series.iter().flat_map(|series| &series.points).flatten();
        points.filter(|[x, y]| panel.x.shows(*x) && panel.y.shows(*y))
    };
    let plane = Plane {
        x: panel.x.ruler(shown().map(|point| point[0])),
        y: panel.y.ruler(shown().map(|point| point[1])),
        left: left + LEFT_PX,
        right: left + width - RIGHT_PX,
        top: top + TOP_PX,
        bottom: top + height - BOTTOM_PX,
    };
    grid(canvas, &plane);
    let middle = [f64::midpoint(plane.left, plane.right), f64::midpoint(plane.top, plane.bottom)];
    canvas.bold_text(&panel.title, [middle[0], plane.top - 14.0], TITLE_TEXT_PX, Align::Middle);
    canvas.text(&panel.x.label, [middle[0], plane.bottom + 36.0], LABEL_TEXT_PX, Align::Middle);
    canvas.upward_text(&panel.y.label, [left + 14.0, middle[1]], LABEL_TEXT_PX);
    for series in &panel.series {
        let style = style_of(&series.name);
        let visible = |point: &Option<[f64; 2]>| {
            let [x, y] = point.filter(|[x, y]| panel.x.shows(*x) && panel.y.shows(*y))?;
            Some([plane.across(x), plane.up(y)])
        };
        let places: Vec<Option<[f64; 2]>> = series.points.iter().map(visible).collect();
        for piece in places.split(Option::is_none).filter(|piece| piece.len() > 1) {
            canvas.curve(piece.iter().flatten().copied().collect(), &style);
        }
        for place in places.into_iter().flatten() {
            canvas.mark(place, &style);
        }
    }
}

fn grid(canvas: &mut Canvas, plane: &Plane) {
    let colour = |label: &str| if label.is_empty() { FAINT_GRID } else { GRID };
    for tick in &plane.x.ticks {
        let x = plane.across(tick.value);
        canvas.line(vec![[x, plane.top], [x, plane.bottom]], colour(&tick.label), 0.8);
        canvas.text(&tick.label, [x, plane.bottom + 14.0], TICK_TEXT_PX, Align::Middle);
    }
    for tick in &plane.y.ticks {
        let y = plane.up(tick.value);
        canvas.line(vec![[plane.left, y], [plane.right, y]], colour(&tick.label), 0.8);
        canvas.text(&tick.label, [plane.left - 6.0, y], TICK_TEXT_PX, Align::End);
    }
    let (left, right, top, bottom) = (plane.left, plane.right, plane.top, plane.bottom);
    canvas.line(vec![[left, top], [right, top], [right, bottom], [left, bottom], [left, top]], FRAME, 1.0);
}
