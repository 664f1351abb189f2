//! The receiver curve of a detector: what it finds against its false alarms, over the threshold of its score.

/// What a detector finds at each false-alarm rate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// By falling threshold.
    pub points: Vec<CurvePoint>,
}

/// A threshold and what it gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// Reports of this score and above count.
    pub threshold: f64,
    /// False alarms a frame.
    pub false_alarms: f64,
    /// Share of the things that are found.
    pub probability: f64,
}

impl Curve {
    /// Of the scores of hits and false alarms in so many frames with so many things. Without frames or things there is no point.
    pub fn of(
        hits: impl IntoIterator<Item = f64>,
        false_alarms: impl IntoIterator<Item = f64>,
        frames: u32,
        objects: u32,
    ) -> Self {
        let hits = hits.into_iter().map(|score| (score, true));
        let mut reports: Vec<(f64, bool)> = hits.chain(false_alarms.into_iter().map(|score| (score, false))).collect();
        if frames == 0 || objects == 0 {
            return Self::default();
        }
        reports.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (mut found, mut false_alarms) = (0_u32, 0_u32);
        let mut points = Vec::new();
        // What has one score passes a threshold together.
        for same in reports.chunk_by(|a, b| a.0.total_cmp(&b.0).is_eq()) {
            for (_, is_hit) in same {
                if *is_hit { found += 1 } else { false_alarms += 1 }
            }
            points.push(CurvePoint {
                threshold: same[0].0,
                false_alarms: f64::from(false_alarms) / f64::from(frames),
                probability: f64::from(found) / f64::from(objects),
            });
        }
        Self { points }
    }

    /// The lowest threshold with at most so many false alarms a frame; `None` if even the highest has more.
    #[must_use]
    pub fn at(&self, false_alarms: f64) -> Option<CurvePoint> {
        self.points.iter().take_while(|point| point.false_alarms <= false_alarms).last().copied()
    }

    /// The same by at most about so many points, for a drawing or a table: those by which it moves on by a like share.
    #[must_use]
    pub fn thinned(&self, most: usize) -> Self {
        let Some(last) = self.points.last() else { return Self::default() };
        let step = 2.0 / most.max(2) as f64;
        let (first_ln, last_ln) = (self.ln_alarms(0), last.false_alarms.max(f64::MIN_POSITIVE).ln());
        let span = (last_ln - first_ln).max(f64::EPSILON);
        let mut kept: Vec<CurvePoint> = Vec::new();
        for point in &self.points {
            let moved = kept.last().is_none_or(|before| {
                let along = (point.false_alarms / before.false_alarms.max(f64::MIN_POSITIVE)).max(1.0).ln() / span;
                along >= step || (point.probability - before.probability) >= step * last.probability
            });
            if moved {
                kept.push(*point);
            }
        }
        if kept.last() != Some(last) {
            kept.push(*last);
        }
        Self { points: kept }
    }

    /// Of the first point from `index` on that has false alarms.
    fn ln_alarms(&self, index: usize) -> f64 {
        let first = self.points[index..].iter().find(|point| point.false_alarms > 0.0);
        first.map_or(0.0, |point| point.false_alarms.ln())
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::random;

    #[test]
    fn the_curve_is_that_of_counting_anew_for_each_threshold() {
        let mut rng = random::named("receiver curve");
        for _ in 0..50 {
            // Coarse scores, so that many are equal.
            let mut scores = |most: usize| -> Vec<f64> {
                let count = rng.random_range(0..most);
                (0..count).map(|_| f64::from(rng.random_range(0..20_u32)) / 20.0).collect()
            };
            let (hits, alarms) = (scores(60), scores(90));
            let (frames, objects) = (30, 80);
            let curve = Curve::of(hits.clone(), alarms.clone(), frames, objects);
            let above = |scores: &[f64], threshold: f64| scores.iter().filter(|score| **score >= threshold).count();
            for point in &curve.points {
                let found = above(&hits, point.threshold) as f64 / 80.0;
                let false_alarms = above(&alarms, point.threshold) as f64 / 30.0;
                assert_eq!((point.probability, point.false_alarms), (found, false_alarms));
            }
            for allowance in [0.0, 0.1, 0.5, 1.0, 2.0, 9.0] {
                let allowed = (0..=20).map(|step| f64::from(step) / 20.0);
                let allowed = allowed.filter(|threshold| above(&alarms, *threshold) as f64 / 30.0 <= allowance);
                let best = allowed.map(|threshold| above(&hits, threshold) as f64 / 80.0).fold(0.0, f64::max);
                let found = curve.at(allowance).map_or(0.0, |point| point.probability);
                assert!((found - best).abs() < 1e-12, "at {allowance}");
            }
        }
    }

    #[test]
    fn a_thinned_curve_keeps_its_ends_and_its_points() {
        let scores = |step: usize| (0..6000).step_by(step).map(|i| f64::from(i) / 6000.0);
        let curve = Curve::of(scores(3), scores(7), 500, 2500);
        let thin = curve.thinned(100);
        assert!((30..=130).contains(&thin.points.len()), "{} of {}", thin.points.len(), curve.points.len());
        assert_eq!((thin.points.first(), thin.points.last()), (curve.points.first(), curve.points.last()));
        assert!(thin.points.iter().all(|point| curve.points.contains(point)));
        assert_eq!(Curve::of([0.5], [0.2], 0, 1), Curve::default());
    }
}
