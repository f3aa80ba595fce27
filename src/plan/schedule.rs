//! Says which read is due, and how its end changes the other reads of its unit. All times are in
//! milliseconds on one clock, which may wrap.
//!
//! The reads are the nodes of a skew heap, whose root is the read that is due first. The steps
//! to take it out and to put it back grow with the logarithm of the number of reads. These
//! reads are not in the heap: those that are queued, those that wait after a request without an
//! answer, and all but one of a unit that does not answer. They cost nothing until one of them
//! may be sent. Then the heap is made anew, and also when the times of reads in it change.

use super::divide::divide;
use super::read::{Read, DOUBTED, HAS_DATA, HELD, QUEUED, SUSPENDED};
use crate::error::Status;
use core::cell::Cell;

/// Exceptions of a gateway (V1.1b3, 7): it does not reach the unit.
const GATEWAY_PATH_UNAVAILABLE: Status = Status::exception(0x0A);
const GATEWAY_TARGET_FAILED_TO_RESPOND: Status = Status::exception(0x0B);

/// A plan whose reads stay as they are.
struct Whole;
/// A plan that divides the reads that a device refuses.
struct Divided;

/// How long the plan leaves a unit alone that does not answer.
///
/// ```
/// use mbm::plan::schedule::Backoff;
///
/// // One second after the first request without an answer, then 2 s, 4 s and so on, up to a minute.
/// let backoff = Backoff { first_ms: 1000, longest_ms: 60_000 };
/// ```
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
fn until(time: u32, now: u32) -> u32 {
    if has_come(now, time) {
        0
    } else {
        time.wrapping_sub(now)
    }
}

/// The index of no read.
const NONE: u16 = u16::MAX;

/// Joins two heaps, and returns the root. If two reads are due at the same time, the later one
/// comes first.
fn merge(reads: &[Read], tree: u16, mut other: u16) -> u16 {
    let root = Cell::new(tree);
    // The place where the heap `other` is joined.
    let mut place = &root;
    while let Some(right) = reads.get(usize::from(other)) {
        let own = place.get();
        let mut first = right;
        let left = reads.get(usize::from(own));
        let is_later = |left: &Read| {
            let later = right.due.get().wrapping_sub(left.due.get());
            later.cast_signed() >= i32::from(other > own)
        };
        match left {
            Some(left) if is_later(left) => first = left,
            _ => {
                place.set(other);
                other = own;
            }
        }
        let left = first.left.replace(first.right.get());
        first.right.set(left);
        place = &first.left;
    }
    root.get()
}

/// The longest time that [`Schedule::idle`] returns: as long as no read ends.
pub const FOREVER: u32 = i32::MAX as u32;

/// The order of the reads of a plan.
///
/// ```
/// use mbm::plan::field::{HOLDING_REGISTERS, UINT16};
/// use mbm::plan::schedule::{Backoff, Schedule};
/// use mbm::plan::{group::group, Field, Limits, Position, Read};
/// use mbm::Status;
/// # let limits = Limits {
/// #     bits: 0, registers: 0, bit_gap: 0, register_gap: 0, units: &[], excluded: &[],
/// # };
///
/// let flow = Field {
///     unit: 17, table: HOLDING_REGISTERS, value_type: UINT16, address: 107, interval_ms: 1000, ..Field::NONE
/// };
/// let (mut positions, mut reads) = ([Position::NONE], [Read::default()]);
/// group(&[flow], 0, &limits, &mut positions, &mut reads, 1).unwrap();
///
/// let schedule = Schedule::default();
/// let backoff = Backoff { first_ms: 1000, longest_ms: 60_000 };
/// schedule.start(&reads, 0);
/// // In the main loop. The program sends the read, and stores its data if the status is OK.
/// let read = schedule.next(&reads, 0).unwrap();
/// schedule.begin(&reads);
/// schedule.end(&reads, read, Status::OK, 20, &backoff);
/// assert!(schedule.next(&reads, 20).is_none());
/// assert!(schedule.idle(&reads, 20) <= 1000);
/// // Somebody wants the value now.
/// schedule.hasten(&reads, read, 30);
/// assert_eq!(schedule.next(&reads, 30), Some(read));
/// schedule.begin(&reads);
/// schedule.end_divided(&reads, read, Status::OK, 40, &backoff);
/// schedule.renew(&reads, 40);
/// ```
#[repr(C)]
#[derive(Debug, Default)]
pub struct Schedule {
    /// The root of the heap.
    root: Cell<u16>,
    /// The first time at which a read that waits may be sent.
    wake: Cell<u32>,
}

