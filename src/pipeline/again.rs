//! A second look at markers whose shapes the first pose tells.
//!
//! Alone, a disc's image is fitted by an ellipse of any shape, which a line that touches its rim bends. The pose of all markers together
//! knows the shape far better than one marker's rim does, and with it the rim tells nothing but the place.

use nalgebra::{Matrix2, Matrix3, Matrix6, SymmetricEigen, Vector3};

use crate::camera::Camera;
use crate::detect::locate::Shape;
use crate::detect::{Centroid, Detector, Workspace};
use crate::frame::Frame;
use crate::geometry::CameraFromTarget;
use crate::identify::{Hypothesis, Identified};
use crate::pose::PoseAnswer;
use crate::target::Target;

/// Where it is less certain which blob is whose, shapes are not known.
const MIN_PROBABILITY: f64 = 0.99;

/// How far radii are off of themselves: as they are glued, and where nothing confirms them.
const RADIUS_SIGMA_RATIO: f64 = 0.005;
const GUESSED_RADIUS_SIGMA_RATIO: f64 = 0.05;

/// So many markers seen as well as this tell how large they are, px.
const TELLING: usize = 3;
const TELLING_SIGMA_PX: f64 = 0.1;

/// The logarithm of an area seen lies as far beside that of the true one, and farther for small ones.
const AREA_TOLERANCE: f64 = 0.06;
const AREA_TOLERANCE_PX: f64 = 4.0;

/// Light that is a share of a disc's area and lies at its rim, or is missing there, moves the centroid by so many radii times the share.
const ASIDE: f64 = 0.5;

/// How far a rim lies beside that of the ideal disc, px: light that the sensor's curve and the coding spread.
const RIM_SIGMA_PX: f64 = 0.05;

/// How far a disc is from round, of its radius.
const BENT_SIGMA_RATIO: f64 = 0.01;

/// What is looked at once more, in what memory and for what.
pub(super) struct Looking<'a> {
    pub frame: &'a Frame,
    pub workspace: &'a mut Workspace,
    pub detector: &'a Detector,
}

impl Looking<'_> {
    /// Locates once more those of `centroids` that are markers of the target.
    pub(super) fn look_again(
        &mut self,
        camera: &Camera,
        target: &Target,
        identified: &Identified,
        centroids: &mut [Centroid],
    ) {
        let Hypothesis { blob_of_marker, answer, probability } = &identified.hypotheses[0];
        if *probability < MIN_PROBABILITY {
            return;
        }
        let shapes: Vec<(usize, Shape)> = blob_of_marker
            .iter()
            .enumerate()
            .filter_map(|(marker, blob)| Some(((*blob)?, shape(camera, target, marker, answer)?)))
            .collect();
        let size = Size::of(&shapes, centroids);
        for (blob, shape) in shapes {
            let expected = size.apply(&shape);
            let centroid = &mut centroids[blob];
            if let Some(again) = self.detector.located_again(self.workspace, self.frame, centroid, &expected) {
                *centroid = again;
            }
            centroid.sigma_px = centroid.sigma_px.hypot(aside_px(centroid.area_px, expected.area_px()));
        }
    }
}

/// How far light may lie aside of which there is more or less than of the disc, px: what is beside it was taken for it, or hides a part.
fn aside_px(area_px: f64, expected_px: f64) -> f64 {
    let off = (area_px / expected_px).ln().abs() - AREA_TOLERANCE - AREA_TOLERANCE_PX / expected_px;
    ASIDE * off.max(0.0) * (expected_px / std::f64::consts::PI).sqrt()
}

/// How large the markers are against what the target says: radii are often a guess.
struct Size {
    area_factor: f64,
    radius_sigma_ratio: f64,
}

impl Size {
    /// By what was seen of the markers alone.
    fn of(shapes: &[(usize, Shape)], centroids: &[Centroid]) -> Self {
        let mut seen: Vec<(f64, f64)> = shapes
            .iter()
            .filter(|(blob, _)| centroids[*blob].sigma_px < TELLING_SIGMA_PX)
            .map(|(blob, shape)| ((centroids[*blob].area_px / shape.area_px()).ln(), shape.area_px()))
            .collect();
        if seen.len() < TELLING {
            return Self { area_factor: 1.0, radius_sigma_ratio: GUESSED_RADIUS_SIGMA_RATIO };
        }
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (ln_factor, area_px) = seen[seen.len() / 2];
        let is_as_stated = ln_factor.abs() < AREA_TOLERANCE + AREA_TOLERANCE_PX / area_px;
        Self { area_factor: if is_as_stated { 1.0 } else { ln_factor.exp() }, radius_sigma_ratio: RADIUS_SIGMA_RATIO }
    }

    fn apply(&self, shape: &Shape) -> Shape {
        let moments = shape.moments * self.area_factor;
        let by_radius = coordinates(&moments) * (2.0 * self.radius_sigma_ratio);
        let covariance = shape.covariance * self.area_factor.powi(2) + by_radius * by_radius.transpose();
        Shape { moments, covariance }
    }
}

