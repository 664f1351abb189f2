//! Discs in a lattice.

mod board;
mod growth;
mod lattice;
mod start;
#[cfg(test)]
mod tests;

use super::discs::{Disc, Near, Places};
use super::{Luma, NoBoard};
use crate::board::Circles;
use crate::calibrate::SeenPoint;

use board::{Fit, placement};
use growth::lattices;

/// The discs of the lattice that the picture shows.
pub(super) fn find(picture: &Luma, circles: &Circles) -> Result<Vec<SeenPoint>, NoBoard> {
    let discs = Disc::all(picture);
    let near = Near::of(discs.iter().map(|disc| disc.pixel).collect(), picture.width, picture.height);
    let lattices = lattices(&discs, &near, circles);
    let need = (circles.columns * circles.rows) as usize;
    let Some(most) = lattices.iter().max_by_key(|lattice| lattice.len()) else {
        return Err(NoBoard::NotSeen { pattern: "circles", found: 0, need });
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
        [] => Err(match fits.iter().find(|fit| matches!(fit, Fit::Other { .. })) {
            Some(Fit::Other { columns: found_columns, rows: found_rows }) => NoBoard::OtherSize {
                pattern: "circles",
                found_columns: *found_columns,
                found_rows: *found_rows,
                columns: circles.columns as usize,
                rows: circles.rows as usize,
            },
            _ => NoBoard::NotSeen { pattern: "circles", found: most.len().min(need), need },
        }),
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
