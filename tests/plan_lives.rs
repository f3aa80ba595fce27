//! Random lives of plans that divide the reads that a device refuses: `common/divided_life.rs` says
//! what happens, and which properties hold. `MBM_LIVES` in the environment is the number of lives,
//! `MBM_SEED` the first one.

#[path = "common/divided.rs"]
mod divided;
#[path = "common/divided_life.rs"]
mod divided_life;
#[path = "common/random.rs"]
mod random;

use divided_life::{live, Choices};
use random::Random;

/// Random choices, up to a number of them.
struct Some {
    random: Random,
    left: u32,
}

impl Choices for Some {
    fn below(&mut self, limit: u32) -> u32 {
        self.left = self.left.saturating_sub(1);
        self.random.below(limit)
    }

    fn is_over(&self) -> bool {
        self.left == 0
    }
}

/// Says which life was wrong.
struct Seed(u64);

impl Drop for Seed {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("MBM_SEED={}", self.0);
        }
    }
}

#[test]
fn no_value_is_of_another_register_and_every_field_that_is_there_is_read() {
    for seed in random::seeds(if cfg!(miri) { 1 } else { 80 }) {
        let seed = Seed(seed);
        let mut random = Random::new(seed.0);
        let left = 100 + random.below(900);
        live(&mut Some { random, left });
    }
}