/// The shape of the marker's image at the poses of `answer`, and how well that is known but for its size.
fn shape(camera: &Camera, target: &Target, marker: usize, answer: &PoseAnswer) -> Option<Shape> {
    let at = |pose: &CameraFromTarget| Some(coordinates(&target.disc_image(marker, camera, pose)?.moments));
    let mut total = 0.0;
    let (mut mean, mut square) = (Vector3::zeros(), Matrix3::zeros());
    for estimate in std::iter::once(&answer.best).chain(&answer.alternatives) {
        let pose = &estimate.camera_from_target;
        let middle = at(pose)?;
        let steps: Matrix6<f64> = estimate.covariance.matrix().cholesky()?.unpack();
        let mut around = Matrix3::zeros();
        for step in steps.column_iter() {
            let off = at(&pose.perturbed(&step.into_owned()))? - middle;
            around += off * off.transpose();
        }
        total += estimate.probability;
        mean += middle * estimate.probability;
        square += (around + middle * middle.transpose()) * estimate.probability;
    }
    let mean = mean / total;
    let of_poses = square / total - mean * mean.transpose();
    let moments = Matrix2::new(mean.x, mean.y, mean.y, mean.z);
    // Half axes are twice the root of the moments: when they grow by d px, the moments do by d times that root.
    let SymmetricEigen { eigenvectors, eigenvalues } = moments.symmetric_eigen();
    if !(eigenvalues.min() > 0.0) {
        return None;
    }
    let root = eigenvectors * Matrix2::from_diagonal(&eigenvalues.map(f64::sqrt)) * eigenvectors.transpose();
    let rim = coordinates(&root) * RIM_SIGMA_PX;
    let bent = eigenvalues.product() * BENT_SIGMA_RATIO.powi(2);
    let covariance = of_poses + rim * rim.transpose() + Matrix3::from_diagonal(&Vector3::new(bent, 0.5 * bent, bent));
    Some(Shape { moments, covariance })
}

fn coordinates(moments: &Matrix2<f64>) -> Vector3<f64> {
    Vector3::new(moments.m11, moments.m12, moments.m22)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::{Estimate, Options, estimate, estimate_of};
    use crate::random::case;
    use crate::scene::flight::Flight;
    use crate::scene::models;
    use crate::scene::render::{Optics, Sky, render};
    use crate::scene::truth::truth;
    use crate::target::Marker;

    /// The wing with radii of another size than it was built with.
    fn scaled(target: &Target, factor: f64) -> Target {
        let marker = |marker: &Marker| Marker { radius_m: marker.radius_m.map(|r| r * factor), ..marker.clone() };
        Target::checked("scaled", target.markers().iter().map(marker).collect()).expect("a target")
    }

    #[test]
    fn light_of_another_area_may_lie_aside_by_what_is_missing_or_too_much() {
        let expected = std::f64::consts::PI * 100.0;
        for (share, least, most) in [(1.0, 0.0, 0.0), (0.95, 0.0, 0.0), (0.7, 0.8, 2.5), (1.4, 0.8, 2.5)] {
            let aside = aside_px(share * expected, expected);
            assert!((least..=most).contains(&aside), "{share}: {aside}");
        }
    }

    #[test]
    fn the_second_look_is_no_worse_and_what_radius_is_stated_hardly_matters() {
        let (camera, model, options) = (models::demo_camera(), models::wing(), Options::default());
        let flight = Flight::ALL[0];
        // Squares of errors of the first look, and of the second for each factor.
        let factors = [1.0, 0.8, 1.25];
        let (mut first, mut second, mut stated, mut count) = (0.0, [0.0; 3], 0.0, 0.0);
        for step in (0..flight.len()).step_by(flight.len() / 8) {
            let pose = flight.pose(step);
            let frame =
                render(&camera, &pose, &model, &Sky::default(), &Optics::default(), &mut case("again", step as u64));
            let detection = crate::detect::detect(&frame, frame.full(), &options.detector);
            let of = |target: &Target, again: bool| -> Estimate {
                let targets = std::slice::from_ref(target);
                if again {
                    estimate(&frame, &camera, targets, &options, |_| {}).expect("of the camera")
                } else {
                    estimate_of(detection.clone(), None, &camera, targets, &options, |_| {})
                }
            };
            let truths: Vec<_> = truth(&camera, &pose, &model).into_iter().filter_map(|m| m.centroid).collect();
            let errors = |found: &Estimate| -> Vec<(f64, f64)> {
                let near = |place: &crate::camera::Pixel| {
                    let distance = |c: &&Centroid| (c.pixel - place).norm_squared();
                    let nearest = found.detection.centroids.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
                    nearest.map(|c| (distance(&c), c.sigma_px))
                };
                truths.iter().filter_map(near).filter(|(squared, _)| *squared < 1.0).collect()
            };
            let alone = errors(&of(&model.target, false));
            first += alone.iter().map(|e| e.0).sum::<f64>();
            count += 2.0 * alone.len() as f64;
            for (sum, factor) in second.iter_mut().zip(factors) {
                let again = errors(&of(&scaled(&model.target, factor), true));
                assert_eq!(again.len(), alone.len(), "step {step}, factor {factor}");
                *sum += again.iter().map(|e| e.0).sum::<f64>();
                stated += again.iter().map(|(squared, sigma)| squared / sigma.powi(2)).sum::<f64>() / 3.0;
            }
        }
        let rms = |squares: f64| (squares / count).sqrt();
        for (squares, factor) in second.into_iter().zip(factors) {
            assert!(rms(squares) < 1.1 * rms(first), "factor {factor}: {} alone {}", rms(squares), rms(first));
        }
        // As chance moves it with so many, and deviations may be off by a quarter.
        assert!((0.3..1.7).contains(&(stated / count)), "{}", stated / count);
        assert!(count > 80.0, "{count}");
    }
}
