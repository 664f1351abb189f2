//! What is behind the target: air, clouds, ground, and things that are not the target.

use super::clouds::{Noise, smooth_step};
use super::light::{Light, mixed, of_srgb, scaled};

/// A background. The default is a clear blue sky without anything in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Sky {
    /// Colour at the picture's top, sRGB.
    pub zenith_rgb: [u8; 3],
    /// Colour at the horizon, or at the picture's bottom where there is no ground; sRGB.
    pub horizon_rgb: [u8; 3],
    /// Clouds.
    pub clouds: Option<Clouds>,
    /// The ground.
    pub ground: Option<Ground>,
    /// Things in front of all this and behind the target, the later over the earlier.
    pub distractors: Vec<Distractor>,
}

/// Fair-weather clouds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clouds {
    /// Names their shapes.
    pub seed: u64,
    /// Roughly the share of the sky that they cover, 0 to 1.
    pub cover_ratio: f64,
    /// How far they have moved, `[right, towards the horizon]`, in cloud sizes.
    pub drift: [f64; 2],
}

/// Hilly ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Names its shape.
    pub seed: u64,
    /// Where it begins, as a share of the picture's height from the top.
    pub horizon_ratio: f64,
    /// Colour near by, sRGB; it fades towards the sky's in the distance.
    pub rgb: [u8; 3],
}

/// Outline of a [`Distractor`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A rectangle.
    Rectangle,
    /// An ellipse.
    Ellipse,
}

/// A flat thing of one colour that is not the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distractor {
    /// Its outline.
    pub shape: Shape,
    /// Its middle, `[u, v]` px.
    pub centre_px: [f64; 2],
    /// Half of its width and height before it is turned, px.
    pub half_px: [f64; 2],
    /// Turned clockwise by this, rad.
    pub turn_rad: f64,
    /// Its colour, sRGB.
    pub rgb: [u8; 3],
}

impl Default for Sky {
    fn default() -> Self {
        Self {
            zenith_rgb: [62, 118, 190],
            horizon_rgb: [178, 205, 230],
            clouds: None,
            ground: None,
            distractors: Vec::new(),
        }
    }
}

impl Sky {
    /// One colour everywhere, sRGB.
    #[must_use]
    pub fn plain(rgb: [u8; 3]) -> Self {
        Self { zenith_rgb: rgb, horizon_rgb: rgb, ..Self::default() }
    }

    /// A fair day: some clouds that drift with `drift`, and fields low in the picture.
    #[must_use]
    pub fn fair(seed: u64, drift: [f64; 2]) -> Self {
        Self {
            clouds: Some(Clouds { seed, cover_ratio: 0.35, drift }),
            ground: Some(Ground { seed, horizon_ratio: 0.86, rgb: [92, 104, 66] }),
            ..Self::default()
        }
    }

    /// The light of each pixel, rows from the top.
    pub(super) fn paint(&self, width: usize, height: usize) -> Vec<Light> {
        let layout = Layout::of(width, height, self.ground);
        let mut light = self.air(&layout);
        if let Some(clouds) = &self.clouds {
            clouds.paint(&layout, &mut light);
        }
        if let Some(ground) = &self.ground {
            ground.paint(&layout, of_srgb(self.horizon_rgb), &mut light);
        }
        for distractor in &self.distractors {
            distractor.paint(&layout, &mut light);
        }
        light
    }

    /// From zenith to horizon, faster near the horizon as the air gets thicker.
    fn air(&self, layout: &Layout) -> Vec<Light> {
        let (zenith, horizon) = (of_srgb(self.zenith_rgb), of_srgb(self.horizon_rgb));
        let rows = (0..layout.height).flat_map(|y| {
            let share = single((px(y) / layout.horizon_px.max(1.0)).clamp(0.0, 1.0));
            std::iter::repeat_n(mixed(zenith, horizon, share * share.sqrt()), layout.width)
        });
        rows.collect()
    }
}

/// Size of the picture and where its horizon is, px.
struct Layout {
    width: usize,
    height: usize,
    horizon_px: f64,
}

/// Clouds and fields are soft: they are evaluated this many pixels apart and blended.
const GRID_PX: usize = 4;

impl Layout {
    fn of(width: usize, height: usize, ground: Option<Ground>) -> Self {
        let ratio = ground.map_or(1.0, |ground| ground.horizon_ratio);
        let ratio = if ratio.is_nan() { 1.0 } else { ratio.clamp(-10.0, 10.0) };
        Self { width, height, horizon_px: px(height) * ratio }
    }

