//! Assignments against each other and against chance.
//!
//! For an assignment of `k` blobs to markers, the probability of the blobs' places, over all poses of the target, is
//! compared with that of clutter, scattered evenly or in crowds: a Bayes factor. It takes account of everything at once: how well the
//! places fit, how free the pose was to make them fit, how crowded the sky is, and how many markers are missing. If there is
//! no target, the Bayes factors of all assignments together have mean 1 at most, so chance exceeds a threshold `1 / p` with
//! probability below `p`.

use std::collections::BTreeSet;
use std::f64::consts::{LN_2, PI, TAU};

use super::cloud::Cloud;
use super::search::Candidate;
use super::{Blob, Hypothesis, IdentifyOptions, Stats, pairs};
use nalgebra::{Matrix2, Matrix6, Vector6};

use crate::camera::{Camera, Pixel};
use crate::geometry::CameraFromTarget;
use crate::pose::{NoPose, PoseAnswer, PoseOptions, estimate_pose};
use crate::refine::{Correspondence, RefineOptions, project_with_pose_jacobian, refine};
use crate::statistics::chi_square_quantile;
use crate::target::Target;

/// Rounds of adding blobs that fit and dropping such that do not.
const ROUNDS: usize = 3;

/// A blob this many standard deviations from its marker's place belongs to something else.
const MAX_DEVIATIONS: f64 = 4.5;

/// Residuals of a right assignment are what is stated, within chance: from four markers on, a larger ratio than this has a
/// probability below 1e-4.
const MAX_RESIDUAL_RATIO: f64 = 3.1;

/// Markers whose blobs a marker may have been given by mistake: the nearest ones, all of six.
const NEIGHBOURS: usize = 5;

/// An exchange that one step of refinement leaves with a larger chi-square is not refined further: twenty times what could
/// still matter, as one step may mislead.
const EXCHANGEABLE: f64 = 600.0;

/// Assignments whose markers exchange their blobs to see whether that is better.
const EXPLORED: usize = 4;

/// Relative standard deviation of a blob's area about its marker's, from blur and thresholds.
const LN_AREA_SIGMA: f64 = 0.35;

/// Clutter has areas spread evenly over this many powers of e.
const LN_AREA_SPAN: f64 = 6.0;

/// Steps of refinement for a first weight: from a pose of three markers four suffice as a rule, where that is bad a dozen.
const ROUGH_STEPS: usize = 12;

/// A candidate whose first weight is below the heaviest (or below chance) by this many powers of e need not be weighed well.
const ROUGHLY_NOTHING: f64 = 14.0;

/// A lead of this many powers of e decides: half of it for what a rival might gain by fitting exactly and by a less certain
/// pose, the other half so that it does not matter.
const DECIDED: f64 = 8.0;

pub(super) struct Scale<'a> {
    camera: &'a Camera,
    target: &'a Target,
    blobs: &'a [Blob],
    options: &'a IdentifyOptions,
    cloud: Cloud,
    /// Assignments already weighed.
    known: BTreeSet<Vec<Option<usize>>>,
    weighed: Vec<(Hypothesis, f64)>,
    heaviest_rough: f64,
}

/// What a blob of just the right area adds to the weight of its marker.
pub(super) fn ln_area_gain() -> f64 {
    (LN_AREA_SPAN / (LN_AREA_SIGMA * TAU.sqrt())).ln()
}

/// The volume of all attitudes from which the target can be seen.
pub(super) fn attitudes(target: &Target) -> f64 {
    let one_sided = target.spread().is_coplanar() && target.markers().iter().all(|m| m.normal.is_some());
    if one_sided { 4.0 * PI * PI } else { 8.0 * PI * PI }
}

impl<'a> Scale<'a> {
    pub(super) fn new(camera: &'a Camera, target: &'a Target, blobs: &'a [Blob], options: &'a IdentifyOptions) -> Self {
        let cloud = Cloud::of(blobs, [camera.width(), camera.height()].map(f64::from));
        Self { camera, target, blobs, options, cloud, known: BTreeSet::new(), weighed: Vec::new(), heaviest_rough: 0.0 }
    }

