//! Random numbers that have a name.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A generator that gives the same numbers for the same name on every machine, for ever.
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
