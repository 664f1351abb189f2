//! A pose from pairs of which some are wrong.
//!
//! Random samples of three pairs give poses (P3P). The one wins that loses least over all pairs, where each pair's loss is
//! marginalised over the noise that it may have ([`Loss::Marginal`], after MAGSAC++: Barath et al. 2020); each new winner is
//! first refined under the same loss (local optimisation: Chum, Matas and Kittler 2003). Sampling stops when a better sample
//! has become improbable, and a sample is dropped as soon as it has lost more than the winner. The numbers are drawn from a
//! fixed seed, so the same request has the same answer.
//!
//! The noise of the pairs that agree then says where right pairs end. A winner counts only if so many would hardly agree by
//! chance (a contrario: Moisan and Stival 2004).

use nalgebra::{Matrix2, Vector3};
use rand::RngExt;

use super::{NoPose, PoseAnswer, PoseEstimate, PoseOptions, estimate_pose_near, rays};
use crate::camera::Camera;
use crate::geometry::CameraFromTarget;
use crate::random;
use crate::refine::{Correspondence, Loss, RefineOptions, project_with_pose_jacobian, refine};
use crate::solve::Solver;
use crate::solve::p3p::p3p;

/// A pair further than this from its place, in standard deviations, is wrong: right ones exceed it once in 900.
const GATE: f64 = 3.7;

/// The noise may be up to so many times as large as stated.
const WIDEST: f64 = 2.0;

/// What a pair loses.
const LOSS: Loss = Loss::Marginal { widest: WIDEST };

/// Steps of refining a winner among samples.
const STEPS: usize = 6;

/// Median of chi-square with two degrees of freedom.
const MEDIAN_SQUARED: f64 = 2.0 * std::f64::consts::LN_2;

/// Most samples: enough for half of the pairs wrong, a thousand times over.
const MAX_SAMPLES: usize = 3000;

/// Probability of having missed the best sample at which sampling stops.
const MISSED: f64 = 1e-6;

/// Expected number of consensus sets as large as the winner's among wrong pairs alone, above which it is refused.
const MAX_CHANCE: f64 = 1e-3;

/// Rounds in which the inliers may change with the pose that they give.
const ROUNDS: usize = 3;

/// The pose that most pairs agree on, and which these are.
///
/// # Errors
/// [`NoPose::NoConsensus`] if no set of pairs agrees beyond chance, and the errors of [`estimate_pose`](super::estimate_pose) on the inliers.
pub fn estimate_pose_robustly(
    camera: &Camera,
    correspondences: &[Correspondence],
    options: &PoseOptions,
) -> Result<(PoseAnswer, Vec<bool>), NoPose> {
    let given = correspondences.len();
    let need = 4;
    if given < need {
        return Err(NoPose::TooFewPoints { given, need });
    }
    let pairs = rays(camera, correspondences)?;
    let bearings: Vec<Vector3<f64>> = pairs.iter().map(|p| Vector3::new(p.ray.x, p.ray.y, 1.0).normalize()).collect();
    let judge = Judge { camera, correspondences };
    let mut rng = random::named("consensus");
    let mut best: Option<(f64, CameraFromTarget)> = None;
    let mut samples = 0;
    let mut enough = MAX_SAMPLES;
    while samples < enough {
        samples += 1;
        let [i, j, k] = three_of(given, &mut rng);
        for pose in p3p(&[bearings[i], bearings[j], bearings[k]], &[i, j, k].map(|n| pairs[n].point)) {
            let least = best.as_ref().map_or(f64::INFINITY, |(least, _)| *least);
            if let Some(cost) = judge.cost_below(least, &pose) {
                let (cost, pose) = judge.improved(cost, pose);
                best = Some((cost, pose));
                enough = enough.min(samples_needed(judge.inliers(&pose).iter().filter(|i| **i).count(), given));
            }
        }
    }
    let no_consensus = NoPose::NoConsensus { given, need: (given / 4).max(need + 1).min(given) };
    let Some((_, pose)) = best else { return Err(no_consensus) };
    let mut inliers = judge.inliers(&pose);
    let mut known = (Solver::P3p, pose);
    for round in 1.. {
        if judge.expected_by_chance(&inliers) > MAX_CHANCE {
            return Err(no_consensus);
        }
        let chosen: Vec<Correspondence> =
            correspondences.iter().zip(&inliers).filter(|(_, inlier)| **inlier).map(|(c, _)| *c).collect();
        let answer = estimate_pose_near(camera, &chosen, Some(known), options)?;
        let agreeing = judge.agreeing(&answer.best, &inliers);
        // Settled: the answer has the inliers that it was made from.
        if agreeing == inliers || round == ROUNDS {
            return Ok((answer, inliers));
        }
        known = (answer.solver, answer.best.camera_from_target);
        inliers = agreeing;
    }
    Err(no_consensus)
}

