//! The probability that a track is something that flies: a logistic function of what its late frames told.
//!
//! The weights are those of a logistic regression on 24 labelled clips (Drone-detection-dataset, F. Svanström 2020), one for each cue.
//! More cues (the track's age, presence and speed, its neighbours) fit those clips better and others worse.
//! A cue says how things are in the world, and its sign can be checked by thought: what stands out from its clutter and moves against
//! the scene is more likely to fly, what goes on beyond its outline, has a foot or stands under other things is less likely to.

use super::track::Track;

/// Cues of a track.
pub const CUES: usize = 10;

/// Weights in the order of [`features`], the constant last.
const WEIGHTS: [f64; CUES + 1] = [
    1.27,  // contrast over clutter
    0.60,  // moves against the scene
    -0.50, // size
    -0.76, // goes on around
    -1.49, // restless around
    -0.59, // upright
    -1.90, // under other things
    -2.24, // part of something
    -1.24, // has a foot
    0.84,  // has come a way of its own
    -3.58, // constant
];

/// What is weighed.
#[must_use]
pub fn features(track: &Track) -> [f64; CUES] {
    let cues = &track.cues;
    [
        f64::from(cues.contrast_ln),
        f64::from(cues.moving_ln),
        f64::from(cues.size_ln),
        f64::from(cues.openness.min(1.5)),
        f64::from(cues.unrest.min(1.0)),
        f64::from(cues.upright_ln),
        f64::from(cues.above_ln),
        f64::from(cues.goes_on),
        f64::from(cues.foot.min(1.5)),
        track.drift_ratio().ln_1p(),
    ]
}

/// The probability.
#[must_use]
pub fn probability(track: &Track) -> f64 {
    let evidence: f64 = features(track).iter().zip(WEIGHTS).map(|(feature, weight)| feature * weight).sum();
    1.0 / (1.0 + (-(evidence + WEIGHTS[CUES])).exp())
}
