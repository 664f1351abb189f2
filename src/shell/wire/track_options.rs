//! How tracks are kept, as a setting and in a stream.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;

use super::from_value;
use crate::shell::fault::Fault;
use crate::track::{TrackError, TrackOptions};

/// How tracks are kept. What is left out in a stream is as the settings of the service have it.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = TrackOptions)]
pub struct TrackOptionsWire {
    /// White acceleration of the target against the camera, m/s^2 per root hertz: over one second its velocity wanders by this many
    /// m/s.
    pub acceleration_mps2_per_rthz: f64,
    /// White angular acceleration, rad/s^2 per root hertz.
    pub angular_acceleration_radps2_per_rthz: f64,
    /// Standard deviation of a new target's velocity per axis.
    pub speed_sigma_mps: f64,
    /// Standard deviation of a new target's angular velocity per axis.
    pub turn_rate_sigma_radps: f64,
    /// What is further away than this many deviations of a normal variable is something else.
    pub gate_z: f64,
    /// Factor on the variances of poses whose covariance is not reliable.
    pub unreliable_variance_factor: f64,
    /// Most motions that are held possible for one track.
    pub max_branches: usize,
    /// A motion less probable than this is given up.
    pub min_branch_probability: f64,
    /// An answer does not hold the right pose at all with this probability.
    pub missed_minimum_probability: f64,
    /// The attitude is none of those held possible, in any frame, with this probability.
    pub jump_probability: f64,
    /// A track is believed when it was seen this often ...
    pub confirm_hits: u32,
    /// ... within this many frames, at most 32.
    pub confirm_frames: u32,
    /// A track not seen for longer is lost.
    pub max_coast_s: f64,
    /// After a longer gap between frames all tracks are lost.
    pub max_gap_s: f64,
    /// A track whose position deviates by more than this share of its range is lost.
    pub max_position_sigma_ratio: f64,
    /// Most tracks of each target at a time.
    pub max_tracks: usize,
    /// With `search` `predicted`: every so many frames the whole frame is searched.
    pub full_search_every: u32,
    /// With `search` `predicted`: the part that is searched holds the target within this many deviations of its predicted pose.
    pub region_sigmas: f64,
    /// With `search` `predicted`: margin around that.
    pub region_margin_px: f64,
    /// With `search` `predicted`: where the part would be a larger share of the frame, all of it is searched.
    pub max_region_ratio: f64,
}

impl Default for TrackOptionsWire {
    fn default() -> Self {
        let core = TrackOptions::default();
        Self {
            acceleration_mps2_per_rthz: core.acceleration_mps2_per_rthz,
            angular_acceleration_radps2_per_rthz: core.angular_acceleration_radps2_per_rthz,
            speed_sigma_mps: core.speed_sigma_mps,
            turn_rate_sigma_radps: core.turn_rate_sigma_radps,
            gate_z: core.gate_z,
            unreliable_variance_factor: core.unreliable_variance_factor,
            max_branches: core.max_branches,
            min_branch_probability: core.min_branch_probability,
            missed_minimum_probability: core.missed_minimum_probability,
            jump_probability: core.jump_probability,
            confirm_hits: core.confirm_hits,
            confirm_frames: core.confirm_frames,
            max_coast_s: core.max_coast.as_secs_f64(),
            max_gap_s: core.max_gap.as_secs_f64(),
            max_position_sigma_ratio: core.max_position_sigma_ratio,
            max_tracks: core.max_tracks,
            full_search_every: core.full_search_every,
            region_sigmas: core.region_sigmas,
            region_margin_px: core.region_margin_px,
            max_region_ratio: core.max_region_ratio,
        }
    }
}

