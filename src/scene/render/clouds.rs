//! Value noise: a smooth random function of the plane that has a seed, and what can be made of it.

/// A random function, smooth, between 0 and 1, with features of size 1.
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    seed: u64,
}

impl Noise {
    /// The function of this seed.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// The random value of a lattice point: `SplitMix64` (Steele, Lea and Flood 2014) of seed and place.
    const fn lattice(self, x: i64, y: i64) -> f32 {
        let mut z = self.seed ^ x.cast_unsigned().wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = z.wrapping_add(y.cast_unsigned().wrapping_mul(0xD1B5_4A32_D192_ED03));
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1_u64 << 24) as f32
    }

    /// The value at a place: the four lattice points about it, blended without kinks.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "the conversion saturates far outside of any picture")]
    pub fn at(self, x: f64, y: f64) -> f32 {
        let (left, top) = (x.floor(), y.floor());
        let ease = |t: f64| (t * t * t * (t * (6.0 * t - 15.0) + 10.0)) as f32;
        let (right_share, bottom_share) = (ease(x - left), ease(y - top));
        let (column, row) = (left as i64, top as i64);
        let along = |row: i64| {
            let (from, to) = (self.lattice(column, row), self.lattice(column.wrapping_add(1), row));
            from + (to - from) * right_share
        };
        let (upper, lower) = (along(row), along(row.wrapping_add(1)));
        upper + (lower - upper) * bottom_share
    }

    /// A sum of ever finer and weaker copies, between 0 and 1, about 0.5 (Perlin 1985): billows.
    #[must_use]
    pub fn billows(self, x: f64, y: f64, octaves: u32) -> f32 {
        let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
        let (mut x, mut y) = (x, y);
        for octave in 0..octaves {
            sum += weight * Self::new(self.seed.wrapping_add(u64::from(octave))).at(x, y);
            total += weight;
            weight *= 0.5;
            // Twice as fine and turned by 37 degrees, so that the lattices do not line up.
            (x, y) = (1.6 * x - 1.2 * y, 1.2 * x + 1.6 * y);
        }
        sum / total
    }
}

/// 0 up to `from`, 1 from `to` on, smooth between.
#[must_use]
pub fn smooth_step(from: f32, to: f32, value: f32) -> f32 {
    let t = ((value - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "the same numbers in, the same out")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn noise_is_bounded_continuous_and_its_seeds(
            seed in any::<u64>(), x in -50.0..50.0, y in -50.0..50.0, step in 0.0..1e-3
        ) {
            let noise = Noise::new(seed);
            let value = noise.billows(x, y, 5);
            prop_assert!((0.0..=1.0).contains(&value));
            // Five octaves, each twice as steep and half as high: 5 times the steepness 15/8 of the first.
            prop_assert!((noise.billows(x + step, y, 5) - value).abs() <= 10.0 * 1e-3 * 2.0);
            prop_assert_eq!(noise.billows(x, y, 5), value);
        }
    }

    #[test]
    fn another_seed_is_another_sky() {
        let differ = (0..100).filter(|&i| {
            let (x, y) = (f64::from(i) * 0.37, f64::from(i) * 0.21);
            (Noise::new(1).at(x, y) - Noise::new(2).at(x, y)).abs() > 0.05
        });
        assert!(differ.count() > 60);
    }
}
