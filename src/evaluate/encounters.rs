//! Many random encounters through the real identification, solver and tracker, from rendered frames or from simulated blobs: is the
//! intruder seen in time, and what is the risk with the system over that without?
//!
//! A [`Lookout`] is one encounter, frame by frame, up to the alert or to the closest approach. What came of it is an [`Outcome`]:
//! ranges at which the intruder was seen, posed and tracked, the alert against the last moment for a turn
//! ([`latest_turn`](crate::encounter::latest_turn)), and how near the two come when the own aircraft flies that turn to the side that its
//! own estimate shows. Outcomes in the order of their numbers make [`Figures`], the same to the last digit on any number of
//! threads.
//!
//! Encounters are conditional ones: two aircraft that would pass within a given distance. So the risk ratio holds for such traffic,
//! and no rate per flight hour follows from it. An aid to evaluate cameras and detectors with; no certified function.

mod alarm;
mod figures;
mod lookout;
mod outcome;
mod plots;
mod quantiles;
mod risk;
mod study;

pub use alarm::{Alarm, Alert};
pub use figures::{Bin, Figures};
pub use lookout::{Look, Lookout};
pub use outcome::{Moment, Outcome, Stage, Verdict};
pub use plots::pictures;
pub use quantiles::Quantiles;
pub use risk::RiskRatio;
pub use study::{EncounterStudy, EncounterStudyError, MAX_FRAMES, Sensing};

#[cfg(test)]
mod tests;
