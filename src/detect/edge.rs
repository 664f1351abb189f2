//! The seed's edge detector (its sections 3.1.1 and 3.2.2): markerless, for a thing against the sky.
//!
//! Colour to gray; median; Sobel's gradient; threshold; 8-connected components; those of small area are outliers; the mean
//! position of what is left is where something is. [`EdgeOptions::THESIS`] is the seed's, step for step, exact where the seed is
//! and failing where it fails. [`Persistence`] is its filter over frames.
//!
//! Where the text leaves a doubt:
//!
//! - It lists gray, median, Sobel, components in this order; its listing of the component function has the median (9 rows,
//!   10 columns) and no Sobel. The text's order counts, the listing's numbers do.
//! - The listing compares an 8-bit picture with 0.2, which every pixel but black passes: meant is 0.2 of full scale.
//! - It looks for areas above 210 and then forgets the result: meant is to keep those. They are those of `bwarea`.
//! - Its `medfilt2` takes what lies beyond the border as black, so corners of a bright picture are edges, too small to count. But
//!   of 10 columns the window has half beyond the last: the whole right border of a bright picture is an edge, and from some
//!   hundred rows on it counts. That false alarm is the seed's; the defaults do not have it.
//! - A window of 10 columns has no middle: it moves everything half a pixel to the left. The seed does not correct that, and
//!   the preset does not; `sigma_px` includes it.

mod blobs;
mod fused;
mod persistence;
mod sieve;

use super::gray::{self, Gray, Plane};
use super::median::{self, Border, Window};
use super::sobel::{self, Bits};
use super::thesis::outline_sigma_px;
use super::{Centroid, Detection, bounds_in_frame, in_frame};
use crate::frame::{Frame, Region};

pub use blobs::{Blob, blobs};
use fused::Walk;
pub use persistence::{Persistence, PersistenceOptions};
use sieve::Sieve;

/// What counts as an edge, and as something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeOptions {
    /// Colour to gray.
    pub gray: Gray,
    /// The median's window.
    pub window: Window,
    /// What the median sees beyond the picture.
    pub border: Border,
    /// Magnitude of the gradient above which a pixel is an edge, of full scale.
    pub threshold_ratio: f64,
    /// Components of this area or less are outliers, px.
    pub min_area_px: f64,
    /// Most centroids returned, the largest.
    pub max_centroids: usize,
}

impl EdgeOptions {
    /// The seed's, its numbers those of its listing. Its gray is one of three that it does not choose between; luminosity is what
    /// it calls more sophisticated. The seed has no limit of centroids.
    pub const THESIS: Self = Self {
        gray: Gray::Luminosity,
        window: Window::THESIS,
        border: Border::Black,
        threshold_ratio: 0.2,
        min_area_px: 210.0,
        max_centroids: 1024,
    };
}

impl Default for EdgeOptions {
    /// The same steps with numbers for what is far away, and so small: little smoothing, and a border that is no edge.
    fn default() -> Self {
        Self {
            gray: Gray::Luminosity,
            window: Window::SMALL,
            border: Border::Nearest,
            threshold_ratio: 0.2,
            min_area_px: 10.0,
            max_centroids: 64,
        }
    }
}

/// What remains of a silhouette's uncertainty when it is large: its edge is blurred by the median, and light falls from a side.
const FLOOR_SIGMA_PX: f64 = 0.3;

/// What the middle of an outline is beside that of the thing, of its size: it is no mean of what it surrounds, and parts of it are not seen. Fitted
/// to rendered aircraft of 2 to 60 px, some in patches of all grays: the mean square of errors over sigma is 1.2 with the seed's numbers and
/// 1.7 with the defaults, in nine of ten cases far less, and far more where half of a thing is as bright as the sky.
const OUTLINE_SHARE: f64 = 0.05;

/// Finds what has edges, frame after frame, in the same memory.
#[derive(Default)]
pub struct Finder {
    walk: Walk,
    gray: Plane,
    medians: median::Filter,
    sobel: sobel::Rows,
    edges: Bits,
    joining: blobs::Joining,
    sieve: Sieve,
}

impl Finder {
    /// What is in `region`, the largest first. Edges do not tell what they belong to, so every score is 1.
    #[must_use]
    pub fn detect(&mut self, frame: &Frame, region: Region, options: &EdgeOptions) -> Detection {
        let Self { walk, gray, medians, sobel, edges, joining, sieve } = self;
        if options.window == Window::SMALL {
            walk.edges(frame, region, options, edges);
        } else {
            gray::take(frame, region, options.gray, gray);
            sobel.edges(medians.median(gray, options.window, options.border), options.threshold_ratio, edges);
        }
        sieve.begin(options);
        blobs::each(joining, edges, |blob| sieve.take(blob));
        sieve.detection(region, options)
    }
}

/// The outlier filter: what is large enough, and what was refused.
#[must_use]
pub fn sifted(blobs: Vec<Blob>, region: Region, options: &EdgeOptions) -> Detection {
    let mut sieve = Sieve::default();
    sieve.begin(options);
    for blob in blobs {
        sieve.take(blob);
    }
    sieve.detection(region, options)
}

