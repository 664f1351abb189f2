//! Camera and poses of all views together: Levenberg-Marquardt over the reprojection error.
//!
//! A point of one view depends on the camera and on that view's pose alone, so the poses are eliminated view by view and what
//! is left to solve is as small as the camera (the Schur complement; Triggs et al. 1999, "Bundle adjustment: a modern
//! synthesis"). Derivatives are analytic. Damping as in `refine`.

use nalgebra::{Matrix6, SMatrix, Vector2, Vector6};

use super::SeenPoint;
use super::freedom::{ByParameter, Freedom, Parameters, camera_of, parameters_of};
use super::watch::Watch;
use crate::board::Board;
use crate::camera::parameters::MAX_PARAMETERS;
use crate::camera::{Camera, Distortion};
use crate::geometry::CameraFromBoard;
use crate::geometry::rotation::cross_matrix;

/// What is seen, and what of it counts.
pub(super) struct Bundle<'a> {
    /// The picture's size, px.
    pub size: [u32; 2],
    /// The board.
    pub board: &'a Board,
    /// Points by view.
    pub views: &'a [&'a [SeenPoint]],
    /// The lens' model.
    pub lens: Distortion,
    /// What is sought besides the poses.
    pub freedom: Freedom,
    /// How residuals count.
    pub loss: Loss,
    /// What is known of the parameters beforehand: the inverse of their variances around zero, in the units of the residuals. Terms
    /// of a rational lens nearly cancel each other; without any such knowledge they may run away together.
    pub prior: Parameters,
    /// Who waits for it.
    pub watch: Watch<'a>,
}

/// How residuals, in units of their standard deviations, count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Loss {
    /// As their squares.
    Squares,
    /// As `c^2 log(1 + |r|^2 / c^2)`: what is far off hardly counts (Cauchy).
    Cauchy {
        /// Where it begins to count less.
        c: f64,
    },
}

impl Loss {
    /// What a step must gain to be of use.
    const fn least_gain(self) -> f64 {
        match self {
            Self::Squares => LEAST_GAIN,
            Self::Cauchy { c } => LEAST_ROBUST_GAIN * c * c,
        }
    }

    /// The cost of a squared residual, and its derivative.
    fn of(self, square: f64) -> (f64, f64) {
        match self {
            Self::Squares => (square, 1.0),
            Self::Cauchy { c } => {
                let share = 1.0 + square / (c * c);
                (c * c * share.ln(), share.recip())
            }
        }
    }
}

/// A camera and a pose for each view.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub camera: Camera,
    pub parameters: Parameters,
    pub poses: Vec<CameraFromBoard>,
}

type Mixed = SMatrix<f64, MAX_PARAMETERS, 6>;

/// The normal equations of one view.
struct ViewNormal {
    mixed: Mixed,
    by_pose: Matrix6<f64>,
    gradient: Vector6<f64>,
}

/// The normal equations of all.
struct Normal {
    cost: f64,
    by_camera: ByParameter,
    gradient: Parameters,
    views: Vec<ViewNormal>,
    free: usize,
}

/// Steps tried at most.
const MAX_ITERATIONS: usize = 200;

/// A step that is predicted to lower the cost by less than this, in units of a standard deviation squared, is of no use.
const LEAST_GAIN: f64 = 1e-6;

/// The same where the loss is to find out what is wrong, in units of its own.
const LEAST_ROBUST_GAIN: f64 = 1e-3;

