//! How the camera moved: the similarity that lays the frame before on this one.
//!
//! Contrast maps of both are aligned from coarse to fine by Gauss and Newton (Baker and Matthews, "Lucas-Kanade 20 years on", IJCV
//! 2004), with the gradient of the new one, on the pixel of steepest slope of every block. Each point counts in units of
//! the contrast around it, so trees do not outvote clouds and a large target does not outvote the sky; what moves on its own is weighed
//! down (Cauchy's weights).

use multiversion::multiversion;
use nalgebra::{Matrix4, Vector4};

use super::cells::Cells;
use super::level::Level;
use crate::detect::single;

/// `x' = x + t_x + zoom x - turn y`, `y' = y + t_y + turn x + zoom y`, in px of the frame from its middle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraMotion {
    /// Translation, px.
    pub shift_px: [f64; 2],
    /// Scale less one.
    pub zoom: f64,
    /// Rotation, rad where it is small.
    pub turn: f64,
}

impl CameraMotion {
    /// Where a place of this frame was, both from the middle.
    #[must_use]
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x + self.shift_px[0] + self.zoom * x - self.turn * y, y + self.shift_px[1] + self.turn * x + self.zoom * y]
    }

    /// Where a place of the frame before is now.
    #[must_use]
    pub fn invert(&self, place: [f64; 2]) -> [f64; 2] {
        let [x, y] = [place[0] - self.shift_px[0], place[1] - self.shift_px[1]];
        let scale = 1.0 + self.zoom;
        let square = scale.mul_add(scale, self.turn * self.turn);
        [(scale * x + self.turn * y) / square, (scale * y - self.turn * x) / square]
    }

    /// How far apart two motions move a place, px, at most: on a circle through the frame's left and right.
    fn farthest_from(&self, other: &Self, width: f64) -> f64 {
        let shift = (self.shift_px[0] - other.shift_px[0]).hypot(self.shift_px[1] - other.shift_px[1]);
        shift + 0.5 * width * (self.zoom - other.zoom).hypot(self.turn - other.turn)
    }

    /// First this one, then the one `before` it: where a place of this frame was two frames ago.
    #[must_use]
    pub fn then(&self, before: &Self) -> Self {
        let (a, b) = (1.0 + self.zoom, self.turn);
        let (c, d) = (1.0 + before.zoom, before.turn);
        Self { shift_px: before.apply(self.shift_px), zoom: a * c - b * d - 1.0, turn: a * d + b * c }
    }
}

/// Residuals that agree better than this are not believed to.
const LEAST_SPREAD: f32 = 0.05;

/// Points along a row of the frame, at every level.
const POINTS_ACROSS: usize = 40;

/// Contrast that tells little yet, in steps of the levels: a gray level and a half. What is left of noise after a video codec stands
/// still whatever the camera does.
const QUIET: f32 = 200.0;

/// Slopes below this tell nothing, in steps of the levels across two pixels: half a gray level.
const LEAST_SLOPE: u32 = 100;

/// A pixel of steep slope.
#[derive(Clone, Copy, Debug)]
struct Point {
    x: f32,
    y: f32,
    value: f32,
    /// By how much the value rises for a unit of each of the four numbers.
    slope: [f32; 4],
    weight: f32,
}

/// Aligns frames; keeps its room for points.
#[derive(Clone, Debug, Default)]
pub struct Aligner {
    points: Vec<Point>,
    /// Of the pixels of a row, how steep it is there, and the steepest pixel of each block.
    slopes: Vec<u32>,
    steepest: Vec<(u32, [usize; 2])>,
    /// Of each point at the motion that is looked at; not a number where the point was not in the frame before.
    residuals: Vec<f32>,
}

/// What speaks for a camera at rest, in points of full weight: a lone thing in a bare sky moves, not the camera.
const STILLNESS: f64 = 1.0;

/// Iterations at a level at most, and the step, px of the level, after which there is nothing to gain: the next level is finer by half.
const ITERATIONS: usize = 6;
const SETTLED_PX: f64 = 0.02;

