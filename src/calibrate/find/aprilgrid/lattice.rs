//! Tags that lie to each other as on the board.

use nalgebra::Vector2;

use super::tag::Tag;
use crate::board::AprilGrid;

/// What tags make.
pub(super) enum Seen {
    /// The tags of the board that are seen, maybe none.
    Board(Vec<Tag>),
    /// So many equal boards.
    Several(usize),
    /// A board of other columns or rows.
    Other {
        /// Its columns.
        columns: usize,
        /// Its rows, at least.
        rows: usize,
    },
}

/// Tags further apart than this are not compared, columns or rows.
const REACH: i64 = 3;

/// A corner lies within this of where another tag has it, sides; the more the further the tags are apart.
const MAX_MISS: f64 = 0.2;

/// Two neighbours above each other tell how many columns the board has; so many pairs must.
const MIN_VOTES: usize = 2;

/// What the tags make.
pub(super) fn of(tags: Vec<Tag>, grid: &AprilGrid) -> Seen {
    if let Some(other) = other(&tags, grid) {
        return other;
    }
    let all = (grid.columns * grid.rows) as usize;
    let tags: Vec<Tag> = tags.into_iter().filter(|tag| tag.number < all).collect();
    let mut groups = groups(&tags, grid);
    groups.sort_by_key(|group| std::cmp::Reverse(group.len()));
    let Some(first) = groups.first() else { return Seen::Board(Vec::new()) };
    let is_in_first = |tag: usize| first.iter().any(|other| tags[*other].number == tags[tag].number);
    let rivals = groups[1..].iter().filter(|group| group.len() > 1 && group.iter().any(|tag| is_in_first(*tag)));
    let count = 1 + rivals.count();
    if count > 1 {
        return Seen::Several(count);
    }
    let mut stays = vec![false; tags.len()];
    for tag in first {
        stays[*tag] = true;
    }
    let mut board: Vec<Tag> = tags.into_iter().zip(stays).filter(|(_, stays)| *stays).map(|(tag, _)| tag).collect();
    board.sort_by_key(|tag| tag.number);
    Seen::Board(board)
}

/// Column and row, rows upwards.
fn cell(number: usize, columns: u32) -> [i64; 2] {
    let columns = columns as usize;
    [number % columns, number / columns].map(|c| i64::try_from(c).unwrap_or(i64::MAX))
}

/// Whether `other` lies so many columns and rows from `tag`, as `tag` and `other` see it.
fn lies(tag: &Tag, other: &Tag, [columns, rows]: [i64; 2], step: f64) -> bool {
    let agrees = |tag: &Tag, other: &Tag, sign: f64| {
        let shift = Vector2::new(columns as f64, -rows as f64) * (sign * step);
        let limit = MAX_MISS * columns.abs().max(rows.abs()) as f64;
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, -1.0], [0.0, -1.0]];
        other.corners.iter().zip(square).all(|(corner, expected)| {
            tag.place_of(corner).is_some_and(|place| (place - shift - Vector2::from(expected)).norm() < limit)
        })
    };
    agrees(tag, other, 1.0) && agrees(other, tag, -1.0)
}

fn step(grid: &AprilGrid) -> f64 {
    1.0 + grid.gap_m / grid.tag_m
}

/// Groups of tags that hang together; a tag that nothing hangs together with is none.
fn groups(tags: &[Tag], grid: &AprilGrid) -> Vec<Vec<usize>> {
    let mut group: Vec<usize> = (0..tags.len()).collect();
    for (a, tag) in tags.iter().enumerate() {
        for (b, other) in tags.iter().enumerate().skip(a + 1) {
            let ([column, row], [to_column, to_row]) =
                (cell(tag.number, grid.columns), cell(other.number, grid.columns));
            let way = [to_column - column, to_row - row];
            let distance = way[0].abs().max(way[1].abs());
            if group[a] != group[b] && (1..=REACH).contains(&distance) && lies(tag, other, way, step(grid)) {
                let (old, new) = (group[b], group[a]);
                group.iter_mut().filter(|group| **group == old).for_each(|group| *group = new);
            }
        }
    }
    let members = |wanted: usize| (0..tags.len()).filter(|tag| group[*tag] == wanted).collect::<Vec<_>>();
    (0..tags.len()).map(members).filter(|members| members.len() > 1).collect()
}

/// A board whose tags are numbered otherwise.
fn other(tags: &[Tag], grid: &AprilGrid) -> Option<Seen> {
    let mut votes: Vec<(usize, usize)> = Vec::new();
    let mut highest = 0;
    for tag in tags {
        for above in tags.iter().filter(|above| above.number > tag.number) {
            if lies(tag, above, [0, 1], step(grid)) {
                let columns = above.number - tag.number;
                highest = highest.max(above.number);
                match votes.iter_mut().find(|(voted, _)| *voted == columns) {
                    Some((_, count)) => *count += 1,
                    None => votes.push((columns, 1)),
                }
            }
        }
    }
    let (columns, _) = votes.into_iter().filter(|(_, count)| *count >= MIN_VOTES).max_by_key(|(_, count)| *count)?;
    let rows = highest / columns + 1;
    let is_other = columns != grid.columns as usize || rows > grid.rows as usize;
    is_other.then_some(Seen::Other { columns, rows })
}
