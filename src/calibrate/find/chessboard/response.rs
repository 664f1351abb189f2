//! Where corners of four squares may be.
//!
//! Bennett and Lasenby, "`ChESS` - quick and robust detection of chess-board features", CVIU 2014: on a ring about such a corner, what lies
//! opposite is alike and what lies a quarter further is not.

use super::pyramid::Plane;

/// The ring of the paper: offsets `(x, y)` of sixteen pixels, 5 px away, opposite ones eight apart.
const RING: [(isize, isize); 16] = [
    (2, -5),
    (0, -5),
    (-2, -5),
    (-4, -4),
    (-5, -2),
    (-5, 0),
    (-5, 2),
    (-4, 4),
    (-2, 5),
    (0, 5),
    (2, 5),
    (4, 4),
    (5, 2),
    (5, 0),
    (5, -2),
    (4, -4),
];

/// The ring's radius, px.
pub(super) const RADIUS: usize = 5;

/// Responses below this are noise: a perfect corner has eight times the difference of black and white.
const MIN_RESPONSE: i16 = 28;

/// A corner is the strongest within so many pixels each way.
const REACH: usize = 3;

/// Most corners that are looked at, the strongest: a board has at most 1600.
const MAX_PEAKS: usize = 5_000;

/// A corner's response is no less than one of so many parts of that of the strong ones: as much darker may a part of the board lie, before
/// its corners are only found where the others have them coming.
const WEAK: i16 = 12;
const STRONG_PEAKS: usize = 16;

/// Strongest responses `[x, y]`, at most [`MAX_PEAKS`].
pub(super) fn peaks(smooth: &Plane<'_>) -> Vec<[usize; 2]> {
    let (width, height) = (smooth.width, smooth.height);
    let border = RADIUS.max(REACH);
    if width <= 2 * border || height <= 2 * border {
        return Vec::new();
    }
    let mut responses = Responses { width, rows: vec![0; HELD * width] };
    let mut found: Vec<(i16, [usize; 2])> = Vec::new();
    for y in RADIUS..height - RADIUS + REACH {
        let out = responses.row_mut(y);
        if y < height - RADIUS {
            let at = |(x, dy): (isize, isize)| {
                let from = (y.saturating_add_signed(dy) * width + RADIUS).saturating_add_signed(x);
                &smooth.samples[from..from + width - 2 * RADIUS]
            };
            respond(&RING.map(at), at((0, 0)), &mut out[RADIUS..width - RADIUS]);
        } else {
            out.fill(0);
        }
        if y >= border + REACH {
            responses.peaks_of(y - REACH, smooth, &mut found);
        }
    }
    if found.len() > STRONG_PEAKS {
        let strong = found.select_nth_unstable_by(STRONG_PEAKS, |a, b| b.cmp(a)).1.0;
        found.retain(|(response, _)| *response >= strong / WEAK);
        found.sort_unstable_by_key(|(_, [x, y])| (*y, *x));
    }
    if found.len() > MAX_PEAKS {
        found.select_nth_unstable_by(MAX_PEAKS, |a, b| b.cmp(a));
        found.truncate(MAX_PEAKS);
        found.sort_unstable_by_key(|(_, [x, y])| (*y, *x));
    }
    found.into_iter().map(|(_, place)| place).collect()
}

/// Differences of black and white below this are not looked at, codes.
const MIN_CONTRAST: u8 = 8;

/// Whether the ring is cut into two black and two white sectors, with a sample's room for noise: a quick look before the thorough one.
fn has_sectors(smooth: &Plane<'_>, [x, y]: [usize; 2]) -> bool {
    let at = |(dx, dy)| smooth.samples[y.saturating_add_signed(dy) * smooth.width + x.saturating_add_signed(dx)];
    let ring = RING.map(at);
    let (least, most) = ring.iter().fold((u8::MAX, 0), |(least, most), value| (least.min(*value), most.max(*value)));
    let gray = least.midpoint(most);
    let changes = (0..16).filter(|n| (ring[*n] > gray) != (ring[(n + 1) % 16] > gray)).count();
    most - least >= MIN_CONTRAST && (4..=6).contains(&changes)
}

