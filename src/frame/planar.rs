//! Planes of Y, Cb and Cr, as video decoders give them.

use super::{Coding, Frame, FrameError, Limits, Pixels, Siting};

/// Which luma samples share a chroma sample, and where that one lies among them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Planar {
    /// One plane of luma, no colour.
    Mono,
    /// Every pixel has its own colour.
    Full,
    /// Two pixels of a row share their colour, which lies on the left one (4:2:2).
    Pairs,
    /// 2 x 2 pixels share their colour, which lies between the rows (4:2:0).
    Squares {
        /// On the left column, as in MPEG-2, MPEG-4 and H.264; otherwise between the columns, as in JPEG and MPEG-1.
        on_left: bool,
    },
}

impl Planar {
    /// Columns and rows of a chroma plane; zero where there is none.
    const fn chroma_size(self, width: u32, height: u32) -> (u32, u32) {
        match self {
            Self::Mono => (0, 0),
            Self::Full => (width, height),
            Self::Pairs => (width.div_ceil(2), height),
            Self::Squares { .. } => (width.div_ceil(2), height.div_ceil(2)),
        }
    }

    /// Where colours are that are shared.
    pub(super) const fn siting(self) -> Siting {
        match self {
            Self::Mono | Self::Full | Self::Pairs => Siting::ON_PIXEL,
            Self::Squares { on_left } => Siting { between_columns: !on_left, between_rows: true },
        }
    }

    /// Bytes of a frame of this size.
    #[must_use]
    pub const fn byte_count(self, width: u32, height: u32) -> u64 {
        let (columns, rows) = self.chroma_size(width, height);
        width as u64 * height as u64 + 2 * columns as u64 * rows as u64
    }
}

impl Frame {
    /// A frame from planes one after the other, full range, BT.601. Shared colour is interpolated to each pixel from where it
    /// was sampled, so that a coloured blob stays where it is.
    ///
    /// # Errors
    /// A size of zero or over the limit; bytes that are not exactly as many as the size asks for.
    pub fn from_planes(
        planar: Planar,
        width: u32,
        height: u32,
        bytes: &[u8],
        limits: Limits,
    ) -> Result<Self, FrameError> {
        limits.check_size(width, height)?;
        let (expected, actual) = (planar.byte_count(width, height), bytes.len() as u64);
        if actual != expected {
            return Err(FrameError::RawLength { format: "planar video", width, height, expected, actual });
        }
        let (luma, chroma) = bytes.split_at(width as usize * height as usize);
        let (pixels, coding) = match planar {
            Planar::Mono => (Pixels::Luma(luma.to_vec()), Coding::LOSSLESS),
            Planar::Full => {
                (Pixels::YCbCr(interleaved(planar, width as usize, luma, halves(chroma))), Coding::LOSSLESS)
            }
            Planar::Pairs | Planar::Squares { .. } => {
                let pixels = interleaved(planar, width as usize, luma, halves(chroma));
                (Pixels::YCbCr(pixels), Coding::shared_chroma(planar.siting()))
            }
        };
        Self::checked(width, height, pixels, coding)
    }
}

/// Cb and Cr.
fn halves(chroma: &[u8]) -> [&[u8]; 2] {
    let (cb, cr) = chroma.split_at(chroma.len() / 2);
    [cb, cr]
}

/// The pixels of planes of luma, Cb and Cr, whose sizes have been checked.
pub(super) fn interleaved(planar: Planar, width: usize, luma: &[u8], planes: [&[u8]; 2]) -> Vec<u8> {
    let columns = match planar {
        Planar::Mono | Planar::Full => width,
        Planar::Pairs | Planar::Squares { .. } => width.div_ceil(2),
    };
    let rows = planes[0].len() / columns;
    let mut out = Vec::with_capacity(luma.len() * 3);
    let mut blend = vec![0_u16; columns];
    let (mut cb, mut cr) = (vec![0; width], vec![0; width]);
    for (y, row) in luma.chunks_exact(width).enumerate() {
        // The row of chroma that is nearest and the next nearest: three parts and one.
        let (near, far) = match planar {
            Planar::Squares { .. } if y % 2 == 0 => (y / 2, (y / 2).saturating_sub(1)),
            Planar::Squares { .. } => (y / 2, (y / 2 + 1).min(rows - 1)),
            Planar::Mono | Planar::Full | Planar::Pairs => (y, y),
        };
        for (plane, spread) in [(planes[0], &mut cb), (planes[1], &mut cr)] {
            let (near, far) = (&plane[near * columns..][..columns], &plane[far * columns..][..columns]);
            for ((sum, &near), &far) in blend.iter_mut().zip(near).zip(far) {
                *sum = 3 * u16::from(near) + u16::from(far);
            }
            match planar {
                Planar::Squares { on_left: false } => spread_centred(&blend, spread),
                Planar::Pairs | Planar::Squares { on_left: true } => spread_from_left(&blend, spread),
                Planar::Mono | Planar::Full => {
                    spread.iter_mut().zip(&blend).for_each(|(to, &sum)| *to = share(sum, 4));
                }
            }
        }
        out.extend(row.iter().zip(&cb).zip(&cr).flat_map(|((&y, &cb), &cr)| [y, cb, cr]));
    }
    out
}

