//! Dots at random places: their arrangement tells which they are.
//!
//! A dot's shape tells how the board lies there up to a turn, so two of its neighbours are at the same distances and the same
//! angle in the picture as on the board. Where the board has such a triple, the three together tell where more dots are; who
//! finds them there grows from dot to dot. In the manner of Nakai, Kise and Iwamura, "Use of affine invariants in locally likely
//! arrangement hashing for camera-based document image retrieval", DAS 2006, and Uchiyama and Saito, "Random dot markers",
//! IEEE VR 2011; the shape of the dots makes fewer neighbours do.

mod growth;
mod stars;
mod start;
#[cfg(test)]
mod tests;

use super::discs::{Disc, Near, Places};
use super::{Luma, NoBoard};
use crate::board::Dots;
use crate::calibrate::SeenPoint;

use growth::Growth;
use stars::Stars;

/// The dots that the picture shows.
pub(super) fn find(picture: &Luma, dots: &Dots) -> Result<Vec<SeenPoint>, NoBoard> {
    let not_seen = |found| NoBoard::NotSeen { pattern: "board of dots", found, need: dots.places_m.len() };
    let discs = Disc::all(picture);
    let near = Near::of(discs.iter().map(|disc| disc.pixel).collect(), picture.width, picture.height);
    let stars = Stars::of(dots).ok_or_else(|| not_seen(0))?;
    let growth = Growth { stars: &stars, discs: &discs, near: &near, picture };
    let known = start::starts(&growth).map_err(not_seen)?;
    let places = Places::of(picture)?;
    let seen = known.into_iter().filter_map(|(point, disc)| {
        let (pixel, sigma_px) = places.place(disc, &discs, &near)?;
        Some(SeenPoint { point, pixel, sigma_px })
    });
    Ok(seen.collect())
}
