//! How ambiguous a constellation is, from images without noise: cheap, and good enough to sort moves by.

use super::AssessOptions;
use super::draws::Draw;
use super::sight::Sight;
use super::stage::Stage;
use crate::identify::{Blob, IdentifyOptions, identify};
use crate::pose::{PoseOptions, estimate_pose};

/// Turns of the target for each score.
const TURNS: usize = 12;

/// A target of this many markers is scored at all turns; the work for larger ones is kept in bounds by fewer.
const TURNS_MARKERS: usize = 8;

/// Alternatives less probable than one in ten thousand are not reported; with a stated deviation this much larger, less
/// probable ones are.
const RELAXATION: f64 = 2.0;

/// Scores constellations at one range.
pub(super) struct Scorer {
    range_m: f64,
    pixel_sigma: f64,
    max_tilt_rad: f64,
    identify: IdentifyOptions,
    turns: Vec<(f64, Draw)>,
    /// Turns at which markers are told apart.
    identified_turns: usize,
}

impl Scorer {
    pub(super) fn new(
        range_m: f64,
        aspects_rad: &[f64],
        options: &AssessOptions,
        markers: usize,
        identified_turns: usize,
    ) -> Self {
        let count = (TURNS * TURNS_MARKERS / markers.max(TURNS_MARKERS)).max(2);
        let turns = (0..count)
            .map(|index| (aspects_rad[index % aspects_rad.len().max(1)], Draw::numbered(index as u64, markers)))
            .collect();
        // Nothing is refused: what counts is how probable the right assignment is.
        let identify = IdentifyOptions { min_probability: 0.0, ..options.identify };
        Self {
            range_m,
            pixel_sigma: options.pixel_sigma,
            max_tilt_rad: options.identify.max_tilt_rad,
            identify,
            turns,
            identified_turns,
        }
    }

    /// Probability of a wrong minimum plus probability of a wrong assignment, means over the turns: 0 is best.
    pub(super) fn score(&self, stage: &Stage<'_>) -> f64 {
        let sight = |(aspect_rad, draw): &(f64, Draw)| {
            Sight::at(stage, stage.pose(self.range_m, *aspect_rad, draw), self.max_tilt_rad)
        };
        let flips: f64 = self.turns.iter().map(|turn| self.flip_probability(stage, &sight(turn))).sum();
        // Spread over the aspects.
        let stride = self.turns.len().div_ceil(self.identified_turns.max(1)).max(1);
        let identified = self.turns.iter().step_by(stride).take(self.identified_turns);
        let wrong: f64 =
            identified.clone().map(|turn| 1.0 - self.assignment_probability(stage, &sight(turn), &turn.1)).sum();
        flips / self.turns.len().max(1) as f64 + wrong / identified.count().max(1) as f64
    }

    /// That noise carries the image more than half way to that of the other minimum. The two are `sqrt(chi-square)` standard
    /// deviations apart.
    fn flip_probability(&self, stage: &Stage<'_>, sight: &Sight<'_>) -> f64 {
        let stated = self.pixel_sigma * RELAXATION;
        let Ok(answer) = estimate_pose(stage.camera, &sight.exact_correspondences(stated), &PoseOptions::default())
        else {
            return 1.0;
        };
        let faces = |pose: &_| sight.seen.iter().all(|seen| stage.target.faces_camera(seen.marker, pose));
        let others = answer.alternatives.iter().chain([&answer.best]).filter(|other| faces(&other.camera_from_target));
        // The true one leaves no residual.
        let deviations = |rms_px: f64| rms_px * (sight.seen.len() as f64).sqrt() / self.pixel_sigma;
        let second = others.map(|other| deviations(other.reprojection_rms_px)).filter(|d| *d > 1e-6).reduce(f64::min);
        second.map_or(0.0, |deviations| normal_tail(0.5 * deviations))
    }

    /// Of the right assignment among all others and against chance.
    fn assignment_probability(&self, stage: &Stage<'_>, sight: &Sight<'_>, draw: &Draw) -> f64 {
        let blobs = sight.blobs(
            &Draw { noise: vec![nalgebra::Vector2::zeros(); draw.noise.len()], ..draw.clone() },
            self.pixel_sigma,
        );
        let given: Vec<Blob> = blobs.iter().map(|marked| marked.blob).collect();
        let Ok(identified) = identify(stage.camera, stage.target, &given, &self.identify) else { return 0.0 };
        let is_right = |blob_of_marker: &[Option<usize>]| {
            let mut pairs = blob_of_marker.iter().enumerate();
            pairs.all(|(marker, blob)| blob.is_none_or(|blob| blobs[blob].markers.contains(&marker)))
        };
        identified.hypotheses.iter().filter(|h| is_right(&h.blob_of_marker)).map(|h| h.probability).sum()
    }
}

/// That a normal variable exceeds this many deviations (Abramowitz and Stegun 26.2.17, within 1e-7).
fn normal_tail(deviations: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * deviations.abs());
    let series = [0.319_381_530, -0.356_563_782, 1.781_477_937, -1.821_255_978, 1.330_274_429];
    let polynomial = series.iter().rev().fold(0.0, |sum, c| (sum + c) * t);
    let tail = (-0.5 * deviations * deviations).exp() / std::f64::consts::TAU.sqrt() * polynomial;
    if deviations >= 0.0 { tail } else { 1.0 - tail }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tail_agrees_with_the_tables() {
        // Abramowitz and Stegun, table 26.1.
        for (deviations, tabulated) in [(0.0, 0.5), (1.0, 0.158_655_254), (2.5, 0.006_209_665), (-1.0, 0.841_344_746)] {
            assert!((normal_tail(deviations) - tabulated).abs() < 1e-7, "{deviations}");
        }
    }
}
