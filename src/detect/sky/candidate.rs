//! A place of one frame where something may be, and what speaks for and against it.

/// What one frame tells of a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cues {
    /// Contrast at the peak over the mean of its surroundings, natural logarithm.
    pub contrast_ln: f32,
    /// The same of what moves against the camera's own motion; 0 where that is not known.
    pub moving_ln: f32,
    /// Square root of the area in px of the frame, natural logarithm.
    pub size_ln: f32,
    /// How much goes on beyond its outline in the worst direction, of its contrast.
    pub openness: f32,
    /// How restless the ring around it is, of its contrast.
    pub unrest: f32,
    /// Height over width, natural logarithm: what stands is taller, what flies is wider.
    pub upright_ln: f32,
    /// Contrast above it in the frame, mean, gray levels, natural logarithm of one more.
    pub above_ln: f32,
    /// 1 where it goes on beyond the window in which it was looked at.
    pub goes_on: f32,
    /// Largest contrast right below it, of its own contrast: what stands on the ground has a foot.
    pub foot: f32,
    /// Clutter all around over that on the quietest side, natural logarithm: what stands beside other things may stand in clear sky.
    pub beside_ln: f32,
    /// 1 where it is so near the border of the frame that it may be a part of something.
    pub cut: f32,
}

impl Cues {
    /// Every cue.
    #[must_use]
    pub const fn numbers(&self) -> [f32; 11] {
        [
            self.contrast_ln,
            self.moving_ln,
            self.size_ln,
            self.openness,
            self.unrest,
            self.upright_ln,
            self.above_ln,
            self.goes_on,
            self.foot,
            self.beside_ln,
            self.cut,
        ]
    }

    /// Of every cue.
    #[must_use]
    pub const fn of_numbers(numbers: [f32; 11]) -> Self {
        let [contrast_ln, moving_ln, size_ln, openness, unrest, upright_ln, above_ln, goes_on, foot, beside_ln, cut] =
            numbers;
        Self { contrast_ln, moving_ln, size_ln, openness, unrest, upright_ln, above_ln, goes_on, foot, beside_ln, cut }
    }
}

/// A place of one frame where something may be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Candidate {
    /// Its centre, px of the frame.
    pub place: [f64; 2],
    /// Left, top, right, bottom, px of the frame; the last two are one past.
    pub bounds: [f64; 4],
    /// Area, px of the frame.
    pub area_px: f64,
    /// Whether it is brighter than its background.
    pub is_bright: bool,
    /// What speaks for and against it.
    pub cues: Cues,
}

impl Candidate {
    /// Whether a place lies in its bounds, grown by a fifth and a pixel.
    #[must_use]
    pub fn holds(&self, place: [f64; 2]) -> bool {
        let [left, top, right, bottom] = self.bounds;
        let (margin_x, margin_y) = (0.2 * (right - left) + 1.0, 0.2 * (bottom - top) + 1.0);
        place[0] >= left - margin_x
            && place[0] < right + margin_x
            && place[1] >= top - margin_y
            && place[1] < bottom + margin_y
    }
}
