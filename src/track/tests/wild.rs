//! Whatever comes in, what goes out is finite, and nothing panics.

use std::time::Duration;

use nalgebra::{Matrix6, Rotation3, Vector3};
use proptest::prelude::*;

use super::flights::{seed_camera, wing_six};
use crate::geometry::{CameraFromTarget, PoseCovariance, rotation};
use crate::pose::{PoseAnswer, PoseEstimate};
use crate::solve::Solver;
use crate::track::{TrackError, TrackOptions, Tracker};

/// Ordinary numbers, huge and tiny ones, and those that are none.
fn wild() -> impl Strategy<Value = f64> {
    prop_oneof![
        12 => -10.0..10.0_f64,
        1 => any::<f64>(),
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(1e300),
        1 => Just(0.0),
    ]
}

fn estimate() -> impl Strategy<Value = PoseEstimate> {
    let turn = proptest::array::uniform3(wild());
    (turn, proptest::array::uniform3(wild()), -300..300_i32, any::<bool>(), any::<bool>(), wild()).prop_map(
        |(turn, place, exponent, is_moderate, covariance_reliable, probability)| {
            let size = if is_moderate { 1e-3 } else { 10.0_f64.powi(exponent) };
            let turned = rotation::exp(&Vector3::from(turn));
            let rotation = if turn[0] > 9.0 { Rotation3::from_matrix_unchecked(turned.matrix() * 7.0) } else { turned };
            PoseEstimate {
                camera_from_target: CameraFromTarget::new(rotation, place.into()),
                covariance: PoseCovariance::checked(Matrix6::identity() * size)
                    .unwrap_or(PoseCovariance::checked(Matrix6::identity()).expect("positive definite")),
                covariance_reliable,
                reprojection_rms_px: 0.1,
                probability,
            }
        },
    )
}

fn answers() -> impl Strategy<Value = Vec<PoseAnswer>> {
    let one = (estimate(), proptest::collection::vec(estimate(), 0..4)).prop_map(|(best, alternatives)| PoseAnswer {
        best,
        alternatives,
        solver: Solver::Ippe,
        noise_scale: 1.0,
        ln_evidence: 0.0,
    });
    proptest::collection::vec(one, 0..4)
}

proptest! {
    #[test]
    fn everything_that_comes_out_is_finite(
        frames in proptest::collection::vec((answers(), prop_oneof![8 => 1..200_u64, 1 => Just(0), 1 => 1000..5000_u64]), 1..25)
    ) {
        let options = TrackOptions { max_tracks: 5, ..TrackOptions::default() };
        let mut tracker = Tracker::new(options).expect("good options");
        let mut stamp = Duration::from_millis(7);
        let mut youngest = None;
        for (index, (answers, gap_ms)) in frames.iter().enumerate() {
            stamp += Duration::from_millis(*gap_ms);
            let report = match tracker.step(stamp, answers) {
                Ok(report) => report,
                Err(error) => {
                    prop_assert!(matches!(error, TrackError::StampNotAfter { .. }), "{error}");
                    prop_assert!(index > 0 && *gap_ms == 0);
                    continue;
                }
            };
            prop_assert!(tracker.tracks().len() <= 5);
            for track in &report.tracks {
                // A name is never given twice.
                if track.began_at() == stamp {
                    prop_assert!(youngest < Some(track.id()));
                    youngest = Some(track.id());
                }
                prop_assert!(track.alternatives().len() < options.max_branches);
                let mut total = 0.0;
                for one in std::iter::once(track.best()).chain(track.alternatives()) {
                    let motion = &one.motion;
                    prop_assert!(one.probability > 0.0 && one.probability <= 1.0 + 1e-12);
                    total += one.probability;
                    prop_assert!(motion.camera_from_target().is_finite());
                    prop_assert!(motion.covariance().cholesky().is_some());
                    prop_assert!(motion.range_rate_mps().is_none_or(|r| r.value.is_finite() && r.sigma.is_finite()));
                    if let Ok(found) = motion.closest_approach() {
                        let numbers = [found.time_s.value, found.time_s.sigma, found.miss_m.value, found.miss_m.sigma];
                        prop_assert!(numbers.iter().all(|x| x.is_finite() && *x >= 0.0), "{numbers:?}");
                    }
                }
                prop_assert!((total - 1.0).abs() < 1e-9);
            }
            let (camera, target) = (seed_camera(), wing_six());
            if let Some(region) = tracker.search(stamp + Duration::from_millis(50), &camera, &target).region() {
                prop_assert!(region.checked(camera.width(), camera.height()).is_ok());
            }
        }
    }
}
