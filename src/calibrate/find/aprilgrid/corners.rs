//! Where four fields meet: saddles of the blurred picture, and the two edges that cross there.

use nalgebra::{Matrix2, Vector2};

use super::plane::Plane;
use crate::camera::Pixel;

/// A place where two edges seem to cross.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Corner {
    pub place: Pixel,
    /// Along the two edges, of unit length.
    pub edges: [Vector2<f64>; 2],
    /// How strong it is, codes: in proportion to white less black.
    pub strength: f64,
}

/// Least white less black that is looked at, codes.
const MIN_CONTRAST: f64 = 10.0;

/// Blur of a sharp picture of itself, px.
const OWN_BLUR_PX: f64 = 0.8;

/// A corner is the strongest within so many pixels each way.
const REACH: usize = 2;

/// The saddle's own place lies no further from its strongest pixel, px.
const MAX_OFFSET_PX: f64 = 1.5;

/// Least angle of the two edges, rad.
const MIN_ANGLE_RAD: f64 = 0.35;

/// Most corners that are looked at, the strongest.
const MAX_CORNERS: usize = 5_000;

/// The corners of a picture that was blurred by so much.
pub(super) fn corners(smooth: &Plane, blur_px: f64) -> Vec<Corner> {
    let (width, height) = (smooth.width, smooth.height);
    let border = REACH + 1;
    if width <= 2 * border || height <= 2 * border {
        return Vec::new();
    }
    // The mixed second derivative of a perfect corner; the determinant is about its square.
    let mixed = MIN_CONTRAST / (std::f64::consts::PI * (blur_px * blur_px + OWN_BLUR_PX * OWN_BLUR_PX));
    #[expect(clippy::cast_possible_truncation, reason = "a few codes")]
    let least = (mixed * mixed) as f32;
    let mut response = vec![0.0_f32; width * height];
    for y in 1..height - 1 {
        let [above, here, below] = [y - 1, y, y + 1].map(|y| smooth.row(y));
        for x in 1..width - 1 {
            let across = here[x + 1] - 2.0 * here[x] + here[x - 1];
            let down = below[x] - 2.0 * here[x] + above[x];
            let mixed = 0.25 * (below[x + 1] - below[x - 1] - above[x + 1] + above[x - 1]);
            response[y * width + x] = mixed * mixed - across * down;
        }
    }
    let mut found: Vec<(f32, [usize; 2])> = Vec::new();
    for y in border..height - border {
        for x in border..width - border {
            let value = response[y * width + x];
            if value >= least && is_peak(&response, width, [x, y]) {
                found.push((value, [x, y]));
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(MAX_CORNERS);
    found.into_iter().filter_map(|(_, place)| corner(smooth, place)).collect()
}

/// Among equals the first.
fn is_peak(response: &[f32], width: usize, [x, y]: [usize; 2]) -> bool {
    let here = response[y * width + x];
    (y - REACH..=y + REACH).all(|row| {
        (x - REACH..=x + REACH).all(|column| {
            let other = response[row * width + column];
            other < here || (other <= here && (row, column) >= (y, x))
        })
    })
}

fn corner(smooth: &Plane, [x, y]: [usize; 2]) -> Option<Corner> {
    let at = |right: usize, down: usize| f64::from(smooth.samples[(y + down - 1) * smooth.width + x + right - 1]);
    let slope = Vector2::new(0.5 * (at(2, 1) - at(0, 1)), 0.5 * (at(1, 2) - at(1, 0)));
    let mixed = 0.25 * (at(2, 2) - at(0, 2) - at(2, 0) + at(0, 0));
    let curve = Matrix2::new(at(2, 1) - 2.0 * at(1, 1) + at(0, 1), mixed, mixed, at(1, 2) - 2.0 * at(1, 1) + at(1, 0));
    let offset = -(curve.try_inverse()? * slope);
    // Also false for NaN.
    if !(offset.norm() <= MAX_OFFSET_PX) {
        return None;
    }
    // Along the edges the picture does not curve.
    let eigen = curve.symmetric_eigen();
    let (up, down) = if eigen.eigenvalues[0] > eigen.eigenvalues[1] { (0, 1) } else { (1, 0) };
    let half = (eigen.eigenvalues[up] / -eigen.eigenvalues[down]).sqrt().atan();
    if !(2.0 * half >= MIN_ANGLE_RAD && 2.0 * half <= std::f64::consts::PI - MIN_ANGLE_RAD) {
        return None;
    }
    let (along, across) = (eigen.eigenvectors.column(up), eigen.eigenvectors.column(down));
    let edges = [1.0, -1.0].map(|side| along * half.cos() + across * (side * half.sin()));
    Some(Corner { place: Pixel::new(x as f64, y as f64) + offset, edges, strength: (-curve.determinant()).sqrt() })
}
