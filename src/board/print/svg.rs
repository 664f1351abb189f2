//! The page as SVG, its unit the millimetre.

use std::fmt::Write;

use super::Print;
use crate::board::Shape;

impl Print {
    /// The page as an SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        let [width, height] = self.page_mm().map(mm);
        let mut svg = String::new();
        // Writing to a string never fails.
        _ = writeln!(
            svg,
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}mm" height="{height}mm" viewBox="0 0 {width} {height}">"#
        );
        _ = writeln!(svg, "<title>{}</title>", escaped(&self.text));
        _ = writeln!(svg, r##"<rect id="page" width="{width}" height="{height}" fill="#fff"/>"##);
        // One path, so that no renderer leaves a seam between two that touch.
        let mut path = String::new();
        let mut discs = String::new();
        for shape in self.ink() {
            match shape {
                Shape::Rectangle { least, greatest } => {
                    let [x, y, right, bottom] = [least.x, least.y, greatest.x, greatest.y].map(mm);
                    _ = write!(path, "M{x} {y}H{right}V{bottom}H{x}Z");
                }
                Shape::Disc { centre, radius } => {
                    let [x, y, r] = [centre.x, centre.y, radius].map(mm);
                    _ = writeln!(discs, r#"<circle cx="{x}" cy="{y}" r="{r}"/>"#);
                }
            }
        }
        _ = writeln!(svg, "<g id=\"pattern\">");
        if !path.is_empty() {
            _ = writeln!(svg, r#"<path d="{path}"/>"#);
        }
        _ = writeln!(svg, "{discs}</g>");
        let [bar, end] = self.bar();
        let [x, y, bar_width, bar_height] = [bar.x, bar.y, end.x - bar.x, end.y - bar.y].map(mm);
        _ = writeln!(svg, r#"<rect id="scale" x="{x}" y="{y}" width="{bar_width}" height="{bar_height}"/>"#);
        for line in self.lines() {
            let [x, y, size] = [line.at.x, line.at.y, line.size_mm].map(mm);
            let text = escaped(&line.text);
            _ = writeln!(
                svg,
                r#"<text x="{x}" y="{y}" font-size="{size}" font-family="Helvetica, Arial, sans-serif">{text}</text>"#
            );
        }
        svg.push_str("</svg>\n");
        svg
    }
}

/// To the nanometre.
fn mm(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use rand::RngExt;

    use crate::board::print::Print;
    use crate::board::{Board, Ink, Shape};
    use crate::random::named;

    /// What a program that reads the SVG draws black of the pattern.
    fn drawn(svg: &str) -> Vec<Shape> {
        let pattern =
            svg.split_once("<g id=\"pattern\">").and_then(|(_, rest)| rest.split_once("</g>")).expect("a group").0;
        let number = |text: &str| text.trim().parse::<f64>().expect("a number");
        let attribute = |element: &str, name: &str| {
            let start = element.find(&format!(" {name}=\"")).expect("the attribute") + name.len() + 3;
            number(element[start..].split('"').next().expect("its end"))
        };
        let circles = pattern.lines().filter(|line| line.starts_with("<circle")).map(|line| Shape::Disc {
            centre: Vector2::new(attribute(line, "cx"), attribute(line, "cy")),
            radius: attribute(line, "r"),
        });
        let path = pattern.split("d=\"").nth(1).map_or("", |rest| rest.split('"').next().expect("its end"));
        let rectangles = path.split_terminator('Z').map(|part| {
            let numbers: Vec<f64> = part.split(['M', 'H', 'V', ' ']).filter(|n| !n.is_empty()).map(number).collect();
            let [x, y, right, bottom, back] = numbers.as_slice().try_into().expect("a rectangle");
            assert_eq!(x.to_bits(), back.to_bits(), "closed");
            Shape::Rectangle { least: Vector2::new(x, y), greatest: Vector2::new(right, bottom) }
        });
        circles.chain(rectangles).collect()
    }

    #[test]
    fn what_is_drawn_is_the_boards_ink_at_true_scale() {
        for text in [
            "chessboard:9x6:0.025",
            "circles:7x5:0.03",
            "asymmetric-circles:4x11:0.02",
            "dots:120:0.25x0.18:0.003:7",
            "aprilgrid:6x6:0.03",
        ] {
            let board: Board = text.parse().expect("a board");
            let print = Print::checked(&board, text, None).expect("prints");
            let drawn = drawn(&print.svg());
            let ink = Ink::of(board.shapes());
            let [least, greatest] = board.sheet();
            let mut rng = named("places on a sheet");
            let mut black = 0;
            for _ in 0..20_000 {
                let share = Vector2::new(rng.random::<f64>(), rng.random::<f64>());
                let place = least + (greatest - least).component_mul(&share);
                let on_page = place * 1e3 + print.origin_mm;
                let is_drawn = drawn.iter().any(|shape| shape.contains(&on_page));
                assert_eq!(is_drawn, ink.is_at(&place), "{text} at {place}");
                black += u32::from(is_drawn);
            }
            assert!((1_000..19_000).contains(&black), "{text}: {black} of 20000 places are black");
        }
    }

    #[test]
    fn a_text_cannot_break_the_picture() {
        let board: Board = "chessboard:9x6:0.025".parse().expect("a board");
        let svg = Print::checked(&board, "<b> & </svg>", None).expect("prints").svg();
        assert!(svg.contains("&lt;b&gt; &amp; &lt;/svg&gt;") && svg.matches("</svg>").count() == 1);
    }
}
