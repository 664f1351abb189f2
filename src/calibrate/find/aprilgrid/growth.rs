//! Tags beside those that were read, where these have them.

use nalgebra::{Vector2, Vector3};

use super::corners::Corner;
use super::plane::Plane;
use super::tag::Tag;
use crate::board::AprilGrid;
use crate::camera::Pixel;

/// A corner lies within this of where a neighbouring tag has it, sides of that tag; the cells' own corners are twice as far.
const REACH: f64 = 0.14;

/// And within this at least, px.
const MIN_REACH_PX: f64 = 1.5;

/// Reads what lies beside the tags, and beside what is read so.
pub(super) fn grow(raw: &Plane, corners: &[Corner], tags: &mut Vec<Tag>, grid: &AprilGrid) {
    let columns = grid.columns as usize;
    let all = columns * grid.rows as usize;
    let mut next = 0;
    // Each tag is read once, so this ends.
    while next < tags.len() && tags.len() <= 4 * all {
        let number = tags[next].number;
        if number < all {
            let beside = [
                (number % columns + 1 < columns, number + 1, [1.0, 0.0]),
                (!number.is_multiple_of(columns), number.wrapping_sub(1), [-1.0, 0.0]),
                (number + columns < all, number + columns, [0.0, -1.0]),
                (number >= columns, number.wrapping_sub(columns), [0.0, 1.0]),
            ];
            for (is_there, number, way) in beside {
                if !is_there {
                    continue;
                }
                if let Some(tag) = read(raw, corners, &tags[next], number, Vector2::from(way), grid)
                    && !tags.iter().any(|other| other.is_same(&tag))
                {
                    tags.push(tag);
                }
            }
        }
        next += 1;
    }
}

fn read(
    raw: &Plane,
    corners: &[Corner],
    from: &Tag,
    number: usize,
    way: Vector2<f64>,
    grid: &AprilGrid,
) -> Option<Tag> {
    let shift = way * (1.0 + grid.gap_m / grid.tag_m);
    // Clockwise as one sees the picture.
    let expected =
        [[0.0, -1.0], [1.0, -1.0], [1.0, 0.0], [0.0, 0.0]].map(|place| from.pixel_of(&(Vector2::from(place) + shift)));
    let [a, b, c, d] =
        expected.map(|pixel| nearest(corners, &pixel?, (REACH * from.least_side_px()).max(MIN_REACH_PX)));
    let tag = Tag::read(raw, &[a?, b?, c?, d?], grid)?;
    (tag.number == number).then_some(tag)
}

fn nearest(corners: &[Corner], pixel: &Pixel, reach_px: f64) -> Option<Pixel> {
    let distance = |corner: &&Corner| (corner.place - pixel).norm_squared();
    let nearest = corners.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    (distance(&nearest) <= reach_px * reach_px).then_some(nearest.place)
}

impl Tag {
    /// Where a place is seen, in sides of the tag from its lower left corner.
    fn pixel_of(&self, place: &Vector2<f64>) -> Option<Pixel> {
        let image = self.pixel_from_sides * Vector3::new(place.x, place.y, 1.0);
        (image.z > 0.0).then(|| image.xy() / image.z)
    }
}