/// Rows that are held, a power of two of no less than those that a peak is compared with.
const HELD: usize = 8;

/// The responses of the last rows.
struct Responses {
    width: usize,
    rows: Vec<i16>,
}

impl Responses {
    fn row(&self, y: usize) -> &[i16] {
        let from = y % HELD * self.width;
        &self.rows[from..from + self.width]
    }

    fn row_mut(&mut self, y: usize) -> &mut [i16] {
        let from = y % HELD * self.width;
        &mut self.rows[from..from + self.width]
    }

    fn peaks_of(&self, y: usize, smooth: &Plane<'_>, found: &mut Vec<(i16, [usize; 2])>) {
        for (block, values) in self.row(y).chunks(32).enumerate() {
            if values.iter().fold(0, |most, value| most.max(*value)) < MIN_RESPONSE {
                continue;
            }
            for (x, value) in (32 * block..).zip(values) {
                if *value >= MIN_RESPONSE && self.is_peak([x, y]) && has_sectors(smooth, [x, y]) {
                    found.push((*value, [x, y]));
                }
            }
        }
    }

    /// Among equals the last.
    fn is_peak(&self, [x, y]: [usize; 2]) -> bool {
        let here = self.row(y)[x];
        (y - REACH..=y + REACH).all(|row| {
            let others = &self.row(row)[x - REACH..=x + REACH];
            let mut places = others.iter().zip(x - REACH..);
            places.all(|(other, column)| *other < here || *other == here && (row, column) <= (y, x))
        })
    }
}

/// The paper's sum response less difference response less mean response; the picture is smooth, so that its middle pixel is the
/// mean of the middle.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1+ssse3"))]
fn respond(ring: &[&[u8]; 16], middle: &[u8], out: &mut [i16]) {
    let width = out.len();
    let ring = ring.map(|row| &row[..width]);
    let middle = &middle[..width];
    for x in 0..width {
        let (mut sums, mut differences, mut total) = (0_i16, 0_i16, 0_i16);
        for n in 0..4 {
            let [a, b, c, d] = [ring[n][x], ring[n + 4][x], ring[n + 8][x], ring[n + 12][x]].map(i16::from);
            let (across, along) = (a + c, b + d);
            sums += (across - along).abs();
            differences += (a - c).abs() + (b - d).abs();
            total += across + along;
        }
        out[x] = sums - differences - (total - 16 * i16::from(middle[x])).abs();
    }
}

#[cfg(test)]
mod tests {
    use super::super::pyramid::Level;
    use super::*;

    fn plane(dark: impl Fn(usize, usize) -> bool) -> Plane<'static> {
        let samples = (0..60 * 60).map(|at| if dark(at % 60, at / 60) { 40 } else { 200 }).collect();
        let plane = Plane { width: 60, height: 60, samples };
        Level::of(plane, 1.0).smooth().clone()
    }

    #[test]
    fn a_corner_of_four_squares_is_a_peak_and_other_corners_are_none() {
        let found = peaks(&plane(|x, y| (x < 30) == (y < 27)));
        assert_eq!(found.len(), 1);
        let [x, y] = found[0];
        assert!((29..=30).contains(&x) && (26..=27).contains(&y), "{found:?}");
        assert_eq!(peaks(&plane(|x, _| x < 30)), [[0; 2]; 0], "an edge");
        assert_eq!(peaks(&plane(|x, y| x < 30 && y < 30)), [[0; 2]; 0], "a square's corner");
        assert_eq!(peaks(&plane(|_, _| true)), [[0; 2]; 0], "nothing");
    }

    #[test]
    fn pictures_smaller_than_the_ring_have_none() {
        for side in 0..=10 {
            assert!(peaks(&Plane { width: side, height: side, samples: vec![9; side * side].into() }).is_empty());
        }
    }
}
