//! Dark discs on white, wherever they are in a picture and however they are lit.
//!
//! Found roughly first, by the shape of what is dark against its surroundings; which disc is which can be told from that. Only
//! the discs of a board are then placed exactly, so that clutter costs little.

mod near;
mod place;
mod shade;

use nalgebra::{Matrix2, Vector2};

use super::Luma;
use crate::camera::Pixel;
use crate::detect::components::{Components, Connectivity, Run};

pub(super) use near::Near;
pub(super) use place::Places;

/// Something that looks like a disc, roughly placed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disc {
    /// Its middle, to a fraction of a pixel.
    pub pixel: Pixel,
    /// Second moments of its area, px^2.
    pub moments: Matrix2<f64>,
}

/// Least area, px: a disc of 2.5 px radius seen at 65 degrees.
const MIN_AREA_PX: f64 = 7.0;

/// Least ratio of the half axes: seen at 75 degrees.
const MIN_AXES_RATIO: f64 = 0.22;

/// How far, as a ratio, the area may be off that of the ellipse of the same moments: so much, and a pixel of its outline.
const AREA_OFF: f64 = 0.06;
const AREA_OFF_PX: f64 = 0.9;

/// It is looked so far beyond its rim, in so many directions, and so many of these are lighter: something dark may lie beside it.
const BEYOND_RADII: f64 = 1.3;
const BEYOND_PX: f64 = 1.0;
const AROUND: u32 = 8;
const MIN_LIGHTER: usize = 6;

/// More discs than this are clutter; those that are most like ellipses stay.
const MAX_DISCS: usize = 6_000;

impl Disc {
    /// What looks like a disc in the picture, in reading order.
    pub(super) fn all(picture: &Luma) -> Vec<Self> {
        let mask = shade::dark(picture);
        let Some(window) = picture.region() else { return Vec::new() };
        let components = Components::of(&mask, picture.width, window, u8::MAX, Connectivity::Four);
        let mut discs: Vec<(f64, Self)> = components.iter().filter_map(|runs| Self::of(runs, picture)).collect();
        if discs.len() > MAX_DISCS {
            let worst = discs.select_nth_unstable_by(MAX_DISCS, |a, b| a.0.total_cmp(&b.0)).1.0;
            discs.retain(|(off, _)| *off < worst);
            discs.sort_by(|(_, a), (_, b)| {
                (a.pixel.y, a.pixel.x).partial_cmp(&(b.pixel.y, b.pixel.x)).unwrap_or(std::cmp::Ordering::Equal)
            });
        }
        discs.into_iter().map(|(_, disc)| disc).collect()
    }

    /// The disc of these pixels with a measure of how little it looks like one; `None` if it does not.
    fn of(runs: &[Run], picture: &Luma) -> Option<(f64, Self)> {
        let (first, last) = (runs.first()?, runs.last()?);
        let height = f64::from(last.y - first.y + 1);
        // Anything long is no disc, however long it takes to find out.
        if first.y == 0 || last.y as usize + 1 >= picture.height || runs.len() > 2 * (last.y - first.y + 1) as usize {
            return None;
        }
        let origin = f64::from(first.start);
        let (mut area, mut x, mut y, mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for run in runs {
            if run.start == 0 || run.end as usize >= picture.width {
                return None;
            }
            let length = f64::from(run.end - run.start);
            let middle = 0.5 * f64::from(run.start + run.end - 1) - origin;
            let down = f64::from(run.y - first.y);
            area += length;
            x += length * middle;
            y += length * down;
            // Of a run of pixels about its middle, each with a twelfth of its own.
            xx += length * (middle * middle + length * length / 12.0);
            xy += length * middle * down;
            yy += length * (down * down + 1.0 / 12.0);
        }
        let (x, y) = (x / area, y / area);
        let moments = Matrix2::new(xx / area - x * x, xy / area - x * y, xy / area - x * y, yy / area - y * y);
        let disc = Self { pixel: Pixel::new(x + origin, y + f64::from(first.y)), moments };
        let [short, long] = disc.half_axes_px();
        let off = (area / disc.area_px()).ln().abs();
        let is_disc = area >= MIN_AREA_PX
            && short > MIN_AXES_RATIO * long
            && 2.0 * long > 0.5 * height
            && off < AREA_OFF + AREA_OFF_PX / area.sqrt()
            && disc.is_lighter_around(picture);
        is_disc.then_some((off, disc))
    }

    /// Whether it is lighter around it than in its middle, on nearly all sides. Where light changes slowly, thresholds that differ
    /// from tile to tile cut out specks which are darker on one side, in a lattice as that of the tiles.
    fn is_lighter_around(&self, picture: &Luma) -> bool {
        let [_, long] = self.half_axes_px();
        let Some(px_from_radii) = self.radii_from_px().and_then(Matrix2::try_inverse) else { return false };
        let middle = picture.nearest(&self.pixel);
        let lighter = (0..AROUND).filter(|side| {
            let angle = f64::from(*side) * std::f64::consts::TAU / f64::from(AROUND);
            let way = px_from_radii * Vector2::new(angle.cos(), angle.sin());
            let beyond = self.pixel + way * (BEYOND_RADII + BEYOND_PX / way.norm().max(1e-3 * long));
            picture.nearest(&beyond) > middle
        });
        lighter.count() >= MIN_LIGHTER
    }

    /// Area of the ellipse of its moments, px.
    pub(super) fn area_px(&self) -> f64 {
        4.0 * std::f64::consts::PI * self.moments.determinant().max(0.0).sqrt()
    }

    /// Half axes of that ellipse, the shorter first, px.
    pub(super) fn half_axes_px(&self) -> [f64; 2] {
        let half_trace = 0.5 * self.moments.trace();
        let spread = (half_trace * half_trace - self.moments.determinant()).max(0.0).sqrt();
        [half_trace - spread, half_trace + spread].map(|moment| 2.0 * moment.max(0.0).sqrt())
    }

    /// Takes a way in the picture, px, to one on the board in radii of the disc, as far as its shape tells: up to a turn.
    pub(super) fn radii_from_px(&self) -> Option<Matrix2<f64>> {
        // The root of a symmetric matrix A is (A + sqrt(det A) I) / sqrt(tr A + 2 sqrt(det A)).
        let ellipse = self.moments * 4.0;
        let root_determinant = ellipse.determinant().max(0.0).sqrt();
        let root =
            (ellipse + Matrix2::identity() * root_determinant) / (ellipse.trace() + 2.0 * root_determinant).sqrt();
        root.try_inverse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_that_changes_slowly_has_no_discs() {
        let (width, height) = (640, 480);
        let mut specks = 0;
        for phase in 0..6 {
            let sample = |index: usize| {
                let (x, y) = ((index % width) as f64, (index / width) as f64 + 40.0 * f64::from(phase));
                let light = 120.0 + 60.0 * (x / 70.0).sin() * (y / 60.0).cos() + 25.0 * (x / 23.0 + y / 31.0).sin();
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "35 to 205")]
                let code = light.round() as u8;
                code
            };
            let picture = Luma { width, height, samples: (0..width * height).map(sample).collect() };
            specks += Disc::all(&picture).len();
        }
        // What is dark in its middle, in a tile or so, may look like one.
        assert!(specks < 60, "{specks}");
    }
}
