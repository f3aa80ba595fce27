//! Records of units, in storage that the caller supplies.

use crate::error::Status;
use crate::time::{clamped, elapsed, Micros, LONGEST_TIMEOUT_MS};

/// The settings and counts of one unit. The counts wrap at 2^32.
///
/// ```
/// use mbm::client::UnitRecord;
///
/// // 50 ms between two requests to unit 17.
/// let mut record = UnitRecord::new(17, 50_000);
/// record.timeout_ms = 3000;
/// record.retry_limit = 2;
/// assert_eq!(record.requests, 0);
/// ```
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct UnitRecord {
    /// Requests that ended. A request counts once, however many retries it had.
    pub requests: u32,
    /// Requests that were answered, exceptions included.
    pub replies: u32,
    /// Requests that were answered with an exception.
    pub exceptions: u32,
    /// Retries of all requests.
    pub retries: u32,
    /// Microseconds from the end of one request to this unit to the start of the next.
    pub delay: Micros,
    /// Time at which the last request to this unit ended.
    last: Micros,
    /// Response timeout of this unit, in milliseconds; 0 for that of the line. One above
    /// [`LONGEST_TIMEOUT_MS`] counts as that.
    pub timeout_ms: u32,
    /// The unit id. No unit has one above 255.
    pub unit: u16,
    /// Status code of the last request that ended.
    pub status: u8,
    /// `delay` may not have passed since `last` yet.
    cooling_down: bool,
    /// Greatest number of retries of a request to this unit; 0 for that of the line,
    /// [`NO_RETRIES`](super::NO_RETRIES) for none.
    pub retry_limit: u8,
}

impl UnitRecord {
    /// The record of a unit that has had no request yet; `delay` is in microseconds.
    pub const fn new(unit: u8, delay: u32) -> UnitRecord {
        UnitRecord {
            requests: 0,
            replies: 0,
            exceptions: 0,
            retries: 0,
            delay,
            last: 0,
            timeout_ms: 0,
            unit: unit as u16,
            status: 0,
            cooling_down: false,
            retry_limit: 0,
        }
    }

    /// False for a unit id or a timeout that is too large.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn is_in_range(&self) -> bool {
        self.unit <= u8::MAX as u16 && self.timeout_ms <= LONGEST_TIMEOUT_MS
    }

    /// Microseconds until the unit may get its next request.
    fn rest(&mut self, now: u32) -> u32 {
        let rest = clamped(self.delay).saturating_sub(elapsed(now, self.last));
        self.cooling_down &= rest > 0;
        if self.cooling_down {
            rest
        } else {
            0
        }
    }

    /// Records that a request ended with `status`. `again` is true if the client will
    /// retry it.
    fn note(&mut self, status: Status, again: bool, now: u32) {
        self.last = now;
        self.cooling_down = true;
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

/// The record of a unit, if there is one.
pub fn find(units: &[UnitRecord], unit: u8) -> Option<&UnitRecord> {
    units.iter().find(|record| record.unit == u16::from(unit))
}

/// The record of a unit, if there is one, to be changed.
pub fn find_mut(units: &mut [UnitRecord], unit: u8) -> Option<&mut UnitRecord> {
    units
        .iter_mut()
        .find(|record| record.unit == u16::from(unit))
}

/// Microseconds until a unit may get its next request, by its record in `units`; 0 if it
/// has no record.
pub fn rest(units: &mut [UnitRecord], unit: u8, now: u32) -> u32 {
    find_mut(units, unit).map_or(0, |unit| unit.rest(now))
}

/// Records in `units`, if the unit has a record there, that a request to it ended with
/// `status`. `again` is true if the client will retry the request.
pub fn note(units: &mut [UnitRecord], unit: u8, status: Status, again: bool, now: u32) {
    if let Some(unit) = find_mut(units, unit) {
        unit.note(status, again, now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::LONGEST;

    #[test]
    fn a_delay_that_the_clock_cannot_count_ends_after_the_longest_time() {
        let mut unit = UnitRecord::new(1, u32::MAX);
        unit.note(Status::OK, false, 7);
        assert_eq!(unit.rest(7), LONGEST);
        assert_eq!(unit.rest(7 + LONGEST - 1), 1);
        assert_eq!(unit.rest(7 + LONGEST), 0);
    }
}
