//! The one pose that explains several best.

use nalgebra::{Matrix6, Vector3, Vector6};

use super::view::Seen;
use crate::geometry::left_jacobian::left_jacobian_inverse;
use crate::geometry::space::Space;
use crate::geometry::uncertain::inversion_slope;
use crate::geometry::{PoseCovariance, Transform, UncertainTransform};

/// Iterations; from poses that agree, three or four are needed.
const MOST_STEPS: usize = 30;
/// How often a step that leads uphill is halved.
const MOST_HALVINGS: usize = 12;
/// Where the sum of squares, which is of the size of its degrees of freedom, would fall by less, it is at its least.
const CLOSE: f64 = 1e-9;

/// A pose, and how well it explains those that it was made of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit<To: Space, From: Space> {
    /// The pose with the covariance that all have together.
    pub pose: UncertainTransform<To, From>,
    /// What is left: squared distances of all, each in units of its covariance.
    pub squared: f64,
    /// Logarithm of the density of all under the pose that they have in common, any such pose being as likely, but for a constant.
    pub ln_evidence: f64,
}

/// One of the poses, ready to be weighed.
struct Term<To: Space, From: Space> {
    seen: Seen<To, From>,
    weight: Matrix6<f64>,
    ln_determinant: f64,
}

impl<To: Space, From: Space> Term<To, From> {
    fn of(seen: &Seen<To, From>) -> Option<Self> {
        let (covariance, is_finite) = match seen {
            Seen::Along(seen) => (seen.covariance, seen.transform.is_finite()),
            Seen::Back(seen) => (seen.covariance, seen.transform.is_finite()),
        };
        let covariance = PoseCovariance::checked(covariance).filter(|_| is_finite)?;
        let ln_determinant = covariance.ln_determinant();
        Some(Self { seen: *seen, weight: covariance.matrix().cholesky()?.inverse(), ln_determinant })
    }

    /// The error that it has if this pose is the true one, and the error's derivative by a step of that pose.
    fn error(&self, at: &Transform<To, From>) -> (Vector6<f64>, Matrix6<f64>) {
        match &self.seen {
            Seen::Along(seen) => {
                let error = seen.transform.difference_to(at);
                (error, turned(&error, &Matrix6::identity()))
            }
            Seen::Back(seen) => {
                let error = seen.transform.difference_to(&at.inverse());
                (error, turned(&error, &inversion_slope(at)))
            }
        }
    }

    fn squared(&self, at: &Transform<To, From>) -> f64 {
        let error = self.error(at).0;
        error.dot(&(self.weight * error))
    }
}

/// The rows of the turn go through the logarithm.
fn turned(error: &Vector6<f64>, slope: &Matrix6<f64>) -> Matrix6<f64> {
    let turn: Vector3<f64> = error.fixed_rows::<3>(3).into_owned();
    let mut turned = *slope;
    turned.fixed_rows_mut::<3>(3).copy_from(&(left_jacobian_inverse(&turn) * slope.fixed_rows::<3>(3)));
    turned
}

/// Gauss and Newton from the pose that explains the others best, in information form: `sum of J^T W J`. `None` where a covariance is not
/// positive definite, or numbers end.
pub(super) fn fit<To: Space, From: Space>(seen: &[Seen<To, From>]) -> Option<Fit<To, From>> {
    let terms: Vec<Term<To, From>> = seen.iter().map(Term::of).collect::<Option<_>>()?;
    let cost = |at: &Transform<To, From>| terms.iter().map(|term| term.squared(at)).sum::<f64>();
    let starts = seen.iter().map(|seen| seen.along().transform).map(|start| (start, cost(&start)));
    let (mut at, mut squared) = starts.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let mut information = Matrix6::zeros();
    for _ in 0..MOST_STEPS {
        let (summed, down) = normal(&terms, &at);
        information = summed;
        let step = information.cholesky()?.solve(&down);
        if !(down.dot(&step) > CLOSE) {
            break;
        }
        let shorter = (0..MOST_HALVINGS).scan(1.0, |share, _| {
            let to = at.perturbed(&(step * *share));
            *share *= 0.5;
            Some((to, cost(&to)))
        });
        let Some((to, less)) = shorter.into_iter().find(|(_, cost)| *cost < squared) else { break };
        (at, squared) = (to, less);
    }
    let covariance = PoseCovariance::from_information(&information)?;
    let ln_determinants: f64 = terms.iter().map(|term| term.ln_determinant).sum();
    let ln_evidence = 0.5 * (covariance.ln_determinant() - ln_determinants - squared);
    let pose = UncertainTransform { transform: at, covariance: *covariance.matrix() };
    (squared.is_finite() && ln_evidence.is_finite() && at.is_finite()).then_some(Fit { pose, squared, ln_evidence })
}

