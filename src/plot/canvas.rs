//! Lines, marks and words on a white sheet, in pixels of the finished figure.

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{Circle, DashedPathElement, Drawable, PathElement, PointCollection, Polygon, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, FontTransform, IntoFont, RGBColor, ShapeStyle, TextStyle};

use super::style::{Mark, Style};

/// The library places things on whole pixels: the sheet is drawn this much larger and shown smaller.
const SCALE: f64 = 8.0;

/// Fonts that every desktop has one of.
const FONT: &str = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif";

/// The library divides sizes by this.
const FONT_FACTOR: f64 = 1.24;

pub(super) const INK: RGBColor = RGBColor(38, 38, 38);
pub(super) const FRAME: RGBColor = RGBColor(120, 120, 120);
pub(super) const GRID: RGBColor = RGBColor(222, 222, 222);
pub(super) const FAINT_GRID: RGBColor = RGBColor(241, 241, 241);

/// Half the size of a mark, px.
const MARK_PX: f64 = 3.2;

/// Which end of a text is at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Align {
    Start,
    Middle,
    End,
}

/// A white sheet.
pub(super) struct Canvas {
    size_px: [f64; 2],
    elements: Vec<Element>,
}

/// What is drawn when all is known.
enum Element {
    Line(Vec<[f64; 2]>, RGBColor, f64, Option<[f64; 2]>),
    Area(Vec<[f64; 2]>, RGBColor),
    Disc([f64; 2], f64, RGBColor),
    Text { text: String, place: [f64; 2], size_px: f64, align: Align, bold: bool, upwards: bool },
}

impl Canvas {
    pub(super) const fn new(size_px: [f64; 2]) -> Self {
        Self { size_px, elements: Vec::new() }
    }

    pub(super) fn line(&mut self, points: Vec<[f64; 2]>, colour: RGBColor, width_px: f64) {
        self.elements.push(Element::Line(points, colour, width_px, None));
    }

    /// The line of a series.
    pub(super) fn curve(&mut self, points: Vec<[f64; 2]>, style: &Style) {
        self.elements.push(Element::Line(points, style.colour, 1.7, style.dash));
    }

    /// The mark of a series.
    pub(super) fn mark(&mut self, [x, y]: [f64; 2], style: &Style) {
        let r = MARK_PX;
        let corners: Vec<[f64; 2]> = match style.mark {
            Mark::Disc => return self.elements.push(Element::Disc([x, y], r, style.colour)),
            Mark::Ring => {
                self.elements.push(Element::Disc([x, y], r * 1.1, style.colour));
                return self.elements.push(Element::Disc([x, y], r * 0.55, RGBColor(255, 255, 255)));
            }
            Mark::Square => vec![[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]],
            Mark::Triangle => vec![[0.0, -1.25], [1.1, 0.8], [-1.1, 0.8]],
            Mark::Diamond => vec![[0.0, -1.35], [1.1, 0.0], [0.0, 1.35], [-1.1, 0.0]],
        };
        self.elements
            .push(Element::Area(corners.into_iter().map(|[a, b]| [x + r * a, y + r * b]).collect(), style.colour));
    }

    pub(super) fn text(&mut self, text: &str, place: [f64; 2], size_px: f64, align: Align) {
        self.elements.push(Element::Text { text: text.into(), place, size_px, align, bold: false, upwards: false });
    }

    pub(super) fn bold_text(&mut self, text: &str, place: [f64; 2], size_px: f64, align: Align) {
        self.elements.push(Element::Text { text: text.into(), place, size_px, align, bold: true, upwards: false });
    }

    /// Turned a quarter to the left, its middle at `place`.
    pub(super) fn upward_text(&mut self, text: &str, place: [f64; 2], size_px: f64) {
        let text = text.into();
        self.elements.push(Element::Text { text, place, size_px, align: Align::Middle, bold: false, upwards: true });
    }

    /// The document.
    pub(super) fn into_svg(self) -> String {
        let [width, height] = self.size_px.map(|side| whole(side).unsigned_abs());
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, (width, height)).into_drawing_area();
            draw(&area, &Rectangle::new([(0, 0), scaled(self.size_px)], RGBColor(255, 255, 255).filled()));
            for element in self.elements {
                element.draw(&area);
            }
        }
        // Large inside, of the wanted size outside.
        let [shown_width, shown_height] = self.size_px.map(f64::round);
        let head = format!("<svg width=\"{width}\" height=\"{height}\"");
        svg.replacen(&head, &format!("<svg width=\"{shown_width}\" height=\"{shown_height}\""), 1)
    }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

impl Element {
    fn draw(self, area: &Area<'_>) {
        match self {
            Self::Line(points, colour, width_px, dash) => {
                let points: Vec<(i32, i32)> = points.into_iter().map(scaled).collect();
                let style =
                    ShapeStyle { color: colour.to_rgba(), filled: false, stroke_width: whole(width_px).unsigned_abs() };
                match dash {
                    None => draw(area, &PathElement::new(points, style)),
                    Some([stroke, gap]) => {
                        draw(area, &DashedPathElement::new(points, whole(stroke), whole(gap), style));
                    }
                }
            }
            Self::Area(corners, colour) => {
                draw(area, &Polygon::new(corners.into_iter().map(scaled).collect::<Vec<_>>(), colour.filled()));
            }
            Self::Disc(centre, radius_px, colour) => {
                draw(area, &Circle::new(scaled(centre), whole(radius_px), colour.filled()));
            }
            Self::Text { text, place, size_px, align, bold, upwards } => {
                // XML has no control characters.
                let text: String = text.chars().filter(|c| !c.is_control()).collect();
                if text.is_empty() {
                    return;
                }
                let horizontal = match align {
                    Align::Start => HPos::Left,
                    Align::Middle => HPos::Center,
                    Align::End => HPos::Right,
                };
                let font = (FONT, size_px * SCALE * FONT_FACTOR).into_font();
                let font = if bold { font.style(FontStyle::Bold) } else { font };
                let font = if upwards { font.transform(FontTransform::Rotate270) } else { font };
                let style = TextStyle::from(font).color(&INK).pos(Pos::new(horizontal, VPos::Center));
                draw(area, &Text::new(text, scaled(place), style));
            }
        }
    }
}

/// Into a string nothing fails to be written.
fn draw<'b, E>(area: &Area<'b>, element: &E)
where
    for<'a> &'a E: PointCollection<'a, (i32, i32)>,
    E: Drawable<SVGBackend<'b>>,
{
    let _ = area.draw(element);
}

fn scaled([x, y]: [f64; 2]) -> (i32, i32) {
    (whole(x), whole(y))
}

#[expect(clippy::cast_possible_truncation, reason = "pixels of a figure")]
fn whole(length_px: f64) -> i32 {
    (length_px * SCALE).round() as i32
}
