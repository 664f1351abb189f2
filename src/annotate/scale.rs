//! How large things are drawn on a frame of a given height.

use super::text::Lettering;

/// Sizes of what is drawn, px.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    /// Width of a line.
    pub line_px: f64,
    /// Half the size of a mark, and the least radius of a ring.
    pub mark_px: f64,
    /// Least length of an axis that is seen from the side.
    pub axis_px: f64,
    /// Letters of the headlines.
    pub headline: Lettering,
    /// Letters of the markers' names.
    pub names: Lettering,
    /// Letters of what matters less.
    pub remarks: Lettering,
}

impl Scale {
    /// The sizes for a frame of this height, px: the same share of it for every frame, as far as that is legible.
    pub fn of(frame_height: u32) -> Self {
        let height = f64::from(frame_height);
        Self {
            line_px: (height / 400.0).max(1.2),
            mark_px: (height / 120.0).max(3.0),
            axis_px: height / 16.0,
            headline: Lettering::of_height((height / 36.0).max(10.0)),
            names: Lettering::of_height((height / 50.0).max(10.0)),
            remarks: Lettering::of_height(height / 60.0),
        }
    }
}
