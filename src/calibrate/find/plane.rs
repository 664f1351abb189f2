//! How a small part of the board lies in the picture.

use nalgebra::{Cholesky, Const, Matrix2, SMatrix, SVector, Vector2};

use crate::camera::Pixel;

/// A homography from the board's plane to the picture, good near the place about which it was made: a lens that bends the
/// plane as a whole hardly bends a part of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    about: Vector2<f64>,
    /// Pixel of `about`, px for each unit of length, and what a unit of length changes of the scale.
    pixel: Pixel,
    linear: Matrix2<f64>,
    fall: Vector2<f64>,
}

/// A place of the board and where it is seen.
pub(super) type Sight = (Vector2<f64>, Pixel);

/// The scale of a picture changes by about this, as a ratio, over one spacing of the board's points, and places are known to
/// about this part of a spacing: few points do not tell perspective from chance.
const EXPECTED_FALL: f64 = 0.08;
const PLACE_ERROR: f64 = 0.02;

impl Plane {
    /// The plane through three or more sights, `unit` the distance of neighbours on the board. `None` if they lie on a line.
    ///
    /// Least squares of the homography's linear equations, in coordinates about `about`, with perspective held near none.
    pub(super) fn through(sights: &[Sight], about: Vector2<f64>, unit: f64) -> Option<Self> {
        let count = sights.len() as f64;
        let mean = sights.iter().fold(Vector2::zeros(), |sum, (_, pixel)| sum + pixel) / count;
        let spread = |of: fn(&Sight, &Vector2<f64>) -> f64, at: &Vector2<f64>| {
            (sights.iter().map(|sight| of(sight, at)).sum::<f64>() / count).sqrt()
        };
        let spread_px = spread(|(_, pixel), at| (pixel - at).norm_squared(), &mean);
        let spread_units = spread(|(place, _), at| (place - at).norm_squared(), &about) / unit;
        if !(sights.len() >= 3 && spread_px > 1e-6 && spread_units > 1e-6) {
            return None;
        }
        // A spacing in the picture, nearly.
        let scale_px = spread_px / spread_units;
        let mut normal = SMatrix::<f64, 8, 8>::zeros();
        let mut right = SVector::<f64, 8>::zeros();
        for (place, pixel) in sights {
            let (p, q) = ((place - about) / unit, (pixel - mean) / scale_px);
            let rows = [
                (SVector::<f64, 8>::from([p.x, p.y, 1.0, 0.0, 0.0, 0.0, -q.x * p.x, -q.x * p.y]), q.x),
                (SVector::<f64, 8>::from([0.0, 0.0, 0.0, p.x, p.y, 1.0, -q.y * p.x, -q.y * p.y]), q.y),
            ];
            for (row, value) in rows {
                normal.ger(1.0, &row, &row, 1.0);
                right.axpy(value, &row, 1.0);
            }
        }
        let hold = (PLACE_ERROR / EXPECTED_FALL).powi(2);
        normal[(6, 6)] += hold;
        normal[(7, 7)] += hold;
        // Points on a line leave a direction of the linear part open.
        let limit = 1e-6 * count;
        let is_open = |factors: &Cholesky<f64, Const<8>>| factors.l_dirty().diagonal().iter().any(|d| !(d * d > limit));
        let factors = normal.cholesky().filter(|factors| !is_open(factors))?;
        let h = factors.solve(&right);
        let (middle, fall) = (Vector2::new(h[2], h[5]), Vector2::new(h[6], h[7]));
        let linear = Matrix2::new(h[0], h[1], h[3], h[4]) - middle * fall.transpose();
        let plane =
            Self { about, pixel: mean + middle * scale_px, linear: linear * (scale_px / unit), fall: fall / unit };
        h.iter().all(|value| value.is_finite()).then_some(plane)
    }

    /// Where the place is seen; `None` if it would lie so near the horizon that nothing is told.
    pub(super) fn pixel(&self, place: &Vector2<f64>) -> Option<Pixel> {
        let way = place - self.about;
        let scale = 1.0 + self.fall.dot(&way);
        (scale > MIN_SCALE).then(|| self.pixel + self.linear * way / scale)
    }

    /// Pixels for each unit of length at a place.
    pub(super) fn by_place(&self, place: &Vector2<f64>) -> Matrix2<f64> {
        let way = place - self.about;
        let scale = (1.0 + self.fall.dot(&way)).max(MIN_SCALE);
        (self.linear - self.linear * way * self.fall.transpose() / scale) / scale
    }
}

/// Nearer to the horizon, as the ratio of the scale there to that in the middle, nothing is told.
const MIN_SCALE: f64 = 0.2;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_seen_where_they_are() {
        let exact = |place: &Vector2<f64>| {
            let scale = 1.0 + 0.8 * place.x - 0.5 * place.y;
            Pixel::new(
                300.0 + (400.0 * place.x + 90.0 * place.y) / scale,
                200.0 + (350.0 * place.y - 60.0 * place.x) / scale,
            )
        };
        let places = (0..16).map(|k| Vector2::new(f64::from(k % 4), f64::from(k / 4)) * 0.05);
        let sights: Vec<Sight> = places.map(|place| (place, exact(&place))).collect();
        let about = Vector2::new(0.06, 0.09);
        let plane = Plane::through(&sights, about, 0.05).expect("a plane");
        for (place, pixel) in &sights {
            // Held towards no perspective, a little.
            assert!((plane.pixel(place).expect("seen") - pixel).norm() < 0.1, "{place}");
            let step = Vector2::new(1e-6, -2e-6);
            let moved = plane.pixel(&(place + step)).expect("seen") - plane.pixel(place).expect("seen");
            assert!((plane.by_place(place) * step - moved).norm() < 1e-3 * moved.norm());
        }
        let line: Vec<Sight> = sights[..4].to_vec();
        assert!(Plane::through(&line, about, 0.05).is_none());
        assert!(Plane::through(&sights[..2], about, 0.05).is_none());
    }
}
