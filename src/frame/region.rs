//! A rectangle of whole pixels.

use super::{Frame, FrameError, Pixels};

/// A region of interest: pixels `x .. x + width`, `y .. y + height`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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

    /// The smallest region that holds both.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        let (x, y) = (self.x.min(other.x), self.y.min(other.y));
        let end = |region: Self| (region.x.saturating_add(region.width), region.y.saturating_add(region.height));
        let ((right, bottom), (other_right, other_bottom)) = (end(self), end(other));
        Self { x, y, width: right.max(other_right) - x, height: bottom.max(other_bottom) - y }
    }

    /// What both have in common; `None` if that is nothing.
    #[must_use]
    pub fn common(self, other: Self) -> Option<Self> {
        let (x, y) = (self.x.max(other.x), self.y.max(other.y));
        let right = self.x.saturating_add(self.width).min(other.x.saturating_add(other.width));
        let bottom = self.y.saturating_add(self.height).min(other.y.saturating_add(other.height));
        (right > x && bottom > y).then(|| Self { x, y, width: right - x, height: bottom - y })
    }

    /// The region with `margin_px` more to every side, as far as a frame of this size goes.
    #[must_use]
    pub fn grown(self, margin_px: u32, frame_width: u32, frame_height: u32) -> Self {
        let side = |start: u32, length: u32, end: u32| {
            let from = start.saturating_sub(margin_px);
            (from, start.saturating_add(length).saturating_add(margin_px).min(end).saturating_sub(from))
        };
        let (x, width) = side(self.x, self.width, frame_width);
        let (y, height) = side(self.y, self.height, frame_height);
        Self { x, y, width, height }
    }

    /// Number of pixels.
    #[must_use]
    pub const fn area(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

impl Frame {
    /// The part of the frame that a region shows, as a frame of its own.
    ///
    /// # Errors
    /// As [`Region::checked`].
    pub fn cropped(&self, region: Region) -> Result<Self, FrameError> {
        let region = region.checked(self.width, self.height)?;
        let cut = |samples: &[u8], channels: usize| {
            let (width, left) = (self.width as usize * channels, region.x as usize * channels);
            let rows = samples.chunks_exact(width).skip(region.y as usize).take(region.height as usize);
            rows.flat_map(|row| &row[left..][..region.width as usize * channels]).copied().collect()
        };
        let pixels = match &self.pixels {
            Pixels::Luma(samples) => Pixels::Luma(cut(samples, 1)),
            Pixels::Rgb(samples) => Pixels::Rgb(cut(samples, 3)),
            Pixels::YCbCr(samples) => Pixels::YCbCr(cut(samples, 3)),
        };
        Ok(Self::checked(region.width, region.height, pixels, self.coding)?.stating(self.orientation))
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
    use crate::frame::Coding;

    #[test]
    fn a_cropped_frame_shows_the_region_and_nothing_else() {
        let samples: Vec<u8> = (0..12).collect();
        let gray = Frame::checked(4, 3, Pixels::Luma(samples), Coding::LOSSLESS).expect("a frame");
        let part = gray.cropped(Region { x: 1, y: 1, width: 2, height: 2 }).expect("inside");
        assert_eq!((part.width(), part.height(), part.pixels()), (2, 2, &Pixels::Luma(vec![5, 6, 9, 10])));
        let rgb = Frame::checked(2, 2, Pixels::Rgb((0..12).collect()), Coding::LOSSLESS).expect("a frame");
        let part = rgb.cropped(Region { x: 1, y: 0, width: 1, height: 2 }).expect("inside");
        assert_eq!(part.pixels(), &Pixels::Rgb(vec![3, 4, 5, 9, 10, 11]));
        let outside = rgb.cropped(Region { x: 1, y: 0, width: 2, height: 2 });
        assert!(matches!(outside, Err(FrameError::RegionOutside { .. })));
    }

    #[test]
    fn a_region_grows_as_far_as_the_frame_and_takes_in_another() {
        let region = Region { x: 10, y: 400, width: 20, height: 60 };
        assert_eq!(region.grown(30, 640, 480), Region { x: 0, y: 370, width: 60, height: 110 });
        assert_eq!(region.grown(u32::MAX, 640, 480), Region { x: 0, y: 0, width: 640, height: 480 });
        let other = Region { x: 25, y: 100, width: 50, height: 10 };
        assert_eq!(region.with(other), Region { x: 10, y: 100, width: 65, height: 360 });
        assert_eq!(other.with(region), region.with(other));
    }

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
