//! Figures of detectors.

use std::collections::BTreeMap;

use super::calibration::{Bin, bins};
use super::curve::{Curve, CurvePoint};
use super::spread::Spread;
use super::verdict::{DetectionVerdict, Hit};
use crate::statistics::Rate;

/// False alarms a frame at which detectors are compared.
pub const ALLOWANCES: [f64; 3] = [0.01, 0.1, 1.0];

/// What a detector finds, over many frames.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectionFigures {
    /// Frames of which it is known what ought to be reported.
    pub frames: u32,
    /// Things found, of all.
    pub found: Rate,
    /// Frames in which something was found, of those in which there is something: the seed's rate.
    pub frames_found: Rate,
    /// Reports of nothing, and further reports of a thing.
    pub false_alarms: u32,
    /// Distances of the hits from the true places, px; of boxes from their middles.
    pub centroid_error_px: Option<Spread>,
    /// Root mean square of the error per axis, px, of hits with a stated deviation.
    pub axis_rms_px: Option<f64>,
    /// Mean of the squared errors per axis over their stated variances: 1 where those hold.
    pub normalized_mean_square: Option<f64>,
    /// Hits that are off by more than four stated deviations: of two normal variables together one in 3000 is.
    pub beyond_four_sigma: Option<Rate>,
    /// Range and distance from the true place of the hits of which the range is known, m and px.
    pub error_against_range: Vec<[f64; 2]>,
    /// Over the threshold of the score.
    pub curve: Curve,
    /// At 0.01, 0.1 and 1 false alarms a frame.
    pub at: Vec<(f64, Option<CurvePoint>)>,
    /// Scores as probabilities: how many of the reports are hits.
    pub scores: Vec<Bin>,
    /// What hits were called and are, where both are known.
    pub classes: Vec<ClassCount>,
}

/// Hits that were called so and are so.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClassCount {
    /// The detector's word; `None` where it says nothing.
    pub stated: Option<&'static str>,
    /// The truth's word.
    pub truth: String,
    /// How many.
    pub count: u32,
}

impl DetectionFigures {
    /// Of the frames of which it is known what ought to be reported; `None` of none.
    #[must_use]
    pub fn of(verdicts: &[&DetectionVerdict]) -> Option<Self> {
        if verdicts.is_empty() {
            return None;
        }
        let whole = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        let frames = whole(verdicts.len());
        let objects = verdicts.iter().map(|verdict| verdict.objects).sum();
        let hits: Vec<&Hit> = verdicts.iter().flat_map(|verdict| &verdict.hits).collect();
        let alarms: Vec<f64> =
            verdicts.iter().flat_map(|verdict| &verdict.false_alarms).map(|alarm| alarm.score).collect();
        let curve = Curve::of(hits.iter().map(|hit| hit.score), alarms.iter().copied(), frames, objects);
        let statements: Vec<(f64, bool)> =
            hits.iter().map(|hit| (hit.score, true)).chain(alarms.iter().map(|score| (*score, false))).collect();
        let with_sigma: Vec<(&Hit, f64)> = hits.iter().filter_map(|hit| Some((*hit, hit.sigma_px?))).collect();
        let coordinates = (2 * with_sigma.len()) as f64;
        let mean = |sum: f64| (!with_sigma.is_empty()).then(|| sum / coordinates);
        let squares = mean(with_sigma.iter().map(|(hit, _)| squared(hit)).sum());
        let normalized = mean(with_sigma.iter().map(|(hit, sigma_px)| squared(hit) / sigma_px.powi(2)).sum());
        let beyond = Rate::among(with_sigma.iter().map(|(hit, sigma_px)| squared(hit) > (4.0 * sigma_px).powi(2)));
        Some(Self {
            frames,
            found: Rate { count: hits.len() as u64, of: objects.into() },
            frames_found: Rate::among(
                verdicts.iter().filter(|verdict| verdict.objects > 0).map(|verdict| !verdict.hits.is_empty()),
            ),
            false_alarms: whole(alarms.len()),
            centroid_error_px: Spread::of(hits.iter().map(|hit| squared(hit).sqrt())),
            axis_rms_px: squares.map(f64::sqrt),
            normalized_mean_square: normalized,
            beyond_four_sigma: (beyond.of > 0).then_some(beyond),
            error_against_range: hits.iter().filter_map(|hit| Some([hit.range_m?, squared(hit).sqrt()])).collect(),
            at: ALLOWANCES.map(|allowance| (allowance, curve.at(allowance))).to_vec(),
            curve,
            scores: bins(&statements),
            classes: classes(&hits),
        })
    }

    /// False alarms a frame.
    #[must_use]
    pub fn false_alarms_per_frame(&self) -> f64 {
        f64::from(self.false_alarms) / f64::from(self.frames)
    }
}

fn squared(hit: &Hit) -> f64 {
    hit.error_px[0].powi(2) + hit.error_px[1].powi(2)
}

fn classes(hits: &[&Hit]) -> Vec<ClassCount> {
    let mut counts: BTreeMap<(Option<&'static str>, &str), u32> = BTreeMap::new();
    for hit in hits {
        if let Some(truth) = &hit.true_class {
            *counts.entry((hit.class.map(crate::detect::Class::name), truth)).or_default() += 1;
        }
    }
    counts.into_iter().map(|((stated, truth), count)| ClassCount { stated, truth: truth.to_owned(), count }).collect()
}
