//! What else is in a patch: lines, edges, other things, of which a part lies under the rim.
//!
//! Beyond the rim they are plain to see. Where they run into it no pixel stands out, as edges are never exactly where a model has them; but
//! a pixel that is off in the same direction as its neighbour that is foreign belongs to the same thing. So what is found beyond the rim
//! is followed into it (hysteresis, as edges are followed by Canny 1986).

use super::pass::{GROUND, Looked};
use super::patch::{Octet, Patch};

/// A pixel of the ground is foreign from so many deviations on, and its neighbours from as many on.
const SEED: f64 = 7.0;
const GROWN: f32 = 2.5;

/// The patch as a square of pixels, with a border of none; patch after patch in the same memory.
#[derive(Default)]
pub(super) struct Picture {
    side: usize,
    cells: Vec<Cell>,
    /// Cells whose neighbours are still to be looked at.
    open: Vec<usize>,
}

#[derive(Clone, Copy, Default)]
struct Cell {
    /// How far the pixel is off, in deviations.
    size: f32,
    is_foreign: bool,
}

/// Pixels of a row of it.
const fn side(patch: &Patch<'_>) -> usize {
    2 * patch.reach + 3
}

/// Where a sample of it stands.
fn place(side: usize, octet: &Octet, lane: usize) -> usize {
    let middle = (side / 2) as f32;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "no sample is beyond the reach")]
    let [column, row] = [octet.x.0[lane], octet.y.0[lane]].map(|at| (at + middle) as usize);
    row * side + column
}

impl Picture {
    /// Takes the pixels of foreign things out of the patch, and puts all others back in. `farthest` is the largest residual of the ground.
    pub(super) fn take_out(&mut self, patch: &mut Patch<'_>, looked: &[Looked], farthest: f64, noise: f64) {
        if farthest <= SEED * noise {
            for octet in patch.luma.octets_mut() {
                octet.free = octet.there;
            }
            return;
        }
        self.draw(patch, looked);
        let side = self.side;
        let is_seed = |looked: &Looked, lane: usize| {
            looked.share.0[lane] < GROUND && f64::from(looked.residual.0[lane].abs()) > SEED * noise
        };
        self.open.clear();
        self.open.extend(patch.luma.octets().zip(looked).flat_map(|(octet, looked)| {
            octet.lanes().filter(move |lane| is_seed(looked, *lane)).map(move |lane| place(side, octet, lane))
        }));
        self.grow();
        for octet in patch.luma.octets_mut() {
            for lane in octet.lanes() {
                octet.free.0[lane] = if self.cells[place(side, octet, lane)].is_foreign { 0.0 } else { 1.0 };
            }
        }
    }

    fn draw(&mut self, patch: &Patch<'_>, looked: &[Looked]) {
        self.side = side(patch);
        self.cells.clear();
        self.cells.resize(self.side * self.side, Cell::default());
        for (octet, looked) in patch.luma.octets().zip(looked) {
            for lane in octet.lanes() {
                self.cells[place(self.side, octet, lane)].size =
                    looked.residual.0[lane] / looked.variance.0[lane].sqrt();
            }
        }
    }

