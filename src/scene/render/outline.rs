//! A polygon in a plane: inside or outside, and how far from the edge.

use nalgebra::Vector2;

/// A closed simple polygon, metres.
pub struct Outline {
    corners: Vec<Vector2<f64>>,
    /// The rectangle about it: most places are told by that alone.
    least: Vector2<f64>,
    most: Vector2<f64>,
}

impl Outline {
    /// The polygon of these corners; `None` for fewer than three or a corner that is not finite.
    #[must_use]
    pub fn of(corners: &[[f64; 2]]) -> Option<Self> {
        let good = corners.len() >= 3 && corners.iter().flatten().all(|c| c.is_finite());
        good.then(|| {
            let corners: Vec<_> = corners.iter().map(|&c| Vector2::from(c)).collect();
            let least = corners.iter().fold(corners[0], |least, c| least.inf(c));
            let most = corners.iter().fold(corners[0], |most, c| most.sup(c));
            Self { corners, least, most }
        })
    }

    fn edges(&self) -> impl Iterator<Item = (&Vector2<f64>, &Vector2<f64>)> {
        self.corners.iter().zip(self.corners.iter().cycle().skip(1))
    }

    /// Whether `point` lies within `reach_m` of the rectangle about the polygon.
    fn is_near(&self, point: &Vector2<f64>, reach_m: f64) -> bool {
        (0..2).all(|axis| point[axis] >= self.least[axis] - reach_m && point[axis] <= self.most[axis] + reach_m)
    }

    /// Whether `point` lies inside: a ray from it crosses the edge an odd number of times.
    #[must_use]
    pub fn contains(&self, point: &Vector2<f64>) -> bool {
        if !self.is_near(point, 0.0) {
            return false;
        }
        let crossings = self
            .edges()
            .filter(|(a, b)| {
                (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
            })
            .count();
        crossings % 2 == 1
    }

    /// Whether the edge comes within `reach_m` of `point`.
    #[must_use]
    pub fn passes_within(&self, point: &Vector2<f64>, reach_m: f64) -> bool {
        self.is_near(point, reach_m)
            && self.edges().any(|(a, b)| {
                let along = b - a;
                let share = ((point - a).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                (a + along * share - point).norm_squared() <= reach_m * reach_m
            })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_notch_of_an_arrow_is_outside() {
        let arrow = Outline::of(&[[1.0, 0.0], [-1.0, 1.0], [-0.2, 0.0], [-1.0, -1.0]]).expect("a polygon");
        assert!(arrow.contains(&Vector2::new(0.0, 0.0)));
        assert!(arrow.contains(&Vector2::new(-0.7, 0.7)));
        assert!(!arrow.contains(&Vector2::new(-0.7, 0.0)));
        assert!(arrow.passes_within(&Vector2::new(-0.25, 0.0), 0.06));
        assert!(!arrow.passes_within(&Vector2::new(0.2, 0.0), 0.3));
    }

    #[test]
    fn two_corners_enclose_nothing() {
        assert!(Outline::of(&[[0.0, 0.0], [1.0, 1.0]]).is_none());
        assert!(Outline::of(&[[0.0, 0.0], [1.0, f64::NAN], [1.0, 0.0]]).is_none());
    }

    proptest! {
        #[test]
        fn a_walk_that_meets_no_edge_stays_on_its_side(
            x in -2.0..2.0, y in -2.0..2.0, turn in 0.0..6.2_f64, reach in 0.01..1.0_f64
        ) {
            let arrow = Outline::of(&[[1.0, 0.0], [-1.0, 1.0], [-0.2, 0.0], [-1.0, -1.0]]).expect("a polygon");
            let from = Vector2::new(x, y);
            prop_assume!(!arrow.passes_within(&from, reach));
            let to = from + Vector2::new(turn.cos(), turn.sin()) * reach;
            prop_assert_eq!(arrow.contains(&from), arrow.contains(&to));
        }
    }
}
