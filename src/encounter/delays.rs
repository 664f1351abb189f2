//! What passes between the first sight of an intruder and the first movement of the ailerons.

use super::error::EncounterError;

/// Times that are added to that of the turn, s. Only [`Delays::checked`] makes other ones than none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Delays {
    /// Of detection, track, link and decision.
    each_s: [f64; 4],
}

/// Longest delay that is taken, s: a day.
const MOST_S: f64 = 86_400.0;

impl Delays {
    /// Until the detector has found it, until a track is believed, on the way to who decides and back, and until it is decided.
    ///
    /// # Errors
    /// [`EncounterError::Time`] names the one that is negative or not finite.
    pub fn checked(detection_s: f64, track_s: f64, link_s: f64, decision_s: f64) -> Result<Self, EncounterError> {
        let named =
            [("detection_s", detection_s), ("track_s", track_s), ("link_s", link_s), ("decision_s", decision_s)];
        match named.into_iter().find(|(_, value)| !(0.0..=MOST_S).contains(value)) {
            Some((field, value)) => Err(EncounterError::Time { field, value, max: MOST_S }),
            None => Ok(Self { each_s: [detection_s, track_s, link_s, decision_s] }),
        }
    }

    /// Each by its name.
    #[must_use]
    pub const fn named(&self) -> [(&'static str, f64); 4] {
        let [detection_s, track_s, link_s, decision_s] = self.each_s;
        [("detection", detection_s), ("track", track_s), ("link", link_s), ("decision", decision_s)]
    }

    /// All of them, s.
    #[must_use]
    pub fn total_s(&self) -> f64 {
        self.each_s.iter().sum()
    }
}
