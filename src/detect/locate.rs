//! Where exactly a marker is: a blurred ellipse fitted to luma and chroma together.
//!
//! Chroma tells a marker from everything else, but JPEG and Bayer sensors sample it at half the rate. Luma is sharp, but a red
//! disc may be as bright as what is behind it, and whatever crosses its rim (a panel line, the edge of a wing) is there too.
//! So one ellipse is fitted to both, each channel with a ground and a height of its own, weighted by its own noise, and
//! pixels that fit neither are left out. An LED in the dark has no rim: it is the centroid of its light.

mod border;
mod cover;
mod ellipse;
mod fit;
mod foreign;
mod lanes;
mod light;
mod mixture;
mod pass;
mod patch;
mod reader;
mod rim;
mod shape;

use nalgebra::{Matrix2, Vector2};

use crate::camera::Pixel;
use crate::frame::Frame;

pub use shape::Shape;

/// A blob that was found, roughly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed {
    /// Its middle in the frame, px.
    pub pixel: Pixel,
    /// Second moments of its area, px^2.
    pub moments: Matrix2<f64>,
    /// How far its middle may be off, one standard deviation, px.
    pub sigma_px: f64,
}

/// The same blob, exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Located {
    /// Middle of its ellipse, px.
    pub pixel: Pixel,
    /// Standard deviation per axis, px.
    pub sigma_px: f64,
    /// Area of its ellipse, px.
    pub area_px: f64,
}

/// How far from the middle of a blob of this length pixels are looked at, at most, px.
#[must_use]
pub const fn reach_px(length_px: u32) -> u32 {
    let reach_px = length_px.saturating_add(BEYOND_PX);
    if reach_px < MAX_REACH_PX { reach_px } else { MAX_REACH_PX }
}

/// Half a side of the largest patch, px: beyond it a marker is as well known as it will be.
const MAX_REACH_PX: u32 = 160;

/// What a patch holds beyond the blob itself at most, px: the ground at its rim, whole pixels.
const BEYOND_PX: u32 = 5;

/// Locates blobs, one after the other in the same memory.
#[derive(Default)]
pub struct Locator {
    fitter: fit::Fitter,
    lights: light::Lights,
}

impl Locator {
    /// The ellipse at `seed`; `chroma` is the direction of the marker's hue in the plane of (Cb, Cr). `None` where no ellipse fits.
    #[must_use]
    pub fn locate(&mut self, frame: &Frame, seed: &Seed, chroma: Option<Vector2<f64>>) -> Option<Located> {
        self.fitter.fit(frame, seed, None, &[], chroma, &Likeness::MARKER)
    }

    /// The light at `seed`, which outshines what is around it. `None` where it is not apart from others.
    #[must_use]
    pub fn locate_light(&mut self, frame: &Frame, seed: &Seed) -> Option<Located> {
        self.lights.locate(frame, seed)
    }

    /// The ellipse at `rough`, of which the shape is known: what touches or covers a part of its rim does not bend it, and moves it less.
    #[must_use]
    pub fn locate_shaped(
        &mut self,
        frame: &Frame,
        rough: &Seed,
        shape: &Shape,
        chroma: Option<Vector2<f64>>,
    ) -> Option<Located> {
        self.fitter.fit(frame, rough, Some(shape), &[], chroma, &Likeness::MARKER)
    }
}

/// The dark disc on white at `seed`, as it is printed on a board; `others` are next to it and are looked past.
#[must_use]
pub fn locate_print(frame: &Frame, seed: &Seed, others: &[Seed]) -> Option<Located> {
    fit::Fitter::default().fit(frame, seed, None, others, None, &Likeness::PRINT)
}

/// How like an ellipse a rim is that is one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Likeness {
    /// The part of an edge's height by which optics, sampling and coding bend it away from the model, as a standard deviation.
    edge_error: f64,
    /// What of that error is left at an edge's feet, where a dark marker's codes rise steepest.
    feet: f32,
    /// Whether lines and other things around it are to be looked past, where it is large enough to be told from them.
    amid_others: bool,
    /// How finely a sector of luma's rim is drawn at best, px.
    floor_px: f64,
    /// Sectors of the rim are left out, as a matter of course or where all of them together make no ellipse: beyond this scatter.
    trim_scatter: f64,
    /// The rim of what is smaller has too few pixels for some of them to be told from the rest, px.
    sectored_area_px: f64,
    /// Passes at most, and the move, px, that ends them.
    max_passes: usize,
    settled_px: f64,
    /// Whether its place is as well known as opposite sides of its rim agree, rather than as all of the rim makes an ellipse.
    by_unevenness: bool,
    /// Whether it may be so large that its middle is not looked at.
    large: bool,
}

