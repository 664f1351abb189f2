//! A board on paper at true scale: where on the page it lies, with a bar that tells whether the printer kept the scale.

mod pdf;
mod svg;

use std::fmt;
use std::str::FromStr;

use nalgebra::Vector2;
use thiserror::Error;

use super::{Board, Shape};

/// Printers leave the outermost of a page white, mm.
const EDGE_MM: f64 = 5.0;

/// Height of what stands below the pattern: the bar, its label and the text, mm.
const FOOT_MM: f64 = 8.0;

/// Least width of a page, mm: for the shortest bar with its label.
const MIN_WIDTH_MM: f64 = 40.0;

/// Lengths of the scale bar, mm; the longest that fits is taken.
const BARS_MM: [f64; 4] = [100.0, 50.0, 20.0, 10.0];

/// Size of the text, mm.
const TEXT_MM: f64 = 2.5;

/// Mean width of a letter of Helvetica, of the text's size; a little more than it is.
const LETTER_RATIO: f64 = 0.6;

/// What is printed on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Paper {
    /// ISO A4, upright or turned.
    A4,
    /// ISO A3, upright or turned.
    A3,
    /// US letter, upright or turned.
    Letter,
    /// Width and height, mm.
    Millimetres([f64; 2]),
}

impl Paper {
    /// Those that are tried where none is named, by size.
    const USUAL: [Self; 2] = [Self::A4, Self::A3];

    /// Width and height of the upright page, mm.
    #[must_use]
    pub const fn size_mm(self) -> [f64; 2] {
        match self {
            Self::A4 => [210.0, 297.0],
            Self::A3 => [297.0, 420.0],
            Self::Letter => [215.9, 279.4],
            Self::Millimetres(size_mm) => size_mm,
        }
    }

    /// The page on which so much finds room, mm: for a standard one upright or turned, as what is printed is.
    fn holding(self, need_mm: &Vector2<f64>) -> Option<Vector2<f64>> {
        let page = Vector2::from(self.size_mm());
        let is_turned = !matches!(self, Self::Millimetres(_)) && need_mm.x > need_mm.y;
        let ways = match self {
            Self::Millimetres(_) => [page, page],
            _ if is_turned => [page.yx(), page],
            _ => [page, page.yx()],
        };
        ways.into_iter().find(|page| need_mm.x <= page.x && need_mm.y <= page.y)
    }
}

impl fmt::Display for Paper {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size_mm();
        let name = match self {
            Self::A4 => "a4: ",
            Self::A3 => "a3: ",
            Self::Letter => "letter: ",
            Self::Millimetres(_) => "",
        };
        write!(f, "{name}{width} x {height} mm")
    }
}

/// A text that names no paper.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{text:?} is no paper: a4, a3, letter, or WIDTHxHEIGHT in millimetres, from 20 to 100000 each")]
pub struct PaperError {
    /// What was given.
    pub text: String,
}

impl FromStr for Paper {
    type Err = PaperError;

    fn from_str(text: &str) -> Result<Self, PaperError> {
        let side = |text: &str| text.parse::<f64>().ok().filter(|side| (20.0..=1e5).contains(side));
        let size = || text.split_once('x').and_then(|(width, height)| Some([side(width)?, side(height)?]));
        match text.to_ascii_lowercase().as_str() {
            "a4" => Ok(Self::A4),
            "a3" => Ok(Self::A3),
            "letter" => Ok(Self::Letter),
            _ => size().map(Self::Millimetres).ok_or_else(|| PaperError { text: text.into() }),
        }
    }
}

/// Why a board cannot be printed.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PrintError {
    /// It is larger than the page.
    #[error(
        "with its margins and its scale bar it takes {:.1} x {:.1} mm, which do not fit on the paper ({paper})",
        need_mm[0], need_mm[1]
    )]
    Paper {
        /// Width and height that it takes, mm.
        need_mm: [f64; 2],
        /// The paper.
        paper: Paper,
    },
    /// It is larger than a page of a PDF can be.
    #[error("the page is {:.0} x {:.0} mm, and one of a PDF at most {max_mm:.0} mm a side", page_mm[0], page_mm[1])]
    Pdf {
        /// Width and height of the page, mm.
        page_mm: [f64; 2],
        /// Longest side of a page, mm.
        max_mm: f64,
    },
}

