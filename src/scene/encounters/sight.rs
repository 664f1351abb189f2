//! The blobs of a frame without the frame: what a detector would find, with the errors that it was measured to have.
//!
//! The numbers are of [`color`](crate::detect::color) and [`beacon`](crate::detect::beacon) on rendered frames of the flying wing,
//! face on and tilted by 60 degrees, by day and by night, without JPEG; a test holds some of them against fresh frames. A frame has
//! textures, reflections and dirt that are not in here: what counts in the end are frames.

use nalgebra::Vector2;
use rand::{Rng, RngExt};
use rand_distr::{Distribution, Poisson};

use crate::camera::{Camera, Pixel};
use crate::detect::{Centroid, Detection, Detector};
use crate::frame::Region;
use crate::geometry::CameraFromTarget;
use crate::random::{normal, normal2};
use crate::scene::render::Model;
use crate::scene::truth::{Sight as Seen, truth};

/// What is put on top of what the detector was measured to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbance {
    /// Probability of a marker not to be found that would be.
    pub missing_ratio: f64,
    /// False blobs in a frame, on average.
    pub clutter: f64,
    /// Errors of the centroids in multiples of the measured ones; what is stated of them stays.
    pub error_ratio: f64,
}

impl Default for Disturbance {
    fn default() -> Self {
        Self { missing_ratio: 0.0, clutter: 0.0, error_ratio: 1.0 }
    }
}

/// How well a detector sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    acuity: Acuity,
    /// What is put on top.
    pub disturbance: Disturbance,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Acuity {
    /// Painted discs.
    Color {
        /// Smallest area that counts as a blob, px.
        min_area_px: f64,
    },
    /// Lights.
    Beacon,
}

/// Half of the discs of this much more than the smallest area are found, and how fast that grows, as a normal distribution, px.
const HALF_FOUND_PX: f64 = 0.2;
const FOUND_SPREAD_PX: f64 = 1.1;

/// No luck is greater, in deviations: of discs of 0.85 px radius none of 150 was found.
const MOST_LUCK: f64 = 1.5;

/// Root mean square error per axis of a disc of 1 px, falling with its area; and its limits, px.
const ERROR_PX: f64 = 1.3;
const LEAST_ERROR_PX: f64 = 0.012;
const MOST_ERROR_PX: f64 = 0.22;

/// What the detector states of a disc of 1 px, falling with the root of its area, px.
const STATED_PX: f64 = 0.36;

/// Two discs whose middles are nearer than this, or whose rims are, are one blob, px.
const ONE_BLOB_PX: f64 = 5.7;
const ONE_RIM_PX: f64 = 0.7;

/// The middles of two that stand this near, rim to rim, are drawn towards each other, by so much for each pixel, px.
const DRAWN_WITHIN_PX: f64 = 4.5;
const DRAWN_RATIO: f64 = 0.4;
const MOST_DRAWN_PX: f64 = 1.3;

/// The same of LEDs, which bloom to a spot of some pixels whatever their size.
const LED_BLOOM_PX: f64 = 1.7;
const LED_ERROR_PX: f64 = 0.06;
const LED_STATED_PX: f64 = 0.08;

/// A group of markers that the detector sees as one thing.
#[derive(Clone, Copy)]
struct Spot {
    pixel: Pixel,
    area_px: f64,
    radius_px: f64,
    /// Area of the largest part that hangs together, px: what stands out from the ground between. Spots that only blur into each
    /// other are as hard to find as the largest of them.
    core_px: f64,
}

impl Sight {
    /// That of a detector. `None` for one that finds no markers, or whose sight was not measured: the presets of the seed.
    #[must_use]
    pub const fn of(detector: &Detector, disturbance: Disturbance) -> Option<Self> {
        let acuity = match detector {
            Detector::Color(options) => Acuity::Color { min_area_px: options.blobs.min_area_px },
            Detector::Beacon(_) => Acuity::Beacon,
            Detector::Thesis | Detector::Edge(_) | Detector::Sky(_) => return None,
        };
        Some(Self { acuity, disturbance })
    }