impl Aligner {
    /// Where places of the new frame were in the one before. Levels are of equal size in both; the finest one is used only if there is
    /// no other.
    pub fn align(&mut self, new: &[Level], cells: &[Cells], before: &[Level], guess: CameraMotion) -> CameraMotion {
        let finest = usize::from(new.len() > 1);
        let Some(frame) = new.first() else { return CameraMotion::default() };
        let size = [frame.width as f64, frame.height as f64];
        let mut motion = guess;
        let coarsest = new.len() - 1;
        for level in (finest..new.len()).rev() {
            self.collect(&new[level], &cells[level], level, size);
            if level == coarsest && guess != CameraMotion::default() {
                let still = CameraMotion::default();
                if self.look(&before[level], level, size, &still) < self.look(&before[level], level, size, &guess) {
                    motion = still;
                }
            }
            let rounds = if level == finest { 4 } else { ITERATIONS };
            let settled = SETTLED_PX * f64::from(1_u32 << level);
            for _ in 0..rounds {
                let spread = self.look(&before[level], level, size, &motion).max(LEAST_SPREAD);
                let next = self.step(spread, level, size, &motion);
                let moved = next.farthest_from(&motion, size[0]);
                motion = next;
                if moved < settled {
                    break;
                }
            }
        }
        // A camera that turns more than this between two frames shows another scene.
        let bound = 0.25 * size[0];
        let is_sane = motion.shift_px.iter().all(|shift| shift.abs() < bound)
            && motion.zoom.abs() < 0.2
            && motion.turn.abs() < 0.2;
        if is_sane { motion } else { CameraMotion::default() }
    }

    fn collect(&mut self, level: &Level, cells: &Cells, index: usize, size: [f64; 2]) {
        self.points.clear();
        let (width, height) = (level.width, level.height);
        if width < 4 || height < 4 {
            return;
        }
        let block = (width / POINTS_ACROSS).max(1);
        let scale = (1 << index) as f32;
        let middle = size.map(|side| single(0.5 * side));
        for top in (1..height - 1).step_by(block) {
            self.steepest.clear();
            self.steepest.resize((width - 2).div_ceil(block), (0, [0; 2]));
            for y in (top..(top + block).min(height - 1)).step_by(1 + usize::from(block > 4)) {
                let row = |y: usize| &level.contrast[y * width..][..width];
                self.slopes.resize(width - 2, 0);
                slopes([row(y - 1), row(y), row(y + 1)], &mut self.slopes);
                for ((best, at), (left, slopes)) in
                    self.steepest.iter_mut().zip((1..).step_by(block).zip(self.slopes.chunks(block)))
                {
                    let most = slopes.iter().copied().fold(0, u32::max);
                    if most > *best {
                        let x = slopes.iter().position(|slope| *slope == most).unwrap_or_default();
                        (*best, *at) = (most, [left + x, y]);
                    }
                }
            }
            for &(steepest, [x, y]) in &self.steepest {
                if steepest < LEAST_SLOPE {
                    continue;
                }
                let value = |x: usize, y: usize| i32::from(level.contrast[y * width + x]);
                let (across, down) = (value(x + 1, y) - value(x - 1, y), value(x, y + 1) - value(x, y - 1));
                // From the frame's middle, in px of the frame.
                let u = (x as f32 + 0.5) * scale - middle[0];
                let v = (y as f32 + 0.5) * scale - middle[1];
                let [gx, gy] = [across as f32 / (2.0 * scale), down as f32 / (2.0 * scale)];
                let quiet = cells.mean_at(x, y) + QUIET;
                let steep = (across as f32).hypot(down as f32);
                self.points.push(Point {
                    x: u,
                    y: v,
                    value: f32::from(level.contrast[y * width + x]),
                    slope: [gx, gy, (gx * u + gy * v) / middle[0], (gy * u - gx * v) / middle[0]],
                    weight: steep * steep / (quiet * quiet + steep * steep).powi(2),
                });
            }
        }
    }

