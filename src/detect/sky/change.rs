//! What moves against the camera's own motion: the level of half size, less itself some frames ago laid on it.

use multiversion::multiversion;

use super::camera_motion::CameraMotion;
use super::level::Level;
use super::whole;

/// Frames over which a change is looked for: at 30 a second a tenth of a second.
pub const SPAN: usize = 3;

/// Pixels along a row over which the shift is taken as constant: turned by a degree, the error at their ends is 0.14 px.
const BLOCK: usize = 16;

/// Past frames, and what changed since the oldest of them.
#[derive(Clone, Debug, Default)]
pub struct Change {
    past: Vec<Vec<u16>>,
    /// From the new frame to each of `past`, in px of the frame.
    motions: Vec<CameraMotion>,
    /// The lesser of contrast and change at every pixel of the level: what stands out, and did not stand there before.
    pub moving: Vec<u16>,
}

impl Change {
    /// Forgets the past.
    pub fn reset(&mut self) {
        self.motions.clear();
    }

    /// Whether there is a past to compare with.
    #[must_use]
    pub const fn is_known(&self) -> bool {
        !self.motions.is_empty()
    }

    /// The next frame, `index` halvings of the frame being `level`; `motion` leads to the frame before, if there was one.
    pub fn take(&mut self, level: &Level, index: usize, frame: [usize; 2], motion: Option<CameraMotion>) {
        self.moving.clear();
        self.moving.resize(level.width * level.height, 0);
        if let Some(motion) = motion {
            for known in &mut self.motions {
                *known = motion.then(known);
            }
            if let Some(oldest) = self.motions.last().copied() {
                let past = &self.past[self.motions.len() - 1];
                compare(level, past, &oldest, f64::from(1_u32 << index), frame, &mut self.moving);
            }
        } else {
            self.motions.clear();
        }
        // The newest comes first; the oldest one's memory is used again.
        let mut memory = if self.past.len() < SPAN { Vec::new() } else { self.past.pop().unwrap_or_default() };
        memory.clear();
        memory.extend_from_slice(&level.smooth);
        self.past.insert(0, memory);
        self.motions.insert(0, CameraMotion::default());
        self.motions.truncate(SPAN);
    }
}

/// Pixels of a row that are compared with past ones beside each other, at the same part of a pixel.
#[derive(Clone, Copy)]
struct Run {
    start: usize,
    end: usize,
    /// Where the first one was: the pixel up and left of it, and how far beyond that, in 1/128 px.
    at: usize,
    fraction: [u32; 2],
}

impl Run {
    /// The block from `start` on, if it was in the past picture.
    fn of_block(start: usize, y: usize, size: [usize; 2], past: impl Fn([f64; 2]) -> [f64; 2]) -> Option<Self> {
        let [width, height] = size;
        let count = BLOCK.min(width - 1 - start);
        let [dx, dy] = past([start as f64 + 0.5 * count as f64, y as f64 + 0.5]);
        let (column, row) = (start as f64 + dx.floor(), y as f64 + dy.floor());
        let fits =
            column >= 0.0 && row >= 0.0 && column + count as f64 + 1.0 <= width as f64 && row + 2.0 <= height as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 1 in 1/128")]
        let fraction = [(dx - dx.floor()) * 128.0, (dy - dy.floor()) * 128.0].map(|part| part as u32);
        fits.then(|| Self { start, end: start + count, at: whole(row) * width + whole(column), fraction })
    }

    /// This one and the next as one, if that goes on where this one ends.
    fn joined(&self, next: &Self) -> Option<Self> {
        let goes_on = next.start == self.end && next.at == self.at + self.end - self.start;
        (goes_on && next.fraction == self.fraction).then_some(Self { end: next.end, ..*self })
    }
}

fn compare(level: &Level, past: &[u16], motion: &CameraMotion, scale: f64, frame: [usize; 2], out: &mut [u16]) {
    let (width, height) = (level.width, level.height);
    let middle = [0.5 * frame[0] as f64, 0.5 * frame[1] as f64];
    // How far from a place of the level its past place lies.
    let shift = |[x, y]: [f64; 2]| {
        let here = [x * scale - middle[0], y * scale - middle[1]];
        let [u, v] = motion.apply(here);
        [(u - here[0]) / scale, (v - here[1]) / scale]
    };
    for y in 1..height.saturating_sub(1) {
        let mut compare = |run: Run| {
            let (here, count) = (y * width + run.start, run.end - run.start);
            compare_run(
                [&level.smooth[here - width..], &level.smooth[here - 1..], &level.smooth[here + width..]],
                &level.contrast[here..here + count],
                [&past[run.at..], &past[run.at + width..]],
                run.fraction,
                &mut out[here..here + count],
            );
        };
        let mut open: Option<Run> = None;
        for start in (1..width.saturating_sub(1)).step_by(BLOCK) {
            let Some(next) = Run::of_block(start, y, [width, height], shift) else { continue };
            let longer = open.and_then(|run| run.joined(&next));
            if longer.is_none() {
                open.into_iter().for_each(&mut compare);
            }
            open = longer.or(Some(next));
        }
        open.into_iter().for_each(compare);
    }
}