    /// Calls `visit` for every pixel with a field that is evaluated on a grid of places in picture heights, x from the
    /// middle, y down from the horizon.
    fn blend<const N: usize>(
        &self,
        light: &mut [Light],
        field: impl Fn(f64, f64) -> [f32; N],
        mut visit: impl FnMut(usize, usize, &mut Light, [f32; N]),
    ) {
        let columns = self.width / GRID_PX + 2;
        let size = px(self.height);
        let row_of = |row: usize| -> Vec<[f32; N]> {
            let y = (px(row * GRID_PX) - self.horizon_px) / size;
            (0..columns).map(|column| field((px(column * GRID_PX) - 0.5 * px(self.width)) / size, y)).collect()
        };
        let (mut upper, mut lower) = (row_of(0), row_of(1));
        for (y, row) in light.chunks_exact_mut(self.width).enumerate() {
            if y > 0 && y.is_multiple_of(GRID_PX) {
                upper = std::mem::replace(&mut lower, row_of(y / GRID_PX + 1));
            }
            let down = single(px(y % GRID_PX) / px(GRID_PX));
            for (x, pixel) in row.iter_mut().enumerate() {
                let (column, across) = (x / GRID_PX, single(px(x % GRID_PX) / px(GRID_PX)));
                let value = std::array::from_fn(|n| {
                    let at = |row: &[[f32; N]]| row[column][n] + (row[column + 1][n] - row[column][n]) * across;
                    at(&upper) + (at(&lower) - at(&upper)) * down
                });
                visit(x, y, pixel, value);
            }
        }
    }
}

impl Clouds {
    fn paint(&self, layout: &Layout, light: &mut [Light]) {
        let noise = Noise::new(self.seed);
        // Billows are nearly normal about 0.5 with a deviation of 0.11, and the normal distribution nearly logistic.
        let cover = self.cover_ratio.clamp(1e-3, 1.0 - 1e-3);
        let edge = single(0.5 + 0.065 * ((1.0 - cover) / cover).ln() - 0.08);
        let field = |x: f64, y: f64| {
            // The clouds' level surface: rows near the horizon look farther.
            let distance = 1.0 / ((-y).max(0.0) + 0.3);
            let place = [1.6 * x * distance + self.drift[0], 2.6 * distance - self.drift[1]];
            let thickness = noise.billows(place[0], place[1], 6);
            let sunward = noise.billows(place[0] + 0.10, place[1] - 0.12, 3);
            [smooth_step(edge, edge + 0.16, thickness), smooth_step(-0.1, 0.12, thickness - sunward)]
        };
        let (lit, shaded) = (of_srgb([250, 250, 248]), of_srgb([176, 186, 200]));
        layout.blend(light, field, |_, _, pixel, [cover, sun]| {
            *pixel = mixed(*pixel, mixed(shaded, lit, sun), 0.92 * cover);
        });
    }
}

impl Ground {
    fn paint(&self, layout: &Layout, haze: Light, light: &mut [Light]) {
        let noise = Noise::new(self.seed ^ 0x0067_726F_756E);
        let near = of_srgb(self.rgb);
        let size = px(layout.height);
        let skyline: Vec<f64> = (0..layout.width)
            .map(|x| {
                let place = px(x) / size;
                let hills = noise.billows(3.0 * place, 0.5, 4) - 0.5;
                layout.horizon_px - 0.10 * f64::from(hills) * size
            })
            .collect();
        let field = |x: f64, y: f64| {
            let depth = 1.0 / (y.max(0.0) + 0.04);
            [noise.billows(2.0 * x * depth, 1.5 * depth, 5), single((-6.0 * y.max(0.0)).exp())]
        };
        layout.blend(light, field, |x, y, pixel, [texture, distance]| {
            let cover = single((px(y) - skyline[x] + 0.5).clamp(0.0, 1.0));
            if cover > 0.0 {
                let field = scaled(near, 0.35 + 1.3 * texture);
                *pixel = mixed(*pixel, mixed(field, haze, 0.55 * distance), cover);
            }
        });
    }
}

impl Distractor {
    fn paint(&self, layout: &Layout, light: &mut [Light]) {
        let colour = of_srgb(self.rgb);
        let reach = self.half_px[0].hypot(self.half_px[1]) + 1.0;
        let rows = span(self.centre_px[1], reach, layout.height);
        for y in rows {
            for x in span(self.centre_px[0], reach, layout.width) {
                let pixel = &mut light[y * layout.width + x];
                *pixel = mixed(*pixel, colour, self.cover(px(x), px(y)));
            }
        }
    }