impl Likeness {
    /// A body in the air: somewhat round, before anything.
    const MARKER: Self = Self {
        edge_error: 0.025,
        feet: 0.3,
        amid_others: true,
        floor_px: 0.025,
        trim_scatter: 0.0,
        sectored_area_px: 20.0,
        max_passes: 10,
        settled_px: 6e-3,
        by_unevenness: true,
        large: false,
    };
    /// A disc in print, on white.
    const PRINT: Self = Self {
        edge_error: 0.008,
        feet: 0.0,
        amid_others: false,
        floor_px: 0.008,
        trim_scatter: 2.5,
        sectored_area_px: 20.0,
        max_passes: 40,
        settled_px: 1e-3,
        by_unevenness: false,
        large: true,
    };
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::frame::{Coding, Pixels};
    use crate::random;

    const GRAY: [f64; 3] = [150.0, 154.0, 158.0];
    const RED: [f64; 3] = [190.0, 40.0, 35.0];

    /// A tilted disc through a lens, sampled by 4 x 4 rays a pixel, with noise of 1.5 levels, on `ground`; `over` is where something
    /// hides it.
    struct Scene<'a> {
        centre: Vector2<f64>,
        axes: Vector2<f64>,
        turn: f64,
        ground: &'a dyn Fn(Vector2<f64>) -> [f64; 3],
        over: &'a dyn Fn(Vector2<f64>) -> bool,
    }

    impl Scene<'_> {
        fn colour(&self, at: Vector2<f64>) -> [f64; 3] {
            let (sine, cosine) = self.turn.sin_cos();
            let q = at - self.centre;
            let (a, b) = ((cosine * q.x + sine * q.y) / self.axes.x, (cosine * q.y - sine * q.x) / self.axes.y);
            if a * a + b * b <= 1.0 && !(self.over)(at) { RED } else { (self.ground)(at) }
        }

        fn frame(&self, rng: &mut impl rand::Rng) -> Frame {
            let mut samples = Vec::new();
            for y in 0..60 {
                for x in 0..60 {
                    let mut sum = [0.0; 3];
                    let mut weights = 0.0;
                    for i in 0..144 {
                        // Rays over two pixels around the pixel's middle, weighted as a lens does.
                        let off = Vector2::new(f64::from(i % 12) - 5.5, f64::from(i / 12) - 5.5) / 4.0;
                        let weight = (-off.norm_squared() / (2.0 * 0.36)).exp();
                        let colour = self.colour(Vector2::new(f64::from(x), f64::from(y)) + off);
                        // Light, not codes, is what mixes.
                        sum.iter_mut().zip(colour).for_each(|(sum, c)| *sum += weight * c * c);
                        weights += weight;
                    }
                    samples.extend(sum.map(|sum| {
                        let noise: f64 = StandardNormal.sample(rng);
                        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a colour")]
                        let code = ((sum / weights).sqrt() + 1.5 * noise).round().clamp(0.0, 255.0) as u8;
                        code
                    }));
                }
            }
            Frame::checked(60, 60, Pixels::Rgb(samples), Coding::LOSSLESS).expect("a frame")
        }

        /// As a detector may find it: off by some part of a pixel.
        fn seed(&self, off: Vector2<f64>) -> Seed {
            let axis = Vector2::new(self.turn.cos(), self.turn.sin());
            let along = axis * axis.transpose();
            let [a, b] = [0.25 * self.axes.x.powi(2), 0.25 * self.axes.y.powi(2)];
            Seed { pixel: self.centre + off, moments: along * a + (Matrix2::identity() - along) * b, sigma_px: 0.2 }
        }
    }

    const HUE: Option<Vector2<f64>> = Some(Vector2::new(-0.31, 0.95));

    fn locate(frame: &Frame, seed: &Seed, chroma: Option<Vector2<f64>>) -> Option<Located> {
        Locator::default().locate(frame, seed, chroma)
    }

    fn plain(_: Vector2<f64>) -> [f64; 3] {
        GRAY
    }

    fn nothing(_: Vector2<f64>) -> bool {
        false
    }

    #[test]
    fn places_are_within_their_deviations_and_areas_right() {
        let mut rng = random::named("located discs");
        let mut squares = Vec::new();
        for index in 0..120_u32 {
            let i = f64::from(index);
            let radius = 2.0 + 1.4 * (i % 7.0);
            let scene = Scene {
                centre: Vector2::new(29.5 + (0.37 * i).fract(), 30.1 + (0.71 * i).fract()),
                axes: Vector2::new(radius, radius * (0.5 + 0.5 * (0.13 * i).fract())),
                turn: i,
                ground: &plain,
                over: &nothing,
            };
            let frame = scene.frame(&mut rng);
            let off = Vector2::new((0.53 * i).fract() - 0.5, (0.29 * i).fract() - 0.5) * 0.4;
            let found = locate(&frame, &scene.seed(off), HUE).unwrap_or_else(|| panic!("{index}: not located"));
            let error = (found.pixel - scene.centre).norm();
            assert!(error < 0.15, "{index}: {error} {found:?}");
            squares.push(0.5 * (error / found.sigma_px).powi(2));
            let area = std::f64::consts::PI * scene.axes.x * scene.axes.y;
            // A small one hides in its blur.
            assert!((found.area_px / area - 1.0).abs() < 0.1 + 3.0 / area, "{index}: {} of {area}", found.area_px);
        }
        // 240 coordinates: chance moves the mean by 0.09. The deviation holds what coding and optics add to a clean scene's
        // noise, so it may be the larger, but not by more than twice.
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        assert!((0.2..1.3).contains(&mean), "{mean}");
    }

    #[test]
    fn what_touches_the_rim_does_not_move_the_place() {
        let mut rng = random::named("lines at discs");
        let centre = Vector2::new(30.3, 29.6);
        // A dark line along the rim, and the corner of something that hides a part.
        let line = |at: Vector2<f64>| if (at.y - 37.4).abs() < 0.8 { GRAY.map(|c| 0.7 * c) } else { GRAY };
        let corner = |at: Vector2<f64>| at.x > 34.0 && at.y > 34.0;
        for (name, ground, over) in [
            ("line", &line as &dyn Fn(Vector2<f64>) -> [f64; 3], &nothing as &dyn Fn(Vector2<f64>) -> bool),
            ("corner", &plain, &corner),
        ] {
            let mut sum = 0.0;
            for _ in 0..10 {
                let scene = Scene { centre, axes: Vector2::new(8.0, 7.5), turn: 0.3, ground, over };
                let frame = scene.frame(&mut rng);
                let found = locate(&frame, &scene.seed(Vector2::zeros()), HUE).expect("located");
                let error = (found.pixel - centre).norm();
                assert!(error < 0.11, "{name}: {error} {found:?}");
                sum += error * error;
            }
            assert!(sum < 10.0 * 0.07 * 0.07, "{name}: {}", (sum / 10.0).sqrt());
        }
    }

    #[test]
    fn a_border_of_paint_behind_a_disc_does_not_move_it_and_places_stay_within_their_deviations() {
        let mut rng = random::named("borders behind discs");
        let (mut squares, mut mean) = (0.0, 0.0);
        for index in 0..24_u32 {
            let i = f64::from(index);
            // From near the middle to beyond the rim.
            let (radius, distance) = (5.0 + (0.37 * i).fract() * 4.0, 1.4 * (0.41 * i).fract());
            let centre = Vector2::new(29.6 + (0.61 * i).fract(), 29.7 + (0.83 * i).fract());
            let normal = Vector2::new((0.5 * i).cos(), (0.5 * i).sin());
            let ground = |at: Vector2<f64>| {
                if normal.dot(&(at - centre)) > distance * radius { GRAY.map(|c| 0.78 * c) } else { GRAY }
            };
            let scene = Scene {
                centre,
                axes: Vector2::new(radius, 0.9 * radius),
                turn: 0.7 * i,
                ground: &ground,
                over: &nothing,
            };
            let frame = scene.frame(&mut rng);
            let found = locate(&frame, &scene.seed(Vector2::new(0.1, -0.05)), HUE).expect("located");
            let error = found.pixel - centre;
            assert!(error.norm() < 0.06, "{index}: {error:?} {found:?}");
            squares += error.norm_squared() / 48.0;
            mean += 0.5 * (error.norm() / found.sigma_px).powi(2) / 24.0;
        }
        // With one ground alone these are 0.030 px and 8.2.
        assert!(squares.sqrt() < 0.018, "{}", squares.sqrt());
        assert!(mean < 1.8, "{mean}");
    }

    #[test]
    fn colour_that_pixels_share_moves_no_disc() {
        let mut rng = random::named("shared colours");
        // As bright as the disc, so that colour alone shows it.
        let dim = |_: Vector2<f64>| [82.0, 84.0, 87.0];
        let (mut mean, count) = (Vector2::zeros(), 80_u32);
        for index in 0..count {
            let i = f64::from(index);
            let centre = Vector2::new(29.5 + (0.377 * i).fract(), 29.5 + (0.713 * i).fract());
            let scene = Scene { centre, axes: Vector2::new(7.0, 6.5), turn: i, ground: &dim, over: &nothing };
            let bytes = crate::scene::encode::jpeg(&scene.frame(&mut rng), 92).expect("encodes");
            let frame = Frame::decode(&bytes, &crate::frame::Decoding::default()).expect("decodes");
            assert!(frame.coding().chroma.is_reduced());
            let found = locate(&frame, &scene.seed(Vector2::zeros()), HUE).expect("located");
            mean += (found.pixel - centre) / f64::from(count);
        }
        // Of the pixels as decoders give them it is 0.027 px to the left, and 0.024 up.
        assert!(mean.amax() < 0.008, "{mean:?}");
    }

    #[test]
    fn a_known_shape_is_bent_by_nothing() {
        let mut rng = random::named("shapes");
        // Small, and something hides a quarter of it.
        let corner = |at: Vector2<f64>| at.x > 31.0 && at.y > 29.5;
        let axes = Vector2::new(5.2, 4.4);
        let (mut alone, mut shaped) = (0.0, 0.0);
        for index in 0..12_u32 {
            let scene = Scene {
                centre: Vector2::new(30.3 + 0.07 * f64::from(index), 29.6),
                axes,
                turn: 0.9,
                ground: &plain,
                over: &corner,
            };
            let frame = scene.frame(&mut rng);
            let seed = scene.seed(Vector2::new(0.1, -0.1));
            let shape = Shape { moments: seed.moments, covariance: Matrix3::identity() * 0.02 };
            let error = |found: Option<Located>| (found.expect("located").pixel - scene.centre).norm_squared();
            alone += error(locate(&frame, &seed, HUE));
            shaped += error(Locator::default().locate_shaped(&frame, &seed, &shape, HUE));
        }
        let (alone, shaped) = ((alone / 24.0_f64).sqrt(), (shaped / 24.0_f64).sqrt());
        assert!(shaped < 0.25 && shaped < 0.7 * alone, "{shaped} alone {alone}");
    }

    #[test]
    fn where_there_is_no_ellipse_or_no_room_there_is_no_place() {
        let mut rng = random::named("no disc");
        let scene = Scene {
            centre: Vector2::new(3.0, 30.0),
            axes: Vector2::new(6.0, 6.0),
            turn: 0.0,
            ground: &plain,
            over: &nothing,
        };
        let frame = scene.frame(&mut rng);
        assert_eq!(locate(&frame, &scene.seed(Vector2::zeros()), HUE), None, "the frame ends within it");
        let empty = Scene { centre: Vector2::new(30.0, 30.0), over: &|_| true, ..scene };
        let found = locate(&empty.frame(&mut rng), &empty.seed(Vector2::zeros()), HUE);
        assert!(found.is_none_or(|found| found.sigma_px > 0.2), "{found:?}");
        for _ in 0..300 {
            let found = locate(&empty.frame(&mut rng), &empty.seed(Vector2::zeros()), HUE);
            let is_known = |found: Located| found.sigma_px < (found.area_px / std::f64::consts::PI).sqrt();
            assert!(found.is_none_or(is_known), "{found:?} is known no better than it is large");
        }
        let odd = Seed { pixel: Vector2::new(f64::NAN, 1.0), ..scene.seed(Vector2::zeros()) };
        assert_eq!(locate(&frame, &odd, HUE), None);
    }
}
