//! A pose from pairs of which some are wrong.
//!
//! Random samples of three pairs give poses (P3P); the pose with the least truncated error over all pairs wins (MSAC, Torr
//! and Zisserman 2000), each new winner being refined on its inliers first (local optimisation: Chum, Matas and Kittler 2003).
//! Sampling stops when a better sample has become improbable. The numbers are drawn from a fixed seed, so the same request
//! has the same answer.
//!
//! A winner counts only if so many pairs would hardly agree by chance (a contrario: Moisan and Stival 2004).

use nalgebra::Vector3;
use rand::RngExt;

use super::{NoPose, PoseAnswer, PoseOptions, estimate_pose_near, rays};
use crate::camera::Camera;
use crate::geometry::CameraFromTarget;
use crate::random;
use crate::refine::{Correspondence, RefineOptions, refine};
use crate::solve::Solver;
use crate::solve::p3p::p3p;

/// A pair further than this from its place, in standard deviations, is wrong: right ones exceed it once in 900.
const GATE: f64 = 3.7;

/// Most samples: enough for half of the pairs wrong, a thousand times over.
const MAX_SAMPLES: usize = 3000;

/// Probability of having missed the best sample at which sampling stops.
const MISSED: f64 = 1e-6;

/// Expected number of consensus sets as large as the winner's among wrong pairs alone, above which it is refused.
const MAX_CHANCE: f64 = 1e-3;

/// Rounds of refining a winner on its own inliers.
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
            let cost = judge.cost(&pose);
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                let (cost, pose) = judge.improved(cost, pose);
                best = Some((cost, pose));
                enough = enough.min(samples_needed(judge.inliers(&pose).iter().filter(|i| **i).count(), given));
            }
        }
    }
    let no_consensus = NoPose::NoConsensus { given, need: (given / 4).max(need + 1).min(given) };
    let Some((_, mut pose)) = best else { return Err(no_consensus) };
    for _ in 0..ROUNDS {
        let inliers = judge.inliers(&pose);
        if judge.expected_by_chance(&inliers) > MAX_CHANCE {
            return Err(no_consensus);
        }
        let chosen: Vec<Correspondence> =
            correspondences.iter().zip(&inliers).filter(|(_, inlier)| **inlier).map(|(c, _)| *c).collect();
        let answer = estimate_pose_near(camera, &chosen, Some((Solver::P3p, pose)), options)?;
        pose = answer.best.camera_from_target;
        // Settled: the answer has the inliers that it was made from.
        if judge.inliers(&pose) == inliers {
            return Ok((answer, inliers));
        }
        if judge.inliers(&pose).iter().filter(|i| **i).count() < need {
            return Err(no_consensus);
        }
    }
    let inliers = judge.inliers(&pose);
    let chosen: Vec<Correspondence> =
        correspondences.iter().zip(&inliers).filter(|(_, inlier)| **inlier).map(|(c, _)| *c).collect();
    Ok((estimate_pose_near(camera, &chosen, Some((Solver::P3p, pose)), options)?, inliers))
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

    fn cost(&self, pose: &CameraFromTarget) -> f64 {
        self.correspondences.iter().map(|seen| self.error(seen, pose).min(GATE * GATE)).sum()
    }

    fn inliers(&self, pose: &CameraFromTarget) -> Vec<bool> {
        self.correspondences.iter().map(|seen| self.error(seen, pose) < GATE * GATE).collect()
    }

    /// The pose refined on its inliers, as long as that lowers the cost.
    fn improved(&self, mut cost: f64, mut pose: CameraFromTarget) -> (f64, CameraFromTarget) {
        let options = RefineOptions { max_iterations: 10, ..RefineOptions::default() };
        for _ in 0..ROUNDS {
            let inliers: Vec<Correspondence> =
                self.correspondences.iter().filter(|seen| self.error(seen, &pose) < GATE * GATE).copied().collect();
            if inliers.len() < 4 {
                break;
            }
            let Ok(refined) = refine(self.camera, &inliers, &pose, &options) else { break };
            let next = self.cost(&refined.camera_from_target);
            if next >= cost {
                break;
            }
            (cost, pose) = (next, refined.camera_from_target);
        }
        (cost, pose)
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
