//! Whether views agree, and what they say together.

use super::fit::{Fit, fit};
use super::options::SwarmOptions;
use super::view::{Seen, View};
use crate::geometry::UncertainTransform;
use crate::geometry::space::Space;
use crate::statistics::{chi_square_limit, chi_square_share_above};

/// Most combinations that are tried: all of four views with four candidates each.
const MOST_COMBINATIONS: usize = 256;

/// How views compare.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison<To: Space, From: Space> {
    /// Of the combination in `chosen`: the squared distance of its poses from the one that explains them best, in units of their
    /// covariances. Chi-square with [`freedom`](Self::freedom) degrees of freedom where nothing is wrong.
    pub squared: f64,
    /// The most at which they agree.
    pub limit: f64,
    /// Six for each view beyond the first.
    pub freedom: u32,
    /// How often chance alone makes the distance as large as that.
    pub share_above: f64,
    /// Which candidate of each view it is: the most probable combination that agrees, or else the nearest.
    pub chosen: Vec<usize>,
    /// What all say together, by falling probability; nothing where they disagree.
    pub fused: Vec<Fused<To, From>>,
}

/// A pose of which several views are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fused<To: Space, From: Space> {
    /// The pose.
    pub pose: UncertainTransform<To, From>,
    /// That this one and none of the others is right.
    pub probability: f64,
}

impl<To: Space, From: Space> Comparison<To, From> {
    /// Whether there is something that they have in common.
    #[must_use]
    pub const fn agrees(&self) -> bool {
        !self.fused.is_empty()
    }
}

/// A candidate of each view.
#[derive(Clone, Debug, PartialEq)]
struct Combination {
    chosen: Vec<usize>,
    probability: f64,
}

/// A combination, and the pose that explains it best.
struct Tried<To: Space, From: Space> {
    combination: Combination,
    fit: Fit<To, From>,
    /// Logarithm of its probability after the views were compared, but for a constant.
    ln_weight: f64,
}

/// Compares two views or more, and fuses what agrees. `None` of less, or where numbers end.
#[must_use]
pub fn compare<To: Space, From: Space>(
    views: &[&View<To, From>],
    options: &SwarmOptions,
) -> Option<Comparison<To, From>> {
    let beyond = u32::try_from(views.len()).ok()?.checked_sub(1).filter(|beyond| *beyond > 0)?;
    let pairs = beyond.checked_mul(3)?;
    let limit = chi_square_limit(pairs, options.significance);
    let mut tried: Vec<Tried<To, From>> = probable(views, options.significance)
        .into_iter()
        .filter_map(|combination| {
            let seen =
                views.iter().zip(&combination.chosen).map(|(view, chosen)| Some(view.candidates.get(*chosen)?.seen));
            let fit = fit(&seen.collect::<Option<Vec<Seen<To, From>>>>()?)?;
            let ln_weight = combination.probability.ln() + fit.ln_evidence;
            Some(Tried { combination, fit, ln_weight })
        })
        .collect();
    let nearest = tried.iter().min_by(|a, b| a.fit.squared.total_cmp(&b.fit.squared))?;
    let told = |tried: &Tried<To, From>, fused| Comparison {
        squared: tried.fit.squared,
        limit,
        freedom: 2 * pairs,
        share_above: chi_square_share_above(pairs, tried.fit.squared),
        chosen: tried.combination.chosen.clone(),
        fused,
    };
    if nearest.fit.squared > limit {
        return Some(told(nearest, Vec::new()));
    }
    tried.retain(|tried| tried.fit.squared <= limit);
    tried.sort_by(|a, b| b.ln_weight.total_cmp(&a.ln_weight));
    let best = tried.first()?;
    let weights: Vec<f64> = tried.iter().map(|tried| (tried.ln_weight - best.ln_weight).exp()).collect();
    let total: f64 = weights.iter().sum();
    let fused = tried.iter().zip(&weights);
    let fused = fused.map(|(tried, weight)| Fused { pose: tried.fit.pose, probability: weight / total }).collect();
    Some(told(best, fused))
}

