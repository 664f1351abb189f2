//! Discs in a lattice.

mod board;
mod growth;
mod lattice;
mod start;
#[cfg(test)]
mod tests;

use super::discs::{Disc, Near, Places};
use super::{Luma, Need, NoBoard};
use crate::board::Circles;
use crate::calibrate::SeenPoint;

use board::{Fit, placement};
use growth::lattices;

/// What it is called.
const PATTERN: &str = "board of circles";

/// The discs of the lattice that the picture shows.
pub(super) fn find(picture: &Luma, circles: &Circles) -> Result<Vec<SeenPoint>, NoBoard> {
    let discs = Disc::all(picture);
    let near = Near::of(discs.iter().map(|disc| disc.pixel).collect(), picture.width, picture.height);
    let lattices = lattices(&discs, &near, circles);
    let need = (circles.columns * circles.rows) as usize;
    let Some(most) = lattices.iter().max_by_key(|lattice| lattice.len()) else {
        return Err(NoBoard::NotSeen { pattern: PATTERN, found: 0, need });
    };
    let fits: Vec<Fit> = lattices.iter().map(|lattice| placement(lattice, picture, circles)).collect();
    let boards: Vec<&Vec<(usize, usize)>> = fits
        .iter()
        .filter_map(|fit| match fit {
            Fit::Board(points) => Some(points),
            Fit::Other { .. } | Fit::None => None,
        })
        .collect();
    match boards.as_slice() {
        [points] => placed(picture, &discs, &near, points),
        [] => {
            let (columns, rows) = (circles.columns as usize, circles.rows as usize);
            Err(match fits.iter().find(|fit| matches!(fit, Fit::Other { .. })) {
                Some(&Fit::Other { columns: found_columns, rows: found_rows, cut }) => {
                    let least = board::least_points(circles);
                    let is_part = found_columns <= columns && found_rows <= rows;
                    // It fits the board as far as it goes, and does not go far enough.
                    if cut && is_part && found_columns * found_rows < least {
                        let need = Need::Points(least);
                        NoBoard::CutOff { pattern: PATTERN, found_columns, found_rows, columns, rows, need }
                    } else {
                        NoBoard::OtherSize { pattern: PATTERN, found_columns, found_rows, columns, rows, cut }
                    }
                }
                _ => NoBoard::NotSeen { pattern: PATTERN, found: most.len(), need },
            })
        }
        several => Err(NoBoard::Several { count: several.len() }),
    }
}

/// Points, each the disc of that number, exactly.
fn placed(picture: &Luma, discs: &[Disc], near: &Near, points: &[(usize, usize)]) -> Result<Vec<SeenPoint>, NoBoard> {
    let places = Places::of(picture)?;
    let seen = points.iter().filter_map(|&(point, disc)| {
        let (pixel, sigma_px) = places.place(disc, discs, near)?;
        Some(SeenPoint { point, pixel, sigma_px })
    });
    Ok(seen.collect())
}
