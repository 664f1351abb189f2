//! Where exactly a thing is that is to be reported, how large it is, and how well that is known.
//!
//! To be found, a thing needs no outline: peaks and squares tell that there is something. What is reported is the middle of its silhouette:
//! a plane is laid through the sky around it, and pixels count by how far they deviate from it, a pixel half covered half as much.

use super::candidate::Candidate;
use super::level::{Level, STEPS};
use crate::detect::components::{Connectivity, Labeling, Run, area, bounds};
use crate::detect::ground::{Sample, shortest_half, slope};
use crate::detect::single;
use crate::frame::Region;

/// The silhouette of a thing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measured {
    /// The middle of its silhouette, px of the frame.
    pub place: [f64; 2],
    /// Its standard deviation per axis, px.
    pub sigma_px: f64,
    /// Its area, px.
    pub area_px: f64,
    /// Left, top, right, bottom, px of the frame; the last two are one past.
    pub bounds: [f64; 4],
}

/// What of the thing's surroundings is looked at on each side, of its length, and more, px of the level.
const MARGIN: f64 = 0.25;
const MORE: f64 = 6.0;
/// How far from its bounds the sky begins, px of the level: so far reaches blur.
const BLUR: usize = 2;
/// What is larger is looked at in a coarser level, px.
const LONGEST: f64 = 64.0;
/// Deviations of the sky's noise by which a pixel of the thing deviates at least, and the part of what the farthest pixel deviates.
const LEAST_DEVIATIONS: f32 = 5.0;
const LEAST_SHARE: f32 = 0.08;
/// What hangs together belongs to it if it is as large as this part of its largest part.
const LEAST_PART: f64 = 0.03;
/// Samples of the sky at least and, about, at most, and the least noise that is believed, gray levels.
const LEAST_SKY: usize = 24;
const ENOUGH_SKY: usize = 400;
const LEAST_NOISE: f32 = 0.05;
/// What has fewer pixels than this is rim all over.
const ALL_RIM: usize = 12;
/// A binomial of 3 by 3 leaves so much of a pixel's own noise.
const SMOOTH_NOISE: f64 = 0.375;
/// What pixels and blur leave, px of the level.
const FLOOR: f64 = 0.05;
/// What light and shade do to its middle unseen, of its size times the part of its height that is not told from sky, to the power of 3/2: of an
/// aircraft in patches that much may be missing, little in a clear sky and most of it among clouds. And how much more they do than is seen of
/// them. Both are fitted to rendered aircraft, half of them in patches of all grays.
const SHADE: f64 = 0.5;
const MORE_THAN_SEEN: f64 = 1.5;

/// Measures thing after thing in the same memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Measurer {
    sky: Vec<Sample>,
    values: Vec<f32>,
    /// Deviations from the sky, gray levels.
    deviations: Vec<f32>,
    tracer: Tracer,
}

impl Measurer {
    /// `None` where it is not alone: its surroundings are no sky, or it goes on beyond them.
    pub(super) fn measure(&mut self, levels: &[Level], candidate: &Candidate) -> Option<Measured> {
        let [left, top, right, bottom] = candidate.bounds;
        let length = (right - left).max(bottom - top);
        let index = (0..levels.len()).find(|index| length * (1.0 + 2.0 * MARGIN) / scale(*index) <= LONGEST)?;
        let patch = self.patch(&levels[index], candidate.bounds.map(|along| along / scale(index)))?;
        let silhouette = self.tracer.trace(&patch, &self.deviations)?;
        let in_frame = |along: f64| (along + 0.5) * scale(index) - 0.5;
        let [x, y, width, height] = silhouette.bounds.map(|along| f64::from(along) * scale(index));
        Some(Measured {
            place: silhouette.place.map(in_frame),
            sigma_px: silhouette.sigma_px * scale(index),
            area_px: silhouette.area_px * scale(index).powi(2),
            bounds: [x, y, x + width, y + height],
        })
    }
}

