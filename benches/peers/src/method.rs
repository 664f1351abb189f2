//! A method, and what it gave.

use std::collections::BTreeMap;

use skypose::geometry::CameraFromTarget;

use crate::study::{Study, Task};

/// A way to solve a task in this process.
pub struct Method {
    pub name: &'static str,
    pub takes: fn(&Study) -> bool,
    /// The pose that it puts first.
    pub solve: fn(&Task) -> Option<CameraFromTarget>,
}

/// What a method gave in a study.
pub struct Results {
    /// To each task.
    pub answers: Vec<Option<CameraFromTarget>>,
    /// Median over the tasks of each task's median over the rounds.
    pub time_us: f64,
}

/// By study, then by method.
pub type All = BTreeMap<String, BTreeMap<String, Results>>;

/// Studies that a method may take.
pub mod takes {
    use crate::study::{Purpose, Study};

    pub const fn any(_: &Study) -> bool {
        true
    }

    pub const fn clean(study: &Study) -> bool {
        !study.has_outliers()
    }

    pub const fn planar(study: &Study) -> bool {
        study.is_planar() && clean(study)
    }

    /// The minimal problem: its time does not depend on further points, and without them nothing says which of its
    /// solutions is the pose.
    pub const fn smallest(study: &Study) -> bool {
        matches!(study.purpose, Purpose::Speed(6))
    }
}

/// The middle one; not a number where there is none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
