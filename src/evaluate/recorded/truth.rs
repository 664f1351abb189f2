//! What is known of a recorded frame.

use crate::camera::Pixel;
use crate::geometry::CameraFromTarget;
use crate::target::Target;

/// What is known of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// One for each target looked for, in their order.
    pub targets: Vec<TargetTruth>,
    /// What a detector ought to report, where that is known: an empty list says that there is nothing. Without it the visible
    /// markers are what ought to be reported, if they are known.
    pub boxes: Option<Vec<BoxTruth>>,
}

/// What is known of a target in a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetTruth {
    /// Whether it is there.
    pub presence: Presence,
    /// Where it is, if that is known.
    pub camera_from_target: Option<CameraFromTarget>,
    /// What is known of its markers, in the target's order, if that is known.
    pub markers: Option<Vec<MarkerTruth>>,
}

/// Whether a target is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// It is not in the frame.
    Absent,
    /// It is, but shows its back, so that its markers cannot be seen.
    TurnedAway,
    /// It is, and shows its markers.
    Seen,
}

/// What is known of a marker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MarkerTruth {
    /// Nothing, or it is not in the frame: nothing is to be reported.
    Unseen,
    /// It is covered, perhaps not wholly: a report at this place is neither right nor wrong.
    Hidden(Pixel),
    /// It is seen, and this is the centroid of its light.
    Visible(Pixel),
}

/// A thing in the frame by its box.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxTruth {
    /// Upper left corner, px.
    pub corner_px: [f64; 2],
    /// Width and height, px.
    pub size_px: [f64; 2],
    /// What it is, in the words of the detector where it has one for it.
    pub class: Option<String>,
}

impl BoxTruth {
    /// Its middle.
    #[must_use]
    pub fn middle(&self) -> Pixel {
        Pixel::new(self.corner_px[0] + 0.5 * self.size_px[0], self.corner_px[1] + 0.5 * self.size_px[1])
    }

    /// Whether a place lies in it, grown by so many px to all sides.
    #[must_use]
    pub fn holds(&self, place: &Pixel, growth_px: f64) -> bool {
        let from_middle = place - self.middle();
        (0..2).all(|axis| from_middle[axis].abs() <= 0.5 * self.size_px[axis] + growth_px)
    }
}

impl TargetTruth {
    /// Markers that are seen with where they are.
    pub fn visible(&self) -> impl Iterator<Item = (usize, Pixel)> {
        let markers = self.markers.iter().flatten().enumerate();
        markers.filter_map(|(index, marker)| match marker {
            MarkerTruth::Visible(pixel) => Some((index, *pixel)),
            MarkerTruth::Unseen | MarkerTruth::Hidden(_) => None,
        })
    }

    /// Whether a pose can be asked for: it shows its markers, and not fewer than a target must have.
    #[must_use]
    pub fn is_solvable(&self) -> bool {
        self.presence == Presence::Seen && (self.markers.is_none() || self.visible().count() >= Target::MIN_MARKERS)
    }

    /// Whether all that a detector of markers ought to report of it is known.
    pub(super) const fn tells_markers(&self) -> bool {
        self.markers.is_some() || !matches!(self.presence, Presence::Seen)
    }
}
