//! Levenberg-Marquardt on SE(3).
//!
//! The residuals are distances in the raw image, lens included, in units of each point's own standard deviation. The pose is
//! moved on the left, by the six coordinates of [`PoseCovariance`], so the information matrix at the minimum is the inverse
//! of the covariance as the contract has it. Marquardt's scaling makes metres and radians comparable; the damping follows
//! Nielsen 1999, "Damping parameter in Marquardt's method". Nothing is allocated.

mod lanes;
mod normal;
mod view;

use multiversion::multiversion;
use nalgebra::{Matrix2x6, Matrix6, Vector2};
use thiserror::Error;

use super::{Correspondence, Loss};
use lanes::{LANES, Lanes};
use normal::{Normal, Sums};
use view::View;

use crate::camera::Camera;
use crate::geometry::{CameraFromTarget, PoseCovariance, rotation::cross_matrix};

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefineOptions {
    /// Most steps tried. From a solver's start five suffice; a start far away takes some dozens.
    pub max_iterations: usize,
    /// Stop when a step is smaller than this share of a standard deviation in every direction: far below anything that the
    /// data can tell.
    pub step_limit: f64,
    /// What is minimised.
    pub loss: Loss,
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self { max_iterations: 300, step_limit: 1e-6, loss: Loss::Squares }
    }
}

/// A minimum of the reprojection error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// The pose there.
    pub camera_from_target: CameraFromTarget,
    /// Its covariance, for the given standard deviations of the pixels.
    pub covariance: PoseCovariance,
    /// Sum of the losses; with [`Loss::Squares`] that of squared residuals in units of their standard deviations, chi-square
    /// with `2 n - 6` degrees of freedom.
    pub chi_square: f64,
    /// Root mean square distance between points and their projections, px.
    pub rms_px: f64,
    /// How it was reached.
    pub stats: Stats,
}

/// The evidence of an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stats {
    /// Steps tried.
    pub iterations: usize,
    /// Why it ended.
    pub stop: Stop,
}

/// Why an iteration ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    /// The last step was too small to matter: a minimum.
    SmallStep {
        /// Its length in standard deviations.
        norm: f64,
        /// What counts as small.
        limit: f64,
    },
    /// No step, however short, makes the error smaller: a minimum to rounding.
    NoDescent,
    /// Out of steps.
    MaxIterations {
        /// How many were allowed.
        limit: usize,
    },
}

/// Why there is no minimum.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum RefineError {
    /// The start puts a point behind the camera or outside the lens model.
    #[error("the start puts point {index} behind the camera or outside the lens model")]
    NotVisible {
        /// Its position.
        index: usize,
    },
    /// The points do not fix all six degrees of freedom.
    #[error("the image of these points does not fix all six degrees of freedom")]
    Singular,
}

/// Damping of the first step: a start by a solver is so near that the undamped step is nearly the best.
const FIRST_DAMPING: f64 = 1e-6;

/// The error and its derivatives at one pose.
struct Linearized {
    residuals: Residuals,
    normal: Normal,
}

/// The error at one pose.
#[derive(Clone, Copy)]
struct Residuals {
    chi_square: f64,
    rms_px: f64,
}

/// The minimum downhill of `start`.
///
/// # Errors
/// [`RefineError::NotVisible`] for a start without an image; [`RefineError::Singular`] where the minimum is no point.
pub fn refine(
    camera: &Camera,
    correspondences: &[Correspondence],
    start: &CameraFromTarget,
    options: &RefineOptions,
) -> Result<Refined, RefineError> {
    let mut pose = *start;
    let mut here =
        linearize(camera, correspondences, &pose, options.loss).map_err(|index| RefineError::NotVisible { index })?;
    let mut damping = FIRST_DAMPING;
    let mut growth = 2.0;
    let mut iterations = 0;
    let stop = loop {
        if iterations == options.max_iterations {
            break Stop::MaxIterations { limit: options.max_iterations };
        }
        iterations += 1;
        if let Some(step) = here.normal.damped_step(damping) {
            let moved = pose.perturbed(&step);
            // Length of the step in standard deviations.
            let norm = step.dot(&(here.normal.information * step)).max(0.0).sqrt();
            if norm <= options.step_limit {
                // So near, the derivatives are the same.
                if let Ok(residuals) = residuals(camera, correspondences, &moved, options.loss)
                    && residuals.chi_square <= here.residuals.chi_square
                {
                    pose = moved;
                    here.residuals = residuals;
                }
                break Stop::SmallStep { norm, limit: options.step_limit };
            }
            if let Ok(there) = linearize(camera, correspondences, &moved, options.loss) {
                let gain = here.residuals.chi_square - there.residuals.chi_square;
                if gain >= 0.0 {
                    let raised = step.component_mul(&here.normal.information.diagonal()) * damping;
                    let expected = step.dot(&(here.normal.descent + raised));
                    pose = moved;
                    here = there;
                    let surplus = 2.0 * gain / expected.max(f64::MIN_POSITIVE) - 1.0;
                    damping = (damping * (1.0 - surplus.powi(3)).max(1.0 / 3.0)).max(1e-12);
                    growth = 2.0;
                    continue;
                }
            }
        }
        damping *= growth;
        growth *= 2.0;
        if damping > 1e16 {
            break Stop::NoDescent;
        }
    };
    Ok(Refined {
        camera_from_target: pose,
        covariance: PoseCovariance::from_information(&here.normal.information).ok_or(RefineError::Singular)?,
        chi_square: here.residuals.chi_square,
        rms_px: here.residuals.rms_px,
        stats: Stats { iterations, stop },
    })
}

