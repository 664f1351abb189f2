//! Detection on the committed frames of `tests/data/frames`: what is found, how far off, and whether the stated deviations and
//! poses hold. The benchmark's frames are others; these are few, and there so that a change that hurts is seen at once.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test says what it takes for granted, and shows its figures"
)]

#[path = "known/frames.rs"]
mod data;
#[path = "known/tally.rs"]
mod tally;

use std::collections::BTreeMap;
use std::path::Path;

use skypose::pipeline::estimate;
use tally::{CONFIDENT, Outcome, Tally, outcome};

/// What a suite must reach.
struct Bound {
    suite: &'static str,
    /// Markers that may be missed.
    missed: u32,
    /// Largest root mean square error of the centroids, px.
    rms_px: f64,
    /// Largest mean square of their errors over their deviations. A suite has 20 to 36 coordinates: chance moves it by 0.3, three
    /// times that is 0.9.
    mean_square: f64,
}

const BOUNDS: [Bound; 8] = [
    Bound { suite: "lab", missed: 0, rms_px: 0.038, mean_square: 1.9 },
    Bound { suite: "easy", missed: 0, rms_px: 0.038, mean_square: 1.9 },
    // At a fifth of the light noise is a large part of what is left.
    Bound { suite: "light", missed: 0, rms_px: 0.09, mean_square: 1.9 },
    // Red things lie under the wing's edge.
    Bound { suite: "clutter", missed: 1, rms_px: 0.045, mean_square: 1.9 },
    Bound { suite: "motion", missed: 0, rms_px: 0.055, mean_square: 1.9 },
    Bound { suite: "occlusion", missed: 0, rms_px: 0.035, mean_square: 1.9 },
    Bound { suite: "range", missed: 0, rms_px: 0.10, mean_square: 1.9 },
    Bound { suite: "led_night", missed: 0, rms_px: 0.12, mean_square: 1.9 },
];

#[test]
fn the_committed_frames_give_their_markers_and_poses() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/frames");
    let mut suites: BTreeMap<String, (Tally, u32)> = BTreeMap::new();
    for known in data::frames(&folder) {
        let targets = std::slice::from_ref(&known.target);
        let estimate =
            estimate(&known.frame, &known.camera, targets, &known.options(), |_| {}).expect("of this camera");
        let found = &estimate.targets[0];
        let Some(pose) = known.pose.filter(|_| known.facing) else {
            assert!(found.answer.is_err(), "{}: a pose of nothing", known.name);
            continue;
        };
        let (tally, seen) = suites.entry(known.suite.clone()).or_default();
        let outcome = outcome(found, &pose);
        tally.add(outcome);
        if let (Outcome::Wrong, Ok(answer)) = (outcome, &found.answer) {
            let probability = answer.best.probability;
            assert!(probability < CONFIDENT, "{}: wrong and sure of it", known.name);
        }
        for truth in (0..known.target.markers().len()).filter_map(|marker| known.centroid(marker)) {
            *seen += 1;
            let near = estimate.detection.centroids.iter().find(|c| (c.pixel - truth).norm() < 1.0);
            if let Some(centroid) = near {
                tally.add_centroid(&centroid.pixel, centroid.sigma_px, truth);
            }
        }
    }
    let mut all = Tally::default();
    Tally::head();
    for (suite, (tally, _)) in &suites {
        tally.print(suite);
        all.merge(tally);
    }
    all.print("all");
    for bound in BOUNDS {
        let suite = bound.suite;
        let (tally, seen) = &suites[suite];
        assert_eq!((tally.missed, tally.wrong), (0, 0), "{suite}: {tally:?}");
        assert!(tally.markers + bound.missed >= *seen, "{suite}: {} of {seen} markers", tally.markers);
        assert!(tally.rms_px() < bound.rms_px, "{suite}: {} px", tally.rms_px());
        assert!(tally.mean_square() < bound.mean_square, "{suite}: {:.2} of sigma^2", tally.mean_square());
    }
    // 234 coordinates together: chance moves it by 0.09; on average deviations may be off by a quarter.
    assert!((0.56..1.57).contains(&all.mean_square()), "{:.2} of sigma^2", all.mean_square());
    // Two normal variables exceed 4 sigma together once in 3000.
    assert!(all.beyond_four * 30 <= all.markers, "{} of {} beyond 4 sigma", all.beyond_four, all.markers);
}