    /// Weighs the candidates that matter beside the best of them.
    pub(super) fn add_all(&mut self, candidates: Vec<Candidate>, stats: &mut Stats) {
        let mut rough: Vec<(f64, Candidate)> = candidates
            .into_iter()
            .filter(|candidate| !self.known.contains(&candidate.blob_of_marker))
            .filter_map(|mut candidate| Some((self.rough_ln_factor(&mut candidate)?, candidate)))
            .collect();
        rough.sort_by(|a, b| b.0.total_cmp(&a.0));
        let heaviest = rough.first().map_or(0.0, |(ln_factor, _)| *ln_factor);
        self.heaviest_rough = self.heaviest_rough.max(heaviest).max(self.options.ln_odds_needed());
        for (ln_factor, candidate) in rough {
            if ln_factor < self.heaviest_rough - ROUGHLY_NOTHING {
                break;
            }
            self.add(candidate.blob_of_marker, stats);
        }
    }

    /// The logarithm of a candidate's Bayes factor from the one minimum that its pose leads to; if a blob lies where that pose
    /// has a marker without one, then of the candidate with it.
    fn rough_ln_factor(&self, candidate: &mut Candidate) -> Option<f64> {
        let options = RefineOptions { max_iterations: ROUGH_STEPS, ..RefineOptions::default() };
        let mut heaviest = None;
        for _ in 0..2 {
            let assignment = &candidate.blob_of_marker;
            let refined = refine(self.camera, &self.correspondences(assignment), &candidate.pose, &options).ok()?;
            candidate.pose = refined.camera_from_target;
            let ln_evidence = -0.5 * refined.chi_square + 0.5 * refined.covariance.ln_determinant();
            if let Some(ln_factor) = self.ln_bayes_factor(assignment, &candidate.pose, ln_evidence) {
                heaviest = Some(heaviest.map_or(ln_factor, |known: f64| known.max(ln_factor)));
            }
            let settled = self.reassigned(assignment, &candidate.pose);
            if settled.iter().flatten().count() <= candidate.found() {
                break;
            }
            candidate.blob_of_marker = settled;
        }
        heaviest
    }

    /// Weighs an assignment, and what it becomes as blobs that fit its pose are added and such that do not are dropped.
    fn add(&mut self, mut assignment: Vec<Option<usize>>, stats: &mut Stats) {
        for _ in 0..ROUNDS {
            if assignment.iter().flatten().count() < self.options.min_markers || !self.known.insert(assignment.clone())
            {
                return;
            }
            let Ok(answer) = self.solve(&assignment) else { return };
            stats.weighed += 1;
            let pose = answer.best.camera_from_target;
            let settled = self.reassigned(&assignment, &pose);
            if let Some(ln_factor) = self.ln_bayes_factor(&assignment, &pose, answer.ln_evidence) {
                let hypothesis = Hypothesis { blob_of_marker: assignment, answer, probability: 0.0 };
                self.weighed.push((hypothesis, ln_factor));
            }
            assignment = settled;
        }
    }

    /// Weighs what the best assignments become when two markers change their blobs, or one takes that of another: the search
    /// may have missed these, as three blobs fix the pose of a small or slanted target badly.
    pub(super) fn add_exchanges(&mut self, stats: &mut Stats) {
        let mut explored: BTreeSet<Vec<Option<usize>>> = BTreeSet::new();
        for _ in 0..EXPLORED {
            let unexplored = self.weighed.iter().filter(|(h, _)| !explored.contains(&h.blob_of_marker));
            let Some((best, ln_factor)) = unexplored.max_by(|a, b| a.1.total_cmp(&b.1)) else { return };
            let heaviest = self.weighed.iter().map(|(_, f)| *f).fold(f64::NEG_INFINITY, f64::max);
            if *ln_factor < heaviest - DECIDED {
                return;
            }
            let assignment = best.blob_of_marker.clone();
            let pose = best.answer.best.camera_from_target;
            let exchanged = self.neighbours(&pose).into_iter().filter_map(|(a, b)| {
                let mut blob_of_marker = assignment.clone();
                blob_of_marker.swap(a, b);
                (blob_of_marker != assignment).then_some(Candidate { blob_of_marker, pose, fit: 0.0 })
            });
            let worth_a_try = exchanged.filter(|candidate| {
                self.predicted_chi_square(&candidate.blob_of_marker, &pose).is_none_or(|c| c < EXCHANGEABLE)
            });
            let worth_a_try = worth_a_try.collect();
            self.add_all(worth_a_try, stats);
            explored.insert(assignment);
        }
    }