impl Bundle<'_> {
    /// The residual of a point, px: seen minus predicted; `None` where the camera does not see it.
    pub fn residual(&self, camera: &Camera, pose: &CameraFromBoard, seen: &SeenPoint) -> Option<Vector2<f64>> {
        let point = *pose * self.board.points()[seen.point];
        let predicted = match self.board.disc_radius_m() {
            Some(radius_m) => camera.disc_centroid(&point, &pose.rotation.matrix().column(2).into_owned(), radius_m)?,
            None => camera.project(&point)?,
        };
        Some(seen.pixel - predicted)
    }

    /// The cost of this state; infinite where a point is not seen.
    pub fn cost(&self, state: &State) -> f64 {
        let mut cost = 0.0;
        for (points, pose) in self.views.iter().zip(&state.poses) {
            for seen in *points {
                let Some(residual) = self.residual(&state.camera, pose, seen) else {
                    return f64::INFINITY;
                };
                cost += self.loss.of(residual.norm_squared() / (seen.sigma_px * seen.sigma_px)).0;
            }
        }
        cost + self.surprise(state)
    }

    /// What the parameters cost.
    fn surprise(&self, state: &State) -> f64 {
        if self.freedom.count() == 0 { 0.0 } else { state.parameters.component_mul(&state.parameters).dot(&self.prior) }
    }

    fn normal(&self, state: &State) -> Option<Normal> {
        let directions = self.freedom.directions();
        let mut normal = Normal {
            cost: 0.0,
            by_camera: ByParameter::zeros(),
            gradient: Parameters::zeros(),
            views: Vec::with_capacity(self.views.len()),
            free: self.freedom.count(),
        };
        for (points, pose) in self.views.iter().zip(&state.poses) {
            let mut view = ViewNormal { mixed: Mixed::zeros(), by_pose: Matrix6::zeros(), gradient: Vector6::zeros() };
            for seen in *points {
                let residual = self.residual(&state.camera, pose, seen)?;
                let variance = seen.sigma_px * seen.sigma_px;
                let (cost, slope) = self.loss.of(residual.norm_squared() / variance);
                normal.cost += cost;
                let weight = slope / variance;
                let turned = pose.rotation * self.board.points()[seen.point].coords;
                let point = *pose * self.board.points()[seen.point];
                let (_, by_point) = state.camera.project_with_jacobian(&point)?;
                let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
                by_pose.fixed_columns_mut::<3>(0).copy_from(&by_point);
                by_pose.fixed_columns_mut::<3>(3).copy_from(&(-by_point * cross_matrix(&turned)));
                view.by_pose += by_pose.transpose() * by_pose * weight;
                view.gradient += by_pose.transpose() * residual * weight;
                if self.freedom.count() > 0 {
                    let by_camera = state.camera.pixel_by_parameters(&point)? * directions;
                    normal.by_camera += by_camera.transpose() * by_camera * weight;
                    normal.gradient += by_camera.transpose() * residual * weight;
                    view.mixed += by_camera.transpose() * by_pose * weight;
                }
            }
            normal.views.push(view);
        }
        normal.cost += self.surprise(state);
        normal.by_camera += directions.transpose() * ByParameter::from_diagonal(&self.prior) * directions;
        normal.gradient -= directions.tr_mul(&self.prior.component_mul(&state.parameters));
        Some(normal)
    }

    /// The least cost that can be reached from `state` downhill; `None` where it has no cost, and where it is not wanted any more.
    pub fn refined(&self, mut state: State) -> Option<State> {
        let mut normal = self.normal(&state)?;
        let (mut damping, mut growth) = (1e-4, 2.0);
        for _ in 0..MAX_ITERATIONS {
            if !self.watch.is_wanted() {
                return None;
            }
            let Some(step) = normal.step(damping) else {
                (damping, growth) = (damping * growth, growth * 2.0);
                if !(damping < 1e12) {
                    break;
                }
                continue;
            };
            if step.gain < self.loss.least_gain() {
                break;
            }
            // Most steps are taken, so the equations there are wanted with the cost.
            let moved = self.moved(&state, &step).and_then(|moved| Some((self.normal(&moved)?, moved)));
            match moved {
                Some((next, moved)) if next.cost < normal.cost => {
                    let quality = (normal.cost - next.cost) / step.gain;
                    damping *= (1.0 - (2.0 * quality - 1.0).powi(3)).clamp(1.0 / 5.0, 2.0);
                    growth = 2.0;
                    (state, normal) = (moved, next);
                }
                _ => {
                    (damping, growth) = (damping * growth, growth * 2.0);
                    if !(damping < 1e12) {
                        break;
                    }
                }
            }
        }
        Some(state)
    }

    fn moved(&self, state: &State, step: &Step) -> Option<State> {
        let parameters = state.parameters + self.freedom.directions() * step.camera;
        let camera = camera_of(self.size, &self.lens, &parameters).ok().filter(has_no_pole)?;
        let poses = state.poses.iter().zip(&step.poses).map(|(pose, step)| pose.perturbed(step)).collect();
        Some(State { camera, parameters, poses })
    }

    /// The camera moved so far, and its poses with it as they follow; `None` where there is no such camera.
    pub fn moved_along(&self, state: &State, by: &Parameters) -> Option<State> {
        let camera = self.freedom.directions().tr_mul(by);
        let views = self.normal(state)?.views;
        let follows = |view: &ViewNormal| Some(-view.damped_inverse(0.0)? * view.mixed.tr_mul(&camera));
        let poses = views.iter().map(follows).collect::<Option<_>>()?;
        self.moved(state, &Step { camera, poses, gain: 0.0 })
    }

    /// The information about the free parameters that all views together give, for residuals of one standard deviation; the
    /// poses are eliminated.
    pub fn information(&self, state: &State) -> Option<ByParameter> {
        Some(self.normal(state)?.reduced(0.0)?.0)
    }

    /// What each view tells about the free parameters and how it pulls at them, for residuals of one standard deviation; the poses
    /// are eliminated.
    pub fn by_view(&self, state: &State) -> Option<Vec<(ByParameter, Parameters)>> {
        let alone = |(view, pose): (&&[SeenPoint], &CameraFromBoard)| {
            let bundle = Bundle { views: &[*view], prior: Parameters::zeros(), ..*self };
            let state = State { camera: state.camera, parameters: state.parameters, poses: vec![*pose] };
            bundle.normal(&state)?.reduced(0.0)
        };
        self.views.iter().zip(&state.poses).map(alone).collect()
    }

    /// Whether these points leave the pose of their view open: then its equations have no answer, whatever the camera is.
    pub fn leaves_pose_open(&self, camera: &Camera, pose: &CameraFromBoard, view: &[SeenPoint]) -> bool {
        let views = [view];
        let alone = Bundle { views: &views, freedom: Freedom::none(), ..*self };
        let state = State { camera: *camera, parameters: parameters_of(camera), poses: vec![*pose] };
        let normal = alone.normal(&state);
        !normal.is_some_and(|normal| normal.views.iter().all(|view| view.least_eigenvalue() > OPEN))
    }
}

