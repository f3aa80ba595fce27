//! Which read is due, and what its end means for the other reads of its unit. All times are in
//! milliseconds on one clock, which may wrap.

use super::divide::quotient;
use super::read::{Read, DOUBTED, HAS_DATA, NEWS, QUEUED, SUSPENDED};
use crate::error::Status;

/// Exceptions of a gateway (V1.1b3, 7): it does not reach the unit.
const GATEWAY_PATH_UNAVAILABLE: Status = Status::exception(0x0A);
const GATEWAY_TARGET_FAILED_TO_RESPOND: Status = Status::exception(0x0B);

/// How long the plan leaves a unit alone that does not answer.
#[derive(Clone, Copy, Debug)]
pub struct Backoff {
    /// After the first request without an answer; each further one doubles it.
    pub first_ms: u32,
    /// The longest, at most [`LONGEST_INTERVAL_MS`](super::field::LONGEST_INTERVAL_MS).
    pub longest_ms: u32,
}

/// True if `time` has come.
fn has_come(now: u32, time: u32) -> bool {
    now.wrapping_sub(time).cast_signed() >= 0
}

/// From now to `time`; 0 if it has come.
pub fn until(time: u32, now: u32) -> u32 {
    time.wrapping_sub(now).cast_signed().max(0).cast_unsigned()
}

/// Makes every read due at once, and spreads the following rounds: the reads of one interval
/// are due one after the other, at equal distances.
pub fn start(reads: &[Read], now: u32) {
    let mut rest = reads;
    while let Some(first) = rest.first() {
        let interval = first.interval_ms;
        // Reads of the same interval stand side by side.
        let is_same = |read: &&Read| read.interval_ms == interval;
        let count = rest.iter().take_while(is_same).count();
        let step = quotient(interval, count as u32);
        // The time before the first round, so that every round after it is on time.
        let mut due = now.wrapping_sub(interval);
        for read in rest.iter().take(count) {
            read.due.set(due);
            due = due.wrapping_add(step);
        }
        rest = rest.get(count..).unwrap_or(&[]);
    }
}

impl Read {
    /// The time from which on it may be sent, in milliseconds from now; 0 if that has come.
    fn wait(&self, now: u32) -> u32 {
        until(self.due.get(), now).max(until(self.not_before.get(), now))
    }

    /// True if it must wait for another read: a unit that does not answer gets one at a time.
    fn is_blocked(&self, reads: &[Read]) -> bool {
        self.is(SUSPENDED)
            && reads
                .iter()
                .any(|other| other.unit == self.unit && other.is(QUEUED))
    }
}

/// The longest time that [`next`] returns: as long as no read ends.
pub const FOREVER: u32 = i32::MAX as u32;

/// The read to send now, the one that is late the longest, and otherwise how many milliseconds
/// none is due; [`FOREVER`] if that depends on reads that are queued.
///
/// # Errors
/// That time.
pub fn next(reads: &[Read], now: u32) -> Result<&Read, u32> {
    let mut shortest = FOREVER;
    let mut next = None;
    let mut latest = 0;
    for read in reads {
        if read.is(QUEUED) || read.is_blocked(reads) {
            continue;
        }
        let wait = read.wait(now);
        shortest = shortest.min(wait);
        let late = now.wrapping_sub(read.due.get());
        if wait == 0 && late >= latest {
            next = Some(read);
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
pub fn end(reads: &[Read], read: &Read, status: Status, now: u32, backoff: &Backoff) {
    let mut flags = read.flags.get() & !QUEUED | NEWS;
    if status == Status::OK {
        flags |= HAS_DATA;
        read.read_at.set(now);
    }
    read.flags.set(flags);
    read.status.set(status.code());
    if !has_come(now, read.read_at.get()) {
        // The age stays below 2^31 milliseconds, 24 days.
        read.read_at.set(now.wrapping_sub(i32::MAX as u32));
    }
    let late = now.wrapping_sub(read.due.get());
    if late.cast_signed() >= 0 {
        let rounds = quotient(late, read.interval_ms).wrapping_add(1);
        let passed = rounds.wrapping_mul(read.interval_ms);
        read.due.set(read.due.get().wrapping_add(passed));
    }
    let (mut state, mut doublings, mut not_before) = (0, 0, now);
    if is_silence(status) {
        if !has_come(now, read.not_before.get()) {
            // It was under way when another read found the unit silent.
            return;
        }
        doublings = read.doublings.get();
        let mut wait = backoff.first_ms << doublings;
        if wait < backoff.longest_ms {
            doublings += 1;
        } else {
            wait = backoff.longest_ms;
        }
        not_before = now.wrapping_add(wait);
        state = DOUBTED;
        if flags & DOUBTED != 0 {
            state = DOUBTED | SUSPENDED;
        }
    } else if status != Status::OK && !status.is_exception() {
        return;
    }
    read.doublings.set(doublings);
    read.not_before.set(not_before);
    for other in reads.iter().filter(|other| other.unit == read.unit) {
        let flags = other.flags.get();
        let mut others = flags & !(SUSPENDED | DOUBTED) | state;
        if (flags | state) & SUSPENDED != 0 {
            other.doublings.set(doublings);
            other.not_before.set(not_before);
        }
        if state & !flags & SUSPENDED != 0 {
            other.status.set(status.code());
            others |= NEWS;
        }
        other.flags.set(others);
    }
}

/// Makes a read due at once, unless its unit does not answer.
pub fn hasten(read: &Read, now: u32) {
    if !has_come(now, read.due.get()) {
        read.due.set(now);
    }
}
