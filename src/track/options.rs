//! How tracks are kept, and why so.

use std::time::Duration;

use thiserror::Error;

/// How tracks are kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackOptions {
    /// White acceleration of the target against the camera, m/s^2 per root hertz. Over one second the velocity wanders by this
    /// many m/s. The default is that of two small aircraft that turn and brake gently; too small a value makes tracks lag and
    /// call themselves too good, too large a one only makes them noisier.
    pub acceleration_mps2_per_rthz: f64,
    /// White angular acceleration, rad/s^2 per root hertz: the default allows the rocking of a small aircraft in gusts.
    pub angular_acceleration_radps2_per_rthz: f64,
    /// Standard deviation of a new target's velocity per axis, m/s: two aircraft of 20 m/s each head on are within two of them.
    pub speed_sigma_mps: f64,
    /// Standard deviation of a new target's angular velocity per axis, rad/s: a brisk roll.
    pub turn_rate_sigma_radps: f64,
    /// What is further away than this many deviations of a normal variable (as a quantile of chi-square) is something else.
    /// 3.72 refuses one right answer in ten thousand.
    pub gate_z: f64,
    /// Factor on the variances of poses whose covariance is not reliable. On simulated flights the squared error of tracks comes
    /// to 1.06 to 1.26 of what they say with 1, to 0.87 to 0.98 with 2, to 0.75 to 0.93 with 4.
    pub unreliable_variance_factor: f64,
    /// Most hypotheses per track: both mirror images, each before and after a jump.
    pub max_branches: usize,
    /// Hypotheses less probable than this are given up. It lies so low that one misleading frame ends none.
    pub min_branch_probability: f64,
    /// An answer does not hold the right minimum at all with this probability: it leaves out those below 1e-4.
    pub missed_minimum_probability: f64,
    /// The attitude is another one than all hypotheses say, in any frame, with this probability: the way back when all of them
    /// are wrong.
    pub jump_probability: f64,
    /// A track is confirmed when it was seen this often ...
    pub confirm_hits: u32,
    /// ... within this many frames, at most 32; before, clutter that looks like a target is as likely as a target.
    pub confirm_frames: u32,
    /// A track not seen for longer is lost: unseen, two seconds of flight can lead anywhere.
    pub max_coast: Duration,
    /// After a longer gap between frames all tracks are lost and everything starts anew.
    pub max_gap: Duration,
    /// A track whose position deviates by more than this share of its range is lost: it says nothing any more.
    pub max_position_sigma_ratio: f64,
    /// Most tracks at a time; further answers start none.
    pub max_tracks: usize,
    /// Every so many frames the whole frame is searched, so that new targets are found within half a second or so. 1 always
    /// searches all.
    pub full_search_every: u32,
    /// The region of interest holds the target within this many deviations of its predicted pose.
    pub region_sigmas: f64,
    /// Margin around it, px: for the blur and the rim of the markers.
    pub region_margin_px: f64,
    /// A region larger than this share of the frame saves nothing, so the whole frame is searched.
    pub max_region_ratio: f64,
}

impl Default for TrackOptions {
    fn default() -> Self {
        Self {
            acceleration_mps2_per_rthz: 2.0,
            angular_acceleration_radps2_per_rthz: 1.0,
            speed_sigma_mps: 20.0,
            turn_rate_sigma_radps: 2.0,
            gate_z: 3.72,
            unreliable_variance_factor: 2.0,
            max_branches: 4,
            min_branch_probability: 1e-6,
            missed_minimum_probability: 1e-4,
            jump_probability: 1e-6,
            confirm_hits: 3,
            confirm_frames: 5,
            max_coast: Duration::from_secs(2),
            max_gap: Duration::from_secs(2),
            max_position_sigma_ratio: 0.5,
            max_tracks: 16,
            full_search_every: 10,
            region_sigmas: 4.0,
            region_margin_px: 8.0,
            max_region_ratio: 0.6,
        }
    }
}

impl TrackOptions {
    /// The options, if every one of them makes sense.
    ///
    /// # Errors
    /// [`TrackError::Option`] names the first that does not.
    pub fn checked(self) -> Result<Self, TrackError> {
        let within = [
            ("acceleration_mps2_per_rthz", self.acceleration_mps2_per_rthz, 1e-6, 1e4),
            ("angular_acceleration_radps2_per_rthz", self.angular_acceleration_radps2_per_rthz, 1e-6, 1e4),
            ("speed_sigma_mps", self.speed_sigma_mps, 1e-6, 1e4),
            ("turn_rate_sigma_radps", self.turn_rate_sigma_radps, 1e-6, 1e3),
            ("gate_z", self.gate_z, 0.0, 10.0),
            ("unreliable_variance_factor", self.unreliable_variance_factor, 1.0, 1e4),
            ("max_branches", self.max_branches as f64, 1.0, 16.0),
            ("min_branch_probability", self.min_branch_probability, 1e-30, 0.1),
            ("missed_minimum_probability", self.missed_minimum_probability, 1e-30, 0.5),
            ("jump_probability", self.jump_probability, 1e-30, 0.5),
            ("confirm_hits", self.confirm_hits.into(), 1.0, self.confirm_frames.into()),
            ("confirm_frames", self.confirm_frames.into(), 1.0, 32.0),
            ("max_coast", self.max_coast.as_secs_f64(), 0.0, 60.0),
            ("max_gap", self.max_gap.as_secs_f64(), 1e-3, 60.0),
            ("max_position_sigma_ratio", self.max_position_sigma_ratio, 1e-6, 1e3),
            ("max_tracks", self.max_tracks as f64, 1.0, 256.0),
            ("full_search_every", self.full_search_every.into(), 1.0, f64::from(u32::MAX)),
            ("region_sigmas", self.region_sigmas, 1.0, 100.0),
            ("region_margin_px", self.region_margin_px, 0.0, 1e4),
            ("max_region_ratio", self.max_region_ratio, 0.0, 1.0),
        ];
        match within.into_iter().find(|(_, value, least, most)| !(value >= least && value <= most)) {
            Some((name, value, least, most)) => Err(TrackError::Option { name, value, least, most }),
            None => Ok(self),
        }
    }
}

/// Why a step or a tracker is refused.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum TrackError {
    /// A frame that is not younger than the last one. The tracks are as they were.
    #[error("the frame's stamp {stamp_s:.6} s is not after that of the last one, {last_s:.6} s")]
    StampNotAfter {
        /// The frame's stamp.
        stamp_s: f64,
        /// That of the last frame.
        last_s: f64,
    },
    /// An option out of its range.
    #[error("{name} = {value}: {least} to {most} is accepted")]
    Option {
        /// Its name.
        name: &'static str,
        /// Its value, spans in seconds.
        value: f64,
        /// The least that is accepted.
        least: f64,
        /// The most.
        most: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_accepted_and_nonsense_is_named() {
        assert!(TrackOptions::default().checked().is_ok());
        let refused = |options: TrackOptions| match options.checked() {
            Err(TrackError::Option { name, .. }) => name,
            other => panic!("{other:?}"),
        };
        assert_eq!(refused(TrackOptions { gate_z: f64::NAN, ..TrackOptions::default() }), "gate_z");
        assert_eq!(refused(TrackOptions { confirm_hits: 9, ..TrackOptions::default() }), "confirm_hits");
        assert_eq!(refused(TrackOptions { max_branches: 0, ..TrackOptions::default() }), "max_branches");
    }
}
