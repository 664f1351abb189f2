//! Median filter with a window of any size, as Matlab's `medfilt2` defines it.
//!
//! Small windows go through a network of minima and maxima over whole stretches of a row (`network`, and `three` for the smallest),
//! large ones through histograms (`histogram`); all agree bit for bit, and the cost of both depends on the window and the number of pixels
//! alone, not on what the picture shows.

mod histogram;
mod network;
pub(super) mod three;

use super::gray::Plane;

/// Rows and columns over which the median is taken. The pixel is the window's middle; of an even side the earlier of the two
/// middles, so an even window reaches one further down or right and moves what it shows by half a pixel up or left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Window {
    rows: usize,
    columns: usize,
}

impl Window {
    /// The seed's: 9 rows, 10 columns.
    pub const THESIS: Self = Self { rows: 9, columns: 10 };
    /// The smallest that has a middle.
    pub const SMALL: Self = Self { rows: 3, columns: 3 };
    /// Longest side.
    pub const MAX_SIDE: usize = 255;

    /// `None` for a side of zero or above [`Self::MAX_SIDE`].
    #[must_use]
    pub const fn checked(rows: usize, columns: usize) -> Option<Self> {
        if rows == 0 || columns == 0 || rows > Self::MAX_SIDE || columns > Self::MAX_SIDE {
            return None;
        }
        Some(Self { rows, columns })
    }

    /// Rows.
    #[must_use]
    pub const fn rows(self) -> usize {
        self.rows
    }

    /// Columns.
    #[must_use]
    pub const fn columns(self) -> usize {
        self.columns
    }

    /// Rows above the pixel and columns before it.
    const fn before(self) -> [usize; 2] {
        [(self.rows - 1) / 2, (self.columns - 1) / 2]
    }

    /// Ranks, from zero, of the samples whose mean is the median: the same twice for an odd number of samples.
    const fn ranks(self) -> [usize; 2] {
        let count = self.rows * self.columns;
        [(count - 1) / 2, count / 2]
    }
}

/// What a window sees beyond the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Border {
    /// Black, as `medfilt2` has it: corners go dark, which shows as an edge.
    Black,
    /// The nearest pixel.
    Nearest,
}

/// The median of each pixel's window; of an even number of samples the mean of the middle two, halves up.
#[must_use]
pub fn median(plane: &Plane, window: Window, border: Border) -> Plane {
    Filter::default().median(plane, window, border).clone()
}

/// Filters pictures, one after the other in the same memory.
#[derive(Default)]
pub struct Filter {
    three: three::Three,
    network: network::Network,
    histograms: histogram::Histograms,
    medians: Plane,
}

impl Filter {
    /// As [`median()`].
    #[must_use]
    pub fn median<'a>(&'a mut self, plane: &'a Plane, window: Window, border: Border) -> &'a Plane {
        if plane.samples.is_empty() || (window.rows, window.columns) == (1, 1) {
            return plane;
        }
        self.medians.resize(plane.width, plane.height);
        let (padded, out) = (Padded { plane, window, border }, &mut *self.medians.samples);
        if window == Window::SMALL {
            self.three.write(&padded, out);
        } else if network::suits(window) {
            self.network.write(&padded, out);
        } else {
            self.histograms.write(&padded, out);
        }
        &self.medians
    }
}

/// A picture with what the window sees around it.
struct Padded<'a> {
    plane: &'a Plane,
    window: Window,
    border: Border,
}

