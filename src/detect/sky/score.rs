//! The probability that a track is something that flies: a logistic function of what its late frames told.
//!
//! The weights are those of a logistic regression on 24 labelled clips (Drone-detection-dataset, F. Svanström 2020), one for each cue.
//! More cues (the track's age, presence and speed) fit those clips better and others worse.
//! A cue says how things are in the world, and its sign can be checked by thought: what stands out from its clutter and moves against
//! the scene is more likely to fly, what goes on beyond its outline, has a foot or stands under other things is less likely to. Where
//! half the frame looks a little like something that flies, nothing of it is much of an argument: that is the [company](compare).

use super::track::Track;

/// Cues of a track by itself.
pub const CUES: usize = 12;

/// Weights in the order of [`features`]: of a track by itself, and of one whose company is known.
const WEIGHTS: [[f64; 2]; CUES] = [
    [1.24, 1.22],   // contrast over clutter
    [0.55, 0.63],   // moves against the scene
    [-0.68, -0.88], // size
    [-0.46, -0.52], // goes on around
    [-1.81, -1.90], // restless around
    [-0.58, -0.49], // upright
    [-1.68, -1.77], // under other things
    [-2.59, -2.72], // part of something
    [-1.88, -1.76], // has a foot
    [0.73, 0.72],   // has come a way of its own
    [0.62, 0.46],   // quieter on one side
    [-2.00, -2.00], // cut by the border
];

/// What is added to both.
const CONSTANTS: [f64; 2] = [-2.75, 0.24];

/// Weight of the company.
const COMPANY: f64 = -1.67;

/// Evidence of which more is no more company: a second aircraft is no argument against the first, a dozen of ragged clouds is one.
const MOST_EVIDENCE: f64 = -2.0;

/// What is weighed of a track by itself.
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
        f64::from(cues.beside_ln),
        f64::from(cues.cut),
    ]
}

/// Logarithm of the odds: by itself, and before the company is weighed.
fn evidence(track: &Track) -> [f64; 2] {
    features(track)
        .iter()
        .zip(WEIGHTS)
        .fold(CONSTANTS, |[alone, known], (feature, [a, k])| [alone + feature * a, known + feature * k])
}

/// Tells each track of the company it has in its frame: of how many others, in doubt or not, something speaks for them.
pub fn compare(tracks: &mut [Track]) {
    let weight = |track: &Track| {
        if track.misses > 0 { 0.0 } else { (evidence(track)[0].min(MOST_EVIDENCE) - MOST_EVIDENCE).exp() }
    };
    let all: f64 = tracks.iter().map(weight).sum();
    for track in tracks {
        track.company = (all - weight(track)).max(0.0).ln_1p();
    }
}

/// The probability.
#[must_use]
pub fn probability(track: &Track) -> f64 {
    let [_, known] = evidence(track);
    1.0 / (1.0 + (-known - COMPANY * track.company).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::sky::candidate::{Candidate, Cues};

    fn track(contrast_ln: f32, goes_on: f32) -> Track {
        let cues = Cues { contrast_ln, moving_ln: 1.5, size_ln: 1.5, goes_on, ..Cues::default() };
        Track::start(1, Candidate { cues, area_px: 20.0, ..Candidate::default() })
    }

    #[test]
    fn a_second_aircraft_speaks_little_against_the_first_and_ragged_clouds_much() {
        let score = |others: &[Track]| {
            let mut tracks = vec![track(3.5, 0.0)];
            tracks.extend_from_slice(others);
            compare(&mut tracks);
            probability(&tracks[0])
        };
        let clouds: Vec<Track> = (0..30).map(|_| track(2.5, 1.0)).collect();
        let alone = score(&[]);
        assert!(alone > 0.95, "{alone}");
        let odds = |p: f64| p / (1.0 - p);
        let pair = score(&[track(3.5, 0.0)]);
        assert!(odds(pair) > 0.25 * odds(alone), "{alone} {pair}");
        let crowd = score(&clouds);
        assert!(odds(crowd) < 0.1 * odds(alone), "{alone} {crowd}");
        // Among clouds a second aircraft matters less still.
        let both = [clouds.as_slice(), &[track(3.5, 0.0)]].concat();
        assert!(odds(score(&both)) > 0.7 * odds(crowd), "{crowd} {}", score(&both));
        let mut gone = clouds;
        for track in &mut gone {
            track.misses = 1;
        }
        assert!((score(&gone) - alone).abs() < 1e-12, "what is not seen in the frame is no company");
    }
}