impl Schedule {
    /// Makes every read due at once, and spreads the following rounds: the reads of one interval
    /// are due one after the other, at equal distances.
    pub fn start(&self, reads: &[Read], now: u32) {
        let mut rest = reads;
        while let Some(first) = rest.first() {
            let interval = first.interval_ms;
            // Reads of the same interval stand side by side.
            let is_same = |read: &&Read| read.interval_ms == interval;
            let count = rest.iter().take_while(is_same).count();
            let (step, _) = divide(interval, count as u32);
            // The time before the first round, so that every round after it is on time.
            let mut due = now.wrapping_sub(interval);
            for read in rest.iter().take(count) {
                read.due.set(due);
                read.not_before.set(now);
                due = due.wrapping_add(step);
            }
            rest = rest.get(count..).unwrap_or(&[]);
        }
        self.wake.set(now);
    }

    /// The read to send now, the one that is late the longest.
    pub fn next<'a>(&self, reads: &'a [Read], now: u32) -> Option<&'a Read> {
        if has_come(now, self.wake.get()) {
            self.gather(reads, now);
        }
        let first = reads.get(usize::from(self.root.get()));
        first.filter(|first| has_come(now, first.due.get()))
    }

    /// For how many milliseconds [`Schedule::next`] goes on to return none, after it has
    /// returned none. If that depends on queued reads, the result is longer than the longest
    /// interval, up to [`FOREVER`]. 0 says only that it may return one.
    pub fn idle(&self, reads: &[Read], now: u32) -> u32 {
        let idle = until(self.wake.get(), now);
        let first = reads.get(usize::from(self.root.get()));
        first.map_or(idle, |first| idle.min(until(first.due.get(), now)))
    }

    /// Notes that the read that [`Schedule::next`] returned is queued; [`Schedule::end`] says that
    /// it has ended. Call this only after `next` has returned one: the order of the reads is made there,
    /// and without it `end` may never return.
    pub fn begin(&self, reads: &[Read]) {
        if let Some(read) = reads.get(usize::from(self.root.get())) {
            self.root
                .set(merge(reads, read.left.get(), read.right.get()));
            read.flags.set(read.flags.get() | QUEUED);
        }
    }

    /// Notes that a read has ended, and sets when it is next due. Returns true if its status
    /// holds for all reads of its unit from now on.
    ///
    /// A read without an answer waits as `backoff` says. After two reads of one unit in a row
    /// without an answer all its reads wait, with this status, and then it is tried with one read
    /// at a time. The first answer lifts that.
    pub fn end(
        &self,
        reads: &[Read],
        read: &Read,
        status: Status,
        now: u32,
        backoff: &Backoff,
    ) -> bool {
        self.note_end::<Whole>(reads, read, status, now, backoff)
    }

    /// As [`Schedule::end`], in a plan that divides its reads.
    pub fn end_divided(
        &self,
        reads: &[Read],
        read: &Read,
        status: Status,
        now: u32,
        backoff: &Backoff,
    ) -> bool {
        self.note_end::<Divided>(reads, read, status, now, backoff)
    }

    /// See [`Schedule::end`]. Each kind of plan has a copy of its own: the compiler puts it into its
    /// only caller, which takes less firmware.
    fn note_end<Kind>(
        &self,
        reads: &[Read],
        read: &Read,
        status: Status,
        now: u32,
        backoff: &Backoff,
    ) -> bool {
        let mut flags = read.flags.get() & !QUEUED;
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
            let (_, rest) = divide(late, read.interval_ms);
            read.due
                .set(now.wrapping_add(read.interval_ms).wrapping_sub(rest));
        }
        let before = flags & (SUSPENDED | DOUBTED);
        let (mut state, mut doublings, mut not_before) = (0, 0, now);
        if is_silence(status) || status != Status::OK && !status.is_exception() {
            state = before;
            doublings = read.doublings.get();
            if !has_come(now, read.not_before.get()) {
                // It was in flight when another read found the unit silent.
                not_before = read.not_before.get();
            } else if is_silence(status) {
                let mut wait = backoff.first_ms << doublings;
                if wait < backoff.longest_ms {
                    doublings += 1;
                } else {
                    wait = backoff.longest_ms;
                }
                not_before = now.wrapping_add(wait);
                state = DOUBTED;
                if before != 0 {
                    state = DOUBTED | SUSPENDED;
                }
            }
        }
        read.doublings.set(doublings);
        read.not_before.set(not_before);
        if (before | state) & SUSPENDED == 0 {
            self.put(reads, read, now);
        } else {
            self.wake.set(now);
        }
        if before | state != 0 {
            settle::<Kind>(reads, read, before, state);
        }
        state & !before & SUSPENDED != 0
    }

    /// Makes a read due at once, unless its unit does not answer.
    pub fn hasten(&self, reads: &[Read], read: &Read, now: u32) {
        if has_come(now, read.due.get()) {
            return;
        }
        read.due.set(now);
        // The heap is made anew, because this read has another place in it.
        self.wake.set(now);
        if read.flags.get() & HELD == 0 {
            return;
        }
        // The unit is tried with this read if the one chosen before is due later.
        let mut limit = 0;
        for other in reads.iter().filter(|other| other.unit == read.unit) {
            if core::ptr::eq(other, read) {
                limit = 1;
            }
            let later = other.due.get().wrapping_sub(now).cast_signed();
            if other.flags.get() & (HELD | QUEUED) == 0 && later >= limit {
                other.set(HELD);
                read.flags.set(read.flags.get() & !HELD);
            }
        }
    }

    /// Puts a read into the heap, unless it must wait.
    fn put(&self, reads: &[Read], read: &Read, now: u32) {
        let not_before = read.not_before.get();
        if has_come(now, not_before) {
            read.left.set(NONE);
            read.right.set(NONE);
            let index = read.index(reads) as u16;
            self.root.set(merge(reads, self.root.get(), index));
        } else if has_come(self.wake.get(), not_before) {
            self.wake.set(not_before);
        }
    }

    /// Takes reads into account that were cut, joined or moved, or that wait.
    #[inline(never)]
    pub fn renew(&self, reads: &[Read], now: u32) {
        self.gather(reads, now);
    }

    /// Makes the heap anew, of the reads that need not wait.
    #[inline(always)] // `renew` is for few.
    fn gather(&self, reads: &[Read], now: u32) {
        self.root.set(NONE);
        self.wake.set(now.wrapping_add(FOREVER));
        for read in reads.iter().rev() {
            if read.flags.get() & (QUEUED | HELD) == 0 {
                self.put(reads, read, now);
            }
        }
    }
}

/// Passes to the other reads of its unit whether the unit is silent.
#[expect(clippy::extra_unused_type_parameters)] // As of `Schedule::note_end`.
fn settle<Kind>(reads: &[Read], read: &Read, before: u8, state: u8) {
    let (mut first, mut all) = (read, 0);
    for other in reads.iter().filter(|other| other.unit == read.unit) {
        let mut flags = other.flags.get() & !(SUSPENDED | DOUBTED | HELD) | state;
        if (before | state) & SUSPENDED != 0 {
            other.doublings.set(read.doublings.get());
            other.not_before.set(read.not_before.get());
        }
        if state & SUSPENDED != 0 {
            flags |= HELD;
            if before & SUSPENDED == 0 {
                other.status.set(read.status.get());
            }
        }
        other.flags.set(flags);
        all |= flags;
        let later = first.due.get().wrapping_sub(other.due.get());
        if later.cast_signed() >= 0 {
            first = other;
        }
    }
    if all & QUEUED == 0 {
        first.flags.set(first.flags.get() & !HELD);
    }
}

/// True if the unit itself, or the gateway before it, shows that it does not answer.
#[inline(always)] // It is called in one place of each kind of plan.
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