    /// What is found in a frame of `model` at this pose. The same random numbers give the same blobs.
    pub fn detect(&self, camera: &Camera, pose: &CameraFromTarget, model: &Model, rng: &mut impl Rng) -> Detection {
        let seen: Vec<Spot> = truth(camera, pose, model)
            .into_iter()
            .filter(|marker| marker.sight == Seen::Whole)
            .filter_map(|marker| Some(self.spot(marker.centroid?, marker.area_px)))
            .collect();
        let drawn = self.drawn_together(&seen);
        let mut centroids: Vec<Centroid> =
            self.grown_together(drawn).into_iter().filter_map(|spot| self.found(&spot, camera, rng)).collect();
        for _ in 0..count(self.disturbance.clutter, rng) {
            centroids.extend(self.clutter(camera, rng));
        }
        // The larger is the surer, as in a detector's own order.
        centroids.sort_by(|a, b| b.area_px.total_cmp(&a.area_px));
        Detection { centroids, refused: Vec::new() }
    }

    fn spot(&self, pixel: Pixel, area_px: f64) -> Spot {
        let radius_px = (area_px / std::f64::consts::PI).sqrt();
        match self.acuity {
            Acuity::Color { .. } => Spot { pixel, area_px, radius_px, core_px: area_px },
            Acuity::Beacon => {
                let radius_px = radius_px + LED_BLOOM_PX;
                let area_px = std::f64::consts::PI * radius_px * radius_px;
                Spot { pixel, area_px, radius_px, core_px: area_px }
            }
        }
    }

    /// Neighbours pull at each other's middles.
    fn drawn_together(&self, spots: &[Spot]) -> Vec<Spot> {
        let drawn = |(index, spot): (usize, &Spot)| {
            let pull: Vector2<f64> = spots
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != index)
                .map(|(_, other)| {
                    let way = other.pixel - spot.pixel;
                    let gap_px = way.norm() - spot.radius_px - other.radius_px;
                    let by_px = (DRAWN_RATIO * (DRAWN_WITHIN_PX - gap_px)).clamp(0.0, MOST_DRAWN_PX);
                    way.try_normalize(1e-9).unwrap_or_default() * by_px
                })
                .sum();
            Spot { pixel: spot.pixel + pull, ..*spot }
        };
        match self.acuity {
            Acuity::Color { .. } => spots.iter().enumerate().map(drawn).collect(),
            // Light falls off so steeply that a neighbour's is felt only where the two are one.
            Acuity::Beacon => spots.to_vec(),
        }
    }

    /// Those too near to be told apart as one, chains of them too.
    fn grown_together(&self, mut spots: Vec<Spot>) -> Vec<Spot> {
        let least_px = match self.acuity {
            Acuity::Color { .. } => ONE_BLOB_PX,
            Acuity::Beacon => 0.0,
        };
        let is_one =
            |a: &Spot, b: &Spot| (a.pixel - b.pixel).norm() < least_px.max(a.radius_px + b.radius_px + ONE_RIM_PX);
        let mut index = 0;
        while index < spots.len() {
            match (index + 1..spots.len()).find(|&other| is_one(&spots[index], &spots[other])) {
                Some(other) => {
                    let (b, a) = (spots.remove(other), &mut spots[index]);
                    let area_px = a.area_px + b.area_px;
                    let touch = (a.pixel - b.pixel).norm() < a.radius_px + b.radius_px + ONE_RIM_PX;
                    a.core_px = if touch { a.core_px + b.core_px } else { a.core_px.max(b.core_px) };
                    a.pixel = (a.pixel * a.area_px + b.pixel * b.area_px) / area_px;
                    a.radius_px = (area_px / std::f64::consts::PI).sqrt();
                    a.area_px = area_px;
                    // What has grown may touch what it did not before.
                    index = 0;
                }
                None => index += 1,
            }
        }
        spots
    }

    fn found(&self, spot: &Spot, camera: &Camera, rng: &mut impl Rng) -> Option<Centroid> {
        // Drawn in any case, so that what is missed changes nothing about the others.
        let (luck, chance, off) = (normal(rng), rng.random_range(0.0..1.0), normal2(rng));
        let (is_large, error_px, sigma_px) = match self.acuity {
            Acuity::Color { min_area_px } => (
                spot.core_px > min_area_px + HALF_FOUND_PX + FOUND_SPREAD_PX * luck.max(-MOST_LUCK),
                LEAST_ERROR_PX.hypot(ERROR_PX / spot.area_px).min(MOST_ERROR_PX),
                STATED_PX / spot.area_px.sqrt(),
            ),
            Acuity::Beacon => (true, LED_ERROR_PX, LED_STATED_PX),
        };
        let pixel = spot.pixel + off * error_px * self.disturbance.error_ratio;
        (is_large && chance >= self.disturbance.missing_ratio && camera.contains(&pixel))
            .then(|| centroid(pixel, sigma_px, spot, camera))
    }

    /// A false blob anywhere.
    fn clutter(&self, camera: &Camera, rng: &mut impl Rng) -> Option<Centroid> {
        let size = [f64::from(camera.width()), f64::from(camera.height())];
        let pixel = Pixel::from(size.map(|side| rng.random_range(0.0..1.0) * (side - 1.0)));
        let spot = self.spot(pixel, 5.0 * 40.0_f64.powf(rng.random_range(0.0..1.0)));
        self.found(&spot, camera, rng)
    }
}

