//! What somebody sees, in the axes in which it was measured.

use crate::geometry::UncertainTransform;
use crate::geometry::space::Space;

/// A pose between two spaces, told by who stands in the one or in the other. It stays in the axes of who measured it, as there its errors
/// are normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seen<To: Space, From: Space> {
    /// From `To`.
    Along(UncertainTransform<To, From>),
    /// From `From`.
    Back(UncertainTransform<From, To>),
}

impl<To: Space, From: Space> Seen<To, From> {
    /// As if it were seen from `To`.
    #[must_use]
    pub fn along(&self) -> UncertainTransform<To, From> {
        match self {
            Self::Along(seen) => *seen,
            Self::Back(seen) => seen.inverse(),
        }
    }
}

/// A pose that a view holds possible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate<To: Space, From: Space> {
    /// The pose.
    pub seen: Seen<To, From>,
    /// That this one and none of the view's others is right.
    pub probability: f64,
}

/// What one or several cameras say together.
#[derive(Clone, Debug, PartialEq)]
pub struct View<To: Space, From: Space> {
    /// The cameras that say it.
    pub cameras: Vec<String>,
    /// All poses that they hold possible, their probabilities with a sum of one.
    pub candidates: Vec<Candidate<To, From>>,
}
