//! Motions that bring one constellation onto another, or onto itself.

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::geometry::rotation;
use crate::target::Target;

/// Normals further apart than this face different ways: the marker could not be seen where it is expected.
const SAME_WAY_COSINE: f64 = 0.5;

/// Radii that differ by more than this factor are told apart by the areas of their blobs.
const SAME_SIZE_FACTOR: f64 = 1.3;

/// A way to lay one constellation onto another about their centres.
#[derive(Clone, Debug, PartialEq)]
pub struct Congruence {
    /// For each marker of the one the marker of the other onto which it falls.
    pub image_of: Vec<usize>,
    /// The angle of the turn; after mirroring in the centre, for a mirrored one.
    pub angle_rad: f64,
    /// Largest distance that is left between a marker and its image.
    pub residual_m: f64,
    /// Whether the one is mirrored.
    pub mirrored: bool,
}

impl Congruence {
    /// Whether every marker falls onto itself.
    #[must_use]
    pub fn is_identity(&self) -> bool {
        self.image_of.iter().enumerate().all(|(marker, image)| marker == *image)
    }
}

/// One marker about the centre of its constellation.
struct Star {
    place: Vector3<f64>,
    normal: Option<Vector3<f64>>,
    radius_m: Option<f64>,
}

impl Star {
    fn looks_like(&self, other: &Self, turn: &Rotation3<f64>) -> bool {
        let same_way = self.normal.zip(other.normal).is_none_or(|(a, b)| (turn * a).dot(&b) > SAME_WAY_COSINE);
        let same_size = self.radius_m.zip(other.radius_m).is_none_or(|(a, b)| a.max(b) < SAME_SIZE_FACTOR * a.min(b));
        same_way && same_size
    }
}

fn stars(target: &Target, sign: f64) -> Vec<Star> {
    let star = |marker: &crate::target::Marker| Star {
        place: (marker.position.coords - target.spread().centre) * sign,
        normal: marker.normal.map(|normal| normal * sign),
        radius_m: marker.radius_m,
    };
    target.markers().iter().map(star).collect()
}

/// All ways to lay `from` (mirrored in its centre, if so asked) onto `onto` by a turn, each marker within `tolerance_m` of one
/// of its own that looks the same.
#[must_use]
pub fn congruences(from: &Target, onto: &Target, mirrored: bool, tolerance_m: f64) -> Vec<Congruence> {
    let (from, onto) = (stars(from, if mirrored { -1.0 } else { 1.0 }), stars(onto, 1.0));
    let mut found: Vec<Congruence> = Vec::new();
    if from.len() != onto.len() {
        return found;
    }
    // Two markers that span a wide triangle with the centre fix the turn.
    let (a, b) = widest_pair(&from);
    let Some(base) = triad(&from[a].place, &from[b].place) else { return found };
    let reach = 2.0 * tolerance_m;
    let fits = |x: f64, y: f64| (x - y).abs() <= reach;
    for (i, first) in onto.iter().enumerate() {
        for (j, second) in onto.iter().enumerate() {
            let may_be = i != j
                && fits(first.place.norm(), from[a].place.norm())
                && fits(second.place.norm(), from[b].place.norm())
                && fits((first.place - second.place).norm(), (from[a].place - from[b].place).norm());
            let Some(image) = may_be.then(|| triad(&first.place, &second.place)).flatten() else { continue };
            let turn = Rotation3::from_matrix_unchecked(image * base.transpose());
            let Some(congruence) = settled(&from, &onto, &turn, mirrored, tolerance_m) else { continue };
            if found.iter().all(|known| known.image_of != congruence.image_of) {
                found.push(congruence);
            }
        }
    }
    found.sort_by(|a, b| a.angle_rad.total_cmp(&b.angle_rad).then_with(|| a.image_of.cmp(&b.image_of)));
    found
}

