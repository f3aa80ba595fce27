//! The order in which a plan reads, held against a scan of all reads: random plans with units
//! that do not answer, over a clock that wraps.

#[path = "common/plan.rs"]
mod plan;

use mbm::error::Status;
use mbm::plan::field::{HOLDING_REGISTERS, INPUT_REGISTERS, UINT16};
use mbm::plan::group::group;
use mbm::plan::schedule::{Backoff, Schedule, FOREVER};
use mbm::plan::{Field, Position, Read};
use plan::LIMITS;
use proptest::prelude::*;

/// From now to `time`; 0 if it has come.
fn until(time: u32, now: u32) -> u32 {
    time.wrapping_sub(now).cast_signed().max(0).cast_unsigned()
}

/// A read as the scan sees it.
#[derive(Clone, Debug)]
struct Scanned {
    unit: u8,
    interval: u32,
    due: u32,
    not_before: u32,
    status: Status,
    doublings: u32,
    is_queued: bool,
    is_doubted: bool,
    is_suspended: bool,
    is_news: bool,
}

/// The scan: it looks at every read for every answer.
struct Scan(Vec<Scanned>);

impl Scan {
    fn start(reads: &[Read], now: u32) -> Scan {
        let mut all: Vec<Scanned> = Vec::new();
        for read in reads {
            let interval = read.interval_ms;
            let own = reads.iter().filter(|own| own.interval_ms == interval);
            let count = own.count() as u32;
            let before = all.iter().filter(|own| own.interval == interval).count() as u32;
            all.push(Scanned {
                unit: read.unit,
                interval,
                due: now
                    .wrapping_sub(interval)
                    .wrapping_add(before * (interval / count)),
                not_before: now,
                status: Status::PENDING,
                doublings: 0,
                is_queued: false,
                is_doubted: false,
                is_suspended: false,
                is_news: false,
            });
        }
        Scan(all)
    }

    fn is_blocked(&self, read: &Scanned) -> bool {
        let is_tried = |other: &Scanned| other.unit == read.unit && other.is_queued;
        read.is_suspended && self.0.iter().any(is_tried)
    }

    /// The read to send, and otherwise how long there is none.
    fn next(&self, now: u32) -> Result<usize, u32> {
        let mut next = Err(FOREVER);
        let mut latest = 0;
        for (index, read) in self.0.iter().enumerate() {
            if read.is_queued || self.is_blocked(read) {
                continue;
            }
            let wait = until(read.due, now).max(until(read.not_before, now));
            let late = now.wrapping_sub(read.due);
            if wait == 0 && late >= latest {
                next = Ok(index);
                latest = late;
            }
            next = next.map_err(|shortest| shortest.min(wait));
        }
        next
    }

    fn end(&mut self, index: usize, status: Status, now: u32, backoff: &Backoff) {
        let read = &mut self.0[index];
        read.is_queued = false;
        read.is_news = true;
        read.status = status;
        if until(read.due, now) == 0 {
            let rounds = now.wrapping_sub(read.due) / read.interval + 1;
            read.due = read.due.wrapping_add(rounds * read.interval);
        }
        let is_silence = [0xE0, 0xE1, 0xE2, 0x0A, 0x0B].contains(&status.code());
        let (mut doublings, mut not_before) = (0, now);
        if is_silence {
            if until(read.not_before, now) > 0 {
                return;
            }
            let wait = (u64::from(backoff.first_ms) << read.doublings) as u32;
            doublings = read.doublings + u32::from(wait < backoff.longest_ms);
            not_before = now.wrapping_add(wait.min(backoff.longest_ms));
        } else if status != Status::OK && !status.is_exception() {
            return;
        }
        let was_suspended = read.is_suspended;
        let is_suspended = is_silence && read.is_doubted;
        let unit = read.unit;
        read.doublings = doublings;
        read.not_before = not_before;
        for other in self.0.iter_mut().filter(|other| other.unit == unit) {
            if was_suspended || is_suspended {
                other.doublings = doublings;
                other.not_before = not_before;
            }
            if is_suspended && !was_suspended {
                other.status = status;
                other.is_news = true;
            }
            other.is_doubted = is_silence;
            other.is_suspended = is_suspended;
        }
    }

