//! The part of a line that can be seen.

use crate::camera::Pixel;

/// The part of the segment from `a` to `b` within the rectangle, px; `None` if there is none, or a number is not finite
/// (Liang and Barsky 1984).
pub(super) fn segment(a: Pixel, b: Pixel, least: Pixel, most: Pixel) -> Option<(Pixel, Pixel)> {
    let along = b - a;
    if !along.iter().all(|d| d.is_finite()) {
        return None;
    }
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let (low, high) = (least[axis] - a[axis], most[axis] - a[axis]);
        if along[axis] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
            continue;
        }
        let (one, other) = (low / along[axis], high / along[axis]);
        from = from.max(one.min(other));
        to = to.min(one.max(other));
    }
    (from < to).then(|| (a + along * from, a + along * to))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_part_lies_on_the_segment_and_in_the_rectangle(
            a in proptest::array::uniform2(-300.0..300.0), b in proptest::array::uniform2(-300.0..300.0)
        ) {
            let (a, b) = (Pixel::from(a), Pixel::from(b));
            let (least, most) = (Pixel::new(0.0, 0.0), Pixel::new(100.0, 60.0));
            let inside = |p: &Pixel| (-1e-9..=100.0 + 1e-9).contains(&p.x) && (-1e-9..=60.0 + 1e-9).contains(&p.y);
            let part = segment(a, b, least, most);
            if let Some((from, to)) = part {
                prop_assert!(inside(&from) && inside(&to));
                prop_assert!((b - a).perp(&(from - a)).abs() < 1e-6 && (b - a).perp(&(to - a)).abs() < 1e-6);
            }
            // What lies inside is never lost.
            for step in 1..40 {
                let p = a + (b - a) * f64::from(step) / 40.0;
                if inside(&p) && p.x > 0.1 && p.y > 0.1 && p.x < 99.9 && p.y < 59.9 {
                    let (from, to) = part.expect("a part is inside");
                    prop_assert!((p - from).dot(&(p - to)) <= 1e-9);
                }
            }
        }
    }

    #[test]
    fn numbers_without_sense_give_nothing() {
        let (least, most) = (Pixel::new(0.0, 0.0), Pixel::new(100.0, 60.0));
        for odd in [f64::NAN, f64::INFINITY] {
            assert_eq!(segment(Pixel::new(odd, 0.0), Pixel::new(5.0, 5.0), least, most), None);
        }
        let far = segment(Pixel::new(-1e300, 30.0), Pixel::new(1e300, 30.0), least, most);
        assert!(far.is_none_or(|(a, b)| a.x >= -1.0 && b.x <= 101.0));
    }
}