/// The information matrix of a pose: its inverse bounds the covariance of any unbiased estimate (Cramer-Rao).
///
/// # Errors
/// [`RefineError::NotVisible`] if a point has no image at this pose.
pub fn information(
    camera: &Camera,
    correspondences: &[Correspondence],
    pose: &CameraFromTarget,
) -> Result<Matrix6<f64>, RefineError> {
    linearize(camera, correspondences, pose, Loss::Squares)
        .map(|here| here.normal.information)
        .map_err(|index| RefineError::NotVisible { index })
}

/// Sum of squared residuals in units of their standard deviations; `None` if a point has no image at this pose.
#[must_use]
pub fn chi_square(camera: &Camera, correspondences: &[Correspondence], pose: &CameraFromTarget) -> Option<f64> {
    correspondences
        .iter()
        .map(|seen| {
            let projected = camera.project(&(*pose * seen.point))?;
            Some((seen.pixel - projected).norm_squared() / (seen.sigma_px * seen.sigma_px))
        })
        .sum()
}

/// The position of the first point without an image, if there is one.
#[multiversion(targets("x86_64+avx2"))]
fn linearize(
    camera: &Camera,
    correspondences: &[Correspondence],
    pose: &CameraFromTarget,
    loss: Loss,
) -> Result<Linearized, usize> {
    let mut sums = Sums::ZERO;
    let residuals = sum_losses(camera, correspondences, pose, loss, |view, weight| {
        sums.add(&view.distance, &view.by_pose(), weight);
    })?;
    Ok(Linearized { residuals, normal: sums.total() })
}

/// The same without the derivatives.
#[multiversion(targets("x86_64+avx2"))]
fn residuals(
    camera: &Camera,
    correspondences: &[Correspondence],
    pose: &CameraFromTarget,
    loss: Loss,
) -> Result<Residuals, usize> {
    sum_losses(camera, correspondences, pose, loss, |_, _| ())
}

/// Sums the losses, and shows each four points with their weights.
#[expect(clippy::inline_always, reason = "to be compiled for the instructions of the function that calls it")]
#[inline(always)]
fn sum_losses(
    camera: &Camera,
    correspondences: &[Correspondence],
    pose: &CameraFromTarget,
    loss: Loss,
    mut each: impl FnMut(&View, Lanes),
) -> Result<Residuals, usize> {
    let (mut chi_square, mut squares) = (Lanes::ZERO, Lanes::ZERO);
    let mut of_lost = 0.0;
    for (index, four) in correspondences.chunks(LANES).enumerate() {
        let mut view = View::of(camera, pose, four);
        if view.lost != [false; LANES] {
            let (most, _) = loss.of(f64::INFINITY);
            if let (Some(lane), false) = (view.lost.iter().position(|lost| *lost), most.is_finite()) {
                return Err(LANES * index + lane);
            }
            // Those may be wrong, and count as such.
            of_lost += view.lost[..four.len()].iter().filter(|lost| **lost).count() as f64 * most;
            view = view.without_lost();
        }
        let squared = view.squared_distance();
        let stated = squared * view.stated;
        let mut weight = view.stated;
        if matches!(loss, Loss::Squares) {
            chi_square += stated;
        } else {
            for lane in 0..LANES {
                let (lost, slope) = loss.of(stated.0[lane]);
                chi_square.0[lane] += lost;
                weight.0[lane] *= slope;
            }
        }
        for lane in 0..four.len() {
            squares.0[lane] += squared.0[lane];
        }
        each(&view, weight);
    }
    let count = correspondences.len().max(1) as f64;
    Ok(Residuals { chi_square: chi_square.sum() + of_lost, rms_px: (squares.sum() / count).sqrt() })
}