/// A board laid out on a page. Its places are in mm, from the page's upper left corner, y down.
#[derive(Clone, Debug)]
pub struct Print {
    shapes: Vec<Shape>,
    text: String,
    page_mm: Vector2<f64>,
    /// The board's origin.
    origin_mm: Vector2<f64>,
    /// Upper left corner of the scale bar.
    bar_mm: Vector2<f64>,
    bar_length_mm: f64,
}

/// A line of text.
struct Line {
    /// Left end of its base line, mm.
    at: Vector2<f64>,
    size_mm: f64,
    text: String,
}

impl Print {
    /// Thickness of the scale bar, mm.
    const BAR_MM: f64 = 1.5;

    /// The board on this paper, or without one on the smallest of A4 and A3 that holds it, or else on a page of its own size.
    /// `text` stands below it.
    ///
    /// # Errors
    /// [`PrintError::Paper`] if it does not fit.
    pub fn checked(board: &Board, text: &str, paper: Option<Paper>) -> Result<Self, PrintError> {
        let quiet_mm = 1e3 * board.margin_m();
        let [least, greatest] = board.sheet().map(|corner| corner * 1e3);
        let ink = greatest - least - Vector2::repeat(2.0 * quiet_mm);
        let margin_mm = quiet_mm.max(EDGE_MM);
        let need =
            Vector2::new((ink.x + 2.0 * margin_mm).max(MIN_WIDTH_MM), margin_mm + ink.y + quiet_mm + FOOT_MM + EDGE_MM);
        // To the nanometre: what is to fit exactly does.
        let need = need.map(|side| (side * 1e6).round() / 1e6);
        let page_mm = match paper {
            Some(paper) => paper.holding(&need).ok_or(PrintError::Paper { need_mm: [need.x, need.y], paper })?,
            None => Paper::USUAL.iter().find_map(|paper| paper.holding(&need)).unwrap_or(need),
        };
        let ink_at = Vector2::new(0.5 * (page_mm.x - ink.x), margin_mm + 0.5 * (page_mm.y - need.y));
        let room_mm = page_mm.x - 2.0 * EDGE_MM;
        let label_mm = 10.0 * LETTER_RATIO * TEXT_MM;
        let bar_length_mm =
            BARS_MM.into_iter().find(|bar| bar + label_mm <= room_mm).unwrap_or(BARS_MM[BARS_MM.len() - 1]);
        // Below the pattern's left side, if there is room to the right.
        let text_mm = LETTER_RATIO * TEXT_MM * text.chars().count() as f64;
        let foot_x = ink_at.x.min(page_mm.x - EDGE_MM - (bar_length_mm + label_mm).max(text_mm)).max(EDGE_MM);
        Ok(Self {
            shapes: board.shapes(),
            text: text.into(),
            page_mm,
            origin_mm: ink_at - least - Vector2::repeat(quiet_mm),
            bar_mm: Vector2::new(foot_x, ink_at.y + ink.y + quiet_mm + 1.0),
            bar_length_mm,
        })
    }

    /// Width and height of the page, mm.
    #[must_use]
    pub fn page_mm(&self) -> [f64; 2] {
        self.page_mm.into()
    }

    /// What is printed black of the pattern, mm on the page.
    fn ink(&self) -> impl Iterator<Item = Shape> {
        let place = |place: Vector2<f64>| place * 1e3 + self.origin_mm;
        self.shapes.iter().map(move |shape| match *shape {
            Shape::Rectangle { least, greatest } => Shape::Rectangle { least: place(least), greatest: place(greatest) },
            Shape::Disc { centre, radius } => Shape::Disc { centre: place(centre), radius: 1e3 * radius },
        })
    }

    /// The scale bar: its upper left and its lower right corner.
    fn bar(&self) -> [Vector2<f64>; 2] {
        [self.bar_mm, self.bar_mm + Vector2::new(self.bar_length_mm, Self::BAR_MM)]
    }