    /// Chi-square that an assignment would have after one step of refinement from this pose.
    fn predicted_chi_square(&self, assignment: &[Option<usize>], pose: &CameraFromTarget) -> Option<f64> {
        let (mut information, mut descent, mut chi_square) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
        for seen in self.correspondences(assignment) {
            let (place, jacobian) = project_with_pose_jacobian(self.camera, pose, &seen)?;
            let residual = (seen.pixel - place) / seen.sigma_px;
            let jacobian = jacobian / seen.sigma_px;
            information += jacobian.tr_mul(&jacobian);
            descent += jacobian.tr_mul(&residual);
            chi_square += residual.norm_squared();
        }
        Some(chi_square - descent.dot(&information.cholesky()?.solve(&descent)))
    }

    /// Each marker with those that appear nearest to it.
    fn neighbours(&self, pose: &CameraFromTarget) -> BTreeSet<(usize, usize)> {
        let places: Vec<Option<Pixel>> = (0..self.target.markers().len()).map(|m| self.place(m, pose)).collect();
        let mut pairs = BTreeSet::new();
        for (a, here) in places.iter().enumerate() {
            let Some(here) = here else { continue };
            let distance = |b: usize| places[b].map_or(f64::INFINITY, |there| (there - here).norm_squared());
            let mut others: Vec<usize> = (0..places.len()).filter(|b| *b != a && places[*b].is_some()).collect();
            others.sort_by(|b, c| distance(*b).total_cmp(&distance(*c)));
            pairs.extend(others.into_iter().take(NEIGHBOURS).map(|b| (a.min(b), a.max(b))));
        }
        pairs
    }

    /// Whether one assignment is so probable that none of up to `markers` markers could still matter beside it.
    pub(super) fn is_decided(&self, markers: usize) -> bool {
        let certain = self.options.ln_odds_needed();
        let sigma = self.sigma_px();
        // What a marker adds at least. One that is not found may have reasons that cost nothing.
        let gain = (1.0 - self.options.miss_probability).ln() - (TAU * sigma * sigma).ln() - self.density().ln();
        self.weighed.iter().any(|(hypothesis, ln_factor)| {
            let lead = hypothesis.found().saturating_sub(markers) as f64 * gain;
            *ln_factor > certain + 1.0 && lead > DECIDED
        })
    }

    /// Whether an assignment is weighed that may be accepted, alone or with another.
    pub(super) fn is_likely(&self) -> bool {
        self.weighed.iter().any(|(_, ln_factor)| *ln_factor > self.options.ln_odds_needed() - LN_2)
    }

    /// The best assignment, if it fits and is so probable that only one that resembles it could matter beside it: one of the
    /// same blobs, or of others alone.
    pub(super) fn beyond_doubt(&self, enough: usize) -> Option<&Hypothesis> {
        let (best, ln_factor) = self.weighed.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let freedom = (2 * best.found()).saturating_sub(6) as f64;
        let ratio = best.answer.best.reprojection_rms_px / self.sigma_px();
        let fits = ratio * ratio * best.found() as f64 <= chi_square_quantile(freedom, 3.09);
        (fits && best.found() >= enough && *ln_factor > self.options.ln_odds_needed() + 2.0 * DECIDED).then_some(best)
    }

    /// The largest standard deviation of a blob.
    fn sigma_px(&self) -> f64 {
        self.blobs.iter().map(|b| b.sigma_px).fold(0.0, f64::max).hypot(self.options.model_sigma_px)
    }

    /// Blobs per squared pixel over the picture.
    fn density(&self) -> f64 {
        self.blobs.len() as f64 / (f64::from(self.camera.width()) * f64::from(self.camera.height()))
    }