/// A weighted sum to its mean, rounded.
#[expect(clippy::cast_possible_truncation, reason = "the weights add up to `weights`")]
const fn share(sum: u16, weights: u16) -> u8 {
    ((sum + weights / 2) / weights) as u8
}

/// Sums of weight 4 at every second pixel, the first included.
fn spread_from_left(sums: &[u16], row: &mut [u8]) {
    let next = sums.iter().skip(1).chain(sums.last());
    for ((pair, &here), &next) in row.chunks_mut(2).zip(sums).zip(next) {
        pair[0] = share(here, 4);
        if let Some(right) = pair.get_mut(1) {
            *right = share(here + next, 8);
        }
    }
}

/// Sums of weight 4 in the middle of every two pixels.
fn spread_centred(sums: &[u16], row: &mut [u8]) {
    let before = sums.first().into_iter().chain(sums);
    let next = sums.iter().skip(1).chain(sums.last());
    for (((pair, &here), &before), &next) in row.chunks_mut(2).zip(sums).zip(before).zip(next) {
        pair[0] = share(3 * here + before, 16);
        if let Some(right) = pair.get_mut(1) {
            *right = share(3 * here + next, 16);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Planar; 5] = [
        Planar::Mono,
        Planar::Full,
        Planar::Pairs,
        Planar::Squares { on_left: true },
        Planar::Squares { on_left: false },
    ];

    fn ycbcr(planar: Planar, width: u32, height: u32, bytes: &[u8]) -> Vec<u8> {
        let frame = Frame::from_planes(planar, width, height, bytes, Limits::default()).expect("a good frame");
        match frame.pixels() {
            Pixels::YCbCr(samples) => samples.clone(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn one_colour_stays_that_colour_whatever_the_format_and_however_odd_the_size() {
        for planar in ALL {
            for (width, height) in [(1, 1), (2, 2), (7, 5), (8, 3)] {
                let area = width as usize * height as usize;
                let count = usize::try_from(planar.byte_count(width, height)).expect("small");
                let half = (count - area) / 2;
                let bytes = [vec![90; area], vec![60; half], vec![255; half]].concat();
                let frame = Frame::from_planes(planar, width, height, &bytes, Limits::default()).expect("a good frame");
                match frame.pixels() {
                    Pixels::Luma(samples) => assert_eq!(*samples, vec![90; area]),
                    Pixels::YCbCr(samples) => assert_eq!(*samples, [90, 60, 255].repeat(area), "{planar:?}"),
                    Pixels::Rgb(_) => panic!("not RGB"),
                }
            }
        }
    }

    /// Chroma planes that are linear in the position of their samples are linear in the pixels, away from the border.
    #[test]
    fn shared_colour_is_interpolated_from_where_it_was_sampled() {
        let (width, height) = (16_u8, 12_u8);
        for planar in &ALL[2..] {
            let (columns, rows) = planar.chroma_size(width.into(), height.into());
            let (across, down) = match planar {
                Planar::Pairs => (0.0, 0.0),
                Planar::Squares { on_left: true } => (0.0, 0.5),
                _ => (0.5, 0.5),
            };
            let step = f64::from(u32::from(height) / rows);
            let value = |x: f64, y: f64| 40.0 + 8.0 * x + 4.0 * y;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "40 to 220")]
            let plane: Vec<u8> = (0..rows)
                .flat_map(|r| (0..columns).map(move |c| (f64::from(c), f64::from(r))))
                .map(|(c, r)| value(2.0 * c + across, step * r + down) as u8)
                .collect();
            let luma = vec![0; usize::from(width) * usize::from(height)];
            let samples = ycbcr(*planar, width.into(), height.into(), &[luma, plane.clone(), plane].concat());
            for (at, pixel) in samples.chunks_exact(3).enumerate() {
                let (x, y) = (at % usize::from(width), at / usize::from(width));
                if (1..usize::from(width) - 2).contains(&x) && (1..usize::from(height) - 2).contains(&y) {
                    let wanted = value(x as f64, y as f64);
                    for found in &pixel[1..] {
                        assert!(
                            (f64::from(*found) - wanted).abs() <= 0.75,
                            "{planar:?} at {x}, {y}: {pixel:?}, {wanted}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn a_wrong_number_of_bytes_is_refused_with_both_numbers() {
        let planar = Planar::Squares { on_left: true };
        let refused = Frame::from_planes(planar, 5, 3, &[0; 26], Limits::default()).expect_err("26 bytes");
        assert_eq!(refused.to_string(), "planar video of 5 x 3 px is 27 bytes, not 26");
        let limits = Limits { max_pixels: 10 };
        assert!(matches!(Frame::from_planes(planar, 5, 3, &[], limits), Err(FrameError::TooManyPixels { .. })));
        let none = Frame::from_planes(Planar::Mono, 0, 3, &[], Limits::default());
        assert!(matches!(none, Err(FrameError::ZeroSize { .. })));
    }
}