/// Least value of what stands below the fraction bar of a rational lens, within the picture.
const LEAST_DENOMINATOR: f64 = 0.5;

/// Whether what stands below the fraction bar of a rational lens stays away from zero within the picture: where it vanishes, what is
/// above vanishes with it, and the lens has a kink that no picture of the board rules out.
fn has_no_pole(camera: &Camera) -> bool {
    let Distortion::RationalPolynomial([.., k4, k5, k6]) = camera.distortion() else { return true };
    let ([fx, fy], [width, height]) = (camera.focal_lengths(), [camera.width(), camera.height()]);
    let corner = (0.5 * f64::from(width) / fx).powi(2) + (0.5 * f64::from(height) / fy).powi(2);
    (1..=16).all(|step| {
        let r2 = corner * f64::from(step) / 16.0;
        1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)) > LEAST_DENOMINATOR
    })
}

/// The covariance of all parameters with this information about the free ones.
pub(super) fn covariance_of(information: &ByParameter, freedom: &Freedom) -> Option<ByParameter> {
    let scaled = Scaled::of(information, freedom.count())?;
    let inverse = scaled.inverse();
    let directions = freedom.directions();
    let covariance = directions * inverse * directions.transpose();
    // As symmetric as it is meant to be.
    Some((covariance + covariance.transpose()) * 0.5)
}

