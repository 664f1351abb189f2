//! Four corners that black edges join: what may be a tag.

use nalgebra::Vector2;

use super::corners::Corner;
use super::plane::Plane;
use crate::camera::Pixel;

/// Four corners, clockwise as one sees the picture, black inside.
pub(super) type Quad = [Pixel; 4];

/// The next corner lies off an edge's direction by no more than this share of the distance, and some px: small corners know their
/// directions coarsely, and lenses bend.
const MAX_SLANT: f64 = 0.2;
const MAX_OFF_PX: f64 = 1.0;

/// Least side of a quad, px.
const MIN_SIDE_PX: f64 = 6.0;

/// Nearest corners on an edge's way that are tried as its end, and corners around that are looked at for them.
const TRIED: usize = 6;
const MAX_LOOKS: usize = 400;

/// The end of an edge is about as strong a corner as its beginning: noise makes weak ones beside edges.
const MIN_STRENGTH: f64 = 0.3;

/// Places at which an edge is looked at.
const LOOKS: u32 = 8;

/// Least white less black over an edge, codes, and as a share of the most.
const MIN_CONTRAST: f64 = 6.0;
const MIN_SHARE: f64 = 0.3;

/// The quads of these corners.
pub(super) fn quads(smooth: &Plane, corners: &[Corner]) -> Vec<Quad> {
    let buckets = Buckets::of(smooth, corners);
    // The ends of the edges that leave each corner on its four ways with black on the right.
    let ends: Vec<[Option<usize>; 4]> = (0..corners.len()).map(|from| ends(smooth, corners, &buckets, from)).collect();
    let mut quads = Vec::new();
    for first in 0..corners.len() {
        for first_way in 0..4 {
            let mut walk = [first; 4];
            let (mut here, mut way) = (first, first_way);
            let closes = (1..=4).all(|step| {
                let Some(there) = ends[here][way] else { return false };
                let along = corners[there].place - corners[here].place;
                way = turned_right(&corners[there], &along);
                here = there;
                match walk.get_mut(step) {
                    // Each quad is found from each of its corners: the first of the list counts.
                    Some(place) if there > first => *place = there,
                    Some(_) => return false,
                    None => return there == first,
                }
                true
            });
            if closes {
                quads.push(walk.map(|corner| corners[corner].place));
            }
        }
    }
    quads
}

/// The four ways out of a corner, opposite ones two apart.
fn ways(corner: &Corner) -> [Vector2<f64>; 4] {
    let [a, b] = corner.edges;
    [a, b, -a, -b]
}

/// The way that leaves a corner to the right of where one comes from.
fn turned_right(corner: &Corner, along: &Vector2<f64>) -> usize {
    let [a, b] = corner.edges.map(|edge| edge.dot(along).abs());
    let other = usize::from(a > b);
    if along.perp(&corner.edges[other]) > 0.0 { other } else { other + 2 }
}

/// The nearest corner on each way, with black on its right all along.
fn ends(smooth: &Plane, corners: &[Corner], buckets: &Buckets, from: usize) -> [Option<usize>; 4] {
    let corner = &corners[from];
    let mut near: [Vec<(f64, usize)>; 4] = std::array::from_fn(|_| Vec::new());
    let mut looks = 0;
    buckets.visit(&corner.place, |to| {
        looks += 1;
        let along = corners[to].place - corner.place;
        for (way, near) in ways(corner).iter().zip(&mut near) {
            let distance = along.dot(way);
            let is_on_way = distance >= MIN_SIDE_PX && along.perp(way).abs() <= MAX_SLANT * distance + MAX_OFF_PX;
            let is_like = corners[to].strength >= MIN_STRENGTH * corner.strength;
            if is_on_way && is_like && to != from && is_crossed_by(&corners[to], &along) {
                near.push((distance, to));
            }
        }
        looks > MAX_LOOKS
    });
    near.map(|mut near| {
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut tried = near.into_iter().take(TRIED).map(|(_, to)| to);
        tried.find(|to| is_edge(smooth, &corner.place, &corners[*to].place))
    })
}

/// Whether one of the corner's edges goes this way.
fn is_crossed_by(corner: &Corner, along: &Vector2<f64>) -> bool {
    let length = along.norm();
    corner.edges.iter().any(|edge| edge.perp(along).abs() <= (2.0 * MAX_SLANT) * length + MAX_OFF_PX)
}

/// Whether white is on the left and black on the right all the way.
fn is_edge(smooth: &Plane, from: &Pixel, to: &Pixel) -> bool {
    let along = to - from;
    let length = along.norm();
    let right = Vector2::new(-along.y, along.x) * ((0.07 * length).clamp(1.2, 5.0) / length);
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for look in 0..LOOKS {
        let share = 0.12 + 0.76 * f64::from(look) / f64::from(LOOKS - 1);
        let place = from + along * share;
        let (Some(white), Some(black)) = (smooth.at(&(place - right)), smooth.at(&(place + right))) else {
            return false;
        };
        least = least.min(white - black);
        most = most.max(white - black);
    }
    least >= MIN_CONTRAST && least >= MIN_SHARE * most
}

/// The corners sorted into squares of the picture.
struct Buckets {
    columns: usize,
    rows: usize,
    cells: Vec<Vec<usize>>,
}

/// Side of a square, px.
const BUCKET_PX: usize = 24;

impl Buckets {
    fn of(plane: &Plane, corners: &[Corner]) -> Self {
        let (columns, rows) = (plane.width / BUCKET_PX + 1, plane.height / BUCKET_PX + 1);
        let mut buckets = Self { columns, rows, cells: vec![Vec::new(); columns * rows] };
        for (index, corner) in corners.iter().enumerate() {
            let [x, y] = buckets.cell(&corner.place);
            buckets.cells[y * columns + x].push(index);
        }
        buckets
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the picture")]
    fn cell(&self, place: &Pixel) -> [usize; 2] {
        let cell = place / BUCKET_PX as f64;
        [(cell.x.max(0.0) as usize).min(self.columns - 1), (cell.y.max(0.0) as usize).min(self.rows - 1)]
    }

    /// The corners, those of nearer squares first; ends with the ring in which `visit` has said that it is enough.
    fn visit(&self, place: &Pixel, mut visit: impl FnMut(usize) -> bool) {
        let [x, y] = self.cell(place);
        let mut is_enough = false;
        for ring in 0..self.columns.max(self.rows) {
            let [left, top] = [x, y].map(|c| c.saturating_sub(ring));
            let (right, bottom) = ((x + ring).min(self.columns - 1), (y + ring).min(self.rows - 1));
            for row in top..=bottom {
                let is_end = row.abs_diff(y) == ring;
                let step = if is_end { 1 } else { (2 * ring).max(1) };
                let first = if is_end { left } else { x.wrapping_sub(ring) };
                for column in
                    (0..=2 * ring / step).map(|k| first.wrapping_add(k * step)).filter(|c| (left..=right).contains(c))
                {
                    for corner in &self.cells[row * self.columns + column] {
                        is_enough |= visit(*corner);
                    }
                }
            }
            if is_enough {
                break;
            }
        }
    }
}
