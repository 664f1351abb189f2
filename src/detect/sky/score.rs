//! The probability that a track is something that flies: a logistic function of what its late frames told.
//!
//! The weights are those of a logistic regression on 24 labelled clips (Drone-detection-dataset, F. Svanström 2020), one for each cue.
//! A cue says how things are in the world, and its sign can be checked by thought: what stands out from its clutter and moves against
//! the scene is more likely to fly, what goes on beyond its outline, has a foot or stands under other things is less likely to.

use super::track::Track;

/// Cues of a track.
pub const CUES: usize = 16;

/// Weights in the order of [`features`], the constant last.
const WEIGHTS: [f64; CUES + 1] = [
    1.65, // contrast
    0.68, // moving
    -0.52, // height
    -0.36, // size
    -1.80, // openness
    -1.09, // unrest
    -0.10, // elongation
    0.60, // crowd
    -2.10, // above
    0.10, // below
    -1.53, // goes on
    -2.16, // foot
    -0.56, // hits
    -1.93, // presence
    0.65, // drift
    -0.27, // speed
    -0.40, // constant
];

/// What is weighed.
#[must_use]
pub fn features(track: &Track) -> [f64; CUES] {
    let cues = &track.cues;
    let speed = track.velocity[0].hypot(track.velocity[1]);
    [
        f64::from(cues.contrast_ln),
        f64::from(cues.moving_ln),
        f64::from(cues.height_ln),
        f64::from(cues.size_ln),
        f64::from(cues.openness.min(1.5)),
        f64::from(cues.unrest.min(1.0)),
        f64::from(cues.upright_ln),
        f64::from(cues.crowd.ln_1p()),
        f64::from(cues.above_ln),
        f64::from(cues.below_ln),
        f64::from(cues.goes_on),
        f64::from(cues.foot.min(1.5)),
        f64::from(track.hits).ln().min(4.0),
        track.presence,
        track.drift_ratio().ln_1p(),
        speed.ln_1p(),
    ]
}

/// The probability.
#[must_use]
pub fn probability(track: &Track) -> f64 {
    let evidence: f64 = features(track).iter().zip(WEIGHTS).map(|(feature, weight)| feature * weight).sum();
    1.0 / (1.0 + (-(evidence + WEIGHTS[CUES])).exp())
}
