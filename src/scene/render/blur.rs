//! What a real lens and a moving camera do to the picture: both keep the centre of everything where it was.

use super::light::{Light, mixed};
use super::optics::Optics;
use super::radiance::Radiance;

/// Wider blur than this, px, leaves no picture.
const MAX_SIGMA_PX: f64 = 50.0;

/// Longer ways than this, px, leave no picture.
const MAX_MOTION_PX: f64 = 200.0;

/// The picture blurred by motion and lens.
#[must_use]
pub fn through_lens(scene: Radiance, optics: &Optics) -> Radiance {
    let moved = smeared(scene, optics.motion_px);
    let share = optics.glare_ratio.clamp(0.0, 1.0);
    if share.is_nan() || share <= 0.0 {
        return blurred(moved, optics.blur_sigma_px);
    }
    let halo = blurred(moved.clone(), optics.glare_sigma_px.hypot(optics.blur_sigma_px));
    let mut sharp = blurred(moved, optics.blur_sigma_px);
    #[expect(clippy::cast_possible_truncation, reason = "light has three digits")]
    let share = share as f32;
    for (pixel, halo) in sharp.light.iter_mut().zip(halo.light) {
        *pixel = mixed(*pixel, halo, share);
    }
    sharp
}

/// The mean of the picture on its way from half of `motion_px` before to half of it after.
fn smeared(scene: Radiance, motion_px: [f64; 2]) -> Radiance {
    let length = motion_px[0].hypot(motion_px[1]);
    if length.is_nan() || length <= 0.0 {
        return scene;
    }
    let motion = motion_px.map(|m| m * (MAX_MOTION_PX / length).min(1.0));
    let taps = way(motion);
    let mut out = vec![[0.0; 3]; scene.light.len()];
    for (y, row) in out.chunks_exact_mut(scene.width).enumerate() {
        for &(dx, dy, weight) in &taps {
            let from = clamped(y, dy, scene.height) * scene.width;
            let source = &scene.light[from..from + scene.width];
            for (x, pixel) in row.iter_mut().enumerate() {
                add(pixel, source[clamped(x, dx, scene.width)], weight);
            }
        }
    }
    Radiance { light: out, ..scene }
}

/// Offsets and weights of the pixels on the way, each point of it shared by the four pixels about it.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most MAX_MOTION_PX")]
fn way(motion: [f64; 2]) -> Vec<(isize, isize, f32)> {
    let steps = (4.0 * motion[0].hypot(motion[1])).ceil() as u32 + 1;
    let mut taps: Vec<(isize, isize, f32)> = Vec::new();
    for step in 0..steps {
        let share = (f64::from(step) + 0.5) / f64::from(steps) - 0.5;
        let [x, y] = motion.map(|m| m * share);
        let (left, top) = (x.floor(), y.floor());
        for (ox, oy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let weight = (1.0 - (x - left - ox).abs()) * (1.0 - (y - top - oy).abs()) / f64::from(steps);
            let (dx, dy, weight) = ((left + ox) as isize, (top + oy) as isize, weight as f32);
            match taps.iter_mut().find(|(tx, ty, _)| (*tx, *ty) == (dx, dy)) {
                Some((.., known)) => *known += weight,
                None => taps.push((dx, dy, weight)),
            }
        }
    }
    taps.retain(|(.., weight)| *weight > 0.0);
    taps
}

/// The picture through a Gaussian, first along its rows, then along its columns.
fn blurred(scene: Radiance, sigma_px: f64) -> Radiance {
    if sigma_px.is_nan() || sigma_px <= 0.05 {
        return scene;
    }
    let kernel = gaussian(sigma_px.min(MAX_SIGMA_PX));
    let (width, height, reach) = (scene.width, scene.height, kernel.len() / 2);
    let mut along = vec![[0.0; 3]; scene.light.len()];
    let mut padded = vec![[0.0; 3]; width + 2 * reach];
    for (row, out) in scene.light.chunks_exact(width).zip(along.chunks_exact_mut(width)) {
        padded[..reach].fill(row[0]);
        padded[reach..reach + width].copy_from_slice(row);
        padded[reach + width..].fill(row[width - 1]);
        for (tap, &weight) in kernel.iter().enumerate() {
            add_row(out, &padded[tap..tap + width], weight);
        }
    }
    let mut light = vec![[0.0; 3]; scene.light.len()];
    for (y, out) in light.chunks_exact_mut(width).enumerate() {
        for (tap, &weight) in kernel.iter().enumerate() {
            let from = clamped(y, tap.cast_signed() - reach.cast_signed(), height) * width;
            add_row(out, &along[from..from + width], weight);
        }
    }
    Radiance { width, height, light }
}