    /// Share of the pixel that it covers, by 4 x 4 sub-pixels.
    fn cover(&self, x: f64, y: f64) -> f32 {
        let (sine, cosine) = self.turn_rad.sin_cos();
        let inside = (0..16).filter(|i| {
            let place = |index: i32| (f64::from(index) + 0.5) / 4.0 - 0.5;
            let (dx, dy) = (x + place(i % 4) - self.centre_px[0], y + place(i / 4) - self.centre_px[1]);
            let (a, b) = ((cosine * dx + sine * dy) / self.half_px[0], (cosine * dy - sine * dx) / self.half_px[1]);
            match self.shape {
                Shape::Rectangle => a.abs() <= 1.0 && b.abs() <= 1.0,
                Shape::Ellipse => a * a + b * b <= 1.0,
            }
        });
        single(px(inside.count()) / 16.0)
    }
}

/// The pixels of `0..length` within `reach` of `middle`; none if that is no number.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the conversion saturates, then is clamped"
)]
fn span(middle: f64, reach: f64, length: usize) -> std::ops::Range<usize> {
    let from = (middle - reach).floor().max(0.0) as usize;
    let to = (middle + reach).ceil().max(-1.0) + 1.0;
    from.min(length)..(to as usize).min(length)
}

/// A count of pixels.
const fn px(count: usize) -> f64 {
    count as f64
}

#[expect(clippy::cast_possible_truncation, reason = "light has three digits")]
const fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "light that was copied, not computed")]
mod tests {
    use super::*;

    #[test]
    fn a_plain_sky_is_one_colour() {
        let light = Sky::plain([10, 20, 30]).paint(7, 5);
        assert_eq!(light.len(), 35);
        assert!(light.iter().all(|l| *l == of_srgb([10, 20, 30])));
    }

    #[test]
    fn the_sky_pales_towards_the_horizon_and_the_ground_is_below_it() {
        let sky = Sky { ground: Sky::fair(1, [0.0; 2]).ground, ..Sky::default() };
        let light = sky.paint(64, 100);
        assert!(light[0][0] < light[60 * 64][0]);
        assert!(light[99 * 64][2] < light[60 * 64][2], "the ground is less blue");
    }

    #[test]
    fn clouds_cover_about_as_much_as_asked() {
        let covered = |cover_ratio: f64| {
            let clouds = Some(Clouds { seed: 3, cover_ratio, drift: [0.0; 2] });
            let clear = Sky::plain([20, 40, 120]).paint(200, 150);
            let overcast = Sky { clouds, ..Sky::plain([20, 40, 120]) }.paint(200, 150);
            clear.iter().zip(&overcast).filter(|(a, b)| b[0] - a[0] > 0.1).count() as f64 / 30_000.0
        };
        assert!(covered(0.0) < 0.05 && covered(1.0) > 0.95, "{} {}", covered(0.0), covered(1.0));
        assert!((covered(0.5) - 0.5).abs() < 0.25, "{}", covered(0.5));
    }

    #[test]
    fn a_distractor_covers_its_area_and_nothing_else() {
        let red = of_srgb([255, 0, 0])[0];
        for (shape, half_px, area) in
            [(Shape::Rectangle, [9.0, 4.0], 144.0), (Shape::Ellipse, [9.0, 4.0], std::f64::consts::PI * 36.0)]
        {
            let thing = Distractor { shape, centre_px: [25.3, 20.8], half_px, turn_rad: 0.6, rgb: [255, 0, 0] };
            let sky = Sky { distractors: vec![thing], ..Sky::plain([0, 0, 0]) };
            let covered: f32 = sky.paint(50, 40).iter().map(|light| light[0] / red).sum();
            assert!((f64::from(covered) - area).abs() < 1.5, "{shape:?}: {covered} of {area}");
        }
        let far = Distractor {
            shape: Shape::Ellipse,
            centre_px: [-1e9, f64::NAN],
            half_px: [3.0, 0.0],
            turn_rad: 0.0,
            rgb: [255, 0, 0],
        };
        assert_eq!(Sky { distractors: vec![far], ..Sky::plain([0; 3]) }.paint(8, 8), Sky::plain([0; 3]).paint(8, 8));
    }
}
