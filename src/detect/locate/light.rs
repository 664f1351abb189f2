//! Where a light is that outshines what is around it: the centroid of its light.
//!
//! A lens blurs, a sensor's colours are filled in from neighbours, and light blooms where it is too much: none of them moves the
//! centroid of linear light much, while an ellipse with a rim is not what is seen. Codes are close to the root of light, so their
//! squares are summed; those near the ground, where noise would pull by its lever, do not count.

use nalgebra::Vector2;

use super::{Located, Seed};
use crate::detect::components::{Components, Connectivity, Labeling, Run, area, bounds};
use crate::detect::ground::middle;
use crate::detect::luma;
use crate::frame::{Frame, Region};

/// Shares of a light's height above which it counts: the lowest at which it is apart from others.
const SHARES: [f64; 3] = [0.2, 0.35, 0.5];

/// The window reaches so many half axes to all sides, and by so many px more, but not farther than that.
const REACH: f64 = 1.8;
const BEYOND_PX: f64 = 3.0;
const MAX_REACH_PX: f64 = 100.0;

/// Deviation of a code that sensor and coding leave at least.
const MIN_NOISE: f64 = 1.0;

/// What pixels have in common and none of them tells, px.
const FLOOR_PX: f64 = 0.01;

/// Locates lights, one after the other in the same memory.
#[derive(Default)]
pub(super) struct Lights {
    view: View,
    /// What is above one of the shares, and above the highest.
    parts: Labeling,
    tops: Labeling,
}

impl Lights {
    /// The light at `seed`. `None` where the frame ends too near, or it is not apart from others.
    pub(super) fn locate(&mut self, frame: &Frame, seed: &Seed) -> Option<Located> {
        let Self { view, parts, tops } = self;
        view.take(frame, seed)?;
        let (ground, noise) = view.ground()?;
        let at = seed.pixel - view.from();
        let height = view.top_near(at) - ground;
        let [.., highest] = SHARES;
        let tops = view.above(ground + highest * height, tops);
        SHARES.iter().find_map(|share| {
            let foot = ground + share * height;
            let runs = view.above(foot, parts).iter().find(|runs| holds(runs, at) && view.is_inside(runs))?;
            let is_one = tops.iter().filter(|top| covers(runs, top)).count() <= 1;
            if is_one { view.located(runs, foot, noise) } else { None }
        })
    }
}

/// Codes around a light.
#[derive(Default)]
struct View {
    window: Region,
    samples: Vec<u8>,
    /// Those at the border.
    border: Vec<f32>,
}