/// An odd number of weights that sum to one, out to three standard deviations.
#[expect(clippy::cast_possible_truncation, reason = "at most 3 MAX_SIGMA_PX")]
fn gaussian(sigma_px: f64) -> Vec<f32> {
    let reach = (3.0 * sigma_px).ceil() as i32;
    let raw: Vec<f64> = (-reach..=reach).map(|x| (-0.5 * (f64::from(x) / sigma_px).powi(2)).exp()).collect();
    let total: f64 = raw.iter().sum();
    raw.into_iter().map(|weight| (weight / total) as f32).collect()
}

fn add_row(out: &mut [Light], source: &[Light], weight: f32) {
    // Flat, so that the compiler works on several samples at once.
    for (sample, light) in out.as_flattened_mut().iter_mut().zip(source.as_flattened()) {
        *sample += light * weight;
    }
}

fn add(pixel: &mut Light, light: Light, weight: f32) {
    (0..3).for_each(|c| pixel[c] += light[c] * weight);
}

/// `position + offset` held within `0..length`.
fn clamped(position: usize, offset: isize, length: usize) -> usize {
    position.saturating_add_signed(offset).min(length - 1)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A single bright pixel in the middle.
    fn spark() -> Radiance {
        let mut light = vec![[0.0; 3]; 61 * 51];
        light[25 * 61 + 30] = [1.0, 0.5, 0.0];
        Radiance { width: 61, height: 51, light }
    }

    /// Total light, its centre, and its variances along the axes, px.
    fn moments(picture: &Radiance) -> (f64, [f64; 2], [f64; 2]) {
        let mut sums = [0.0; 5];
        for (i, light) in picture.light.iter().enumerate() {
            let (x, y, w) = ((i % picture.width) as f64, (i / picture.width) as f64, f64::from(light[0]));
            for (sum, term) in sums.iter_mut().zip([1.0, x, y, x * x, y * y]) {
                *sum += w * term;
            }
        }
        let [total, x, y, xx, yy] = sums;
        let centre = [x / total, y / total];
        (total, centre, [xx / total - centre[0].powi(2), yy / total - centre[1].powi(2)])
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn motion_and_blur_move_no_light_on_average(x in -12.0..12.0, y in -12.0..12.0, sigma in 0.0..2.5) {
            let optics = Optics { motion_px: [x, y], blur_sigma_px: sigma, ..Optics::ideal() };
            let (total, centre, _) = moments(&through_lens(spark(), &optics));
            prop_assert!((total - 1.0).abs() < 1e-5);
            prop_assert!((centre[0] - 30.0).abs() < 1e-4 && (centre[1] - 25.0).abs() < 1e-4, "{centre:?}");
        }
    }

    #[test]
    fn blur_and_motion_spread_as_much_as_they_say() {
        let still = Optics { blur_sigma_px: 1.5, ..Optics::ideal() };
        let (.., variance) = moments(&through_lens(spark(), &still));
        // The tails beyond three deviations are cut.
        assert!((variance[0] - 2.25).abs() < 0.06 && (variance[1] - 2.25).abs() < 0.06, "{variance:?}");
        let moving = Optics { motion_px: [12.0, 0.0], ..Optics::ideal() };
        let (.., variance) = moments(&through_lens(spark(), &moving));
        // A box of length 12 has 12; sharing between neighbours adds a sixth.
        assert!((variance[0] - 12.17).abs() < 0.1 && variance[1] < 1e-6, "{variance:?}");
    }

    #[test]
    fn glare_is_a_halo_of_the_share_and_the_width_that_it_is_said_to_have() {
        let optics = Optics { glare_ratio: 0.25, glare_sigma_px: 4.0, ..Optics::ideal() };
        let hazy = through_lens(spark(), &optics);
        let (total, centre, variance) = moments(&hazy);
        assert!((total - 1.0).abs() < 1e-5 && (centre[0] - 30.0).abs() < 1e-4);
        assert!((hazy.light[25 * 61 + 30][0] - 0.75).abs() < 0.01, "three quarters stay");
        // A quarter of sixteen, less the tails beyond three deviations.
        assert!((variance[0] - 4.0).abs() < 0.2, "{variance:?}");
    }

    #[test]
    fn an_even_picture_stays_even_to_its_border() {
        let even = Radiance { width: 9, height: 5, light: vec![[0.4; 3]; 45] };
        let optics = Optics { motion_px: [7.0, -3.0], blur_sigma_px: 2.0, ..Optics::ideal() };
        for light in through_lens(even, &optics).light {
            assert!((light[0] - 0.4).abs() < 1e-5);
        }
    }

    #[test]
    fn senseless_amounts_do_no_harm() {
        for amount in [f64::NAN, -1.0, 1e300] {
            let optics =
                Optics { motion_px: [amount, 0.0], blur_sigma_px: amount, glare_ratio: amount, ..Optics::ideal() };
            assert!(through_lens(spark(), &optics).light.iter().flatten().all(|l| l.is_finite()));
        }
    }
}
