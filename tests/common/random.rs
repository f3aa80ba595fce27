//! Random lives: a generator of random numbers, and the seeds to live.
#![allow(dead_code)] // Not every test uses everything.

/// A generator of random numbers.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub fn below(&mut self, limit: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 33) % u64::from(limit)) as u32
    }

    pub fn one_of<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.below(items.len() as u32) as usize]
    }
}

fn variable(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().expect("a number"))
}

/// The seeds of the lives of a test: `MBM_LIVES` in the environment is their number, `MBM_SEED` the
/// first one.
pub fn seeds(lives: u64) -> std::ops::Range<u64> {
    let first = variable("MBM_SEED", 0);
    first..first + variable("MBM_LIVES", lives)
}
