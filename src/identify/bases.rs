//! Which triples of markers are tried on the blobs.

use nalgebra::{Matrix2, Vector2, Vector3};

use crate::target::Target;

/// Three markers, and the others as seen from them.
#[derive(Clone, Debug)]
pub(super) struct Base {
    /// The three.
    pub markers: [usize; 3],
    /// The others.
    pub others: Vec<Other>,
    /// Twice the signed area of the triangle on the target's plane, m^2; `None` for a target that is not flat.
    pub doubled_area: Option<f64>,
    /// From an affine image's two sides to that of a unit square in the plane of the three, 1/m.
    pub from_sides: Matrix2<f64>,
    /// Which way round the triangle appears, if the normals say from which side the target is seen.
    pub turn: Option<f64>,
    /// Largest distance between markers, m.
    pub extent_m: f64,
    /// Weights of the three whose weighted mean is the middle of all.
    pub centre: Vector3<f64>,
}

/// A marker outside the base.
#[derive(Clone, Copy, Debug)]
pub(super) struct Other {
    pub marker: usize,
    /// Weights of the three markers whose weighted mean is this one (flat targets; otherwise of its projection onto their
    /// plane). They also tell how the noise of the three spreads to it.
    pub weights: Vector3<f64>,
    /// Distance from the plane of the three, m.
    pub height_m: f64,
    /// Deviation of the place that the three give it from its own image, in those of a blob.
    pub noise: f64,
}

/// Most bases for a large target: enough that one of them is all visible with a third of the markers missing, in 999 cases
/// of 1,000 (a triple is with probability 0.3).
const MAX_BASES: usize = 20;

/// Of so few markers every triple is tried: any of them may be seen edge on, and then the right assignment is only found from
/// another.
const TRIED_MARKERS: usize = 5;

/// Larger targets take the widest triples instead of a proven cover.
const COVERED_MARKERS: usize = 8;

/// Bases in groups, each with a number of markers: whichever so many markers are visible, one base of this group or of those
/// before it is among them. The numbers fall to `need`; within a group the widest come first.
pub(super) fn of(target: &Target, need: usize) -> Vec<(usize, Vec<Base>)> {
    let count = target.markers().len();
    let mut triples: Vec<[usize; 3]> = (0..count)
        .flat_map(|a| (a + 1..count).flat_map(move |b| (b + 1..count).map(move |c| [a, b, c])))
        .filter(|triple| triangle_area(target, *triple) > 0.02 * target.spread().rms_m[0] * target.spread().rms_m[1])
        .collect();
    triples.sort_by(|a, b| triangle_area(target, *b).total_cmp(&triangle_area(target, *a)));
    let mut chosen: Vec<[usize; 3]> = Vec::new();
    let mut groups = Vec::new();
    let mut add = |visible: usize, fresh: Vec<[usize; 3]>| {
        groups.push((visible, fresh.into_iter().map(|triple| base(target, triple)).collect()));
    };
    if count <= TRIED_MARKERS {
        add(count, triples);
    } else if count <= COVERED_MARKERS {
        for visible in (need..=count).rev() {
            let before = chosen.len();
            cover(count, visible, &triples, &mut chosen);
            add(visible, chosen[before..].to_vec());
        }
    } else {
        // One base after the other, so that the search can end after any.
        let few = (count - count / 3).max(need);
        for triple in spread(count, &triples) {
            add(few, vec![triple]);
        }
        add(need, Vec::new());
    }
    groups
}

fn triangle_area(target: &Target, [a, b, c]: [usize; 3]) -> f64 {
    let p = |i: usize| target.markers()[i].position.coords;
    0.5 * (p(b) - p(a)).cross(&(p(c) - p(a))).norm()
}

/// Adds to `chosen`, greedily, until it covers all subsets of `visible` markers.
fn cover(count: usize, visible: usize, triples: &[[usize; 3]], chosen: &mut Vec<[usize; 3]>) {
    let mask = |triple: &[usize; 3]| triple.iter().fold(0_u32, |mask, i| mask | 1 << i);
    let mut open: Vec<u32> = (0_u32..1 << count)
        .filter(|set| set.count_ones() as usize == visible)
        .filter(|set| chosen.iter().all(|triple| set & mask(triple) != mask(triple)))
        .collect();
    while !open.is_empty() {
        let gain = |triple: &[usize; 3]| open.iter().filter(|set| *set & mask(triple) == mask(triple)).count();
        // The first of the best: triples stand in order of their width.
        let Some(best) = triples.iter().rev().max_by_key(|triple| gain(triple)).filter(|triple| gain(triple) > 0)
        else {
            break;
        };
        open.retain(|set| set & mask(best) != mask(best));
        chosen.push(*best);
    }
}

