//! What a calibration rests on: the points that count, under their poses.

use super::SeenPoint;
use super::bundle::{Bundle, Loss, State, covariance_of};
use super::estimate::{CalibrateOptions, Calibration, freedom_of, less_certain, prior};
use super::freedom::{ByParameter, Freedom, parameters_of};
use super::watch::Watch;
use crate::board::Board;
use crate::camera::{Camera, Pixel};
use crate::geometry::{CameraFromBoard, Point, space};

/// The views that count, without the points that do not.
pub(super) struct Evidence<'a> {
    pub board: &'a Board,
    pub camera: &'a Camera,
    pub freedom: Freedom,
    /// Position of each in the views that were given.
    pub places: Vec<usize>,
    pub views: Vec<Vec<SeenPoint>>,
    pub poses: Vec<CameraFromBoard>,
    scale: f64,
}

impl<'a> Evidence<'a> {
    pub fn of(board: &'a Board, views: &[Vec<SeenPoint>], options: &CalibrateOptions, found: &'a Calibration) -> Self {
        let size = [found.camera.width(), found.camera.height()];
        let freedom = freedom_of(size, options).unwrap_or(Freedom::none());
        let mut evidence = Self {
            board,
            camera: &found.camera,
            freedom,
            places: Vec::new(),
            views: Vec::new(),
            poses: Vec::new(),
            scale: found.scale,
        };
        for (place, (fitted, seen)) in found.views.iter().zip(views).enumerate() {
            if let Some(pose) = fitted.camera_from_board.filter(|_| fitted.counts()) {
                let counted = seen.iter().zip(&fitted.inliers).filter(|(_, counts)| **counts);
                let counted = counted.map(|(seen, _)| less_certain(seen, found.model_error_px));
                evidence.places.push(place);
                evidence.views.push(counted.collect());
                evidence.poses.push(pose);
            }
        }
        evidence
    }

    /// All places that count, px.
    pub fn pixels(&self) -> impl Iterator<Item = Pixel> + '_ {
        self.views.iter().flatten().map(|seen| seen.pixel)
    }

    /// What these views tell about the free parameters.
    pub fn information(&self) -> Option<ByParameter> {
        let prior = prior(self.camera, self.scale);
        self.information_of(&self.views, &self.poses, prior)
    }

    /// What one more view would tell.
    pub fn information_of_view(&self, view: Vec<SeenPoint>, pose: CameraFromBoard) -> Option<ByParameter> {
        self.information_of(&[view], &[pose], super::freedom::Parameters::zeros())
    }

    fn information_of(
        &self,
        views: &[Vec<SeenPoint>],
        poses: &[CameraFromBoard],
        prior: super::freedom::Parameters,
    ) -> Option<ByParameter> {
        let slices: Vec<&[SeenPoint]> = views.iter().map(Vec::as_slice).collect();
        let bundle = Bundle {
            size: [self.camera.width(), self.camera.height()],
            board: self.board,
            views: &slices,
            lens: *self.camera.distortion(),
            freedom: self.freedom,
            loss: Loss::Squares,
            prior,
            watch: Watch::nobody(),
        };
        let state = State { camera: *self.camera, parameters: parameters_of(self.camera), poses: poses.to_vec() };
        Some(bundle.information(&state)? / self.scale.powi(2))
    }

    /// Standard deviation of the pixels of rays all over the picture, root mean square per axis, px, of a camera of which so much is
    /// known (Beck and Stiller 2018, "Generalized B-spline camera model", judge calibrations by it).
    pub fn ray_sigma_px(&self, information: &ByParameter) -> Option<f64> {
        let covariance = covariance_of(information, &self.freedom)?;
        let sigmas = ray_sigmas_px(self.camera, &covariance, RAYS);
        let seen: Vec<f64> = sigmas.into_iter().flatten().collect();
        (!seen.is_empty()).then(|| (seen.iter().map(|sigma| sigma * sigma).sum::<f64>() / seen.len() as f64).sqrt())
    }
}

/// Rays tried along each side of the picture.
const RAYS: [u32; 2] = [8, 6];

/// Standard deviation per axis, px, of the pixels of rays through the middles of `columns` x `rows` cells of the picture, row by row;
/// `None` where the lens has no ray.
pub(super) fn ray_sigmas_px(camera: &Camera, covariance: &ByParameter, [columns, rows]: [u32; 2]) -> Vec<Option<f64>> {
    let middle = |cell: u32, cells: u32, side: u32| (f64::from(cell) + 0.5) / f64::from(cells) * f64::from(side) - 0.5;
    let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
    cells
        .map(|(column, row)| {
            let pixel = Pixel::new(middle(column, columns, camera.width()), middle(row, rows, camera.height()));
            let ray = camera.unproject(&pixel)?;
            let by = camera.pixel_by_parameters(&Point::<space::Camera>::new(ray.x, ray.y, 1.0))?;
            let variance = (by * covariance * by.transpose()).trace();
            Some((0.5 * variance.max(0.0)).sqrt())
        })
        .collect()
}
