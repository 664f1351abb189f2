//! Whether a frame still shows the scene of the one before.

use super::camera_motion::CameraMotion;
use super::level::{Level, STEPS};

/// The level on which scenes are compared: what flies is small there.
const COARSE: usize = 4;
/// Deviation from its mean that a scene is granted, gray levels: a bare sky has none of its own.
const PLAIN: f32 = 6.0;

/// How much of the coarse picture is not that of the frame before, laid on it: its mean difference as a share of its mean deviation.
/// Light that changes everywhere counts half.
#[must_use]
pub fn scene_change(new: &[Level], before: &[Level], motion: &CameraMotion) -> f32 {
    let (Some(frame), index) = (new.first(), COARSE.min(new.len().saturating_sub(1))) else { return 0.0 };
    let (new, before) = (&new[index], &before[index]);
    let scale = f64::from(1_u32 << index);
    let middle = [0.5 * frame.width as f64, 0.5 * frame.height as f64];
    let pair = |x: usize, y: usize| {
        let [u, v] = motion.apply([(x as f64 + 0.5) * scale - middle[0], (y as f64 + 0.5) * scale - middle[1]]);
        let (u, v) = (((u + middle[0]) / scale).floor(), ((v + middle[1]) / scale).floor());
        if !(u >= 0.0 && v >= 0.0 && u < before.width as f64 && v < before.height as f64) {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "on the level")]
        let at = v as usize * before.width + u as usize;
        Some([f32::from(new.smooth[y * new.width + x]), f32::from(before.smooth[at])])
    };
    let places = || (0..new.height).flat_map(|y| (0..new.width).map(move |x| (x, y)));
    let (mut sums, mut count) = ([0.0_f32; 2], 0.0_f32);
    for [now, then] in places().filter_map(|(x, y)| pair(x, y)) {
        sums = [sums[0] + now, sums[1] + then];
        count += 1.0;
    }
    let [mean, mean_then] = sums.map(|sum| sum / count.max(1.0));
    let (mut changed, mut spread) = (0.0, 0.0);
    for [now, then] in places().filter_map(|(x, y)| pair(x, y)) {
        let (now, then) = (now - mean, then - mean_then);
        changed += (now - then).abs();
        spread += now.abs().max(then.abs());
    }
    (changed + 0.5 * count * (mean - mean_then).abs()) / (spread + PLAIN * STEPS * count).max(1.0)
}
