//! What else is in a patch: lines, edges, other things, of which a part lies under the rim.
//!
//! Beyond the rim they are plain to see. Where they run into it no pixel stands out, as edges are never exactly where a model has them; but
//! a pixel that is off in the same direction as its neighbour that is foreign belongs to the same thing. So what is found beyond the rim
//! is followed into it (hysteresis, as edges are followed by Canny 1986).

use super::pass::Looked;
use super::patch::{Octet, Patch};

/// A pixel of the ground is foreign from so many deviations on, and its neighbours from as many on.
const SEED: f64 = 7.0;
const GROWN: f32 = 2.5;

/// Shares below this are ground.
const GROUND: f32 = 0.05;

/// Takes the pixels of foreign things out of the patch, and puts all others back in.
pub(super) fn take_out(patch: &mut Patch, looked: &[Looked], noise: f64) {
    let is_seed = |looked: &Looked, lane: usize| {
        looked.share.0[lane] < GROUND && f64::from(looked.residual.0[lane].abs()) > SEED * noise
    };
    let octets = || patch.luma.octets().iter().zip(looked);
    let seeds = octets().flat_map(|(octet, looked)| {
        octet.lanes().filter(move |lane| is_seed(looked, *lane)).map(move |lane| (octet, lane))
    });
    let mut seeds = seeds.peekable();
    if seeds.peek().is_none() {
        for octet in patch.luma.octets_mut() {
            octet.free = octet.there;
        }
        return;
    }
    let mut picture = Picture::of(patch, looked);
    let open: Vec<usize> = seeds.map(|(octet, lane)| picture.index(octet, lane)).collect();
    picture.grow(open);
    for octet in patch.luma.octets_mut() {
        for lane in octet.lanes() {
            octet.free.0[lane] = if picture.cells[picture.index(octet, lane)].is_foreign { 0.0 } else { 1.0 };
        }
    }
}

/// The patch as a square of pixels, with a border of none.
struct Picture {
    side: usize,
    cells: Vec<Cell>,
}

#[derive(Clone, Copy, Default)]
struct Cell {
    /// How far the pixel is off, in deviations.
    size: f32,
    is_foreign: bool,
}

impl Picture {
    fn of(patch: &Patch, looked: &[Looked]) -> Self {
        let side = 2 * patch.reach + 3;
        let mut picture = Self { side, cells: vec![Cell::default(); side * side] };
        for (octet, looked) in patch.luma.octets().iter().zip(looked) {
            for lane in octet.lanes() {
                let index = picture.index(octet, lane);
                picture.cells[index].size = looked.residual.0[lane] / looked.variance.0[lane].sqrt();
            }
        }
        picture
    }

    fn index(&self, octet: &Octet, lane: usize) -> usize {
        let middle = (self.side / 2) as f32;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "no sample is beyond the reach")]
        let [column, row] = [octet.x.0[lane], octet.y.0[lane]].map(|at| (at + middle) as usize);
        row * self.side + column
    }

    /// Takes in the cells of `open`, and what is next to them and off in their direction.
    fn grow(&mut self, mut open: Vec<usize>) {
        for index in &open {
            self.cells[*index].is_foreign = true;
        }
        while let Some(index) = open.pop() {
            let sign = self.cells[index].size.signum();
            for row in [index - self.side, index, index + self.side] {
                for next in row - 1..=row + 1 {
                    let cell = &mut self.cells[next];
                    if !cell.is_foreign && cell.size * sign > GROWN {
                        cell.is_foreign = true;
                        open.push(next);
                    }
                }
            }
        }
    }
}
