//! The seed's board: dots at random places, which tell by their arrangement which they are.

use nalgebra::Vector2;
use rand::RngExt;

use super::shape::Shape;
use super::{Board, BoardError, check_length};
use crate::random;

/// Black dots of one size at irregular places on white.
#[derive(Clone, Debug, PartialEq)]
pub struct Dots {
    /// Their centres, m.
    pub places_m: Vec<[f64; 2]>,
    /// Radius of a dot, m.
    pub radius_m: f64,
}

/// What a sheet of random dots is drawn from; the same numbers give the same dots on every machine, for ever.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DotSheet {
    /// How many dots are wanted.
    pub count: u32,
    /// Width and height of the sheet's inside, m: centres lie within it.
    pub size_m: [f64; 2],
    /// Radius of a dot, m.
    pub radius_m: f64,
    /// Number of the draw.
    pub seed: u64,
}

/// Centres of two dots are at least this many radii apart.
const MIN_DISTANCE_RADII: f64 = 3.2;

/// Draws for each dot before the sheet counts as full.
const TRIES: u32 = 2_000;

impl Dots {
    /// Least number of dots: fewer cannot be told apart by their arrangement with an object on some of them.
    pub const MIN_COUNT: usize = 20;

    /// Dots at random places, none nearer to another than 3.2 radii.
    ///
    /// # Errors
    /// [`BoardError`] if they do not fit on the sheet, or a number makes no sense.
    pub fn random(sheet: &DotSheet) -> Result<Self, BoardError> {
        check_length("width_m", sheet.size_m[0])?;
        check_length("height_m", sheet.size_m[1])?;
        check_length("radius_m", sheet.radius_m)?;
        let count = sheet.count as usize;
        check_dot_count(count)?;
        let mut rng = random::case("random dot sheet", sheet.seed);
        let mut places_m: Vec<[f64; 2]> = Vec::with_capacity(count);
        let apart = MIN_DISTANCE_RADII * sheet.radius_m;
        while places_m.len() < count {
            let free = (0..TRIES).find_map(|_| {
                // Micrometres: a description file holds the same numbers.
                let place = sheet.size_m.map(|side| (rng.random::<f64>() * side * 1e6).round() / 1e6);
                let is_free = places_m.iter().all(|other| (place[0] - other[0]).hypot(place[1] - other[1]) >= apart);
                is_free.then_some(place)
            });
            let Some(place) = free else {
                let need = "as many as fit on the sheet with 3.2 radii between their centres";
                return Err(BoardError::Count { field: "count", value: count, need });
            };
            places_m.push(place);
        }
        Ok(Self { places_m, radius_m: sheet.radius_m })
    }

    pub(super) fn points(&self) -> Result<Vec<Vector2<f64>>, BoardError> {
        check_length("radius_m", self.radius_m)?;
        check_dot_count(self.places_m.len())?;
        let places: Vec<Vector2<f64>> = self.places_m.iter().map(|place| Vector2::from(*place)).collect();
        let need_m = 2.5 * self.radius_m;
        for (second, place) in places.iter().enumerate() {
            if !place.iter().all(|c| c.abs() <= 100.0) {
                let value = if place.x.abs() <= 100.0 { place.y } else { place.x };
                return Err(BoardError::Length { field: "dots_m", value, need: "a place within 100 m of the origin" });
            }
            let near = places[..second].iter().position(|other| (place - other).norm() < need_m);
            if let Some(first) = near {
                let distance_m = (place - places[first]).norm();
                return Err(BoardError::Overlap { first, second, distance_m, need_m });
            }
        }
        Ok(places)
    }

    pub(super) fn shapes(&self) -> Vec<Shape> {
        let disc = |place: &[f64; 2]| Shape::Disc { centre: Vector2::from(*place), radius: self.radius_m };
        self.places_m.iter().map(disc).collect()
    }
}

fn check_dot_count(value: usize) -> Result<(), BoardError> {
    if (Dots::MIN_COUNT..=Board::MAX_POINTS).contains(&value) {
        return Ok(());
    }
    Err(BoardError::Count { field: "count", value, need: "from 20 to 2000 dots" })
}