fn scale(index: usize) -> f64 {
    (0..index).fold(1.0, |scale, _| 2.0 * scale)
}

/// A part of a level with a thing in it, and sky around that.
struct Patch {
    /// Its place in the level.
    window: Region,
    /// Where it ends though the level goes on: left, top, right, bottom.
    goes_on: [bool; 4],
    /// The thing's bounds in it.
    bounds: Region,
    /// The deviation of its noise, gray levels.
    noise: f32,
}

/// What is measured, in px of the level.
struct Silhouette {
    place: [f64; 2],
    sigma_px: f64,
    area_px: f64,
    /// Left, top, width, height.
    bounds: [u32; 4],
}

impl Measurer {
    /// Takes what the surroundings of bounds deviate from the sky in them. `None` where there is none.
    fn patch(&mut self, level: &Level, [left, top, right, bottom]: [f64; 4]) -> Option<Patch> {
        let margin = MARGIN * (right - left).max(bottom - top) + MORE;
        let region = |grown: f64| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the level")]
            let clamped = |along: f64, side: usize| along.clamp(0.0, side as f64) as u32;
            let (x, y) = (clamped(left - grown, level.width), clamped(top - grown, level.height));
            let (end, last) =
                (clamped((right + grown).ceil(), level.width), clamped((bottom + grown).ceil(), level.height));
            Region { x, y, width: end - x, height: last - y }
        };
        let (window, inner, own) = (region(margin), region(BLUR as f64), region(0.0));
        let end = |region: &Region| [region.x + region.width, region.y + region.height];
        let middle = [window.x as f32 + 0.5 * window.width as f32, window.y as f32 + 0.5 * window.height as f32];
        let samples = (window.y..end(&window)[1]).flat_map(|y| {
            (window.x..end(&window)[0]).map(move |x| {
                let value = f32::from(level.smooth[y as usize * level.width + x as usize]) / STEPS;
                ([x, y], Sample { x: x as f32 - middle[0], y: y as f32 - middle[1], value })
            })
        });
        let is_sky = |[x, y]: [u32; 2]| x < inner.x || y < inner.y || x >= end(&inner)[0] || y >= end(&inner)[1];
        let count = (window.area() - inner.area()).max(1);
        let sky = samples.clone().filter(|(at, _)| is_sky(*at)).step_by(count.div_ceil(ENOUGH_SKY));
        self.sky.clear();
        self.sky.extend(sky.map(|(_, sample)| sample));
        if self.sky.len() < LEAST_SKY {
            return None;
        }
        let slope = slope(&self.sky, &mut self.values)?.map(single);
        let over = |sample: &Sample| sample.value - slope.x * sample.x - slope.y * sample.y;
        self.values.clear();
        self.values.extend(self.sky.iter().map(over));
        let (ground, noise) = shortest_half(&mut self.values)?;
        self.deviations.clear();
        self.deviations.extend(samples.map(|(_, sample)| over(&sample) - ground));
        Some(Patch {
            window,
            goes_on: [
                window.x > 0,
                window.y > 0,
                (end(&window)[0] as usize) < level.width,
                (end(&window)[1] as usize) < level.height,
            ],
            bounds: Region { x: own.x - window.x, y: own.y - window.y, ..own },
            noise: noise.max(LEAST_NOISE),
        })
    }
}

/// Traces silhouette after silhouette in the same memory.
#[derive(Clone, Debug, Default)]
struct Tracer {
    mask: Vec<u8>,
    labeling: Labeling,
    sizes: Vec<f32>,
    covered: Vec<bool>,
}