    fn hasten(&mut self, index: usize, now: u32) {
        let read = &mut self.0[index];
        if until(read.due, now) > 0 {
            read.due = now;
        }
    }
}

/// Both, side by side.
struct Pair {
    reads: Vec<Read>,
    schedule: Schedule,
    scan: Scan,
    queued: Vec<usize>,
    now: u32,
    backoff: Backoff,
}

impl Pair {
    /// A plan with one read for each unit and interval of the list.
    fn of(list: &[(u8, u32)], now: u32, backoff: Backoff) -> Pair {
        let fields: Vec<Field> = (0..)
            .zip(list)
            .map(|(index, (unit, interval_ms))| Field {
                unit: (*unit).into(),
                table: if index & 1 == 0 {
                    HOLDING_REGISTERS
                } else {
                    INPUT_REGISTERS
                },
                value_type: UINT16,
                address: 2 * index,
                interval_ms: *interval_ms,
                ..Field::NONE
            })
            .collect();
        let mut positions = vec![Position::NONE; fields.len()];
        let mut reads = vec![Read::default(); fields.len()];
        let count = group(&fields, 0, &LIMITS, &mut positions, &mut reads, u16::MAX);
        assert_eq!(count, Ok(fields.len()));
        let schedule = Schedule::default();
        schedule.start(&reads, now);
        let scan = Scan::start(&reads, now);
        Pair {
            reads,
            schedule,
            scan,
            queued: Vec::new(),
            now,
            backoff,
        }
    }

    /// The next read of both.
    fn next(&self) -> Option<usize> {
        let next = self.schedule.next(&self.reads, self.now);
        let next = next.map(|read| read.index(&self.reads));
        match self.scan.next(self.now) {
            Ok(index) => assert_eq!(next, Some(index)),
            Err(wait) => {
                assert_eq!(next, None);
                let idle = self.schedule.idle(&self.reads, self.now);
                assert!(idle > 0 && idle <= wait, "{idle} ms instead of {wait}");
            }
        }
        next
    }

    /// Queues the next read, if one is due.
    fn begin(&mut self) -> bool {
        let Some(index) = self.next() else {
            return false;
        };
        self.schedule.begin(&self.reads);
        self.scan.0[index].is_queued = true;
        self.queued.push(index);
        true
    }

    /// Ends one of the queued reads.
    fn end(&mut self, which: usize, status: Status) {
        let index = self.queued.remove(which % self.queued.len());
        let (reads, now) = (&self.reads, self.now);
        let is_of_unit = self
            .schedule
            .end(reads, &reads[index], status, now, &self.backoff);
        self.scan.end(index, status, now, &self.backoff);
        for (at, (read, own)) in reads.iter().zip(&mut self.scan.0).enumerate() {
            let is_news = at == index || is_of_unit && read.unit == reads[index].unit;
            assert_eq!(
                is_news,
                std::mem::take(&mut own.is_news),
                "news of read {at}"
            );
            assert_eq!(read.status(), own.status);
        }
    }

    fn hasten(&mut self, index: usize) {
        let index = index % self.reads.len();
        self.schedule
            .hasten(&self.reads, &self.reads[index], self.now);
        self.scan.hasten(index, self.now);
    }

    fn pass(&mut self, time: u32) {
        self.now = self.now.wrapping_add(time);
    }
}

const ENDS: [Status; 8] = [
    Status::OK,
    Status::OK,
    Status::RESPONSE_TIMED_OUT,
    Status::RESPONSE_TIMED_OUT,
    Status::ILLEGAL_DATA_ADDRESS,
    Status::INVALID_CRC,
    Status::exception(0x0B),
    Status::LINK_LOST,
];

