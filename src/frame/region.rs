//! A rectangle of whole pixels.

use super::FrameError;

/// A region of interest: pixels `x .. x + width`, `y .. y + height`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// Left column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Region {
    /// The region, if it has pixels and lies on a frame of this size.
    ///
    /// # Errors
    /// [`FrameError::EmptyRegion`] or [`FrameError::RegionOutside`].
    pub const fn checked(self, frame_width: u32, frame_height: u32) -> Result<Self, FrameError> {
        if self.width == 0 || self.height == 0 {
            return Err(FrameError::EmptyRegion { region: self });
        }
        if self.x as u64 + self.width as u64 > frame_width as u64
            || self.y as u64 + self.height as u64 > frame_height as u64
        {
            return Err(FrameError::RegionOutside { region: self, frame: [frame_width, frame_height] });
        }
        Ok(self)
    }

    /// Number of pixels.
    #[must_use]
    pub const fn area(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

impl std::fmt::Display for Region {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "[{}, {}, {}, {}]", self.x, self.y, self.width, self.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_region_must_have_pixels_and_lie_on_the_frame() {
        let region = |x, y, width, height| Region { x, y, width, height }.checked(640, 480);
        assert!(region(0, 0, 640, 480).is_ok());
        assert!(region(639, 479, 1, 1).is_ok());
        assert!(matches!(region(10, 10, 0, 5), Err(FrameError::EmptyRegion { .. })));
        assert!(matches!(region(600, 0, 41, 10), Err(FrameError::RegionOutside { .. })));
        assert!(matches!(region(u32::MAX, 0, u32::MAX, 10), Err(FrameError::RegionOutside { .. })));
    }
}