/// All combinations by falling probability, without the least probable ones, which have less than `negligible` of it together.
fn probable<To: Space, From: Space>(views: &[&View<To, From>], negligible: f64) -> Vec<Combination> {
    let mut all = vec![Combination { chosen: Vec::new(), probability: 1.0 }];
    for view in views {
        let longer = all.iter().flat_map(|shorter| {
            view.candidates.iter().enumerate().map(|(place, candidate)| Combination {
                chosen: [shorter.chosen.as_slice(), &[place]].concat(),
                probability: shorter.probability * candidate.probability,
            })
        });
        let mut longer: Vec<Combination> = longer.filter(|combination| combination.probability > 0.0).collect();
        longer.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        longer.truncate(MOST_COMBINATIONS);
        all = longer;
    }
    let mut left: f64 = all.iter().map(|combination| combination.probability).sum::<f64>() * negligible;
    while let Some(last) = all.last() {
        left -= last.probability;
        if left < 0.0 {
            break;
        }
        all.pop();
    }
    all
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Rotation3, Vector3};

    use super::*;
    use crate::geometry::Transform;
    use crate::geometry::space::{Body, Peer};
    use crate::swarm::view::Candidate;

    fn view(poses: &[(f64, f64)]) -> View<Body, Peer> {
        let candidate = |(x, probability): &(f64, f64)| Candidate {
            seen: Seen::Along(UncertainTransform {
                transform: Transform::new(Rotation3::identity(), Vector3::new(*x, 0.0, 0.0)),
                covariance: Matrix6::identity(),
            }),
            probability: *probability,
        };
        View { cameras: Vec::new(), candidates: poses.iter().map(candidate).collect() }
    }

    #[test]
    fn of_hypotheses_the_pair_that_agrees_is_taken() {
        let (one, other) = (view(&[(0.0, 0.6), (50.0, 0.4)]), view(&[(80.0, 0.7), (51.0, 0.3)]));
        let found = compare(&[&one, &other], &SwarmOptions::default()).expect("good numbers");
        assert_eq!((found.chosen.as_slice(), found.freedom, found.fused.len()), (&[1, 1][..], 6, 1));
        // Two of one deviation each, one apart: a half, and the middle.
        assert!((found.squared - 0.5).abs() < 1e-9, "{found:?}");
        assert!((found.fused[0].pose.transform.translation.x - 50.5).abs() < 1e-9);
        assert!((found.fused[0].pose.covariance - Matrix6::identity() * 0.5).amax() < 1e-9);
        assert!((found.fused[0].probability - 1.0).abs() < 1e-12);
    }

    #[test]
    fn probabilities_follow_from_how_well_the_pairs_agree() {
        // Distances of 0 and of 2 between two of one deviation each: exp(-1) to one.
        let found = compare(&[&view(&[(0.0, 0.5), (2.0, 0.5)]), &view(&[(0.0, 1.0)])], &SwarmOptions::default());
        let found = found.expect("good numbers");
        let expected = 1.0 / (1.0 + (-1.0_f64).exp());
        assert!((found.fused[0].probability - expected).abs() < 1e-9, "{found:?}");
        assert_eq!(found.chosen, [0, 0]);
    }

    #[test]
    fn what_is_apart_is_told_and_not_fused_and_a_hypothesis_in_a_million_saves_nobody() {
        let found = compare(&[&view(&[(0.0, 1.0)]), &view(&[(9.0, 0.8), (20.0, 0.2)])], &SwarmOptions::default());
        let found = found.expect("good numbers");
        assert!(!found.agrees() && found.chosen == [0, 0]);
        assert!((found.squared - 40.5).abs() < 1e-9 && (found.limit - 22.4577).abs() < 1e-3, "{found:?}");
        assert!(found.share_above < 1e-6);
        let lucky = view(&[(9.0, 1.0 - 1e-6), (0.0, 1e-6)]);
        assert!(!compare(&[&view(&[(0.0, 1.0)]), &lucky], &SwarmOptions::default()).expect("good numbers").agrees());
    }

    #[test]
    fn three_views_have_twelve_degrees_of_freedom_and_one_has_none() {
        let [one, two, three] = [view(&[(0.0, 1.0)]), view(&[(1.0, 1.0)]), view(&[(2.0, 1.0)])];
        let found = compare(&[&one, &two, &three], &SwarmOptions::default()).expect("good numbers");
        assert!((found.squared - 2.0).abs() < 1e-9 && found.freedom == 12, "{found:?}");
        assert!((found.fused[0].pose.covariance - Matrix6::identity() / 3.0).amax() < 1e-9);
        assert!(compare(&[&one], &SwarmOptions::default()).is_none());
        assert!(compare::<Body, Peer>(&[], &SwarmOptions::default()).is_none());
        assert!(compare(&[&one, &view(&[])], &SwarmOptions::default()).is_none());
    }

    #[test]
    fn the_least_probable_combinations_are_left_out() {
        let (one, other) = (view(&[(0.0, 0.999), (1.0, 0.001)]), view(&[(0.0, 0.5), (1.0, 0.5)]));
        let kept = |negligible| probable(&[&one, &other], negligible).len();
        assert_eq!([kept(1e-12), kept(6e-4), kept(2e-3)], [4, 3, 2]);
    }
}
