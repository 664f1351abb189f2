//! Who waits for a calibration: is told what share of it is done, and asked whether it is still wanted.

use std::fmt;

/// Who waits. Asked before every step of a fit, told between these.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    is_wanted: &'a dyn Fn() -> bool,
    tell: &'a dyn Fn(f64),
    /// What is told of as 0, and as 1.
    shares: [f64; 2],
}

impl<'a> Watch<'a> {
    /// Somebody who says whether it is still wanted, and hears which share is done.
    #[must_use]
    pub const fn new(is_wanted: &'a dyn Fn() -> bool, tell: &'a dyn Fn(f64)) -> Self {
        Self { is_wanted, tell, shares: [0.0, 1.0] }
    }

    /// Nobody in particular: it is computed to the end.
    #[must_use]
    pub const fn nobody() -> Self {
        Self::new(&|| true, &|_| {})
    }

    /// Whether to go on.
    #[must_use]
    pub fn is_wanted(&self) -> bool {
        (self.is_wanted)()
    }

    /// Tells that this share is done.
    pub fn done(&self, share: f64) {
        let [from, to] = self.shares;
        (self.tell)(from + (to - from) * share);
    }

    /// The same for what is done between these shares.
    #[must_use]
    pub fn part(&self, from: f64, to: f64) -> Self {
        let whole = |share: f64| self.shares[0] + (self.shares[1] - self.shares[0]) * share;
        Self { shares: [whole(from), whole(to)], ..*self }
    }

    /// The same without being told.
    #[must_use]
    pub const fn silent(&self) -> Self {
        Self { tell: &|_| {}, ..*self }
    }
}

impl fmt::Debug for Watch<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Watch").field("shares", &self.shares).finish_non_exhaustive()
    }
}
