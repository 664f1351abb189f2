//! Which answer belongs to which track.

/// For each row the column that it gets, so that as many rows as possible get one and, among those ways, the sum of the costs is
/// the least. `None` as a cost is a pair that cannot be.
///
/// Shortest augmenting paths: Jonker and Volgenant, "A shortest augmenting path algorithm for dense and sparse linear
/// assignment problems", Computing 38, 1987.
pub(super) fn assign(costs: &[Vec<Option<f64>>], columns: usize) -> Vec<Option<usize>> {
    let rows = costs.len();
    // Every row may stay alone, in a column of its own, at a price above any sum of others.
    let largest = costs.iter().flatten().flatten().fold(0.0_f64, |most, cost| most.max(cost.abs()));
    let alone = (2.0 * largest + 1.0) * (rows + 1) as f64;
    let never = alone * (rows + 1) as f64 * 4.0;
    let cost = |row: usize, column: usize| match column.checked_sub(columns) {
        None => costs[row][column].unwrap_or(never),
        Some(own) if own == row => alone,
        Some(_) => never,
    };
    let width = columns + rows;
    let (mut row_price, mut column_price) = (vec![0.0; rows], vec![0.0; width]);
    let mut row_of: Vec<Option<usize>> = vec![None; width];
    for start in 0..rows {
        let mut nearest = vec![(f64::INFINITY, None); width];
        let mut is_done = vec![false; width];
        let mut path = Vec::new();
        let (mut row, mut from) = (start, None);
        let end = loop {
            let mut next = (f64::INFINITY, 0);
            for column in (0..width).filter(|column| !is_done[*column]) {
                let reduced = cost(row, column) - row_price[row] - column_price[column];
                if reduced < nearest[column].0 {
                    nearest[column] = (reduced, from);
                }
                if nearest[column].0 < next.0 {
                    next = (nearest[column].0, column);
                }
            }
            let (step, column) = next;
            // The rows and columns on the path share the step, so that the pair found costs nothing any more.
            row_price[start] += step;
            for &done in &path {
                column_price[done] -= step;
                let owner: Option<usize> = row_of[done];
                if let Some(owner) = owner {
                    row_price[owner] += step;
                }
            }
            for other in (0..width).filter(|other| !is_done[*other]) {
                nearest[other].0 -= step;
            }
            is_done[column] = true;
            path.push(column);
            match row_of[column] {
                Some(owner) => (row, from) = (owner, Some(column)),
                None => break column,
            }
        };
        let mut column = end;
        while let Some(before) = nearest[column].1 {
            row_of[column] = row_of[before];
            column = before;
        }
        row_of[column] = Some(start);
    }
    let mut column_of = vec![None; rows];
    for (column, owner) in row_of.into_iter().enumerate().take(columns) {
        if let Some(row) = owner
            && costs[row][column].is_some()
        {
            column_of[row] = Some(column);
        }
    }
    column_of
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Number of rows that get a column, and the sum of their costs.
    fn worth(costs: &[Vec<Option<f64>>], columns: &[Option<usize>]) -> (usize, f64) {
        let taken = columns.iter().enumerate().filter_map(|(row, column)| column.and_then(|c| costs[row][c]));
        taken.fold((0, 0.0), |(count, sum), cost| (count + 1, sum + cost))
    }

    /// The best of all ways.
    fn obvious(costs: &[Vec<Option<f64>>], row: usize, used: u32) -> (usize, f64) {
        if row == costs.len() {
            return (0, 0.0);
        }
        let mut best = obvious(costs, row + 1, used);
        for (column, cost) in costs[row].iter().enumerate() {
            if let Some(cost) = cost.filter(|_| used & (1 << column) == 0) {
                let (count, sum) = obvious(costs, row + 1, used | 1 << column);
                if count + 1 > best.0 || (count + 1 == best.0 && sum + cost < best.1) {
                    best = (count + 1, sum + cost);
                }
            }
        }
        best
    }

    proptest! {
        #[test]
        fn it_is_the_best_of_all_ways(
            columns in 0..5_usize,
            all in proptest::collection::vec(proptest::array::uniform5(proptest::option::of(-50.0..50.0_f64)), 0..6)
        ) {
            let costs: Vec<Vec<Option<f64>>> = all.iter().map(|row| row[..columns].to_vec()).collect();
            let found = assign(&costs, columns);
            let mut taken: Vec<usize> = found.iter().flatten().copied().collect();
            let count = taken.len();
            taken.sort_unstable();
            taken.dedup();
            prop_assert_eq!(taken.len(), count);
            let (best, mine) = (obvious(&costs, 0, 0), worth(&costs, &found));
            prop_assert_eq!(best.0, mine.0);
            prop_assert!((best.1 - mine.1).abs() < 1e-9, "{best:?} {mine:?}");
        }
    }
}