/// The information of all, and where the sum of squares falls.
fn normal<To: Space, From: Space>(terms: &[Term<To, From>], at: &Transform<To, From>) -> (Matrix6<f64>, Vector6<f64>) {
    let (mut information, mut down) = (Matrix6::zeros(), Vector6::zeros());
    for term in terms {
        let (error, slope) = term.error(at);
        let weighed = slope.transpose() * term.weight;
        information += weighed * slope;
        down -= weighed * error;
    }
    (information, down)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::rotation;
    use crate::geometry::space::{Body, Peer};

    fn transform(v: [f64; 6]) -> Transform<Body, Peer> {
        Transform::new(rotation::exp(&(Vector3::new(v[0], v[1], v[2]) * 1.5)), Vector3::new(v[3], v[4], v[5]) * 10.0)
    }

    fn covariance(entries: &[f64], scale: f64) -> Matrix6<f64> {
        let root = Matrix6::from_iterator(entries.iter().copied());
        (root * root.transpose() + Matrix6::identity() * 0.1) * scale
    }

    proptest! {
        #[test]
        fn slopes_agree_with_central_differences(
            v in proptest::array::uniform6(-1.0..1.0_f64), off in proptest::array::uniform6(-0.4..0.4_f64)
        ) {
            let (at, half) = (transform(v), 1e-5);
            let moved = at.perturbed(&Vector6::from(off));
            let covariance = Matrix6::identity();
            for seen in [
                Seen::Along(UncertainTransform { transform: moved, covariance }),
                Seen::Back(UncertainTransform { transform: moved.inverse(), covariance }),
            ] {
                let term = Term::of(&seen).expect("good numbers");
                let slope = term.error(&at).1;
                for axis in 0..6 {
                    let error = |size: f64| term.error(&at.perturbed(&Vector6::ith(axis, size))).0;
                    let found = (error(half) - error(-half)) / (2.0 * half);
                    prop_assert!((found - slope.column(axis)).amax() < 1e-7);
                }
            }
        }

        #[test]
        fn for_small_errors_it_is_the_mahalanobis_distance_of_the_closed_loop(
            v in proptest::array::uniform6(-1.0..1.0_f64), off in proptest::array::uniform6(-1.0..1.0_f64),
            ours in proptest::collection::vec(-1.0..1.0_f64, 36), theirs in proptest::collection::vec(-1.0..1.0_f64, 36)
        ) {
            // Errors so small that the first order holds, with covariances to match.
            let scale = 1e-10;
            let along = UncertainTransform { transform: transform(v), covariance: covariance(&ours, scale) };
            let off = along.transform.perturbed(&(Vector6::from(off) * scale.sqrt()));
            let back = UncertainTransform { transform: off.inverse(), covariance: covariance(&theirs, scale) };
            // There and back again is nowhere, within the errors of both.
            let closed = along * back;
            let left = Transform::<Body, Body>::new(nalgebra::Rotation3::identity(), Vector3::zeros()).difference_to(&closed.transform);
            let expected = left.dot(&closed.covariance.cholesky().expect("positive definite").solve(&left));
            let found = fit(&[Seen::Along(along), Seen::Back(back)]).expect("good numbers");
            prop_assert!((found.squared / expected - 1.0).abs() < 1e-2, "{} {expected}", found.squared);
            // And the fused covariance is that of two measurements of one thing.
            let sum = along.covariance.try_inverse().expect("regular") + back.inverse().covariance.try_inverse().expect("regular");
            let fused = sum.try_inverse().expect("regular");
            prop_assert!((found.pose.covariance - fused).amax() < 1e-3 * fused.amax());
        }

        #[test]
        fn nothing_near_is_better(
            v in proptest::array::uniform6(-1.0..1.0_f64), off in proptest::array::uniform6(-0.5..0.5_f64),
            step in proptest::array::uniform6(-1e-3..1e-3_f64), entries in proptest::collection::vec(-1.0..1.0_f64, 36)
        ) {
            let at = transform(v);
            let covariance = covariance(&entries, 0.05);
            let off = at.perturbed(&Vector6::from(off)).inverse();
            let seen = [
                Seen::Along(UncertainTransform { transform: at, covariance }),
                Seen::Back(UncertainTransform { transform: off, covariance }),
            ];
            let found = fit(&seen).expect("good numbers");
            let other = found.pose.transform.perturbed(&Vector6::from(step));
            let squared: f64 = seen.iter().map(|seen| Term::of(seen).expect("good numbers").squared(&other)).sum();
            prop_assert!(squared > found.squared - 1e-6, "{squared} {}", found.squared);
        }
    }

    #[test]
    fn what_has_no_covariance_cannot_be_weighed() {
        let at = transform([0.1; 6]);
        assert!(fit(&[Seen::Along(UncertainTransform::exact(at))]).is_none());
        let broken = UncertainTransform { transform: at, covariance: Matrix6::repeat(f64::NAN) };
        assert!(fit(&[Seen::Along(broken)]).is_none());
        assert!(fit::<Body, Peer>(&[]).is_none());
    }
}