    /// The hypotheses with their probabilities, and the logarithm of the odds of all of them against chance.
    pub(super) fn ranked(self) -> Result<(Vec<Hypothesis>, f64), NoPose> {
        let presence = self.options.presence_probability;
        let ln_clutter = ((1.0 - presence) / presence).ln();
        let largest = self.weighed.iter().map(|(_, f)| *f).fold(ln_clutter, f64::max);
        let sum: f64 = self.weighed.iter().map(|(_, f)| (f - largest).exp()).sum();
        let total = sum + (ln_clutter - largest).exp();
        let presence = sum / total;
        if self.weighed.is_empty() || presence < self.options.min_probability {
            return Err(NoPose::NotIdentified {
                detail: if self.weighed.is_empty() {
                    format!(
                        "no pose of {:?} puts {} of its markers on the {} blobs",
                        self.target.name(),
                        self.options.min_markers,
                        self.blobs.len()
                    )
                } else {
                    format!(
                        "the best match of {:?} to the {} blobs may be chance: probability {:.1e}, at most {:.1e} is accepted",
                        self.target.name(),
                        self.blobs.len(),
                        1.0 - presence,
                        1.0 - self.options.min_probability
                    )
                },
            });
        }
        let mut hypotheses: Vec<Hypothesis> = self
            .weighed
            .into_iter()
            .map(|(hypothesis, f)| Hypothesis { probability: (f - largest).exp() / total, ..hypothesis })
            .filter(|hypothesis| hypothesis.probability > 1e-6)
            .collect();
        hypotheses.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        Ok((hypotheses, sum.ln() + largest - ln_clutter))
    }

    fn solve(&self, assignment: &[Option<usize>]) -> Result<PoseAnswer, NoPose> {
        let correspondences = self.correspondences(assignment);
        let options = PoseOptions { max_residual_ratio: MAX_RESIDUAL_RATIO, ..PoseOptions::default() };
        let answer = estimate_pose(self.camera, &correspondences, &options)?;
        let shown = |pose: &CameraFromTarget| {
            pairs(self.target, assignment).all(|(marker, _)| self.options.shows(self.target, marker, pose))
        };
        answer.restricted(shown)
    }

    fn correspondences(&self, assignment: &[Option<usize>]) -> Vec<Correspondence> {
        pairs(self.target, assignment)
            .map(|(marker, blob)| Correspondence {
                point: self.target.markers()[marker].position,
                pixel: self.blobs[blob].pixel,
                sigma_px: self.blobs[blob].sigma_px.hypot(self.options.model_sigma_px),
            })
            .collect()
    }

