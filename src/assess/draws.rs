//! Chance: the same for every cell and every variant of the target, so that differences are those of the cells.

use std::f64::consts::TAU;

use nalgebra::Vector2;
use rand::RngExt;

use crate::random;

/// One throw: how the target is turned, and the noise of each marker.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Draw {
    /// To which side the front is turned away.
    pub azimuth_rad: f64,
    /// How the target is turned about the line of sight.
    pub spin_rad: f64,
    /// For each marker, in units of the pixels' standard deviation.
    pub noise: Vec<Vector2<f64>>,
    /// For each marker, in units of the standard deviation of a blob's logarithmic area.
    pub area_noise: Vec<f64>,
    /// The order in which the blobs are listed, as a number by which each marker's blob is sorted.
    pub order: Vec<u64>,
}

impl Draw {
    /// Number `index` of the series, for a target of so many markers.
    pub(super) fn numbered(index: u64, markers: usize) -> Self {
        let mut rng = random::case("assessment", index);
        // Turns that cover all turns evenly, however few are drawn (Roberts 2018, the R2 sequence).
        let turn = |step: f64| (0.5 + step * (index as f64 + 1.0)).fract() * TAU;
        Self {
            azimuth_rad: turn(0.754_877_666_246_693),
            spin_rad: turn(0.569_840_290_998_053),
            noise: (0..markers).map(|_| random::normal2(&mut rng)).collect(),
            area_noise: (0..markers).map(|_| random::normal(&mut rng)).collect(),
            order: (0..markers).map(|_| rng.random()).collect(),
        }
    }

    /// The first `count` of the series.
    pub(super) fn first(count: usize, markers: usize) -> Vec<Self> {
        (0..count as u64).map(|index| Self::numbered(index, markers)).collect()
    }
}