/// The pair by which the turn is least uncertain.
fn widest_pair(stars: &[Star]) -> (usize, usize) {
    let area = |(a, b): &(usize, usize)| stars[*a].place.cross(&stars[*b].place).norm();
    let pairs = (0..stars.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
    pairs.max_by(|p, q| area(p).total_cmp(&area(q))).unwrap_or_default()
}

/// Three unit vectors that move with the two; `None` if these are on one line.
fn triad(a: &Vector3<f64>, b: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let first = a.try_normalize(0.0)?;
    let third = a.cross(b).try_normalize(1e-9 * a.norm() * b.norm())?;
    Some(Matrix3::from_columns(&[first, third.cross(&first), third]))
}

/// Which marker falls onto which, with the turn that fits all of them best (Kabsch 1976).
fn settled(
    from: &[Star],
    onto: &[Star],
    turn: &Rotation3<f64>,
    mirrored: bool,
    tolerance_m: f64,
) -> Option<Congruence> {
    let image_of = nearest_of_each(from, onto, turn, 3.0 * tolerance_m)?;
    let pairs = || from.iter().zip(&image_of).map(|(star, image)| (star, &onto[*image]));
    let correlation: Matrix3<f64> = pairs().map(|(star, image)| image.place * star.place.transpose()).sum();
    let turn = rotation::nearest(&correlation).unwrap_or(*turn);
    let residual_m = pairs().map(|(star, image)| (turn * star.place - image.place).norm()).fold(0.0, f64::max);
    let fits = residual_m <= tolerance_m && pairs().all(|(star, image)| star.looks_like(image, &turn));
    fits.then(|| Congruence { angle_rad: rotation::log(&turn).norm(), image_of, residual_m, mirrored })
}

/// For each star the nearest on the other side, if no two fall onto the same.
fn nearest_of_each(from: &[Star], onto: &[Star], turn: &Rotation3<f64>, reach_m: f64) -> Option<Vec<usize>> {
    let mut taken = vec![false; onto.len()];
    from.iter()
        .map(|star| {
            let place = turn * star.place;
            let distance = |image: &usize| (onto[*image].place - place).norm();
            let nearest = (0..onto.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            (distance(&nearest) <= reach_m && !std::mem::replace(&mut taken[nearest], true)).then_some(nearest)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assess::tests::{flat_target, target};
    use crate::scene::models::wing_six;

    const SQUARE: [[f64; 2]; 4] = [[0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.3, -0.3]];

    /// An L, which no motion within its plane brings onto its mirror image.
    const ELL: [[f64; 2]; 5] = [[0.0, 0.0], [0.2, 0.0], [0.0, 0.2], [0.0, 0.4], [0.0, 0.6]];

    fn onto_itself(target: &Target, mirrored: bool) -> Vec<Congruence> {
        congruences(target, target, mirrored, 0.01)
    }

    #[test]
    fn a_square_that_is_seen_from_one_side_has_four_turns_and_one_that_is_not_has_eight() {
        let angles: Vec<f64> =
            onto_itself(&flat_target(&SQUARE, true), false).iter().map(|c| c.angle_rad.to_degrees().round()).collect();
        assert_eq!(angles, [0.0, 90.0, 90.0, 180.0]);
        // Four about the normal, four that turn it over.
        assert_eq!(onto_itself(&flat_target(&SQUARE, false), false).len(), 8);
    }

    #[test]
    fn a_box_has_four_turns_and_its_mirror_image_is_itself() {
        let corners: Vec<[f64; 3]> = [-1.0, 1.0]
            .into_iter()
            .flat_map(|x| [-1.0, 1.0].into_iter().flat_map(move |y| [-1.0, 1.0].map(|z| [0.3 * x, 0.2 * y, 0.1 * z])))
            .collect();
        // A box of three different sides: the group D2, doubled by the mirror.
        assert_eq!(onto_itself(&target(&corners), false).len(), 4);
        assert_eq!(onto_itself(&target(&corners), true).len(), 4);
    }

    #[test]
    fn an_irregular_constellation_has_none_but_the_identity() {
        let found = onto_itself(&wing_six(), false);
        assert_eq!(found.len(), 1);
        assert!(found[0].is_identity() && found[0].residual_m < 1e-12);
        assert!(onto_itself(&wing_six(), true).is_empty());
    }

    #[test]
    fn an_ell_and_its_mirror_image_are_told_from_each_other() {
        let mirrored = ELL.map(|[x, y]| [-x, y]);
        let (one, other) = (flat_target(&ELL, true), flat_target(&mirrored, true));
        assert!(congruences(&one, &other, false, 0.01).is_empty(), "turned over, its markers would face away");
        assert_eq!(congruences(&one, &other, true, 0.01).len(), 1);
        // Without normals it may be turned over.
        let (one, other) = (flat_target(&ELL, false), flat_target(&mirrored, false));
        assert_eq!(congruences(&one, &other, false, 0.01).len(), 1);
    }

    #[test]
    fn markers_of_different_size_are_no_image_of_each_other() {
        let mut markers = flat_target(&SQUARE, true).markers().to_vec();
        for (marker, radius_m) in markers.iter_mut().zip([0.02, 0.03, 0.02, 0.03]) {
            marker.radius_m = Some(radius_m);
        }
        let two_sizes = Target::checked("two sizes", markers).expect("a good target");
        assert_eq!(onto_itself(&two_sizes, false).len(), 2, "half a turn is left");
    }
}
