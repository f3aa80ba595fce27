//! Which read is due, and what its end means for the other reads of its unit. All times are in
//! milliseconds on one clock, which may wrap.

use super::read::{Read, DOUBTED, HAS_DATA, NEWS, NO_SLOT, SUSPENDED};
use crate::error::Status;

/// Exceptions of a gateway (V1.1b3, 7): it does not reach the unit.
const GATEWAY_PATH_UNAVAILABLE: Status = Status::exception(0x0A);
const GATEWAY_TARGET_FAILED_TO_RESPOND: Status = Status::exception(0x0B);

/// The most failures in a row that are counted.
const MAX_FAILURES: u8 = 31;

/// How long the plan leaves a unit alone that does not answer.
#[derive(Clone, Copy, Debug)]
pub struct Backoff {
    /// After the first request without an answer; each further one doubles it.
    pub first_ms: u32,
    /// The longest.
    pub longest_ms: u32,
}

impl Backoff {
    fn after(&self, failures: u8) -> u32 {
        let mut wait = self.first_ms;
        for _ in 1..failures {
            if wait >= self.longest_ms {
                break;
            }
            wait = wait.saturating_add(wait);
        }
        wait.min(self.longest_ms)
    }
}

/// Divides, rounded down. (A loop, for a Cortex-M0+ has no division.)
fn quotient(mut dividend: u32, divisor: u32) -> u32 {
    let mut result = 0;
    for shift in (0..u32::BITS).rev() {
        if dividend >> shift >= divisor {
            dividend = dividend.wrapping_sub(divisor << shift);
            result |= 1 << shift;
        }
    }
    result
}

/// True if `time` has come.
fn has_come(now: u32, time: u32) -> bool {
    now.wrapping_sub(time).cast_signed() >= 0
}

/// Makes every read due at once, and spreads the following rounds: the reads of one interval
/// are due one after the other, at equal distances.
pub fn start(reads: &mut [Read], now: u32) {
    for index in 0..reads.len() {
        let interval = reads.get(index).map_or(0, |read| read.interval_ms);
        let has_same = |read: &&Read| read.interval_ms == interval;
        let all = reads.iter().filter(has_same).count();
        let before = reads.iter().take(index).filter(has_same).count();
        let phase = quotient(interval, all as u32).wrapping_mul(before as u32);
        if let Some(read) = reads.get_mut(index) {
            // The time before the first round, so that every round after it is on time.
            read.due = now.wrapping_add(phase).wrapping_sub(interval);
        }
    }
}

impl Read {
    /// The time from which on it may be sent, in milliseconds from now; 0 if that has come.
    fn wait(&self, now: u32) -> u32 {
        let mut wait = 0;
        if !has_come(now, self.due) {
            wait = self.due.wrapping_sub(now);
        }
        if self.failures > 0 && !has_come(now, self.not_before) {
            wait = wait.max(self.not_before.wrapping_sub(now));
        }
        wait
    }

    /// True if it must wait for another read: a unit that does not answer gets one at a time.
    fn is_blocked(&self, reads: &[Read]) -> bool {
        self.flags & SUSPENDED != 0
            && reads
                .iter()
                .any(|other| other.unit == self.unit && other.slot != NO_SLOT)
    }
}

/// The read to send now, the one that is late the longest, and otherwise how many milliseconds
/// none is due; [`u32::MAX`] if that depends on reads that are queued.
///
/// # Errors
/// That time.
pub fn next(reads: &[Read], now: u32) -> Result<usize, u32> {
    let mut shortest = u32::MAX;
    let mut next = None;
    let mut latest = 0;
    for (index, read) in reads.iter().enumerate() {
        if read.slot != NO_SLOT || read.is_blocked(reads) {
            continue;
        }
        let wait = read.wait(now);
        shortest = shortest.min(wait);
        let late = now.wrapping_sub(read.due);
        if wait == 0 && (next.is_none() || late > latest) {
            next = Some(index);
            latest = late;
        }
    }
    next.ok_or(shortest)
}