    fn residual(point: &Point, before: &Level, scale: f32, middle: [f32; 2], motion: [f32; 4]) -> Option<f32> {
        let [shift_x, shift_y, zoom, turn] = motion;
        let x = (point.x + shift_x + zoom * point.x - turn * point.y + middle[0]) / scale - 0.5;
        let y = (point.y + shift_y + turn * point.x + zoom * point.y + middle[1]) / scale - 0.5;
        if !(x >= 0.0 && y >= 0.0) {
            return None;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "not negative, and small or refused"
        )]
        let (column, row) = (x as usize, y as usize);
        if column + 1 >= before.width || row + 1 >= before.height {
            return None;
        }
        let (fx, fy) = (x - column as f32, y - row as f32);
        let at = row * before.width + column;
        let [a, b] = [before.contrast[at], before.contrast[at + 1]].map(f32::from);
        let [c, d] = [before.contrast[at + before.width], before.contrast[at + before.width + 1]].map(f32::from);
        let upper = a + fx * (b - a);
        let lower = c + fx * (d - c);
        Some(upper + fy * (lower - upper) - point.value)
    }

    fn numbers(motion: &CameraMotion) -> [f32; 4] {
        [motion.shift_px[0], motion.shift_px[1], motion.zoom, motion.turn].map(single)
    }

    /// Takes the residuals at a motion. Their mean size, each in units of what is around it, and counted as it tells of the motion.
    fn look(&mut self, before: &Level, index: usize, size: [f64; 2], motion: &CameraMotion) -> f32 {
        let scale = (1 << index) as f32;
        let middle = size.map(|side| single(0.5 * side));
        let numbers = Self::numbers(motion);
        let (mut sum, mut count) = (0.0, 0.0);
        self.residuals.clear();
        for point in &self.points {
            let residual = Self::residual(point, before, scale, middle, numbers);
            self.residuals.push(residual.unwrap_or(f32::NAN));
            if let Some(residual) = residual {
                let told = point.weight * (point.slope[0] * point.slope[0] + point.slope[1] * point.slope[1]);
                sum += told * residual.abs() * point.weight.sqrt();
                count += told;
            }
        }
        if count > 0.0 { sum / count } else { f32::MAX }
    }

    /// A step from the motion of which the residuals are those that were taken.
    fn step(&self, spread: f32, index: usize, size: [f64; 2], motion: &CameraMotion) -> CameraMotion {
        let scale = (1 << index) as f32;
        let mut normal = [0.0_f32; 10];
        let mut right = [0.0_f32; 4];
        for (point, &residual) in self.points.iter().zip(&self.residuals) {
            if residual.is_nan() {
                continue;
            }
            let relative = residual * residual * point.weight / (spread * spread);
            let weight = point.weight / (1.0 + relative);
            let s = point.slope;
            let mut k = 0;
            for i in 0..4 {
                right[i] += weight * s[i] * residual;
                for j in 0..=i {
                    normal[k] += weight * s[i] * s[j];
                    k += 1;
                }
            }
        }
        let n = normal.map(f64::from);
        // A camera of which little is known stands still.
        let rest = STILLNESS / f64::from(scale * scale);
        let half = 0.5 * size[0];
        let ridges = [rest, rest, 4.0 * rest, 4.0 * rest];
        let from_rest = [motion.shift_px[0], motion.shift_px[1], motion.zoom * half, motion.turn * half];
        let matrix = Matrix4::new(
            n[0] + ridges[0],
            n[1],
            n[3],
            n[6],
            n[1],
            n[2] + ridges[1],
            n[4],
            n[7],
            n[3],
            n[4],
            n[5] + ridges[2],
            n[8],
            n[6],
            n[7],
            n[8],
            n[9] + ridges[3],
        );
        let right = Vector4::from_fn(|i, _| f64::from(right[i]) + ridges[i] * from_rest[i]);
        let Some(step) = matrix.cholesky().map(|factor| factor.solve(&right)) else { return *motion };
        CameraMotion {
            shift_px: [motion.shift_px[0] - step[0], motion.shift_px[1] - step[1]],
            zoom: motion.zoom - step[2] / half,
            turn: motion.turn - step[3] / half,
        }
    }
}