impl TrackOptionsWire {
    /// These, with what a stream says differently.
    ///
    /// # Errors
    /// [`FaultKind::Senseless`](crate::shell::fault::FaultKind::Senseless) for what there is not, or is of another kind.
    pub fn with(&self, changes: &Map<String, Value>) -> Result<Self, Fault> {
        let mut merged = serde_json::to_value(self).unwrap_or_default();
        if let Value::Object(merged) = &mut merged {
            merged.extend(changes.iter().map(|(name, value)| (name.clone(), value.clone())));
        }
        from_value(merged)
    }

    /// For the core.
    ///
    /// # Errors
    /// Names the option that makes no sense, and what would.
    pub fn options(&self) -> Result<TrackOptions, Fault> {
        // What is no span of time is refused by its number before.
        let span = |name: &str, seconds: f64| {
            Duration::try_from_secs_f64(seconds)
                .map_err(|_| Fault::senseless(format!("/{name}"), format!("{name} = {seconds}: 0 to 60 is accepted")))
        };
        let options = TrackOptions {
            acceleration_mps2_per_rthz: self.acceleration_mps2_per_rthz,
            angular_acceleration_radps2_per_rthz: self.angular_acceleration_radps2_per_rthz,
            speed_sigma_mps: self.speed_sigma_mps,
            turn_rate_sigma_radps: self.turn_rate_sigma_radps,
            gate_z: self.gate_z,
            unreliable_variance_factor: self.unreliable_variance_factor,
            max_branches: self.max_branches,
            min_branch_probability: self.min_branch_probability,
            missed_minimum_probability: self.missed_minimum_probability,
            jump_probability: self.jump_probability,
            confirm_hits: self.confirm_hits,
            confirm_frames: self.confirm_frames,
            max_coast: span("max_coast_s", self.max_coast_s)?,
            max_gap: span("max_gap_s", self.max_gap_s)?,
            max_position_sigma_ratio: self.max_position_sigma_ratio,
            max_tracks: self.max_tracks,
            full_search_every: self.full_search_every,
            region_sigmas: self.region_sigmas,
            region_margin_px: self.region_margin_px,
            max_region_ratio: self.max_region_ratio,
        };
        options.checked().map_err(|error| {
            let pointer = match error {
                TrackError::Option { name: name @ ("max_coast" | "max_gap"), .. } => format!("/{name}_s"),
                TrackError::Option { name, .. } => format!("/{name}"),
                TrackError::StampNotAfter { .. } => String::new(),
            };
            Fault::senseless(pointer, error.to_string())
        })
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn changed(changes: &Value) -> Result<TrackOptions, Fault> {
        TrackOptionsWire::default().with(changes.as_object().expect("an object"))?.options()
    }

    #[test]
    fn the_defaults_are_those_of_the_core_and_what_is_said_goes_over_them() {
        assert_eq!(changed(&json!({})), Ok(TrackOptions::default()));
        let wanted = TrackOptions {
            confirm_hits: 2,
            max_coast: Duration::from_millis(500),
            acceleration_mps2_per_rthz: 5.0,
            ..TrackOptions::default()
        };
        let changes = json!({"confirm_hits": 2, "max_coast_s": 0.5, "acceleration_mps2_per_rthz": 5});
        assert_eq!(changed(&changes), Ok(wanted));
    }

    #[test]
    fn what_makes_no_sense_is_named() {
        for (changes, pointer) in [
            (json!({"gate_z": 11}), "/gate_z"),
            (json!({"confirm_hits": 9}), "/confirm_hits"),
            (json!({"confirm_hits": -1}), "/confirm_hits"),
            (json!({"max_coast_s": -1}), "/max_coast_s"),
            (json!({"max_gap_s": 61}), "/max_gap_s"),
            (json!({"max_coast_s": "long"}), "/max_coast_s"),
            (json!({"max_tracks": 2.5}), "/max_tracks"),
            (json!({"maximum": 1}), "/maximum"),
        ] {
            let fault = changed(&changes).expect_err(pointer);
            assert_eq!(fault.pointer.as_deref(), Some(pointer), "{fault}");
        }
    }
}
