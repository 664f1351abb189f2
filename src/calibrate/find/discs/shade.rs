//! What is dark against its surroundings.
//!
//! Light falls off across a picture and shadows lie on it, so what is dark is told by the darkest and lightest that is near.
//! How near depends on the place: as near as there is contrast. In the middle of a large disc that is its own rim, beside
//! a small one the paper around it.

use super::super::Luma;

/// Side of a tile, px.
const TILE: usize = 8;

/// Tiles are looked at with their neighbours, and where that shows no contrast, four together and so on, so many times.
const LEVELS: usize = 8;

/// Least contrast, codes, beyond what noise shows.
const MIN_CONTRAST: u8 = 12;

/// What noise shows, in standard deviations of a pixel: the range of a few thousand pixels, softened.
const NOISE_RANGE: u8 = 3;

/// Every so many rows the noise is measured.
const NOISE_ROWS: usize = 5;

/// Darkest and lightest of each tile.
struct Extremes {
    columns: usize,
    rows: usize,
    least: Vec<u8>,
    most: Vec<u8>,
}

/// 255 where the picture is dark, else 0.
pub(super) fn dark(picture: &Luma) -> Vec<u8> {
    let soft = softened(picture);
    let tiles = Extremes::of(&soft, picture.width);
    let thresholds = thresholds(&tiles, contrast_limit(picture));
    let mut mask = vec![0; soft.len()];
    let rows = mask.chunks_exact_mut(picture.width).zip(soft.chunks_exact(picture.width));
    for (y, (out, row)) in rows.enumerate() {
        let thresholds = &thresholds[y / TILE * tiles.columns..];
        for ((out, tile), threshold) in out.chunks_mut(TILE).zip(row.chunks(TILE)).zip(thresholds) {
            for (out, sample) in out.iter_mut().zip(tile) {
                *out = if sample < threshold { u8::MAX } else { 0 };
            }
        }
    }
    mask
}

/// Through a 3 x 3 binomial: noise makes specks of what is in the middle between dark and light.
fn softened(picture: &Luma) -> Vec<u8> {
    let Luma { width, height, samples } = picture;
    let (width, height) = (*width, *height);
    let mut soft = samples.clone();
    if width < 3 {
        return soft;
    }
    let mut sums = vec![0_u16; width];
    for y in 1..height.saturating_sub(1) {
        let [above, here, below] = [y - 1, y, y + 1].map(|y| &samples[y * width..(y + 1) * width]);
        for (sum, ((a, b), c)) in sums.iter_mut().zip(above.iter().zip(here).zip(below)) {
            *sum = u16::from(*a) + 2 * u16::from(*b) + u16::from(*c);
        }
        let out = &mut soft[y * width + 1..(y + 1) * width - 1];
        for (out, ((a, b), c)) in out.iter_mut().zip(sums.iter().zip(&sums[1..]).zip(&sums[2..])) {
            #[expect(clippy::cast_possible_truncation, reason = "the weights sum to 16")]
            let mean = ((a + 2 * b + c + 8) >> 4) as u8;
            *out = mean;
        }
    }
    soft
}

impl Extremes {
    fn of(samples: &[u8], width: usize) -> Self {
        let columns = width.div_ceil(TILE);
        let rows = (samples.len() / width).div_ceil(TILE);
        let (mut least, mut most) = (vec![u8::MAX; columns * rows], vec![0; columns * rows]);
        for (y, row) in samples.chunks_exact(width).enumerate() {
            let from = y / TILE * columns;
            let tiles = least[from..].iter_mut().zip(&mut most[from..]);
            for ((least, most), samples) in tiles.zip(row.chunks(TILE)) {
                for sample in samples {
                    *least = (*least).min(*sample);
                    *most = (*most).max(*sample);
                }
            }
        }
        Self { columns, rows, least, most }
    }

    /// Of two by two tiles each.
    fn halved(&self) -> Self {
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        let (mut least, mut most) = (vec![u8::MAX; columns * rows], vec![0; columns * rows]);
        for row in 0..self.rows {
            for column in 0..self.columns {
                let (from, to) = (row * self.columns + column, row / 2 * columns + column / 2);
                least[to] = least[to].min(self.least[from]);
                most[to] = most[to].max(self.most[from]);
            }
        }
        Self { columns, rows, least, most }
    }

    /// Darkest and lightest of the tile and the eight around it.
    fn around(&self, column: usize, row: usize) -> (u8, u8) {
        let (mut least, mut most) = (u8::MAX, 0);
        for row in row.saturating_sub(1)..(row + 2).min(self.rows) {
            let tiles =
                row * self.columns + column.saturating_sub(1)..row * self.columns + (column + 2).min(self.columns);
            least = self.least[tiles.clone()].iter().fold(least, |a, b| a.min(*b));
            most = self.most[tiles].iter().fold(most, |a, b| a.max(*b));
        }
        (least, most)
    }
}

/// What is contrast and no noise.
fn contrast_limit(picture: &Luma) -> u8 {
    let mut counts = [0_usize; 256];
    for row in picture.samples.chunks_exact(picture.width).step_by(NOISE_ROWS) {
        for (a, b) in row.iter().zip(&row[1..]) {
            counts[usize::from(a.abs_diff(*b))] += 1;
        }
    }
    // The median of the difference of two normal variables is 0.95 of their deviation.
    let half = counts.iter().sum::<usize>() / 2;
    let mut below = 0;
    let noise = counts.iter().take_while(|count| {
        below += **count;
        below <= half
    });
    u8::try_from(noise.count()).unwrap_or(u8::MAX).saturating_mul(NOISE_RANGE).min(100).saturating_add(MIN_CONTRAST)
}

/// For each tile the code below which a pixel is dark.
fn thresholds(tiles: &Extremes, contrast: u8) -> Vec<u8> {
    let mut found: Vec<Option<u8>> = vec![None; tiles.columns * tiles.rows];
    let mut coarser: Option<Extremes> = None;
    for level in 0..LEVELS {
        let here = coarser.as_ref().unwrap_or(tiles);
        for row in 0..tiles.rows {
            for column in 0..tiles.columns {
                let threshold = &mut found[row * tiles.columns + column];
                if threshold.is_none() {
                    let (least, most) = here.around(column >> level, row >> level);
                    *threshold = (most.saturating_sub(least) >= contrast).then(|| least.midpoint(most));
                }
            }
        }
        coarser = Some(here.halved());
    }
    found.into_iter().map(Option::unwrap_or_default).collect()
}