impl View {
    /// `None` where the frame ends too near, or it is too large.
    fn take(&mut self, frame: &Frame, seed: &Seed) -> Option<()> {
        let reach = seed.moments.diagonal().map(|v| (2.0 * REACH * v.max(0.25).sqrt() + BEYOND_PX).ceil());
        let middle = seed.pixel.map(f64::round);
        let (near, far) = (middle - reach, middle + reach);
        let fits = near.min() >= 0.0 && far.x < f64::from(frame.width()) && far.y < f64::from(frame.height());
        if !(fits && reach.max() <= MAX_REACH_PX) {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the frame, as was checked")]
        let [x, y, width, height] = [near.x, near.y, far.x - near.x + 1.0, far.y - near.y + 1.0].map(|v| v as u32);
        self.window = Region { x, y, width, height };
        luma::take(frame, self.window, &mut self.samples);
        Some(())
    }

    /// What is of this code at least.
    fn above<'a>(&self, code: f64, labeling: &'a mut Labeling) -> &'a Components {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two codes")]
        let threshold = code.ceil().max(1.0) as u8;
        labeling.of(&self.samples, self.width(), self.whole(), threshold, Connectivity::Eight)
    }

    const fn width(&self) -> usize {
        self.window.width as usize
    }

    const fn height(&self) -> usize {
        self.window.height as usize
    }

    const fn whole(&self) -> Region {
        Region { x: 0, y: 0, ..self.window }
    }

    fn from(&self) -> Vector2<f64> {
        Vector2::new(f64::from(self.window.x), f64::from(self.window.y))
    }

    fn code(&self, x: usize, y: usize) -> f64 {
        f64::from(self.samples[y * self.width() + x])
    }

    /// What is around the light, by the border, and its noise.
    fn ground(&mut self) -> Option<(f64, f64)> {
        let (width, height) = (self.width(), self.height());
        let is_border = |index: usize| {
            let (x, y) = (index % width, index / width);
            x == 0 || y == 0 || x + 1 == width || y + 1 == height
        };
        let border = (0..width * height).filter(|index| is_border(*index)).map(|index| f32::from(self.samples[index]));
        self.border.clear();
        self.border.extend(border);
        let (ground, noise) = middle(&mut self.border)?;
        Some((f64::from(ground), f64::from(noise).max(MIN_NOISE)))
    }

    /// The brightest pixel at a place or next to it.
    fn top_near(&self, at: Vector2<f64>) -> f64 {
        let is_near = |x: usize, y: usize| (Vector2::new(x as f64, y as f64) - at).amax() <= 1.5;
        let places = (0..self.height()).flat_map(|y| (0..self.width()).map(move |x| (x, y)));
        places.filter(|(x, y)| is_near(*x, *y)).map(|(x, y)| self.code(x, y)).fold(0.0, f64::max)
    }

    /// Whether a component ends before the window does.
    fn is_inside(&self, runs: &[Run]) -> bool {
        let reached = bounds(runs);
        let (right, bottom) = (reached.x + reached.width, reached.y + reached.height);
        reached.x > 0 && reached.y > 0 && right < self.window.width && bottom < self.window.height
    }

    /// A code between pixels, bilinear.
    fn between(&self, at: Vector2<f64>) -> f64 {
        let (x, y) = (at.x.clamp(0.0, self.width() as f64 - 1.001), at.y.clamp(0.0, self.height() as f64 - 1.001));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the window")]
        let (i, j) = (x as usize, y as usize);
        let (p, q) = (x - i as f64, y - j as f64);
        let upper = self.code(i, j) * (1.0 - p) + self.code(i + 1, j) * p;
        let lower = self.code(i, j + 1) * (1.0 - p) + self.code(i + 1, j + 1) * p;
        upper * (1.0 - q) + lower * q
    }

    /// The centroid of the squares of what is above `foot`.
    fn located(&self, runs: &[Run], foot: f64, noise: f64) -> Option<Located> {
        let pixels = || {
            runs.iter()
                .flat_map(|run| (run.start..run.end).map(|x| (x, run.y)))
                .map(|(x, y)| (Vector2::new(f64::from(x), f64::from(y)), self.code(x as usize, y as usize) - foot))
        };
        let sum: f64 = pixels().map(|(_, above)| above * above).sum();
        if !(sum > 0.0) {
            return None;
        }
        let centre = pixels().map(|(place, above)| place * (above * above)).sum::<Vector2<f64>>() / sum;
        let area_px = area(runs) as f64;
        // A light is as bright on the one side of its centre as on the other: what is left is noise, and what sampling makes of a
        // light that is small.
        let uneven = |(place, above): (Vector2<f64>, f64)| above + foot - self.between(centre * 2.0 - place);
        let noise = (0.5 * pixels().map(|pixel| uneven(pixel).powi(2)).sum::<f64>() / area_px).sqrt().max(noise);
        // The centroid moves by 2 above (place - centre) / sum with each code; of both axes the mean.
        let lever: f64 = pixels().map(|(place, above)| (above * (place - centre).norm()).powi(2)).sum();
        let random = noise * (2.0 * lever).sqrt() / sum;
        Some(Located { pixel: centre + self.from(), sigma_px: random.hypot(FLOOR_PX), area_px })
    }
}

/// Whether a component holds another.
fn covers(runs: &[Run], other: &[Run]) -> bool {
    other
        .first()
        .is_some_and(|part| runs.iter().any(|run| run.y == part.y && run.start <= part.start && part.start < run.end))
}

