//! The light that falls on the sensor through a perfect lens.

use nalgebra::{Matrix2, Vector2};

use super::light::{Light, scaled};
use super::model::Model;
use super::optics::Optics;
use super::sky::Sky;
use super::surface::{Cell, Seen, Surfaces};
use crate::camera::{Camera, Normalized, Pixel};
use crate::geometry::CameraFromTarget;

/// Mean light of each pixel, rows from the top; linear, 1 fills the sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Radiance {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green, blue of each pixel.
    pub light: Vec<Light>,
}

/// Sides of the squares into which the picture is cut, px: a square that meets no edge is filled at once, any other is cut
/// into the next smaller.
const CELL_SIDES: [usize; 3] = [16, 4, 1];

/// The lens bends a square's sides; its corners are put this much farther out to enclose it.
const CELL_MARGIN: f64 = 1.2;

impl Radiance {
    /// `model` in front of `sky`. Pixels with an edge are the mean of `supersampling` squared rays.
    #[must_use]
    pub fn of(
        camera: &Camera,
        camera_from_target: &CameraFromTarget,
        model: &Model,
        sky: &Sky,
        supersampling: u32,
    ) -> Self {
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        let mut picture = Self { width, height, light: sky.paint(width, height) };
        let surfaces = Surfaces::of(model, camera_from_target);
        let tracer = Tracer { camera, surfaces: &surfaces, offsets: offsets(supersampling) };
        for y in (0..height).step_by(CELL_SIDES[0]) {
            for x in (0..width).step_by(CELL_SIDES[0]) {
                tracer.fill(&mut picture, [x, y], 0);
            }
        }
        picture
    }
}

/// Places of the `supersampling` squared sub-pixels about a pixel's centre, px: a lattice of rank one (Korobov 1959), point
/// symmetric, no two on the same row or column, so that an edge along the pixels is met as finely as any other.
pub(super) fn offsets(supersampling: u32) -> Vec<Vector2<f64>> {
    let side = supersampling.clamp(1, Optics::MAX_SUPERSAMPLING);
    let count = side * side;
    // Near the golden section, odd and without a divisor in common with the count.
    let mut slope = (count * 618 / 1000) | 1;
    while common_divisor(slope, count) > 1 {
        slope += 2;
    }
    let place = |index: u32| {
        let across = (f64::from(index) + 0.5) / f64::from(count);
        Vector2::new(across, (across * f64::from(slope)).fract()) - Vector2::repeat(0.5)
    };
    (0..count).map(place).collect()
}

const fn common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

struct Tracer<'a> {
    camera: &'a Camera,
    surfaces: &'a Surfaces,
    offsets: Vec<Vector2<f64>>,
}

impl Tracer<'_> {
    /// Draws the target's part of the square at `corner`, of the side of this level.
    fn fill(&self, picture: &mut Radiance, corner: [usize; 2], level: usize) {
        let side = CELL_SIDES[level];
        let middle = Pixel::from(corner.map(|c| c as f64 + 0.5 * (side - 1) as f64));
        let lens = self.camera.unproject_with_jacobian(&middle);
        let uniform = lens.and_then(|(ray, by_pixel)| {
            self.surfaces.seen_by_all(&cell(ray, by_pixel, 0.5 * CELL_MARGIN * side as f64))
        });
        match (uniform, CELL_SIDES.get(level + 1), lens) {
            (Some(Seen::Sky), _, _) | (None, None, None) => {}
            (Some(seen), _, _) => {
                let [x0, y0] = corner;
                let row_end = (x0 + side).min(picture.width);
                for y in y0..(y0 + side).min(picture.height) {
                    for pixel in &mut picture.light[y * picture.width + x0..y * picture.width + row_end] {
                        *pixel = self.surfaces.light_of(seen, *pixel);
                    }
                }
            }
            (None, Some(&smaller), _) => {
                for y in (corner[1]..(corner[1] + side).min(picture.height)).step_by(smaller) {
                    for x in (corner[0]..(corner[0] + side).min(picture.width)).step_by(smaller) {
                        self.fill(picture, [x, y], level + 1);
                    }
                }
            }
            (None, None, Some((ray, by_pixel))) => {
                let pixel = &mut picture.light[corner[1] * picture.width + corner[0]];
                *pixel = self.mean(ray, by_pixel, *pixel);
            }
        }
    }

    /// Mean over the sub-pixels. Within a pixel the lens is linear to 1e-3 px.
    fn mean(&self, ray: Normalized, by_pixel: Matrix2<f64>, sky: Light) -> Light {
        let mut sum = [0.0; 3];
        for offset in &self.offsets {
            let light = self.surfaces.light_of(self.surfaces.seen_by(&(ray + by_pixel * offset)), sky);
            (0..3).for_each(|c| sum[c] += light[c]);
        }
        let count = self.offsets.len() as f32;
        scaled(sum, count.recip())
    }
}

fn cell(middle: Normalized, by_pixel: Matrix2<f64>, reach_px: f64) -> Cell {
    let corner = |x: f64, y: f64| middle + by_pixel * Vector2::new(x, y) * reach_px;
    Cell { middle, corners: [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sub_pixels_are_even_along_both_axes_and_symmetric() {
        for supersampling in 1..=Optics::MAX_SUPERSAMPLING {
            let places = offsets(supersampling);
            assert_eq!(places.len(), (supersampling * supersampling) as usize);
            let sum: Vector2<f64> = places.iter().sum();
            assert!(sum.norm() < 1e-9, "{supersampling}: {sum}");
            for axis in 0..2 {
                let mut along: Vec<f64> = places.iter().map(|place| place[axis]).collect();
                along.sort_by(f64::total_cmp);
                for (i, value) in along.iter().enumerate() {
                    let even = (i as f64 + 0.5) / places.len() as f64 - 0.5;
                    assert!((value - even).abs() < 1e-9, "{supersampling}, axis {axis}");
                }
            }
        }
    }
}
