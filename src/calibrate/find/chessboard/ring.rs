//! Whether four squares meet at a place: a look along a ring about it, which crosses four edges.

use nalgebra::{Matrix2, Vector2};

use super::pyramid::Plane;

/// Samples on the ring.
const COUNT: usize = 32;

/// What a ring shows; places and directions are shares of the ring's half axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    /// Where the edges cross.
    pub place: Vector2<f64>,
    /// The edge that one crosses from white into black, turning from the first half axis to the second.
    pub enter: Vector2<f64>,
    /// The edge that one crosses from black into white.
    pub leave: Vector2<f64>,
    /// White less black, codes.
    pub contrast: f64,
}

/// What makes a ring one about a corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Demand {
    /// Least correlation of the ring with two black and two white sectors.
    pub correlation: f64,
    /// Least white less black, codes.
    pub contrast: f64,
    /// The edges cross no further from the middle.
    pub reach: f64,
}

/// Rings of some number of samples.
pub(super) struct Ring {
    circle: [Vector2<f64>; COUNT],
}

impl Ring {
    pub(super) fn new() -> Self {
        let angle = |index: usize| (index as f64 + 0.5) * std::f64::consts::TAU / COUNT as f64;
        Self { circle: std::array::from_fn(|index| Vector2::new(angle(index).cos(), angle(index).sin())) }
    }

    /// The crossing within the ring about `middle` whose half axes are the columns of `axes`, the second to the right of the first
    /// as one sees the picture. `None` where the ring leaves the picture or shows anything else.
    pub(super) fn look(
        &self,
        plane: &Plane<'_>,
        middle: &Vector2<f64>,
        axes: &Matrix2<f64>,
        demand: &Demand,
    ) -> Option<Crossing> {
        let mut raw = [0.0; COUNT];
        for (value, unit) in raw.iter_mut().zip(&self.circle) {
            let place = middle + axes * unit;
            *value = plane.at(place.x, place.y)?;
        }
        let (least, most) = raw.iter().fold((f64::MAX, f64::MIN), |(least, most), v| (least.min(*v), most.max(*v)));
        if most - least < demand.contrast {
            return None;
        }
        let values: [f64; COUNT] =
            std::array::from_fn(|i| 0.25 * (raw[(i + COUNT - 1) % COUNT] + 2.0 * raw[i] + raw[(i + 1) % COUNT]));
        let (least, most) = values.iter().fold((f64::MAX, f64::MIN), |(least, most), v| (least.min(*v), most.max(*v)));
        let gray = 0.5 * (least + most);
        let mut edges = [Vector2::zeros(); 4];
        let mut count = 0;
        let mut first_enters = false;
        for i in 0..COUNT {
            let next = (i + 1) % COUNT;
            let (here, there) = (values[i] - gray, values[next] - gray);
            if (here > 0.0) == (there > 0.0) {
                continue;
            }
            if count == 4 {
                return None;
            }
            if count == 0 {
                first_enters = here > 0.0;
            }
            edges[count] = self.circle[i] + (self.circle[next] - self.circle[i]) * (here / (here - there));
            count += 1;
        }
        if count != 4 {
            return None;
        }
        let contrast = contrast(&values, gray, demand)?;
        let chords = [edges[2] - edges[0], edges[3] - edges[1]];
        let turn = chords[0].perp(&chords[1]);
        let place = edges[0] + chords[0] * ((edges[1] - edges[0]).perp(&chords[1]) / turn);
        // Also false for chords that are one.
        if !(place.norm() < demand.reach) {
            return None;
        }
        let [enter, leave] = if first_enters { chords } else { [chords[1], chords[0]] };
        let found = Crossing { place, enter: enter.normalize(), leave: leave.normalize(), contrast };
        self.is_crossed_within(plane, middle, axes, &found, gray).then_some(found)
    }