    /// The bar's label and the text.
    fn lines(&self) -> [Line; 2] {
        let room_mm = self.page_mm.x - EDGE_MM - self.bar_mm.x;
        let letters = self.text.chars().count().max(1) as f64;
        let beside = Vector2::new(self.bar_length_mm + 1.5, Self::BAR_MM);
        [
            Line { at: self.bar_mm + beside, size_mm: TEXT_MM, text: format!("{} mm", self.bar_length_mm) },
            Line {
                at: self.bar_mm + Vector2::new(0.0, FOOT_MM - 2.0),
                size_mm: TEXT_MM.min(room_mm / (LETTER_RATIO * letters)),
                text: self.text.clone(),
            },
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn print(text: &str, paper: Option<Paper>) -> Result<Print, PrintError> {
        Print::checked(&text.parse().expect("a board"), text, paper)
    }

    #[test]
    fn papers_have_names() {
        assert_eq!("A4".parse(), Ok(Paper::A4));
        assert_eq!("300x200.5".parse(), Ok(Paper::Millimetres([300.0, 200.5])));
        for text in ["", "a5", "300", "300x", "-1x200", "NaNx200", "1e9x200"] {
            assert!(text.parse::<Paper>().is_err(), "{text}");
        }
    }

    #[test]
    fn the_smallest_usual_page_is_taken_or_one_of_its_own_size() {
        for (text, page) in [
            ("chessboard:9x6:0.02", [297.0, 210.0]),
            ("chessboard:6x9:0.02", [210.0, 297.0]),
            ("chessboard:9x6:0.025", [420.0, 297.0]),
            // 10 x 7 squares, a square of white around, and the foot of 13 mm less the white that it needs not.
            ("chessboard:9x6:0.05", [600.0, 463.0]),
            // The bar's width.
            ("chessboard:3x3:0.5", [3000.0, 3013.0]),
        ] {
            let found = print(text, None).expect("prints").page_mm();
            assert!((Vector2::from(found) - Vector2::from(page)).amax() < 1e-9, "{text}: {found:?}");
        }
    }

    #[test]
    fn what_does_not_fit_says_by_how_much() {
        let error = print("chessboard:9x6:0.025", Some(Paper::A4)).expect_err("too large");
        assert_eq!(
            error.to_string(),
            "with its margins and its scale bar it takes 300.0 x 238.0 mm, which do not fit on the paper (a4: 210 x 297 mm)"
        );
        assert!(print("chessboard:9x6:0.025", Some(Paper::Millimetres([238.0, 300.0]))).is_err(), "taken as it is");
        assert!(print("chessboard:9x6:0.025", Some(Paper::Millimetres([300.0, 238.0]))).is_ok());
    }

    #[test]
    fn the_quiet_zone_is_quiet_and_all_is_on_the_page() {
        for text in [
            "chessboard:9x6:0.025",
            "chessboard:3x3:0.002",
            "circles:7x5:0.03",
            "dots:120:0.25x0.18:0.003",
            "aprilgrid:6x6:0.03",
            "asymmetric-circles:4x11:0.003:0.00123456789",
        ] {
            let board: Board = text.parse().expect("a board");
            let print = Print::checked(&board, text, None).expect("prints");
            let [least, greatest] = board.sheet().map(|corner| corner * 1e3 + print.origin_mm);
            let margin = 1e3 * board.margin_m();
            let [width, height] = print.page_mm();
            assert!(least.min() >= -1e-9 && greatest.x <= width + 1e-9, "{text}: the quiet zone is on the page");
            assert!(least.add_scalar(margin - EDGE_MM).min() >= -1e-9, "{text}: the ink is where printers print");
            let [bar, bar_end] = print.bar();
            assert!(bar.y > greatest.y && bar_end.y < height - EDGE_MM, "{text}: the bar is below");
            for line in print.lines() {
                let end = line.at.x + LETTER_RATIO * line.size_mm * line.text.chars().count() as f64;
                assert!(line.at.x >= EDGE_MM - 1e-9 && end <= width - EDGE_MM + 1e-9, "{text}: {}", line.text);
                assert!(line.at.y - line.size_mm > greatest.y - 1e-9 && line.at.y < height, "{text}: {}", line.text);
            }
        }
    }
}