/// True if the unit itself, or the gateway before it, shows that it does not answer.
fn is_silence(status: Status) -> bool {
    matches!(
        status,
        Status::RESPONSE_TIMED_OUT
            | Status::INVALID_SLAVE_ID
            | Status::INVALID_FUNCTION
            | GATEWAY_PATH_UNAVAILABLE
            | GATEWAY_TARGET_FAILED_TO_RESPOND
    )
}

/// Takes up that a read has ended, and sets when it is next due.
///
/// A read without an answer waits as `backoff` says. After two reads of one unit in a row
/// without an answer all its reads wait, with this status, and then it is tried with one read
/// at a time. The first answer lifts that.
pub fn end(reads: &mut [Read], index: usize, status: Status, now: u32, backoff: &Backoff) {
    let Some(read) = reads.get_mut(index) else {
        return;
    };
    read.slot = NO_SLOT;
    read.status = status.code();
    read.flags |= NEWS;
    if status == Status::OK {
        read.flags |= HAS_DATA;
        read.read_at = now;
    }
    if !has_come(now, read.read_at) {
        // The age stays below 2^31 milliseconds, 24 days.
        read.read_at = now.wrapping_sub(i32::MAX as u32);
    }
    let late = now.wrapping_sub(read.due);
    if late.cast_signed() >= 0 {
        let rounds = quotient(late, read.interval_ms).wrapping_add(1);
        read.due = read.due.wrapping_add(rounds.wrapping_mul(read.interval_ms));
    }
    let unit = read.unit;
    if is_silence(status) {
        if read.failures > 0 && !has_come(now, read.not_before) {
            // It was under way when another read found the unit silent.
            return;
        }
        read.failures = MAX_FAILURES.min(read.failures + 1);
        read.not_before = now.wrapping_add(backoff.after(read.failures));
        let Read {
            failures,
            not_before,
            flags,
            ..
        } = *read;
        let is_second = flags & DOUBTED != 0;
        for read in reads.iter_mut().filter(|read| read.unit == unit) {
            if is_second {
                if read.flags & SUSPENDED == 0 && read.status != status.code() {
                    read.flags |= NEWS;
                    read.status = status.code();
                }
                read.flags |= SUSPENDED;
                read.failures = failures;
                read.not_before = not_before;
            }
            read.flags |= DOUBTED;
        }
    } else if status == Status::OK || status.is_exception() {
        read.failures = 0;
        for read in reads.iter_mut().filter(|read| read.unit == unit) {
            if read.flags & SUSPENDED != 0 {
                read.failures = 0;
            }
            read.flags &= !(SUSPENDED | DOUBTED);
        }
    }
}

/// Makes a read due at once, unless its unit does not answer.
pub fn hasten(reads: &mut [Read], index: usize, now: u32) {
    if let Some(read) = reads.get_mut(index) {
        if !has_come(now, read.due) {
            read.due = now;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quotient_is_rounded_down() {
        for dividend in [0, 1, 9, 10, 11, 999, 1000, 86_400_000, u32::MAX] {
            for divisor in [1, 2, 3, 10, 1000, u32::MAX - 1, u32::MAX] {
                assert_eq!(quotient(dividend, divisor), dividend / divisor);
            }
        }
    }

    #[test]
    fn a_back_off_doubles_up_to_the_longest() {
        let backoff = Backoff {
            first_ms: 1000,
            longest_ms: 5000,
        };
        let waits = [1, 2, 3, 4, 31].map(|failures| backoff.after(failures));
        assert_eq!(waits, [1000, 2000, 4000, 5000, 5000]);
        let least = Backoff {
            first_ms: 5000,
            longest_ms: 1000,
        };
        assert_eq!(least.after(1), 1000);
    }
}