/// A number of events, so many on average.
fn count(mean: f64, rng: &mut impl Rng) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small whole number")]
    Poisson::new(mean).map_or(0, |poisson| poisson.sample(rng) as u32)
}

fn centroid(pixel: Pixel, sigma_px: f64, spot: &Spot, camera: &Camera) -> Centroid {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the frame")]
    let side = |middle: f64, size: u32| {
        let from = (middle - spot.radius_px).round().clamp(0.0, f64::from(size - 1)) as u32;
        let to = (middle + spot.radius_px).round().clamp(0.0, f64::from(size - 1)) as u32;
        (from, to + 1 - from)
    };
    let ((x, width), (y, height)) = (side(pixel.x, camera.width()), side(pixel.y, camera.height()));
    Centroid {
        pixel,
        sigma_px,
        area_px: spot.area_px,
        bounds: Region { x, y, width, height },
        score: (spot.area_px / (spot.area_px + 5.0)).clamp(0.0, 1.0),
        class: None,
        track_id: None,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::*;
    use crate::camera::Distortion;
    use crate::detect::{BeaconOptions, ColorOptions, detect};
    use crate::geometry::rotation;
    use crate::random::case;
    use crate::scene::encounters::Light;
    use crate::scene::models;
    use crate::scene::render::render;

    fn camera() -> Camera {
        Camera::checked([320, 240], [1000.0; 2], [160.0, 120.0], Distortion::None).expect("a camera")
    }

    fn color() -> Detector {
        Detector::Color(ColorOptions::default())
    }

    fn beacon() -> Detector {
        Detector::Beacon(BeaconOptions::default())
    }

    /// Found share, and root mean square error per axis, of the wing's markers at this distance, in `frames` frames.
    fn measured(
        name: &str,
        frames: u64,
        tilt_rad: f64,
        range_m: f64,
        look: impl Fn(&CameraFromTarget, &Model, u64) -> Detection,
    ) -> (f64, f64) {
        let model = models::wing();
        let (mut all, mut found, mut squares) = (0.0, 0.0, 0.0);
        for index in 0..frames {
            let mut rng = case(name, index);
            let spin = rotation::exp(&(Vector3::z() * rng.random_range(0.0..std::f64::consts::TAU)));
            let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), tilt_rad) * spin;
            let pose = CameraFromTarget::new(turn, Vector3::new(0.01 * range_m, -0.007 * range_m, range_m));
            let detection = look(&pose, &model, index);
            for centroid in truth(&camera(), &pose, &model).into_iter().filter_map(|marker| marker.centroid) {
                all += 1.0;
                let near = detection.centroids.iter().map(|c| (c.pixel - centroid).norm_squared());
                if let Some(squared) = near.filter(|squared| *squared < 1.0).min_by(f64::total_cmp) {
                    found += 1.0;
                    squares += 0.5 * squared;
                }
            }
        }
        (found / all, (squares / f64::max(found, 1.0)).sqrt())
    }

    #[test]
    fn simulated_blobs_are_found_and_err_as_those_of_frames_do() {
        let camera = camera();
        // Discs of 1.15, 1.5, 2.5 and 5 px radius face on, 2 px tilted; LEDs.
        let cases = [
            (Light::Day, color(), 0.0, 26.0),
            (Light::Day, color(), 0.0, 20.0),
            (Light::Day, color(), 0.0, 12.0),
            (Light::Day, color(), 0.0, 6.0),
            (Light::Day, color(), 1.05, 15.0),
            (Light::Night, beacon(), 0.0, 20.0),
        ];
        for (light, detector, tilt_rad, range_m) in cases {
            let sight = Sight::of(&detector, Disturbance::default()).expect("measured");
            let simulated = measured("simulated", 100, tilt_rad, range_m, |pose, model, index| {
                sight.detect(&camera, pose, model, &mut case("of sight", index))
            });
            let rendered = measured("rendered", 12, tilt_rad, range_m, |pose, model, index| {
                let (sky, mut rng) = (light.sky(index, &camera, 0.0), case("of frames", index));
                let frame = render(&camera, pose, &light.on(model.clone()), &sky, &light.optics(), &mut rng);
                detect(&frame, frame.full(), &detector)
            });
            println!("{light:?} at {range_m} m tilted {tilt_rad}: {simulated:.3?} {rendered:.3?}");
            // 72 markers of frames: a share is off by 0.06 by chance, what the model leaves out is as much.
            assert!((simulated.0 - rendered.0).abs() < 0.25, "{range_m} m: found {simulated:?} {rendered:?}");
            assert!((0.4..2.5).contains(&(simulated.1 / rendered.1)), "{range_m} m: off {simulated:?} {rendered:?}");
        }
    }

    #[test]
    fn markers_that_stand_too_near_are_one_blob_and_what_faces_away_is_none() {
        let sight = Sight::of(&beacon(), Disturbance::default()).expect("measured");
        let blobs = |range_m: f64, turn: Vector3<f64>| {
            let pose = CameraFromTarget::new(rotation::exp(&turn), Vector3::new(0.0, 0.0, range_m));
            sight.detect(&camera(), &pose, &models::wing(), &mut case("near", 0)).centroids.len()
        };
        assert_eq!(blobs(10.0, Vector3::zeros()), 6);
        assert_eq!(blobs(1500.0, Vector3::zeros()), 1);
        assert_eq!(blobs(10.0, Vector3::x() * 3.0), 0);
    }

    #[test]
    fn what_is_disturbed_is_missed_and_cluttered_so_often() {
        let disturbance = Disturbance { missing_ratio: 0.3, clutter: 2.0, error_ratio: 1.0 };
        let sight = Sight::of(&color(), disturbance).expect("measured");
        let away = CameraFromTarget::new(rotation::exp(&(Vector3::x() * 3.0)), Vector3::new(0.0, 0.0, 6.0));
        let near = CameraFromTarget::new(Rotation3::identity(), Vector3::new(0.0, 0.0, 6.0));
        let mean = |pose: &CameraFromTarget| {
            let blobs = |i| sight.detect(&camera(), pose, &models::wing(), &mut case("disturbed", i)).centroids.len();
            (0..400).map(blobs).sum::<usize>() as f64 / 400.0
        };
        // Two false ones, of which 0.3 are missed as well; six markers.
        assert!((mean(&away) - 1.35).abs() < 0.25, "{}", mean(&away));
        assert!((mean(&near) - 1.35 - 4.2).abs() < 0.35, "{}", mean(&near));
    }

    #[test]
    fn detectors_without_measured_markers_have_no_simulated_sight() {
        assert_eq!(Sight::of(&Detector::Thesis, Disturbance::default()), None);
    }
}