/// A step of the picture by this share of a pixel is the aligner's error, not a change.
const SLACK_SHIFT: u32 = 1;

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn compare_run(
    [above, row, below]: [&[u16]; 3],
    contrast: &[i16],
    [upper, lower]: [&[u16]; 2],
    [fx, fy]: [u32; 2],
    out: &mut [u16],
) {
    let count = out.len();
    let (above, below, row) = (&above[..count], &below[..count], &row[..count + 2]);
    let (upper, lower) = (&upper[..=count], &lower[..=count]);
    for i in 0..count {
        let top = u32::from(upper[i]) * (128 - fx) + u32::from(upper[i + 1]) * fx;
        let bottom = u32::from(lower[i]) * (128 - fx) + u32::from(lower[i + 1]) * fx;
        let was = ((top >> 7) * (128 - fy) + (bottom >> 7) * fy) >> 7;
        let change = was.abs_diff(u32::from(row[i + 1]));
        let slope = u32::from(row[i].abs_diff(row[i + 2])) + u32::from(above[i].abs_diff(below[i]));
        let beyond = change.saturating_sub(slope >> SLACK_SHIFT);
        #[expect(clippy::cast_possible_truncation, reason = "contrast is below 2^15")]
        let least = beyond.min(u32::from(contrast[i].unsigned_abs())) as u16;
        out[i] = least;
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::random;

    #[test]
    fn a_run_is_that_of_its_definition() {
        let mut rng = random::named("change");
        for count in [1, 5, 16] {
            let mut line = |length: usize| -> Vec<u16> { (0..length).map(|_| rng.random_range(0..32_640)).collect() };
            let (above, row, below) = (line(count), line(count + 2), line(count));
            let (upper, lower) = (line(count + 1), line(count + 1));
            let contrast: Vec<i16> = line(count).iter().map(|value| value.cast_signed() / 2 - 8000).collect();
            let (fx, fy) = (37, 101);
            let mut out = vec![0; count];
            compare_run([&above, &row, &below], &contrast, [&upper, &lower], [fx, fy], &mut out);
            for i in 0..count {
                let (x, y) = (f64::from(fx) / 128.0, f64::from(fy) / 128.0);
                let of = |line: &[u16]| (1.0 - x) * f64::from(line[i]) + x * f64::from(line[i + 1]);
                let change = ((1.0 - y) * of(&upper) + y * of(&lower) - f64::from(row[i + 1])).abs();
                let slope = row[i].abs_diff(row[i + 2])
                    + above[i].abs_diff(below[i]).min(u16::MAX - row[i].abs_diff(row[i + 2]));
                let least = (change - f64::from(slope) / 2.0).max(0.0).min(f64::from(contrast[i]).abs());
                // Weights of 1/128, rounded down twice.
                assert!((f64::from(out[i]) - least).abs() <= 3.0, "{} {least}", out[i]);
            }
        }
    }

    #[test]
    fn blocks_that_are_compared_together_are_the_same_as_one_by_one() {
        let mut rng = random::named("changed blocks");
        let (width, height) = (150, 12);
        let mut level = Level::default();
        (level.width, level.height) = (width, height);
        level.smooth = (0..width * height).map(|_| rng.random_range(0..32_640)).collect();
        level.contrast = (0..width * height).map(|_| rng.random_range(-9000..9000)).collect();
        let past: Vec<u16> = (0..width * height).map(|_| rng.random_range(0..32_640)).collect();
        let frame = [2 * width, 2 * height];
        for (shift_px, zoom, turn) in [([0.0; 2], 0.0, 0.0), ([7.3, -2.9], 0.0, 2e-4), ([-40.2, 3.1], 0.01, -0.02)] {
            let motion = CameraMotion { shift_px, zoom, turn };
            let mut together = vec![0; width * height];
            compare(&level, &past, &motion, 2.0, frame, &mut together);
            let mut alone = vec![0; width * height];
            let middle = frame.map(|side| 0.5 * side as f64);
            let mut count = 0;
            for y in 1..height - 1 {
                for start in (1..width - 1).step_by(BLOCK) {
                    let run = Run::of_block(start, y, [width, height], |[x, y]| {
                        let here = [2.0 * x - middle[0], 2.0 * y - middle[1]];
                        let [u, v] = motion.apply(here);
                        [0.5 * (u - here[0]), 0.5 * (v - here[1])]
                    });
                    let Some(Run { end, at, fraction, .. }) = run else { continue };
                    let here = y * width + start;
                    let around =
                        [&level.smooth[here - width..], &level.smooth[here - 1..], &level.smooth[here + width..]];
                    let (contrast, out) = (&level.contrast[here..][..end - start], &mut alone[here..][..end - start]);
                    compare_run(around, contrast, [&past[at..], &past[at + width..]], fraction, out);
                    count += 1;
                }
            }
            assert!(count > 20, "{count}");
            assert_eq!(together, alone, "{motion:?}");
        }
    }
}