/// Whether a place lies on a component.
fn holds(runs: &[Run], at: Vector2<f64>) -> bool {
    runs.iter().any(|run| {
        let off = at.y - f64::from(run.y);
        off.abs() <= 0.5 && f64::from(run.start) - 0.5 <= at.x && at.x < f64::from(run.end) - 0.5
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix2;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::frame::{Coding, Pixels};
    use crate::random;

    /// Lights of (place, peak, radius px) on a ground of 12. With a mosaic, a quarter of what a pixel shows is of a colour that is sampled
    /// at every other pixel of every other row, and filled in from the neighbours.
    fn frame(lights: &[(Vector2<f64>, f64, f64)], is_mosaic: bool, rng: &mut impl rand::Rng) -> Frame {
        let light = |x: usize, y: usize| {
            let at = Vector2::new(x as f64, y as f64);
            let of = |(place, peak, radius): &(Vector2<f64>, f64, f64)| {
                peak * (-(at - place).norm_squared() / (2.0 * radius * radius)).exp()
            };
            lights.iter().map(of).sum::<f64>()
        };
        let seen = |x: usize, y: usize| {
            if !is_mosaic {
                return light(x, y);
            }
            let (left, right) = (x & !1, (x + 1) & !1);
            let (top, bottom) = (y & !1, (y + 1) & !1);
            0.75 * light(x, y)
                + 0.0625 * (light(left, top) + light(right, top) + light(left, bottom) + light(right, bottom))
        };
        let mut code = |x: usize, y: usize| {
            let noise: f64 = StandardNormal.sample(rng);
            let code = (seen(x, y) * 255.0 + 144.0).sqrt() + noise;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a code")]
            let code = code.round().clamp(0.0, 255.0) as u8;
            code
        };
        let samples = (0..60).flat_map(|y| (0..60).map(move |x| (x, y))).map(|(x, y)| code(x, y)).collect();
        Frame::checked(60, 60, Pixels::Luma(samples), Coding::LOSSLESS).expect("a frame")
    }

    fn locate(frame: &Frame, seed: &Seed) -> Option<Located> {
        Lights::default().locate(frame, seed)
    }

    fn seed(pixel: Vector2<f64>) -> Seed {
        Seed { pixel, moments: Matrix2::identity() * 1.5, sigma_px: 0.2 }
    }

    #[test]
    fn errors_are_as_large_as_they_are_said_to_be_however_the_light_is_sampled() {
        let mut rng = random::named("lights");
        for is_mosaic in [false, true] {
            let (mut squares, mut errors) = (0.0, 0.0);
            for index in 0..200_u32 {
                let i = f64::from(index);
                let place = Vector2::new(30.0 + 2.0 * (0.37 * i).fract(), 29.0 + 2.0 * (0.71 * i).fract());
                let peak = [120.0, 250.0, 900.0][index as usize % 3];
                let frame = frame(&[(place, peak, 0.9)], is_mosaic, &mut rng);
                let found = locate(&frame, &seed(place.map(f64::round))).expect("apart");
                let error = (found.pixel - place).norm_squared();
                squares += 0.5 * error / found.sigma_px.powi(2) / 200.0;
                errors += 0.5 * error / 200.0;
            }
            // What is between pixels is not quite what lies on them: where nothing else is uneven, that makes deviations cautious.
            let least = if is_mosaic { 0.4 } else { 0.1 };
            assert!((least..2.0).contains(&squares), "mosaic {is_mosaic}: {squares}, off by {}", errors.sqrt());
        }
    }

    #[test]
    fn two_that_run_into_each_other_are_two_or_none() {
        let mut rng = random::named("two lights");
        let (one, other) = (Vector2::new(27.3, 30.2), Vector2::new(32.4, 30.7));
        let frame = frame(&[(one, 250.0, 1.1), (other, 220.0, 1.1)], false, &mut rng);
        for place in [one, other] {
            let found = locate(&frame, &seed(place.map(f64::round))).expect("apart at half height");
            assert!((found.pixel - place).norm() < 0.12, "{found:?}");
        }
        let near = Vector2::new(30.1, 30.4);
        assert!(locate(&frame, &Seed { pixel: Vector2::new(1.0, 1.0), ..seed(near) }).is_none(), "the frame ends");
    }
}
