//! Conversions between colour spaces, full range BT.601 as in JFIF, and between codes and light, the curve of sRGB.

/// Interleaved `YCbCr` to interleaved RGB, as many samples, rounded to nearest.
pub fn write_rgb(ycbcr: &[u8], rgb: &mut [u8]) {
    for (pixel, rgb) in ycbcr.as_chunks::<3>().0.iter().zip(rgb.as_chunks_mut::<3>().0) {
        *rgb = rgb_of_ycbcr(*pixel);
    }
}

/// One pixel from `YCbCr` to RGB.
#[must_use]
pub fn rgb_of_ycbcr([y, cb, cr]: [u8; 3]) -> [u8; 3] {
    // 16 fraction bits: 1.402, 0.344136, 0.714136, 1.772.
    let (y, cb, cr) = (i32::from(y) << 16, i32::from(cb) - 128, i32::from(cr) - 128);
    let half = 1 << 15;
    [
        clamp((y + 91_881 * cr + half) >> 16),
        clamp((y - 22_554 * cb - 46_802 * cr + half) >> 16),
        clamp((y + 116_130 * cb + half) >> 16),
    ]
}

/// One pixel from RGB to `YCbCr`.
#[must_use]
pub fn ycbcr_of_rgb([r, g, b]: [u8; 3]) -> [u8; 3] {
    let (r, g, b) = (i32::from(r), i32::from(g), i32::from(b));
    let half = 1 << 15;
    let middle = 128 << 16;
    [
        clamp((19_595 * r + 38_470 * g + 7_471 * b + half) >> 16),
        clamp((-11_059 * r - 21_709 * g + 32_768 * b + middle + half) >> 16),
        clamp((32_768 * r - 27_439 * g - 5_329 * b + middle + half) >> 16),
    ]
}

/// The light of a code, both from 0 to 1 (IEC 61966-2-1).
#[must_use]
pub fn light_of_srgb(code: f32) -> f32 {
    if code <= 0.040_45 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// The code of light, both from 0 to 1 (IEC 61966-2-1).
#[must_use]
pub fn srgb_of_light(light: f32) -> f32 {
    if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

#[expect(clippy::cast_sign_loss, reason = "clamped to 0..=255")]
fn clamp(value: i32) -> u8 {
    value.clamp(0, 255) as u8
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn middle_gray_is_a_fifth_of_the_light_and_half_of_it_has_the_code_of_the_standard() {
        assert!((light_of_srgb(118.0 / 255.0) - 0.18).abs() < 2e-3);
        assert!((srgb_of_light(0.5) - 0.735_36).abs() < 1e-4);
        assert!(light_of_srgb(0.0) == 0.0 && (light_of_srgb(1.0) - 1.0).abs() < 1e-6);
    }

    proptest! {
        #[test]
        fn a_code_comes_back_from_its_light(code in 0.0_f32..=1.0) {
            prop_assert!((srgb_of_light(light_of_srgb(code)) - code).abs() < 1e-4);
        }

        #[test]
        fn the_way_there_and_back_loses_at_most_rounding(rgb in any::<[u8; 3]>()) {
            let back = rgb_of_ycbcr(ycbcr_of_rgb(rgb));
            for (a, b) in rgb.iter().zip(back) {
                prop_assert!(a.abs_diff(b) <= 2, "{rgb:?} came back as {back:?}");
            }
        }

        #[test]
        fn conversion_agrees_with_the_jfif_formula(y in any::<u8>(), cb in any::<u8>(), cr in any::<u8>()) {
            let (l, b, r) = (f64::from(y), f64::from(cb) - 128.0, f64::from(cr) - 128.0);
            let exact = [l + 1.402 * r, l - 0.344_136_286 * b - 0.714_136_286 * r, l + 1.772 * b];
            for (found, exact) in rgb_of_ycbcr([y, cb, cr]).iter().zip(exact) {
                prop_assert!((f64::from(*found) - exact.clamp(0.0, 255.0)).abs() <= 0.51);
            }
        }
    }
}