impl Tracer {
    /// `None` for what is no more than noise, or goes on beyond the patch.
    fn trace(&mut self, patch: &Patch, deviations: &[f32]) -> Option<Silhouette> {
        let own = patch.bounds;
        let whole = Region { x: 0, y: 0, ..patch.window };
        let size = |x: u32, y: u32| deviations[(y * whole.width + x) as usize].abs();
        let inside = || (own.y..own.y + own.height).flat_map(|y| (own.x..own.x + own.width).map(move |x| (x, y)));
        let most = inside().map(|(x, y)| size(x, y)).fold(0.0, f32::max);
        let limit = (LEAST_SHARE * most).max(LEAST_DEVIATIONS * patch.noise);
        self.mask.clear();
        self.mask.extend(deviations.iter().map(|deviation| u8::from(deviation.abs() > limit)));
        let components = self.labeling.of(&self.mask, whole.width as usize, whole, 1, Connectivity::Eight);
        // What else is in the patch lies beside its bounds.
        let its = || components.iter().filter(|part| overlap(bounds(part), own));
        let largest = its().map(area).max()? as f64;
        let parts = || its().filter(|part| area(part) as f64 >= LEAST_PART * largest);
        let ends = parts().map(bounds).reduce(joined)?;
        let reaches =
            [ends.x == 0, ends.y == 0, ends.x + ends.width == whole.width, ends.y + ends.height == whole.height];
        if reaches.iter().zip(patch.goes_on).any(|(reaches, goes_on)| *reaches && goes_on) {
            return None;
        }
        // A quarter of its pixels deviate by more; the others are rim, each counting by its part of that, or in the shade.
        let runs = || parts().flatten();
        self.sizes.clear();
        self.sizes.extend(runs().flat_map(|run| (run.start..run.end).map(|x| size(x, run.y))));
        let rank = if self.sizes.len() < ALL_RIM { self.sizes.len() - 1 } else { self.sizes.len() / 4 * 3 };
        let height = *self.sizes.select_nth_unstable_by(rank, f32::total_cmp).1;
        let [mut middle, mut of_light, mut of_mask] = [Middle::default(); 3];
        let (mut squares, mut pixels) = (0.0, 0.0);
        for (x, y) in rim_and_all(runs(), whole, &mut self.covered) {
            let size = size(x, y);
            let share = f64::from((size / height).min(1.0));
            middle.add(share, x, y);
            of_light.add(f64::from(size), x, y);
            of_mask.add(f64::from(u8::from(size > limit)), x, y);
            squares += share * f64::from(x * x + y * y);
            pixels += 1.0;
        }
        let area_px = middle.weight;
        let [u, v] = middle.place();
        let spread = 0.5 * (squares / area_px - u * u - v * v).max(1.0 / 12.0);
        let noise = f64::from(patch.noise / height) / SMOOTH_NOISE * f64::sqrt(pixels * spread) / area_px;
        let seen = [of_light, of_mask].map(|other| MORE_THAN_SEEN * (other.place()[0] - u).hypot(other.place()[1] - v));
        let unseen = f64::from((limit / height).min(1.0));
        let window = patch.window;
        Some(Silhouette {
            place: [u + f64::from(window.x), v + f64::from(window.y)],
            sigma_px: [noise, seen[0], seen[1], SHADE * unseen.powf(1.5) * area_px.sqrt()]
                .into_iter()
                .fold(FLOOR, f64::hypot),
            area_px,
            bounds: [ends.x + window.x, ends.y + window.y, ends.width, ends.height],
        })
    }
}

/// The pixels of some runs and those next to them, row by row: rims reach further than what deviates much.
fn rim_and_all<'a>(
    runs: impl Iterator<Item = &'a Run>,
    Region { width, height, .. }: Region,
    covered: &'a mut Vec<bool>,
) -> impl Iterator<Item = (u32, u32)> + 'a {
    covered.clear();
    covered.resize(width as usize * height as usize, false);
    for run in runs {
        for y in run.y.saturating_sub(1)..(run.y + 2).min(height) {
            let [first, end] = [run.start.saturating_sub(1), (run.end + 1).min(width)];
            covered[(y * width + first) as usize..(y * width + end) as usize].fill(true);
        }
    }
    let all = (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)));
    all.zip(&*covered).filter(|(_, covered)| **covered).map(|(at, _)| at)
}

