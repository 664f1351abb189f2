//! Random numbers that have a name: the same on every machine, for ever. There are no others outside the shell.

use nalgebra::Vector2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A generator that gives the same numbers for the same name.
#[must_use]
pub fn named(name: &str) -> ChaCha8Rng {
    // FNV-1a, 64 bits.
    let hash = name
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    ChaCha8Rng::seed_from_u64(hash)
}

/// The generator of case number `index` of a named study; independent of every other.
#[must_use]
pub fn case(name: &str, index: u64) -> ChaCha8Rng {
    let mut rng = named(name);
    rng.set_stream(index + 1);
    rng
}

/// A normal variable of mean 0 and variance 1.
pub fn normal(rng: &mut impl Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Two of them.
pub fn normal2(rng: &mut impl Rng) -> Vector2<f64> {
    Vector2::new(normal(rng), normal(rng))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_gives_the_same_numbers_and_another_name_others() {
        let draw = |mut rng: ChaCha8Rng| rng.next_u64();
        assert_eq!(draw(named("gate")), draw(named("gate")));
        assert_ne!(draw(named("gate")), draw(named("gait")));
        assert_ne!(draw(case("gate", 0)), draw(case("gate", 1)));
    }
}
