//! Boards in a line of text: `chessboard:9x6:0.025`.

use std::str::FromStr;

use thiserror::Error;

use super::{AprilGrid, Board, BoardError, Chessboard, CircleLayout, Circles, DotSheet, Dots, Pattern};

/// Why a text names no board.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum NameError {
    /// Not one of the forms.
    #[error(
        "{text:?} is no pattern: chessboard:COLUMNSxROWS:SQUARE (inner corners), circles:COLUMNSxROWS:SPACING[:RADIUS], \
         asymmetric-circles:COLUMNSxROWS:SPACING[:RADIUS], dots:COUNT:WIDTHxHEIGHT:RADIUS[:SEED] or \
         aprilgrid:COLUMNSxROWS:TAG[:GAP], lengths in metres"
    )]
    Form {
        /// What was given.
        text: String,
    },
    /// A number that makes no sense.
    #[error(transparent)]
    Board(#[from] BoardError),
}

impl FromStr for Board {
    type Err = NameError;

    fn from_str(text: &str) -> Result<Self, NameError> {
        let pattern = pattern(text)?.ok_or_else(|| NameError::Form { text: text.into() })?;
        Ok(Self::checked(pattern)?)
    }
}

/// `None` where the form is wrong.
fn pattern(text: &str) -> Result<Option<Pattern>, BoardError> {
    let parts: Vec<&str> = text.split(':').collect();
    Ok(match parts.as_slice() {
        ["chessboard", size, square] => both(pair(size), number(square))
            .map(|([columns, rows], square_m)| Pattern::Chessboard(Chessboard { columns, rows, square_m })),
        ["circles", rest @ ..] => circles(rest, CircleLayout::Symmetric),
        ["asymmetric-circles", rest @ ..] => circles(rest, CircleLayout::Asymmetric),
        ["dots", count, size, radius, rest @ ..] if rest.len() < 2 => {
            let seed = rest.first().map_or(Some(0), |seed| seed.parse().ok());
            let sheet = both(both(count.parse().ok(), pair(size)), both(number(radius), seed));
            sheet
                .map(|((count, size_m), (radius_m, seed))| Dots::random(&DotSheet { count, size_m, radius_m, seed }))
                .transpose()?
                .map(Pattern::Dots)
        }
        ["aprilgrid", size, tag, rest @ ..] if rest.len() < 2 => {
            both(pair(size), number(tag)).and_then(|([columns, rows], tag_m)| {
                let gap_m = rest.first().map_or(Some(0.3 * tag_m), |gap| number(gap))?;
                Some(Pattern::AprilGrid(AprilGrid { columns, rows, tag_m, gap_m }))
            })
        }
        _ => None,
    })
}

fn circles(parts: &[&str], layout: CircleLayout) -> Option<Pattern> {
    let (size, spacing, radius) = match parts {
        [size, spacing] => (size, spacing, None),
        [size, spacing, radius] => (size, spacing, Some(radius)),
        _ => return None,
    };
    let ([columns, rows], spacing_m) = both(pair(size), number(spacing))?;
    let radius_m = radius.map_or(Some(0.3 * spacing_m), |radius| number(radius))?;
    Some(Pattern::Circles(Circles { columns, rows, spacing_m, radius_m, layout }))
}

fn both<A, B>(a: Option<A>, b: Option<B>) -> Option<(A, B)> {
    a.zip(b)
}

fn number(text: &str) -> Option<f64> {
    text.parse().ok()
}

fn pair<T: FromStr>(text: &str) -> Option<[T; 2]> {
    let (a, b) = text.split_once('x')?;
    Some([a.parse().ok()?, b.parse().ok()?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_contracts_name_is_read() {
        let board: Board = "chessboard:9x6:0.025".parse().expect("a board");
        assert_eq!(board.points().len(), 54);
        assert_eq!(board.points()[10].coords.as_slice(), [0.025, 0.025, 0.0]);
    }

    #[test]
    fn every_form_is_read() {
        for (text, points) in [
            ("circles:7x5:0.03", 35),
            ("circles:7x5:0.03:0.01", 35),
            ("asymmetric-circles:4x11:0.02", 44),
            ("dots:120:0.25x0.18:0.003", 120),
            ("dots:120:0.25x0.18:0.003:7", 120),
            ("aprilgrid:6x6:0.03", 144),
            ("aprilgrid:6x6:0.03:0.009", 144),
        ] {
            assert_eq!(text.parse::<Board>().map(|board| board.points().len()), Ok(points), "{text}");
        }
    }

    #[test]
    fn what_names_no_board_is_told_what_does() {
        for text in
            ["", "chess", "chessboard:9:0.025", "chessboard:9x6", "circles:7x5", "dots:x:1x1:0.1", "chessboard:9x6:a"]
        {
            assert!(matches!(text.parse::<Board>(), Err(NameError::Form { .. })), "{text}");
        }
        let field = |text: &str| match text.parse::<Board>() {
            Err(NameError::Board(error)) => error.field(),
            other => panic!("{text}: {other:?}"),
        };
        assert_eq!(field("chessboard:2x6:0.025"), "columns");
        assert_eq!(field("chessboard:9x6:-1"), "square_m");
        assert_eq!(field("chessboard:9x6:NaN"), "square_m");
        assert_eq!(field("circles:7x5:0.03:0.02"), "radius_m");
        assert_eq!(field("dots:120:0.25x0.18:0.03"), "count");
    }
}