fn three_of(count: usize, rng: &mut impl rand::Rng) -> [usize; 3] {
    let i = rng.random_range(0..count);
    let j = (i + rng.random_range(1..count)) % count;
    loop {
        let k = rng.random_range(0..count);
        if k != i && k != j {
            return [i, j, k];
        }
    }
}

/// Samples after which one of three inliers has been drawn with all but [`MISSED`].
fn samples_needed(inliers: usize, count: usize) -> usize {
    let good = (inliers as f64 / count as f64).powi(3);
    if good >= 1.0 - MISSED {
        return 8;
    }
    #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "positive; the cast saturates")]
    let samples = (MISSED.ln() / (1.0 - good).ln()).ceil() as usize;
    samples.clamp(8, MAX_SAMPLES)
}

struct Judge<'a> {
    camera: &'a Camera,
    correspondences: &'a [Correspondence],
}

impl Judge<'_> {
    /// Squared distance of a pair from its place in units of its deviation; infinite without an image.
    fn error(&self, seen: &Correspondence, pose: &CameraFromTarget) -> f64 {
        self.camera
            .project(&(*pose * seen.point))
            .map_or(f64::INFINITY, |place| (place - seen.pixel).norm_squared() / (seen.sigma_px * seen.sigma_px))
    }

    /// What the pose loses over all pairs, if that is less than `least`.
    fn cost_below(&self, least: f64, pose: &CameraFromTarget) -> Option<f64> {
        let mut cost = 0.0;
        for seen in self.correspondences {
            cost += LOSS.of(self.error(seen, pose)).0;
            if cost >= least {
                return None;
            }
        }
        Some(cost)
    }

    /// The pairs that agree with the pose, at the noise that those around it have.
    fn inliers(&self, pose: &CameraFromTarget) -> Vec<bool> {
        let errors: Vec<f64> = self.correspondences.iter().map(|seen| self.error(seen, pose)).collect();
        let reach = LOSS.reach().powi(2);
        let mut near: Vec<f64> = errors.iter().copied().filter(|error| *error < reach).collect();
        let freedom = 2 * near.len();
        let scale_squared = if freedom > 6 {
            let middle = near.len() / 2;
            let (_, median, _) = near.select_nth_unstable_by(middle, f64::total_cmp);
            // The pose has taken six of the degrees of freedom.
            (*median / MEDIAN_SQUARED * freedom as f64 / (freedom - 6) as f64).clamp(1.0, WIDEST * WIDEST)
        } else {
            1.0
        };
        errors.into_iter().map(|error| error < GATE * GATE * scale_squared).collect()
    }

    /// The pairs that agree with an estimate made from those that were `inside`: of the others the estimate's own uncertainty
    /// is allowed for, which is large where few were inside.
    fn agreeing(&self, estimate: &PoseEstimate, inside: &[bool]) -> Vec<bool> {
        let pose = &estimate.camera_from_target;
        let within = self.inliers(pose);
        let admitted = |seen: &Correspondence| {
            let (place, jacobian) = project_with_pose_jacobian(self.camera, pose, seen)?;
            let spread = jacobian * estimate.covariance.matrix() * jacobian.transpose();
            let sum = spread + Matrix2::identity() * (seen.sigma_px * seen.sigma_px);
            let off = seen.pixel - place;
            Some(off.dot(&sum.cholesky()?.solve(&off)) < GATE * GATE)
        };
        (self.correspondences.iter().zip(inside).zip(within))
            .map(|((seen, was_inside), within)| within || (!was_inside && admitted(seen).unwrap_or(false)))
            .collect()
    }

    /// The pose refined under the loss, if that lowers it.
    fn improved(&self, cost: f64, pose: CameraFromTarget) -> (f64, CameraFromTarget) {
        let options = RefineOptions { max_iterations: STEPS, step_limit: 0.01, loss: LOSS };
        match refine(self.camera, self.correspondences, &pose, &options) {
            Ok(refined) if refined.chi_square < cost => (refined.chi_square, refined.camera_from_target),
            _ => (cost, pose),
        }
    }

    /// Expected number of sets of this size, with a pose that three of them give, among pairs scattered over the picture.
    fn expected_by_chance(&self, inliers: &[bool]) -> f64 {
        let size = inliers.iter().filter(|i| **i).count();
        if size < 4 {
            return f64::INFINITY;
        }
        let n = inliers.len();
        let picture = f64::from(self.camera.width()) * f64::from(self.camera.height());
        let gate: f64 = self.correspondences.iter().map(|c| (GATE * c.sigma_px).powi(2)).sum::<f64>()
            * std::f64::consts::PI
            / n as f64;
        let share = (gate / picture).min(1.0);
        let ln_tests = (4.0 * n as f64).ln() + ln_choose(n, size) + ln_choose(size, 3);
        let ln_chance = (size - 3) as f64 * share.ln();
        (ln_tests + ln_chance).exp()
    }
}

fn ln_choose(n: usize, k: usize) -> f64 {
    (0..k.min(n - k)).map(|i| (((n - i) as f64) / ((i + 1) as f64)).ln()).sum()
}