/// Wide triples that use every marker about equally often.
fn spread(count: usize, triples: &[[usize; 3]]) -> Vec<[usize; 3]> {
    let mut used = vec![0_usize; count];
    let mut chosen: Vec<[usize; 3]> = Vec::new();
    while chosen.len() < MAX_BASES.min(triples.len()) {
        let wear = |triple: &[usize; 3]| triple.iter().map(|i| used[*i]).sum::<usize>();
        let Some(next) = triples.iter().filter(|t| !chosen.contains(t)).min_by_key(|t| wear(t)) else { break };
        for i in next {
            used[*i] += 1;
        }
        chosen.push(*next);
    }
    chosen
}

fn base(target: &Target, markers: [usize; 3]) -> Base {
    let spread = target.spread();
    let flat = |i: usize| spread.local(&target.markers()[i].position).xy();
    let [a, b, c] = markers.map(|i| target.markers()[i].position.coords);
    let (u, v) = (b - a, c - a);
    let gram = Matrix2::new(u.dot(&u), u.dot(&v), u.dot(&v), v.dot(&v));
    let normal = u.cross(&v).normalize();
    let weights = |p: &Vector3<f64>| {
        let shares = gram.try_inverse().unwrap_or_default() * Vector2::new(u.dot(&(p - a)), v.dot(&(p - a)));
        Vector3::new(1.0 - shares.x - shares.y, shares.x, shares.y)
    };
    let mut others: Vec<Other> = (0..target.markers().len())
        .filter(|i| !markers.contains(i))
        .map(|marker| {
            let p = target.markers()[marker].position.coords;
            let weights = weights(&p);
            let noise = (1.0 + weights.norm_squared()).sqrt();
            Other { marker, weights, height_m: normal.dot(&(p - a)).abs(), noise }
        })
        .collect();
    let extent_m = extent(target);
    // Those whose places are known best come first: what is not there is then found out soon.
    let vagueness = |other: &Other| other.weights.norm() + 4.0 * other.height_m / extent_m;
    others.sort_by(|a, b| vagueness(a).total_cmp(&vagueness(b)));
    let sides = Matrix2::new(u.norm(), u.dot(&v) / u.norm(), 0.0, u.cross(&v).norm() / u.norm());
    let from_sides = sides.try_inverse().unwrap_or_default();
    let [fa, fb, fc] = markers.map(flat);
    let doubled_area = spread.is_coplanar().then(|| (fb - fa).perp(&(fc - fa)));
    // Seen from the side to which the plane's normal points *away*, the plane's axes appear right way round.
    let seen_from = target.markers().iter().map(|m| m.normal.map(|n| n.dot(&spread.axes.column(2)))).try_fold(
        None,
        |side: Option<f64>, facing| {
            let sign = facing.filter(|f| f.abs() > 0.5)?.signum();
            side.is_none_or(|s| s * sign > 0.0).then_some(Some(sign))
        },
    );
    let turn = seen_from.flatten().zip(doubled_area).map(|(side, area)| -side * area.signum());
    let centre = weights(&spread.centre);
    Base { markers, others, doubled_area, from_sides, turn, extent_m, centre }
}

/// Largest distance between markers, m.
fn extent(target: &Target) -> f64 {
    let positions = || target.markers().iter().map(|m| m.position.coords);
    positions().flat_map(|p| positions().map(move |q| (p - q).norm())).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::models::wing_six;

    #[test]
    fn whichever_four_of_six_are_visible_one_base_is_among_them() {
        let groups = of(&wing_six(), 4);
        let sizes: Vec<(usize, usize)> = groups.iter().map(|(markers, bases)| (*markers, bases.len())).collect();
        assert_eq!(sizes[..2], [(6, 1), (5, 1)], "one triple is in all six, two that share none are in any five");
        let bases: Vec<Base> = groups.into_iter().flat_map(|(_, bases)| bases).collect();
        assert!(bases.len() <= 8, "{} bases where six suffice", bases.len());
        for visible in (0_u32..64).filter(|set| set.count_ones() == 4) {
            assert!(bases.iter().any(|base| base.markers.iter().all(|i| visible >> i & 1 == 1)), "{visible:b}");
        }
    }

    #[test]
    fn the_others_are_weighted_means_of_the_base() {
        let target = wing_six();
        for base in of(&target, 4).into_iter().flat_map(|(_, bases)| bases) {
            for other in &base.others {
                let sum: Vector3<f64> = base
                    .markers
                    .iter()
                    .zip(other.weights.iter())
                    .map(|(i, w)| target.markers()[*i].position.coords * *w)
                    .sum();
                assert!((sum - target.markers()[other.marker].position.coords).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn normals_tell_which_way_round_a_triangle_appears() {
        let target = wing_six();
        // Facing the camera with x right and y down: as drawn.
        for base in of(&target, 4).into_iter().flat_map(|(_, bases)| bases) {
            let [a, b, c] = base.markers.map(|i| target.markers()[i].position.coords.xy());
            assert_eq!(base.turn, Some((b - a).perp(&(c - a)).signum()));
        }
    }
}