/// How steep it is at the pixels of a row that have a neighbour on either side: across and down together.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn slopes([above, row, below]: [&[i16]; 3], out: &mut [u32]) {
    let down = above[1..].iter().zip(&below[1..]);
    for ((out, (left, right)), (above, below)) in out.iter_mut().zip(row.iter().zip(&row[2..])).zip(down) {
        *out = i32::from(*left).abs_diff(i32::from(*right)) + i32::from(*above).abs_diff(i32::from(*below));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOTION: CameraMotion = CameraMotion { shift_px: [3.2, -1.7], zoom: 0.004, turn: -0.003 };

    #[test]
    fn slopes_are_those_of_their_definition() {
        let row = |seed: i32| -> Vec<i16> {
            let value = |x: i32| (x * 7919 + seed * 104_729) % 65_536 - 32_768;
            (0..70).map(|x| i16::try_from(value(x)).expect("of 16 bits")).collect()
        };
        let [above, here, below] = [1, 2, 3].map(row);
        let mut found = vec![0; 68];
        slopes([&above, &here, &below], &mut found);
        for x in 1..69 {
            let [left, right, up, down] = [here[x - 1], here[x + 1], above[x], below[x]].map(i64::from);
            assert_eq!(i64::from(found[x - 1]), (right - left).abs() + (down - up).abs(), "{x}");
        }
    }

    #[test]
    fn a_motion_undone_is_none_and_two_are_one() {
        let place = [101.0, -57.0];
        let back = MOTION.invert(MOTION.apply(place));
        assert!((back[0] - place[0]).hypot(back[1] - place[1]) < 1e-9);
        let before = CameraMotion { shift_px: [-0.4, 5.0], zoom: -0.02, turn: 0.03 };
        let (twice, once) = (before.apply(MOTION.apply(place)), MOTION.then(&before).apply(place));
        assert!((twice[0] - once[0]).hypot(twice[1] - once[1]) < 1e-9);
    }

    /// Levels of a scene of which a pixel at `place` from the middle shows what is at `of(place)`.
    fn levels(of: impl Fn([f64; 2]) -> [f64; 2], target: [f64; 2]) -> (Vec<Level>, Vec<Cells>) {
        let samples: Vec<u8> = (0..256 * 320)
            .map(|index| {
                let place = [f64::from(index % 320) + 0.5 - 160.0, f64::from(index / 320) + 0.5 - 128.0];
                let [x, y] = of(place);
                let texture =
                    (x / 5.0).sin() * (y / 7.0).cos() + (x / 17.0 + y / 11.0).sin() + (y / 23.0 - x / 40.0).cos();
                // It moves its own way.
                let is_target = (place[0] - target[0]).hypot(place[1] - target[1]) < 14.0;
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "of 255")]
                let sample = if is_target { 20 } else { (128.0 + 30.0 * texture) as u8 };
                sample
            })
            .collect();
        let mut levels = vec![Level::default(); 4];
        levels[0].take_frame(&samples, 320, 256);
        for index in 1..4 {
            let (below, above) = levels.split_at_mut(index);
            above[0].take_half(&below[index - 1]);
        }
        let cells = levels.iter().map(|level| {
            let map: Vec<u16> = level.contrast.iter().map(|contrast| contrast.unsigned_abs()).collect();
            let mut cells = Cells::default();
            cells.take(&map, level.width, level.height);
            cells
        });
        let cells = cells.collect();
        (levels, cells)
    }

    #[test]
    fn the_motion_of_a_scene_is_found_though_something_in_it_moves_otherwise() {
        let (before, _) = levels(|place| place, [40.0, 20.0]);
        let (new, cells) = levels(|place| MOTION.apply(place), [49.0, 15.0]);
        let found = Aligner::default().align(&new, &cells, &before, CameraMotion::default());
        for place in [[0.0, 0.0], [-140.0, 100.0], [140.0, -100.0]] {
            let (truth, found) = (MOTION.apply(place), found.apply(place));
            let error = (truth[0] - found[0]).hypot(truth[1] - found[1]);
            // The finest level used has pixels of two; a camera is drawn a little towards rest.
            assert!(error < 0.5, "{error} px at {place:?}");
        }
    }
}