    /// Every marker with the blob nearest to its place at this pose, if that is near enough.
    fn reassigned(&self, assignment: &[Option<usize>], pose: &CameraFromTarget) -> Vec<Option<usize>> {
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (marker, current) in assignment.iter().enumerate() {
            let Some(place) = self.place(marker, pose) else { continue };
            for (blob, seen) in self.blobs.iter().enumerate() {
                let deviations = (seen.pixel - place).norm() / seen.sigma_px.hypot(self.options.model_sigma_px);
                // A marker that had no part in the pose is predicted less well than one that had.
                let reach = if *current == Some(blob) { MAX_DEVIATIONS } else { 2.0 * MAX_DEVIATIONS };
                if deviations < reach {
                    pairs.push((deviations, marker, blob));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
        let mut settled = vec![None; assignment.len()];
        for (_, marker, blob) in pairs {
            if settled[marker].is_none() && !settled.contains(&Some(blob)) {
                settled[marker] = Some(blob);
            }
        }
        settled
    }

    /// Where the marker appears, if it can be seen.
    fn place(&self, marker: usize, pose: &CameraFromTarget) -> Option<Pixel> {
        if !self.options.shows(self.target, marker, pose) {
            return None;
        }
        self.camera.project(&(*pose * self.target.markers()[marker].position))
    }

    /// Logarithm of the probability of the picture under this assignment over that under clutter alone.
    fn ln_bayes_factor(&self, assignment: &[Option<usize>], best: &CameraFromTarget, ln_evidence: f64) -> Option<f64> {
        // The markers' blobs as clutter: each of all blobs anywhere in the picture, or in one cloud with all others, or each
        // from the crowd about the target, whichever is most likely.
        let crowd = self.crowd(assignment, best);
        let area = f64::from(self.camera.width()) * f64::from(self.camera.height());
        let mut left = self.blobs.len() as f64;
        let (mut ln_choices, mut ln_scattered, mut ln_crowded) = (0.0, 0.0, 0.0);
        // Integral over the pose of the likelihood (Laplace; the residuals are in `ln_evidence`), times the prior there.
        let mut ln_factor = ln_evidence + 3.0 * TAU.ln() + self.ln_pose_prior(best);
        for (marker, blob) in assignment.iter().enumerate() {
            let place = self.place(marker, best);
            let Some(blob) = blob.map(|b| &self.blobs[b]) else {
                // A marker outside the picture or turned away is not missing.
                if place.is_some_and(|p| self.camera.contains(&p)) {
                    ln_factor += self.options.miss_probability.ln();
                }
                continue;
            };
            let sigma = blob.sigma_px.hypot(self.options.model_sigma_px);
            ln_factor += (1.0 - self.options.miss_probability).ln() - (TAU * sigma * sigma).ln();
            ln_factor += self.ln_area_factor(marker, blob, best);
            // As many ways there are to choose this blob among those that the markers before left.
            ln_choices += left.ln();
            ln_scattered -= area.ln();
            ln_crowded += crowd.ln();
            left -= 1.0;
        }
        let ln_cloud = self.cloud.ln_density(assignment.iter().flatten().map(|blob| &self.blobs[*blob]));
        ln_factor -= (ln_choices + ln_scattered.max(ln_cloud)).max(ln_crowded);
        ln_factor.is_finite().then_some(ln_factor)
    }

    /// Blobs per squared pixel of those over the target's own ellipse that are not its markers: clutter comes in crowds, and
    /// along edges.
    fn crowd(&self, assignment: &[Option<usize>], pose: &CameraFromTarget) -> f64 {
        let places: Vec<Pixel> = (0..self.target.markers().len()).filter_map(|m| self.place(m, pose)).collect();
        let count = places.len().max(1) as f64;
        let middle = places.iter().sum::<Pixel>() / count;
        let scatter: Matrix2<f64> =
            places.iter().map(|p| (p - middle) * (p - middle).transpose()).sum::<Matrix2<f64>>() / count
                + Matrix2::identity();
        let Some(inverse) = scatter.try_inverse() else { return 0.0 };
        // Two standard deviations hold a disc of points exactly.
        let others = self.blobs.iter().enumerate().filter(|(index, blob)| {
            let d = blob.pixel - middle;
            d.dot(&(inverse * d)) < 4.0 && !assignment.contains(&Some(*index))
        });
        others.count() as f64 / (4.0 * PI * scatter.determinant().sqrt())
    }

    /// Evenly over the directions in view, the logarithm of the range, and all attitudes from which the target can be seen.
    fn ln_pose_prior(&self, pose: &CameraFromTarget) -> f64 {
        let [fx, fy] = self.camera.focal_lengths();
        let solid_angle = f64::from(self.camera.width()) / fx * f64::from(self.camera.height()) / fy;
        let [nearest, farthest] = self.options.range_m;
        let range = pose.translation.norm();
        -(solid_angle * range.powi(3) * (farthest / nearest).ln() * attitudes(self.target)).ln()
    }

    fn ln_area_factor(&self, marker: usize, blob: &Blob, pose: &CameraFromTarget) -> f64 {
        let marker = &self.target.markers()[marker];
        let Some((radius, measured)) = marker.radius_m.zip(blob.area_px) else { return 0.0 };
        let p = (*pose * marker.position).coords;
        let facing = marker.normal.map_or(1.0, |n| ((pose.rotation * n).dot(&p) / p.norm()).abs());
        let [fx, fy] = self.camera.focal_lengths();
        // Blur adds about a pixel all round.
        let sharp = PI * radius * radius * facing * fx * fy / (p.z * p.z);
        let blurred = (sharp.sqrt() + 1.0).powi(2);
        let deviation = (measured / blurred).ln() / LN_AREA_SIGMA.hypot(2.0 / blurred.sqrt());
        // Gaussian against uniform; a floor, as paint and light may deceive.
        ln_area_gain() - 0.5 * (deviation * deviation).min(25.0)
    }
}
