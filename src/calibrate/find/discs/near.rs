//! Places in a picture sorted into cells: what is near is found without looking at all of them.

use crate::camera::Pixel;

/// Places by cell.
pub(in super::super) struct Near {
    cell_px: f64,
    columns: usize,
    rows: usize,
    /// Where each cell begins in `members`, and the end of the last.
    starts: Vec<usize>,
    members: Vec<usize>,
    places: Vec<Pixel>,
}

/// Places a cell, on average.
const PER_CELL: f64 = 2.0;

impl Near {
    /// These places in a picture of this size; those outside of it count as at its border.
    pub(in super::super) fn of(places: Vec<Pixel>, width: usize, height: usize) -> Self {
        let cell_px = (PER_CELL * (width * height) as f64 / places.len().max(1) as f64).sqrt().max(4.0);
        let cells = |side: usize| Self::index(side as f64 / cell_px, usize::MAX - 1) + 1;
        let (columns, rows) = (cells(width), cells(height));
        let mut near =
            Self { cell_px, columns, rows, starts: vec![0; columns * rows + 1], members: Vec::new(), places };
        let cells: Vec<usize> = near.places.iter().map(|place| near.cell(place)).collect();
        for cell in &cells {
            near.starts[cell + 1] += 1;
        }
        for cell in 0..columns * rows {
            near.starts[cell + 1] += near.starts[cell];
        }
        let mut next = near.starts.clone();
        near.members = vec![0; cells.len()];
        for (member, cell) in cells.into_iter().enumerate() {
            near.members[next[cell]] = member;
            next[cell] += 1;
        }
        near
    }

    /// Those no further than `reach_px` from `centre`.
    pub(in super::super) fn within(&self, centre: Pixel, reach_px: f64) -> impl Iterator<Item = usize> + '_ {
        let column = |x: f64| Self::index(x / self.cell_px, self.columns - 1);
        let row = |y: f64| Self::index(y / self.cell_px, self.rows - 1);
        let (left, right) = (column(centre.x - reach_px), column(centre.x + reach_px));
        (row(centre.y - reach_px)..=row(centre.y + reach_px))
            .flat_map(move |row| {
                let from = row * self.columns;
                self.members[self.starts[from + left]..self.starts[from + right + 1]].iter().copied()
            })
            .filter(move |member| (self.places[*member] - centre).norm_squared() <= reach_px * reach_px)
    }

    /// The nearest no further than `reach_px` for which `fits` holds.
    pub(in super::super) fn nearest(
        &self,
        centre: Pixel,
        reach_px: f64,
        fits: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let distance = |member: &usize| (self.places[*member] - centre).norm_squared();
        self.within(centre, reach_px).filter(|member| fits(*member)).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    fn cell(&self, place: &Pixel) -> usize {
        let column = Self::index(place.x / self.cell_px, self.columns - 1);
        Self::index(place.y / self.cell_px, self.rows - 1) * self.columns + column
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "casting saturates; NaN is the first")]
    fn index(at: f64, last: usize) -> usize {
        (at as usize).min(last)
    }
}