/// Moves of camera and poses, and by how much they are predicted to lower the cost.
struct Step {
    camera: Parameters,
    poses: Vec<Vector6<f64>>,
    gain: f64,
}

impl Normal {
    /// The equations of the camera alone: matrix, right side.
    fn reduced(&self, damping: f64) -> Option<(ByParameter, Parameters)> {
        let mut matrix = self.by_camera;
        for i in 0..MAX_PARAMETERS {
            matrix[(i, i)] *= 1.0 + damping;
        }
        let mut right = self.gradient;
        for view in &self.views {
            let inverse = view.damped_inverse(damping)?;
            let carried = view.mixed * inverse;
            matrix -= carried * view.mixed.transpose();
            right -= carried * view.gradient;
        }
        Some((matrix, right))
    }

    fn step(&self, damping: f64) -> Option<Step> {
        let (matrix, right) = self.reduced(damping)?;
        let camera = Scaled::of(&matrix, self.free)?.solve(&right);
        let mut gain = camera.dot(&self.gradient);
        let mut poses = Vec::with_capacity(self.views.len());
        for view in &self.views {
            let step = view.damped_inverse(damping)? * (view.gradient - view.mixed.tr_mul(&camera));
            gain += step.dot(&view.gradient);
            poses.push(step);
        }
        (gain.is_finite() && camera.iter().all(|c| c.is_finite())).then_some(Step { camera, poses, gain })
    }
}

/// Least eigenvalue of the equations of a pose, their diagonal brought to one, at which it is known. Rounding leaves about 1e-15.
const OPEN: f64 = 1e-9;

impl ViewNormal {
    /// The least eigenvalue of the pose's equations, their diagonal brought to one; not a number where the diagonal has a zero.
    fn least_eigenvalue(&self) -> f64 {
        let scale = self.by_pose.diagonal().map(|value| value.sqrt().recip());
        let unit = Matrix6::from_fn(|r, c| self.by_pose[(r, c)] * scale[r] * scale[c]);
        unit.symmetric_eigenvalues().min()
    }

    fn damped_inverse(&self, damping: f64) -> Option<Matrix6<f64>> {
        let mut matrix = self.by_pose;
        for i in 0..6 {
            matrix[(i, i)] *= 1.0 + damping;
        }
        matrix.cholesky().map(|factor| factor.inverse())
    }
}

/// What rounding may leave of an eigenvalue that is zero, in units of the diagonal. A parameter that others can stand for as well as
/// this is left with a deviation of a hundred thousand times what it would have alone.
const ROUNDING: f64 = 1e-10;

/// A positive definite matrix, its diagonal brought to one: focal lengths and coefficients differ by orders of magnitude. Rows
/// beyond `free` are those of the unit matrix.
struct Scaled {
    factor: nalgebra::Cholesky<f64, nalgebra::Const<MAX_PARAMETERS>>,
    scale: Parameters,
}

impl Scaled {
    fn of(matrix: &ByParameter, free: usize) -> Option<Self> {
        if (0..free).any(|i| !(matrix[(i, i)] > 0.0)) {
            return None;
        }
        let scale = Parameters::from_fn(|i, _| if i < free { matrix[(i, i)].sqrt().recip() } else { 0.0 });
        let unit = ByParameter::from_fn(|r, c| match (r < free && c < free, r == c) {
            (_, true) => 1.0,
            (true, false) => matrix[(r, c)] * scale[r] * scale[c],
            (false, false) => 0.0,
        });
        let factor = unit.cholesky().or_else(|| (unit + ByParameter::identity() * ROUNDING).cholesky())?;
        Some(Self { factor, scale })
    }

    fn solve(&self, right: &Parameters) -> Parameters {
        self.factor.solve(&right.component_mul(&self.scale)).component_mul(&self.scale)
    }

    fn inverse(&self) -> ByParameter {
        let scale = ByParameter::from_diagonal(&self.scale);
        scale * self.factor.inverse() * scale
    }
}