fn centroid(blob: &Blob, region: Region, window: Window) -> Centroid {
    let (x, y) = blob.mean_position();
    let area_px = blob.area_px();
    let shift_px = if window.columns().is_multiple_of(2) || window.rows().is_multiple_of(2) { 0.5 } else { 0.0 };
    let size_px = f64::from(blob.bounds.width * blob.bounds.height).sqrt();
    let parts = [outline_sigma_px(area_px), FLOOR_SIGMA_PX, shift_px, OUTLINE_SHARE * size_px];
    Centroid {
        pixel: in_frame(region, x, y),
        sigma_px: parts.into_iter().fold(0.0, f64::hypot),
        area_px,
        bounds: bounds_in_frame(region, blob.bounds),
        score: 1.0,
        class: None,
        track_id: None,
    }
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::detect::Refusal;
    use crate::frame::{Coding, Pixels};
    use crate::random;

    /// A dark disc in a bright sky, its rim smooth as a lens has it, with noise of three levels.
    fn disc(u: f64, v: f64, radius: f64, rng: &mut impl rand::Rng) -> Frame {
        let samples = (0..120 * 160)
            .map(|index| {
                let (x, y) = (f64::from(index % 160), f64::from(index / 160));
                let share = (radius + 0.5 - (x - u).hypot(y - v)).clamp(0.0, 1.0);
                let noise: f64 = StandardNormal.sample(rng);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a gray level")]
                let level = (180.0 - 120.0 * share + 3.0 * noise).round() as u8;
                level
            })
            .collect();
        Frame::checked(160, 120, Pixels::Luma(samples), Coding::LOSSLESS).expect("a frame")
    }

    fn detect(frame: &Frame, region: Region, options: &EdgeOptions) -> Detection {
        Finder::default().detect(frame, region, options)
    }

    #[test]
    fn a_silhouette_is_found_within_its_deviation() {
        let mut rng = random::named("edge discs");
        for options in [EdgeOptions::THESIS, EdgeOptions::default()] {
            for index in 0..20_u32 {
                let (u, v) = (70.0 + f64::from(index) * 0.73, 60.0 - f64::from(index) * 0.41);
                let frame = disc(u, v, 14.0 + f64::from(index % 5), &mut rng);
                let detection = detect(&frame, frame.full(), &options);
                // The seed's right border is one more.
                let is_border = |c: &Centroid| c.bounds.x + c.bounds.width == frame.width();
                let (border, found): (Vec<Centroid>, Vec<Centroid>) =
                    detection.centroids.iter().copied().partition(is_border);
                assert_eq!(border.len(), usize::from(options == EdgeOptions::THESIS), "{options:?} {index}");
                let [centroid] = found[..] else { panic!("{options:?} {index}: {detection:?}") };
                let error = (centroid.pixel.x - u).hypot(centroid.pixel.y - v);
                assert!(error < 3.0 * centroid.sigma_px, "{options:?} {index}: {error} px, {centroid:?}");
            }
        }
    }

    #[test]
    fn areas_of_the_limit_are_outliers_and_the_largest_come_first() {
        let blobs_of = |sizes: &[u32]| {
            let (width, stride) = (640, 10);
            let mut words = vec![0; stride * sizes.len() * 2];
            for (row, size) in sizes.iter().enumerate() {
                for x in 0..*size as usize {
                    words[2 * row * stride + x / 64] |= 1 << (x % 64);
                }
            }
            blobs(&Bits { width, height: sizes.len() * 2, words })
        };
        let region = Region { x: 5, y: 7, width: 640, height: 8 };
        let found =
            sifted(blobs_of(&[211, 210, 400, 300]), region, &EdgeOptions { max_centroids: 2, ..EdgeOptions::THESIS });
        let areas: Vec<f64> = found.centroids.iter().map(|centroid| centroid.area_px).collect();
        assert_eq!(areas, [400.0, 300.0]);
        assert_eq!((found.centroids[0].pixel.x, found.centroids[0].pixel.y), (5.0 + 199.5, 7.0 + 4.0));
        let refused: Vec<_> = found.refused.iter().map(|refused| (refused.area_px, refused.reason)).collect();
        assert_eq!(refused, [(211.0, Refusal::Crowded), (210.0, Refusal::TooSmall)]);
    }

    #[test]
    fn a_region_gives_positions_on_the_whole_frame() {
        let frame = disc(100.0, 70.0, 15.0, &mut random::named("edge region"));
        let region = Region { x: 70, y: 40, width: 60, height: 60 };
        let found = detect(&frame, region, &EdgeOptions::default());
        assert_eq!(found.centroids.len(), 1, "{found:?}");
        assert!((found.centroids[0].pixel.x - 100.0).hypot(found.centroids[0].pixel.y - 70.0) < 0.5, "{found:?}");
    }

    #[test]
    fn an_even_sky_is_empty_and_its_dark_border_is_the_seeds_alone() {
        let frame = Frame::checked(64, 48, Pixels::Luma(vec![200; 64 * 48]), Coding::LOSSLESS).expect("a frame");
        assert_eq!(detect(&frame, frame.full(), &EdgeOptions::default()), Detection::default());
        let seeds = detect(&frame, frame.full(), &EdgeOptions::THESIS);
        // The corners on the left, and the right border with those that it joins; of so few rows it is too small.
        assert_eq!((seeds.centroids.len(), seeds.refused.len()), (0, 3), "{seeds:?}");
    }
}