    /// Takes in the open cells, and what is next to them and off in their direction.
    fn grow(&mut self) {
        for index in &self.open {
            self.cells[*index].is_foreign = true;
        }
        while let Some(index) = self.open.pop() {
            let sign = self.cells[index].size.signum();
            for row in [index - self.side, index, index + self.side] {
                for next in row - 1..=row + 1 {
                    let cell = &mut self.cells[next];
                    if !cell.is_foreign && cell.size * sign > GROWN {
                        cell.is_foreign = true;
                        self.open.push(next);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::super::lanes::{LANES, Lanes};
    use super::super::patch::Gatherer;
    use super::super::{Likeness, Seed};
    use super::*;
    use crate::frame::{Coding, Frame, Pixels};

    const RADIUS: f32 = 6.0;

    fn patch(gatherer: &mut Gatherer) -> Patch<'_> {
        let frame = Frame::checked(41, 41, Pixels::Luma(vec![100; 41 * 41]), Coding::LOSSLESS).expect("a frame");
        let moments = Matrix2::identity() * f64::from(0.25 * RADIUS * RADIUS);
        let seed = Seed { pixel: Vector2::new(20.0, 20.0), moments, sigma_px: 0.1 };
        gatherer.around(&frame, &seed, &[], None, &Likeness::MARKER).expect("inside the frame")
    }

    /// Residuals, in deviations of one, of a disc with soft rim.
    fn looked(patch: &Patch<'_>, residual: impl Fn(f32, f32) -> f32) -> Vec<Looked> {
        let of = |octet: &Octet| {
            let lanes = |f: &dyn Fn(f32, f32) -> f32| {
                Lanes(std::array::from_fn(|lane| f(octet.x.0[lane], octet.y.0[lane]) * octet.there.0[lane]))
            };
            Looked {
                residual: lanes(&residual),
                variance: Lanes([1.0; LANES]),
                share: lanes(&|x, y| (RADIUS + 0.5 - x.hypot(y)).clamp(0.0, 1.0)),
            }
        };
        patch.luma.octets().map(of).collect()
    }

    /// The largest residual of the ground.
    fn farthest(looked: &[Looked]) -> f64 {
        let lanes = looked.iter().flat_map(|l| l.residual.0.iter().zip(l.share.0));
        lanes.filter(|(_, share)| *share < GROUND).map(|(residual, _)| f64::from(residual.abs())).fold(0.0, f64::max)
    }

    /// The pixels that are out.
    fn out(patch: &Patch<'_>) -> Vec<(f32, f32)> {
        let octets = patch.luma.octets();
        let out = octets.flat_map(|o| o.lanes().filter(|i| o.free.0[*i] == 0.0).map(|i| (o.x.0[i], o.y.0[i])));
        let mut out: Vec<(f32, f32)> = out.collect();
        out.sort_by(|a, b| a.partial_cmp(b).expect("whole numbers"));
        out
    }

    #[test]
    fn a_thing_beyond_the_rim_is_followed_into_it_and_no_farther() {
        let mut gatherer = Gatherer::default();
        let mut patch = patch(&mut gatherer);
        let mut picture = Picture::default();
        // A dark line that runs into the disc from the right and fades; a bright pixel next to it, and one dark pixel by itself in the rim.
        let residual = |x: f32, y: f32| match (x, y) {
            (8.0, 0.0) => -9.0,
            (5.0..8.0, 0.0) => -3.0,
            (4.0, 0.0) => -2.0,
            (6.0, 1.0) => 5.0,
            (-6.0, 0.0) => -5.0,
            _ => 0.0,
        };
        let looked = looked(&patch, residual);
        picture.take_out(&mut patch, &looked, farthest(&looked), 1.0);
        assert_eq!(out(&patch), [(5.0, 0.0), (6.0, 0.0), (7.0, 0.0), (8.0, 0.0)]);
    }

    #[test]
    fn what_is_far_off_on_the_disc_is_no_start_and_what_fits_again_is_put_back() {
        let mut gatherer = Gatherer::default();
        let mut patch = patch(&mut gatherer);
        let mut picture = Picture::default();
        let on_disc = looked(&patch, |x, y| if (x, y) == (2.0, 0.0) { -30.0 } else { 0.0 });
        picture.take_out(&mut patch, &on_disc, farthest(&on_disc), 1.0);
        assert_eq!(out(&patch), []);
        let beyond = looked(&patch, |x, y| if (x, y) == (0.0, -8.0) { 30.0 } else { 0.0 });
        picture.take_out(&mut patch, &beyond, farthest(&beyond), 1.0);
        assert_eq!(out(&patch), [(0.0, -8.0)]);
        picture.take_out(&mut patch, &beyond, farthest(&beyond), 5.0);
        assert_eq!(out(&patch), [], "that is six deviations of more noise");
        picture.take_out(&mut patch, &beyond, farthest(&beyond), 1.0);
        picture.take_out(&mut patch, &on_disc, farthest(&on_disc), 1.0);
        assert_eq!(out(&patch), []);
    }
}