    /// Whether the same four sectors are seen half as far out: about a bar they are not.
    fn is_crossed_within(
        &self,
        plane: &Plane<'_>,
        middle: &Vector2<f64>,
        axes: &Matrix2<f64>,
        found: &Crossing,
        gray: f64,
    ) -> bool {
        let centre = middle + axes * found.place;
        let turn = found.enter.perp(&found.leave);
        let (mut agreed, mut total) = (0.0, 0.0);
        for unit in self.circle.iter().step_by(2) {
            let place = centre + axes * unit * 0.5;
            let Some(value) = plane.at(place.x, place.y) else { return false };
            // Black lies between `enter` and the next `leave`, and opposite.
            let is_black = found.enter.perp(unit) * unit.perp(&found.leave) * turn > 0.0;
            // `leave` may point either way; with `turn` its side is that of the sector.
            let sign = if is_black { -1.0 } else { 1.0 };
            agreed += sign * (value - gray);
            total += (value - gray).abs();
        }
        agreed > 0.6 * total
    }
}

/// White less black if the ring is as good as demanded.
fn contrast(values: &[f64; COUNT], gray: f64, demand: &Demand) -> Option<f64> {
    let white = values.iter().filter(|value| **value > gray).count() as f64;
    let bright: f64 = values.iter().filter(|value| **value > gray).sum();
    let all: f64 = values.iter().sum();
    let (count, mean) = (COUNT as f64, all / COUNT as f64);
    let contrast = bright / white - (all - bright) / (count - white);
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
    let share = white / count;
    let correlation = contrast * (share * (1.0 - share) / variance).sqrt();
    (correlation >= demand.correlation && contrast >= demand.contrast).then_some(contrast)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEMAND: Demand = Demand { correlation: 0.8, contrast: 8.0, reach: 0.5 };

    fn look(dark: impl Fn(f64, f64) -> bool, axes: Matrix2<f64>) -> Option<Crossing> {
        let samples = (0..60 * 60).map(|at| if dark(f64::from(at % 60), f64::from(at / 60)) { 40 } else { 200 });
        let plane = Plane { width: 60, height: 60, samples: samples.collect() };
        Ring::new().look(&plane, &Vector2::new(30.5, 29.5), &axes, &DEMAND)
    }

    #[test]
    fn a_crossing_is_seen_with_its_edges_and_colours() {
        let round = Matrix2::identity() * 6.0;
        // Black right of and below the corner, and opposite.
        let found = look(|x, y| (x > 31.2) == (y > 29.0), round).expect("a crossing");
        assert!((found.place - Vector2::new(0.17, -0.0)).norm() < 0.12, "{found:?}");
        assert!(found.enter.x.abs() > 0.95 && found.leave.y.abs() > 0.95, "{found:?}");
        let other = look(|x, y| (x > 31.2) != (y > 29.0), round).expect("a crossing");
        assert!(other.enter.y.abs() > 0.95 && other.leave.x.abs() > 0.95, "{other:?}");
    }

    #[test]
    fn squares_seen_at_a_slant_are_seen_along_their_own_axes() {
        let axes = Matrix2::new(9.0, 6.0, 0.0, 4.0);
        let slanted = |x: f64, y: f64| (y > 29.5) == (x - 30.5 - 1.5 * (y - 29.5) > 0.0);
        let found = look(slanted, axes).expect("a crossing");
        assert!(found.enter.x.abs() > 0.95 && found.leave.y.abs() > 0.95, "{found:?}");
    }

    #[test]
    fn what_is_no_crossing_is_none() {
        let round = Matrix2::identity() * 6.0;
        assert_eq!(look(|x, _| x > 30.0, round), None, "an edge");
        assert_eq!(look(|x, y| x > 30.0 && y > 30.0, round), None, "a square's corner");
        assert_eq!(look(|_, y| (y - 29.5).abs() < 3.5, round), None, "a bar");
        assert_eq!(look(|_, _| true, round), None, "nothing");
        assert_eq!(look(|x, y| (x > 31.2) == (y > 29.0), round * 9.0), None, "beyond the picture");
    }
}