/// Where the point appears at this pose, and how that moves with the pose's six coordinates.
pub(crate) fn project_with_pose_jacobian(
    camera: &Camera,
    pose: &CameraFromTarget,
    seen: &Correspondence,
) -> Option<(Vector2<f64>, Matrix2x6<f64>)> {
    let turned = pose.rotation * seen.point.coords;
    let (pixel, by_point) = camera.project_with_jacobian(&(turned + pose.translation).into())?;
    let by_turn = by_point * -cross_matrix(&turned);
    let mut jacobian = Matrix2x6::zeros();
    jacobian.fixed_columns_mut::<3>(0).copy_from(&by_point);
    jacobian.fixed_columns_mut::<3>(3).copy_from(&by_turn);
    Some((pixel, jacobian))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Vector3, Vector6};
    use proptest::prelude::*;

    use super::*;
    use crate::camera::distortion::tests::REAL;
    use crate::geometry::{Point, rotation};

    fn camera(lens: usize) -> Camera {
        Camera::checked([640, 480], [608.7, 611.2], [314.0, 220.0], REAL[lens]).expect("a real camera")
    }

    fn pose() -> impl Strategy<Value = CameraFromTarget> {
        (proptest::array::uniform3(-1.0..1.0), -0.2..0.2, -0.2..0.2, 2.0..12.0).prop_map(|(w, x, y, z)| {
            CameraFromTarget::new(rotation::exp(&Vector3::from(w)), Vector3::new(x * z, y * z, z))
        })
    }

    const POINTS: [[f64; 3]; 6] = [
        [0.31, 0.02, 0.0],
        [-0.12, -0.36, 0.05],
        [-0.20, 0.33, 0.0],
        [-0.38, -0.06, -0.1],
        [0.05, 0.11, 0.0],
        [0.14, -0.27, 0.2],
    ];

    fn seen(camera: &Camera, pose: &CameraFromTarget) -> Vec<Correspondence> {
        POINTS
            .iter()
            .map(|&p| {
                let point = Point::from(p);
                Correspondence { point, pixel: camera.project(&(*pose * point)).expect("in view"), sigma_px: 0.5 }
            })
            .collect()
    }

    proptest! {
        #[test]
        fn the_jacobian_agrees_with_central_differences(lens in 0..REAL.len(), pose in pose()) {
            let camera = camera(lens);
            for seen in seen(&camera, &pose) {
                let (_, analytic) = project_with_pose_jacobian(&camera, &pose, &seen).expect("in view");
                for axis in 0..6 {
                    let mut step = Vector6::zeros();
                    step[axis] = 1e-6;
                    let at = |s: &Vector6<f64>| camera.project(&(pose.perturbed(s) * seen.point)).expect("in view");
                    let numeric = (at(&step) - at(&-step)) / 2e-6;
                    prop_assert!((analytic.column(axis) - numeric).norm() < 1e-6 * (1.0 + numeric.norm()));
                }
            }
        }

        #[test]
        fn a_start_nearby_comes_home_through_any_lens(
            lens in 0..REAL.len(), pose in pose(), step in proptest::array::uniform6(-0.05..0.05)
        ) {
            let camera = camera(lens);
            let refined = refine(&camera, &seen(&camera, &pose), &pose.perturbed(&Vector6::from(step)), &RefineOptions::default())
                .expect("in view");
            prop_assert!(refined.rms_px < 1e-6, "{refined:?}");
            prop_assert!(refined.camera_from_target.difference_to(&pose).norm() < 1e-6);
        }
    }

    #[test]
    fn a_start_behind_the_camera_is_refused() {
        let camera = camera(0);
        let good = CameraFromTarget::new(nalgebra::Rotation3::identity(), Vector3::new(0.0, 0.0, 5.0));
        let behind = CameraFromTarget::new(good.rotation, -good.translation);
        let refused = refine(&camera, &seen(&camera, &good), &behind, &RefineOptions::default());
        assert_eq!(refused, Err(RefineError::NotVisible { index: 0 }));
    }

    #[test]
    fn points_on_a_line_leave_the_covariance_open() {
        let camera = camera(0);
        let pose = CameraFromTarget::new(rotation::exp(&Vector3::new(0.2, 0.3, 0.1)), Vector3::new(0.1, 0.0, 5.0));
        let line: Vec<_> = (0..6)
            .map(|i| {
                let point = Point::new(0.1 * f64::from(i), 0.0, 0.0);
                Correspondence { point, pixel: camera.project(&(pose * point)).expect("in view"), sigma_px: 1.0 }
            })
            .collect();
        assert_eq!(refine(&camera, &line, &pose, &RefineOptions::default()), Err(RefineError::Singular));
    }
}
