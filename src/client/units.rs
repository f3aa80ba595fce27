//! What is kept for each unit, in storage that the caller lends.

use crate::error::Status;
use crate::time::{clamped, elapsed};

/// One unit: how it is to be treated, and how it behaves. The counts wrap at
/// 2^32.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Unit {
    /// Requests that ended, retries apart.
    pub requests: u32,
    /// Of these, those that were answered, exceptions included.
    pub replies: u32,
    /// Of the answers, those that were exceptions.
    pub exceptions: u32,
    /// Requests that were asked again.
    pub retries: u32,
    /// Rest for this unit between the end of a request and the next, in
    /// microseconds.
    pub delay: u32,
    /// When the last request to it ended.
    last: u32,
    /// Which unit this is.
    pub unit: u8,
    /// How the last request ended.
    pub status: u8,
    /// It may still need its rest.
    tired: bool,
}

impl Unit {
    /// A unit that was not asked yet, with a rest of so many microseconds.
    pub const fn new(unit: u8, delay: u32) -> Unit {
        Unit {
            requests: 0,
            replies: 0,
            exceptions: 0,
            retries: 0,
            delay,
            last: 0,
            unit,
            status: 0,
            tired: false,
        }
    }

    /// How much longer the unit rests.
    fn rest(&mut self, now: u32) -> u32 {
        let rest = clamped(self.delay).saturating_sub(elapsed(now, self.last));
        self.tired &= rest > 0;
        if self.tired {
            rest
        } else {
            0
        }
    }

    /// Takes note of a request that ended, or is to be asked again.
    fn note(&mut self, status: Status, again: bool, now: u32) {
        self.last = now;
        self.tired = true;
        self.status = status.code();
        if again {
            self.retries = self.retries.wrapping_add(1);
            return;
        }
        self.requests = self.requests.wrapping_add(1);
        if !status.is_failure() {
            self.replies = self.replies.wrapping_add(1);
        }
        if status.is_exception() {
            self.exceptions = self.exceptions.wrapping_add(1);
        }
    }
}

/// The record of a unit, if the caller lent one.
fn find(units: &mut [Unit], unit: u8) -> Option<&mut Unit> {
    units.iter_mut().find(|record| record.unit == unit)
}

/// How much longer a unit rests, by its record among `units`.
pub fn rest(units: &mut [Unit], unit: u8, now: u32) -> u32 {
    find(units, unit).map_or(0, |unit| unit.rest(now))
}

/// Takes note, in the record of a unit among `units`, of a request to it that
/// ended, or is to be asked `again`.
pub fn note(units: &mut [Unit], unit: u8, status: Status, again: bool, now: u32) {
    if let Some(unit) = find(units, unit) {
        unit.note(status, again, now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::LONGEST;

    #[test]
    fn a_delay_that_the_clock_cannot_count_ends_after_the_longest_time() {
        let mut unit = Unit::new(1, u32::MAX);
        unit.note(Status::OK, false, 7);
        assert_eq!(unit.rest(7), LONGEST);
        assert_eq!(unit.rest(7 + LONGEST - 1), 1);
        assert_eq!(unit.rest(7 + LONGEST), 0);
    }
}