const INTERVALS: [u32; 6] = [1, 7, 100, 1000, 1000, 60_000];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn the_order_is_that_of_a_scan_of_all_reads(
        list in prop::collection::vec((1..4u8, 0..INTERVALS.len()), 1..24),
        now in any::<u32>(),
        first_ms in 1..2000u32,
        longest_ms in 1..20_000u32,
        in_flight in 1..5usize,
        steps in prop::collection::vec((0..8u8, any::<u16>(), 0..ENDS.len()), 1..300),
    ) {
        let list: Vec<(u8, u32)> =
            list.iter().map(|(unit, at)| (*unit, INTERVALS[*at])).collect();
        let mut pair = Pair::of(&list, now, Backoff { first_ms, longest_ms });
        for (step, number, end) in steps {
            match step {
                0..=2 if pair.queued.len() < in_flight => _ = pair.begin(),
                0..=4 if !pair.queued.is_empty() => pair.end(number.into(), ENDS[end]),
                5 => pair.hasten(number.into()),
                6 => pair.pass(u32::from(number) % 50),
                _ => pair.pass(number.into()),
            }
            _ = pair.next();
        }
    }
}

/// Runs a plan some of whose units do not answer for some time, and sleeps as the plan says.
/// Returns how many reads of each unit were sent.
fn run(
    pair: &mut Pair,
    in_flight: usize,
    time: u32,
    is_silent: impl Fn(u8, u32) -> bool,
) -> [u32; 256] {
    let (start, mut sent) = (pair.now, [0; 256]);
    while pair.now.wrapping_sub(start) < time {
        while pair.queued.len() < in_flight && pair.begin() {}
        let passed = pair.now.wrapping_sub(start);
        let Some(index) = pair.queued.first() else {
            pair.pass(pair.schedule.idle(&pair.reads, pair.now).min(time));
            continue;
        };
        let unit = pair.reads[*index].unit;
        sent[usize::from(unit)] += 1;
        let is_silent = is_silent(unit, passed);
        pair.pass(if is_silent { 100 } else { 3 });
        pair.end(
            0,
            if is_silent {
                Status::RESPONSE_TIMED_OUT
            } else {
                Status::OK
            },
        );
    }
    sent
}

const BACKOFF: Backoff = Backoff {
    first_ms: 1000,
    longest_ms: 60_000,
};

#[test]
fn the_order_of_many_reads_is_that_of_a_scan() {
    let intervals = [2000, 5000, 4999, 10_000];
    let list: Vec<(u8, u32)> = (0..300)
        .map(|at| (1 + (at % 7) as u8, intervals[at % 4]))
        .collect();
    for in_flight in [1, 16] {
        let mut pair = Pair::of(&list, u32::MAX - 30_000, BACKOFF);
        let sent = run(&mut pair, in_flight, 120_000, |unit, passed| {
            unit == 3 || unit == 5 && (20_000..70_000).contains(&passed)
        });
        assert!(sent[1] > 500 && sent[5] > 300, "{} {}", sent[1], sent[5]);
        assert!(sent[3] < 30, "{}", sent[3]);
    }
}

#[test]
fn a_line_that_is_too_slow_reads_in_the_order_of_a_scan() {
    let list: Vec<(u8, u32)> = (0..200)
        .map(|at| (1 + (at % 3) as u8, [100, 150][at % 2]))
        .collect();
    let mut pair = Pair::of(&list, 7, BACKOFF);
    let sent = run(&mut pair, 1, 30_000, |_, _| false);
    assert!(
        sent[1..4].iter().all(|sent| *sent > 3000),
        "{:?}",
        &sent[..4]
    );
}

#[test]
fn a_link_that_was_lost_for_a_month_is_read_at_its_interval() {
    let mut pair = Pair::of(&[(1, 3_600_000), (2, 3_600_000)], 0, BACKOFF);
    let (mut passed, mut sent) = (0u64, 0);
    while passed < 60 * 86_400_000 {
        while let Some(read) = pair.schedule.next(&pair.reads, pair.now) {
            pair.schedule.begin(&pair.reads);
            pair.schedule
                .end(&pair.reads, read, Status::LINK_LOST, pair.now, &BACKOFF);
            sent += 1;
        }
        let idle = pair.schedule.idle(&pair.reads, pair.now);
        assert!(idle <= 3_600_000);
        pair.pass(idle);
        passed += u64::from(idle);
    }
    // The second round begins with one of them half an hour after the first.
    assert_eq!(sent, 2 * 60 * 24 + 1);
}
