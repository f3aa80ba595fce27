//! A plan that divides the reads that devices refuse, for which the input chooses fields, devices and
//! what happens: see `tests/common/divided_life.rs`.

#[path = "../../../tests/common/divided.rs"]
mod divided;
#[path = "../../../tests/common/divided_life.rs"]
mod divided_life;

use crate::Input;
use divided_life::{live, Choices};

impl Choices for Input<'_> {
    fn below(&mut self, limit: u32) -> u32 {
        u32::from(self.u8()) % limit
    }

    fn is_over(&self) -> bool {
        self.is_empty()
    }
}

pub fn run(data: &[u8]) {
    live(&mut Input(data));
}