impl Padded<'_> {
    /// Samples of a padded row.
    const fn width(&self) -> usize {
        self.plane.width + self.window.columns - 1
    }

    /// Row `y` of the padded picture, which begins [`Window::before`] above and left of the picture.
    fn write_row(&self, y: usize, out: &mut [u8]) {
        let [above, before] = self.window.before();
        let (width, height) = (self.plane.width, self.plane.height);
        let inside = (above..above + height).contains(&y);
        if !inside && self.border == Border::Black {
            out.fill(0);
            return;
        }
        let start = y.saturating_sub(above).min(height - 1) * width;
        let row = &self.plane.samples[start..start + width];
        let [first, last] = if self.border == Border::Black { [0; 2] } else { [row[0], row[width - 1]] };
        out[..before].fill(first);
        out[before..before + width].copy_from_slice(row);
        out[before + width..].fill(last);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// By the definition: sort what the window sees.
    fn slow_median(plane: &Plane, window: Window, border: Border) -> Plane {
        let at = |y: isize, x: isize| {
            let (last_y, last_x) = (plane.height.cast_signed() - 1, plane.width.cast_signed() - 1);
            let (near_y, near_x) = (y.clamp(0, last_y), x.clamp(0, last_x));
            if border == Border::Black && (near_y, near_x) != (y, x) {
                return 0;
            }
            plane.samples[near_y.cast_unsigned() * plane.width + near_x.cast_unsigned()]
        };
        let mut out = plane.clone();
        for (index, out) in out.samples.iter_mut().enumerate() {
            // Matlab's middle, counted from one, is floor((side + 1) / 2).
            let origin = |place: usize, side: usize| (place + 1).cast_signed() - side.div_ceil(2).cast_signed();
            let y = origin(index / plane.width, window.rows);
            let x = origin(index % plane.width, window.columns);
            let mut seen: Vec<u8> = (y..y + window.rows.cast_signed())
                .flat_map(|y| (x..x + window.columns.cast_signed()).map(move |x| at(y, x)))
                .collect();
            seen.sort_unstable();
            let n = seen.len();
            let middle = if n % 2 == 1 { [seen[n / 2]; 2] } else { [seen[n / 2 - 1], seen[n / 2]] };
            *out = u8::try_from((u16::from(middle[0]) + u16::from(middle[1])).div_ceil(2)).expect("a mean of bytes");
        }
        out
    }

    fn planes() -> impl Strategy<Value = Plane> {
        (1_usize..40, 1_usize..24, prop_oneof![Just(2_u8), Just(255)]).prop_flat_map(|(width, height, most)| {
            proptest::collection::vec(0..=most, width * height).prop_map(move |samples| Plane {
                width,
                height,
                samples,
            })
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        #[test]
        fn networks_and_histograms_give_the_median(
            plane in planes(), rows in 1_usize..13, columns in 1_usize..13, black in any::<bool>()
        ) {
            let window = Window::checked(rows, columns).expect("small");
            let border = if black { Border::Black } else { Border::Nearest };
            let slow = slow_median(&plane, window, border);
            prop_assert_eq!(&median(&plane, window, border), &slow);
            prop_assert_eq!(median(&plane, Window::SMALL, border), slow_median(&plane, Window::SMALL, border));
            let padded = Padded { plane: &plane, window, border };
            let mut out = plane.samples.clone();
            network::Network::default().write(&padded, &mut out);
            prop_assert_eq!(&out, &slow.samples, "network");
            histogram::Histograms::default().write(&padded, &mut out);
            prop_assert_eq!(&out, &slow.samples, "histogram");
        }

        #[test]
        fn large_windows_too(plane in planes(), rows in 1_usize..60, columns in 1_usize..60) {
            let window = Window::checked(rows, columns).expect("small");
            let found = median(&plane, window, Border::Black);
            prop_assert_eq!(found, slow_median(&plane, window, Border::Black));
        }
    }

    #[test]
    fn a_wide_picture_is_the_same_across_stretches() {
        let (width, height) = (1031, 12);
        let mut state = 1_u32;
        let noise = (0..width * height).map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.to_be_bytes()[0]
        });
        let plane = Plane { width, height, samples: noise.collect() };
        for [rows, columns] in [[9, 10], [3, 3], [5, 5], [2, 31], [1, 64]] {
            let window = Window::checked(rows, columns).expect("small");
            assert_eq!(median(&plane, window, Border::Black), slow_median(&plane, window, Border::Black), "{window:?}");
        }
    }

    proptest! {
        #[test]
        fn what_was_filtered_before_leaves_nothing_behind(planes in proptest::collection::vec(planes(), 8)) {
            let mut filter = Filter::default();
            let sides = [[3, 3], [5, 4], [1, 1], [21, 33], [5, 4], [3, 3], [9, 10], [21, 33]];
            for (index, (plane, [rows, columns])) in planes.iter().zip(sides).enumerate() {
                let window = Window::checked(rows, columns).expect("small");
                let border = if index % 3 == 0 { Border::Black } else { Border::Nearest };
                prop_assert_eq!(filter.median(plane, window, border), &slow_median(plane, window, border), "{:?}", window);
            }
        }
    }

    #[test]
    fn the_seeds_example_gives_a_hundred() {
        // Its figure 3.2: 200 among 100, 100, 100, 100, 205, 100, 195, 200.
        let plane = Plane { width: 3, height: 3, samples: vec![100, 100, 100, 100, 200, 205, 100, 195, 200] };
        let window = Window::checked(3, 3).expect("small");
        assert_eq!(median(&plane, window, Border::Black).samples[4], 100);
    }

    #[test]
    fn no_window_without_samples() {
        assert_eq!(Window::checked(0, 3), None);
        assert_eq!(Window::checked(3, 256), None);
    }
}
