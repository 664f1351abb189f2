//! Bird or aircraft, as far as shape and motion tell.

use super::track::Track;
use crate::detect::Class;

/// The class of a track; none where it is seen too little to tell.
#[must_use]
pub fn class(track: &Track) -> Option<Class> {
    let _ = track;
    None
}
