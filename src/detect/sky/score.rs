//! The probability that a track is something that flies: a logistic function of what its late frames told.
//!
//! The weights are those of a logistic regression on 24 labelled clips (Drone-detection-dataset, F. Svanström 2020), one for each cue.
//! More cues (the track's age, presence and speed) fit those clips better and others worse.
//! A cue says how things are in the world, and its sign can be checked by thought: what stands out from its clutter and moves against
//! the scene is more likely to fly, what goes on beyond its outline, has a foot or stands under other things is less likely to. Mostly one
//! thing flies in a frame, so what is seen beside a better one is less likely to: that is the [company](compare). A second aircraft that
//! is as plain as the first loses some of its odds by it and stays far above one half.

use super::track::Track;

/// Cues of a track by itself.
pub const CUES: usize = 12;

/// Weights in the order of [`features`]: of a track by itself, and of one whose company is known.
const WEIGHTS: [[f64; 2]; CUES] = [
    [1.27, 0.93],   // contrast over clutter
    [0.52, 0.71],   // moves against the scene
    [-0.57, -0.94], // size
    [-0.23, -0.46], // goes on around
    [-1.06, -0.12], // restless around
    [-0.28, -0.15], // upright
    [-1.73, -2.40], // under other things
    [-2.32, -2.02], // part of something
    [-1.17, -1.04], // has a foot
    [0.72, 0.73],   // has come a way of its own
    [0.31, -0.03],  // quieter on one side
    [-4.47, -3.03], // cut by the border
];

/// What is added to both.
const CONSTANTS: [f64; 2] = [-3.17, -0.93];

/// Weight of the company.
const COMPANY: f64 = -0.50;

/// Evidence of which more, or less, is no other company.
const EVIDENCE: [f64; 2] = [-4.0, 6.0];

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

/// Tells each track of the company it has in its frame: what speaks for the other that most speaks for.
pub fn compare(tracks: &mut [Track]) {
    let [least, most] = EVIDENCE;
    // The greatest and the one after it: of one that is the greatest itself, that is the company.
    let mut greatest = [least; 2];
    for track in tracks.iter().filter(|track| track.misses == 0) {
        let evidence = evidence(track)[0];
        if evidence > greatest[0] {
            greatest = [evidence, greatest[0]];
        } else {
            greatest[1] = greatest[1].max(evidence);
        }
    }
    for track in tracks {
        let is_greatest = track.misses == 0 && evidence(track)[0] >= greatest[0];
        track.company = greatest[usize::from(is_greatest)].min(most);
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

    fn odds(tracks: &[Track]) -> f64 {
        let mut tracks = tracks.to_vec();
        compare(&mut tracks);
        let p = probability(&tracks[0]);
        p / (1.0 - p)
    }

    #[test]
    fn what_is_seen_beside_something_better_is_less_likely_to_fly() {
        let (plain, cloud) = (track(4.5, 0.0), track(2.5, 0.5));
        let alone = odds(std::slice::from_ref(&cloud));
        let beside = odds(&[cloud.clone(), plain.clone()]);
        assert!(beside < 0.1 * alone, "{alone} {beside}");
        let mut gone = plain.clone();
        gone.misses = 1;
        assert!(
            (odds(&[cloud.clone(), gone]) - alone).abs() < 1e-9 * alone,
            "what is not seen in the frame is no company"
        );
        // Of many only the best counts, wherever it stands among them.
        let many = [vec![cloud.clone(); 5], vec![plain.clone()], vec![cloud.clone(); 5]].concat();
        assert!((odds(&many) - beside).abs() < 1e-9 * beside);
        // Clouds are little of an argument against it.
        let crowd = [vec![plain.clone()], vec![cloud; 30]].concat();
        assert!(odds(&crowd) > 0.1 * odds(&[plain]), "{}", odds(&crowd));
    }

    #[test]
    fn a_second_aircraft_stays_likely_beside_the_first() {
        let plain = track(4.5, 0.0);
        let [alone, pair] = [odds(std::slice::from_ref(&plain)), odds(&[plain.clone(), plain.clone()])];
        assert!(alone > 20.0 && pair > 3.0 && pair < alone, "{alone} {pair}");
    }
}
