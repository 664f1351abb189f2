//! What one method said of one case, as a row of a table.

use super::numbers::Numbers;

/// The errors that are summed up: degrees, metres and shares, estimate minus truth. The first six have signs.
pub const ERRORS: [&str; 9] =
    ["roll_deg", "pitch_deg", "yaw_deg", "x_m", "y_m", "z_m", "rotation_deg", "translation_m", "range_ratio"];

/// Place of the angle between the rotations among [`ERRORS`].
pub const ROTATION: usize = 6;
/// Place of the distance between the translations among [`ERRORS`].
pub const TRANSLATION: usize = 7;

/// How a case may end: with a pose, or the contract's reason for none.
pub const OUTCOMES: [&str; 7] = [
    "pose",
    "too_few_points",
    "degenerate_geometry",
    "behind_camera",
    "high_residual",
    "no_consensus",
    "not_identified",
];

/// Names of the columns after `step`, `run`, `method` and `outcome`.
pub const COLUMNS: [&str; 25] = [
    "true_roll_deg",
    "true_pitch_deg",
    "true_yaw_deg",
    "true_x_m",
    "true_y_m",
    "true_z_m",
    "roll_error_deg",
    "pitch_error_deg",
    "yaw_error_deg",
    "x_error_m",
    "y_error_m",
    "z_error_m",
    "rotation_error_deg",
    "translation_error_m",
    "range_error_ratio",
    "is_good",
    "is_flip",
    "over_bound_squared",
    "reprojection_rms_px",
    "probability",
    "poses",
    "best_is_right",
    "covariance_is_reliable",
    "normalized_error_squared",
    "time_us",
];

/// Where the truth begins.
pub(super) const TRUTH: usize = 0;
/// Where the errors begin.
pub(super) const FIRST_ERROR: usize = 6;
/// Where it begins what is told of the pose.
pub(super) const ESTIMATE: usize = 15;
/// Where it begins what the answer says of itself.
pub(super) const CLAIMS: usize = 18;
/// The time taken.
pub(super) const ANSWER: usize = 24;

/// One method on one case.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// At which value of the sweep.
    pub step: u64,
    /// Which case.
    pub run: u64,
    /// Which method of the study.
    pub method: u64,
    /// Place in [`OUTCOMES`].
    pub outcome: u64,
    /// In the order of [`COLUMNS`]; `None` where there is nothing to say.
    pub values: [Option<f64>; COLUMNS.len()],
}

impl Row {
    /// How the case ended.
    #[must_use]
    pub fn outcome_name(&self) -> &'static str {
        usize::try_from(self.outcome).ok().and_then(|outcome| OUTCOMES.get(outcome)).copied().unwrap_or_default()
    }

    /// One of the [`ERRORS`].
    #[must_use]
    pub fn error(&self, which: usize) -> Option<f64> {
        self.values[FIRST_ERROR + which]
    }

    /// Time taken, s.
    #[must_use]
    pub fn time_s(&self) -> Option<f64> {
        self.values[ANSWER].map(|microseconds| microseconds * 1e-6)
    }
}

impl Numbers for Row {
    fn write(&self, to: &mut Vec<f64>) {
        [self.step, self.run, self.method, self.outcome].write(to);
        // A list of bits says which values there are; there are fewer than 53.
        let present = self.values.iter().rev().fold(0_u64, |bits, value| bits << 1 | u64::from(value.is_some()));
        present.write(to);
        to.extend(self.values.iter().flatten());
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let [step, run, method, outcome, present] = <[u64; 5]>::read(from)?;
        let mut values = [None; COLUMNS.len()];
        for (place, value) in values.iter_mut().enumerate() {
            if present >> place & 1 == 1 {
                *value = Some(f64::read(from)?);
            }
        }
        Some(Self { step, run, method, outcome, values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_read_as_they_were_written() {
        let mut values = [None; COLUMNS.len()];
        values[0] = Some(-1.5);
        values[COLUMNS.len() - 1] = Some(0.1 + 0.2);
        let row = Row { step: 3, run: 1 << 40, method: 2, outcome: 4, values };
        let mut numbers = Vec::new();
        row.write(&mut numbers);
        assert_eq!(numbers.len(), 7);
        assert_eq!(Row::read(&mut numbers.iter().copied()), Some(row));
        assert_eq!(Row::read(&mut numbers[..6].iter().copied()), None);
        assert_eq!(ERRORS.len(), ESTIMATE - FIRST_ERROR);
        assert_eq!(
            (COLUMNS[TRUTH], COLUMNS[FIRST_ERROR], COLUMNS[ANSWER]),
            ("true_roll_deg", "roll_error_deg", "time_us")
        );
    }
}