/// A weighted mean of places.
#[derive(Clone, Copy, Default)]
struct Middle {
    weight: f64,
    sums: [f64; 2],
}

impl Middle {
    fn add(&mut self, weight: f64, x: u32, y: u32) {
        self.weight += weight;
        self.sums = [self.sums[0] + weight * f64::from(x), self.sums[1] + weight * f64::from(y)];
    }

    fn place(&self) -> [f64; 2] {
        self.sums.map(|sum| sum / self.weight)
    }
}

fn overlap(a: Region, b: Region) -> bool {
    let along = |a: u32, a_side: u32, b: u32, b_side: u32| a < b + b_side && b < a + a_side;
    along(a.x, a.width, b.x, b.width) && along(a.y, a.height, b.y, b.height)
}

fn joined(a: Region, b: Region) -> Region {
    let (x, y) = (a.x.min(b.x), a.y.min(b.y));
    let [end, last] = [(a.x + a.width).max(b.x + b.width), (a.y + a.height).max(b.y + b.height)];
    Region { x, y, width: end - x, height: last - y }
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::random;

    const WIDTH: usize = 160;
    const HEIGHT: usize = 120;

    /// A sky that brightens downwards, with noise of a level and a half, and what `height` adds to it, each pixel the mean of 6 x 6 places.
    fn levels(height: impl Fn(f64, f64) -> f64, rng: &mut impl rand::Rng) -> Vec<Level> {
        let samples: Vec<u8> = (0..WIDTH * HEIGHT)
            .map(|index| {
                let (x, y) = ((index % WIDTH) as f64, (index / WIDTH) as f64);
                let places =
                    (0..36).map(|k| (f64::from(k % 6) / 6.0 - 5.0 / 12.0, f64::from(k / 6) / 6.0 - 5.0 / 12.0));
                let thing = places.map(|(dx, dy)| height(x + dx, y + dy)).sum::<f64>() / 36.0;
                let noise: f64 = StandardNormal.sample(rng);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a gray level")]
                let level = (150.0 + 0.2 * y + thing + 1.5 * noise).round() as u8;
                level
            })
            .collect();
        let mut levels = vec![Level::default(); 3];
        levels[0].take_frame(&samples, WIDTH, HEIGHT);
        for index in 1..3 {
            let (below, above) = levels.split_at_mut(index);
            above[0].take_half(&below[index - 1]);
        }
        levels
    }

    fn measure(levels: &[Level], candidate: &Candidate) -> Option<Measured> {
        Measurer::default().measure(levels, candidate)
    }

    fn seen(bounds: [f64; 4]) -> Candidate {
        Candidate { bounds, ..Candidate::default() }
    }

    /// An aircraft's cross: a fuselage of 26 by 4 px and, off its middle, a wing of 5 by 20; its area and its middle.
    const CROSS: ([f64; 2], f64) = ([(104.0 * 13.0 + 80.0 * 8.5) / 184.0, 2.0], 184.0);

    fn is_of_cross(x: f64, y: f64) -> bool {
        let fuselage = (0.0..26.0).contains(&x) && (0.0..4.0).contains(&y);
        fuselage || (6.0..11.0).contains(&x) && (-8.0..12.0).contains(&y)
    }

    #[test]
    fn the_middle_of_a_silhouette_is_found_within_its_deviation() {
        let mut rng = random::named("measured silhouettes");
        for index in 0..20 {
            let (x, y) = (50.0 + 0.37 * f64::from(index), 40.0 + 0.73 * f64::from(index));
            let height = if index % 2 == 0 { -60.0 } else { 40.0 };
            let levels = levels(|u, v| if is_of_cross(u - x, v - y) { height } else { 0.0 }, &mut rng);
            // Bounds of squares are wider than the thing.
            let found = measure(&levels, &seen([x - 7.0, y - 15.0, x + 33.0, y + 19.0])).expect("it stands alone");
            let (middle, area) = CROSS;
            let error = (found.place[0] - x - middle[0]).hypot(found.place[1] - y - middle[1]);
            assert!(error < 2.5 * found.sigma_px && error < 0.15, "{index}: {error} px, {found:?}");
            assert!((found.area_px / area - 1.0).abs() < 0.2, "{index}: {found:?}");
            let [left, top, right, bottom] = found.bounds;
            let off = [left - x, top - (y - 8.0), right - (x + 26.0), bottom - (y + 12.0)];
            // What is seen of its rim through blur is a pixel or two more.
            assert!(off.iter().all(|off| off.abs() < 2.5), "{index}: {off:?}");
        }
    }

    #[test]
    fn shade_that_hides_a_part_widens_what_is_said_of_its_place() {
        let mut rng = random::named("shaded silhouettes");
        let mut of = |fore: f64| {
            let height = |u: f64, v: f64| match (is_of_cross(u - 60.0, v - 50.0), u > 71.0) {
                (true, true) => fore,
                (true, false) => -60.0,
                _ => 0.0,
            };
            measure(&levels(height, &mut rng), &seen([53.0, 38.0, 93.0, 66.0])).expect("it stands alone")
        };
        let (even, shaded) = (of(-60.0), of(-22.0));
        assert!(shaded.sigma_px > 1.5 * even.sigma_px, "{even:?} {shaded:?}");
        let error = (shaded.place[0] - 60.0 - CROSS.0[0]).hypot(shaded.place[1] - 50.0 - CROSS.0[1]);
        assert!(error < 2.5 * shaded.sigma_px, "{error} {shaded:?}");
    }

    #[test]
    fn what_may_be_hidden_in_the_texture_of_a_sky_widens_what_is_said_of_its_place() {
        let mut rng = random::named("silhouettes before clouds");
        let mut of = |fore: f64, clouds: f64| {
            let height = |u: f64, v: f64| {
                let cloud = clouds * ((u / 2.3).sin() * (v / 3.1).sin() + (u / 5.7 + v / 4.1).sin());
                let cross = if u > 71.0 { fore } else { -60.0 };
                if is_of_cross(u - 60.0, v - 50.0) { cross } else { cloud }
            };
            let found = measure(&levels(height, &mut rng), &seen([53.0, 38.0, 93.0, 66.0])).expect("it stands alone");
            let error = (found.place[0] - 60.0 - CROSS.0[0]).hypot(found.place[1] - 50.0 - CROSS.0[1]);
            assert!(error < 2.5 * found.sigma_px, "{error} px: {found:?}");
            found.sigma_px
        };
        // Of a fore part that hardly deviates there is nothing to be seen before clouds.
        let (clear, cloudy, hidden) = (of(-60.0, 0.0), of(-60.0, 6.0), of(-8.0, 6.0));
        assert!(cloudy > 2.0 * clear && hidden > 2.0 * clear, "{clear} {cloudy} {hidden} px");
    }

    #[test]
    fn another_thing_nearby_moves_nothing_and_what_goes_on_has_no_middle() {
        let mut rng = random::named("silhouettes and others");
        let cross = |u: f64, v: f64| if is_of_cross(u - 60.0, v - 50.0) { -60.0 } else { 0.0 };
        let beside = |u: f64, v: f64| if (u - 96.0).hypot(v - 50.0) < 4.0 { -90.0 } else { cross(u, v) };
        let bounds = seen([57.0, 40.0, 89.0, 64.0]);
        let found = measure(&levels(beside, &mut rng), &bounds).expect("apart");
        let error = (found.place[0] - 60.0 - CROSS.0[0]).hypot(found.place[1] - 50.0 - CROSS.0[1]);
        assert!(error < 0.3, "{error} px: {found:?}");
        let mast = |u: f64, v: f64| if (66.0..71.0).contains(&u) && v > 42.0 { -60.0 } else { 0.0 };
        assert_eq!(measure(&levels(mast, &mut rng), &bounds), None);
        assert_eq!(measure(&levels(|_, _| 0.0, &mut rng), &bounds), None, "nothing but noise");
    }
}
