//! The page as PDF, whose unit is the point: 1/72 inch.

use nalgebra::Vector2;
use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str, TextStr};

use super::{Print, PrintError};
use crate::board::Shape;

/// Points of a millimetre.
const POINTS: f64 = 72.0 / 25.4;

/// Longest side of a page that every reader takes (ISO 32000, annex C), points.
const MAX_SIDE: f64 = 14_400.0;

/// Cubic curves of a circle: with eight the radius is off by 4e-6 of itself.
const ARCS: u32 = 8;

const FONT: Name<'static> = Name(b"F1");

impl Print {
    /// The page as a PDF, always the same bytes.
    ///
    /// # Errors
    /// [`PrintError::Pdf`] if the page is larger than those of a PDF.
    pub fn pdf(&self) -> Result<Vec<u8>, PrintError> {
        if self.page_mm.max() * POINTS > MAX_SIDE {
            return Err(PrintError::Pdf { page_mm: self.page_mm(), max_mm: MAX_SIDE / POINTS });
        }
        let [catalog, pages, page, font, content, info] = [1, 2, 3, 4, 5, 6].map(Ref::new);
        let [width, height] = self.page_mm().map(points);
        let mut pdf = Pdf::new();
        pdf.catalog(catalog).pages(pages);
        pdf.pages(pages).kids([page]).count(1);
        let mut written = pdf.page(page);
        written.media_box(Rect::new(0.0, 0.0, width, height)).parent(pages).contents(content);
        written.resources().fonts().pair(FONT, font);
        written.finish();
        pdf.type1_font(font).base_font(Name(b"Helvetica"));
        pdf.stream(content, &self.content().finish());
        pdf.document_info(info).title(TextStr(&self.text)).producer(TextStr("skypose"));
        Ok(pdf.finish())
    }

    fn content(&self) -> Content {
        let mut content = Content::new();
        // A page counts y upwards.
        let place = |at: Vector2<f64>| [points(at.x), points(self.page_mm.y - at.y)];
        let mut rectangle = |least: Vector2<f64>, greatest: Vector2<f64>| {
            let [[left, top], [right, bottom]] = [least, greatest].map(place);
            let path = content.move_to(left, top).line_to(right, top).line_to(right, bottom).line_to(left, bottom);
            path.close_path();
        };
        for shape in self.ink() {
            if let Shape::Rectangle { least, greatest } = shape {
                rectangle(least, greatest);
            }
        }
        let [bar, end] = self.bar();
        rectangle(bar, end);
        for shape in self.ink() {
            if let Shape::Disc { centre, radius } = shape {
                circle(&mut content, place, centre, radius);
            }
        }
        // One path, so that no reader leaves a seam between two that touch.
        content.fill_nonzero();
        for line in self.lines() {
            let [x, y] = place(line.at);
            content.begin_text().set_font(FONT, points(line.size_mm)).next_line(x, y);
            content.show(Str(&ascii(&line.text))).end_text();
        }
        content
    }
}

fn circle(content: &mut Content, place: impl Fn(Vector2<f64>) -> [f32; 2], centre: Vector2<f64>, radius: f64) {
    let step = std::f64::consts::TAU / f64::from(ARCS);
    let reach = 4.0 / 3.0 * (0.25 * step).tan();
    let [x, y] = place(centre + Vector2::new(radius, 0.0));
    content.move_to(x, y);
    for arc in 0..ARCS {
        let at = |angle: f64| Vector2::new(angle.cos(), angle.sin()) * radius;
        let along = |point: Vector2<f64>| Vector2::new(-point.y, point.x) * reach;
        let (from, to) = (at(f64::from(arc) * step), at(f64::from(arc + 1) * step));
        let [[x1, y1], [x2, y2], [x3, y3]] =
            [from + along(from), to - along(to), to].map(|offset| place(centre + offset));
        content.cubic_to(x1, y1, x2, y2, x3, y3);
    }
    content.close_path();
}

#[expect(clippy::cast_possible_truncation, reason = "seven digits: 30 nm on A4")]
fn points(mm: f64) -> f32 {
    (mm * POINTS) as f32
}

/// The font's own encoding is used, which has no more in common with Unicode.
fn ascii(text: &str) -> Vec<u8> {
    text.chars().map(|c| u8::try_from(c).ok().filter(|c| c.is_ascii_graphic() || *c == b' ').unwrap_or(b'?')).collect()
}

#[cfg(test)]
mod tests {
    use crate::board::Board;
    use crate::board::print::{Print, PrintError};

    #[test]
    fn a_page_is_of_true_size() {
        let board: Board = "chessboard:9x6:0.02".parse().expect("a board");
        let pdf = Print::checked(&board, "(text)", None).expect("prints").pdf().expect("a page");
        let text = String::from_utf8_lossy(&pdf);
        assert!(text.starts_with("%PDF-") && text.contains("/MediaBox [0 0 841.8898 595.2756]"), "{text}");
    }

    #[test]
    fn a_wall_is_no_page() {
        let board: Board = "chessboard:9x6:1".parse().expect("a board");
        let refused = Print::checked(&board, "", None).expect("prints").pdf();
        assert!(matches!(refused, Err(PrintError::Pdf { .. })), "{refused:?}");
    }
}
