//! A plan that divides its reads, at work on simulated devices, with several requests in flight. It
//! does what `mbm_plan_pollSplitting` does, and checks after each step that every value is from its
//! own registers.
#![allow(dead_code)] // Not every test uses everything.

use mbm::error::Status;
use mbm::plan::group::group;
use mbm::plan::schedule::{Backoff, Schedule};
use mbm::plan::split::{Finding, Splitter};
use mbm::plan::value::place;
use mbm::plan::{Field, Limits, Position, Read};
use std::collections::BTreeSet;

pub const RETRY_MS: u32 = 30_000;
pub const BACKOFF: Backoff = Backoff {
    first_ms: 1000,
    longest_ms: 60_000,
};

/// What a device lacks, and how much one read may request.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Device {
    pub holes: BTreeSet<(u8, u16)>,
    pub most: u16,
    /// It answers a read that is too long with nothing.
    pub is_mute: bool,
}

impl Device {
    /// A device without holes.
    pub fn whole() -> Device {
        Device {
            most: 2000,
            ..Device::default()
        }
    }

    pub fn has(&self, table: u8, address: u16, quantity: u16) -> bool {
        let mut own = u32::from(address)..u32::from(address) + u32::from(quantity);
        own.all(|own| !self.holes.contains(&(table, own as u16)))
    }

    pub fn answer(&self, read: &Read) -> Status {
        if read.quantity > self.most {
            return if self.is_mute {
                Status::RESPONSE_TIMED_OUT
            } else {
                Status::ILLEGAL_DATA_VALUE
            };
        }
        if self.has(read.table, read.address, read.quantity) {
            Status::OK
        } else {
            Status::ILLEGAL_DATA_ADDRESS
        }
    }

    /// How a field is read in the end.
    pub fn status_of(&self, field: &Field) -> Status {
        if self.has(field.table, field.address, field.length() as u16) {
            Status::OK
        } else {
            Status::ILLEGAL_DATA_ADDRESS
        }
    }
}

/// A number of 8 bits that says where a register is.
fn stamp(unit: u8, table: u8, address: u16) -> u16 {
    let of_table = u32::from(unit) << 5 ^ u32::from(table) << 3;
    u16::from(address as u8 ^ of_table as u8)
}

fn bit_of(unit: u8, table: u8, address: u16) -> bool {
    (u32::from(address) + u32::from(unit) * 7 + u32::from(table)).wrapping_mul(2_654_435_761) >> 16
        & 1
        != 0
}

/// A request in flight: the index of its read, which may move, and what it requests.
#[derive(Clone, Debug)]
pub struct Flight {
    pub read: usize,
    pub of: Read,
}

/// A plan at work.
#[derive(Debug)]
pub struct World {
    pub fields: Vec<Field>,
    pub positions: Vec<Position>,
    pub reads: Vec<Read>,
    pub data: Vec<u16>,
    pub blocks: Vec<u16>,
    pub count: usize,
    pub schedule: Schedule,
    pub now: u32,
    /// How many requests may be in flight at a time.
    pub places: usize,
    pub in_flight: Vec<Flight>,
    /// How many requests were sent.
    pub requests: usize,
    serial: u16,
    is_settled: bool,
    forgiven: u32,
}

impl World {
    /// `storage` is how many reads there is storage for, at most as many as fields; `spare` is the
    /// words of data that the reads of the beginning do not need.
    pub fn new(fields: Vec<Field>, limits: &Limits, storage: usize, spare: usize) -> World {
        let count = fields.len();
        let mut world = World {
            positions: vec![Position::NONE; count],
            reads: vec![Read::default(); count],
            data: Vec::new(),
            blocks: vec![0; count],
            fields,
            count: 0,
            schedule: Schedule::default(),
            now: u32::MAX - 5000,
            places: 1,
            in_flight: Vec::new(),
            requests: 0,
            serial: 0,
            is_settled: true,
            forgiven: u32::MAX - 5000,
        };
        world.count = group(
            &world.fields,
            0,
            limits,
            &mut world.positions,
            &mut world.reads,
            u16::MAX,
        )
        .expect("the table is right");
        let words = world.reads[..world.count]
            .iter()
            .map(|read| usize::from(read.words()));
        world.data = vec![0; words.sum::<usize>() + spare];
        world.reads.truncate(storage.max(world.count));
        world.splitter().start();
        world.schedule.start(&world.reads[..world.count], world.now);
        world
    }

    /// The same plan once more. Its heap is made anew.
    pub fn copy(&self) -> World {
        let world = World {
            fields: self.fields.clone(),
            positions: self.positions.clone(),
            reads: self.reads.clone(),
            data: self.data.clone(),
            blocks: self.blocks.clone(),
            schedule: Schedule::default(),
            in_flight: self.in_flight.clone(),
            ..*self
        };
        world.schedule.renew(&world.reads[..world.count], world.now);
        world
    }

    fn splitter(&mut self) -> Splitter<'_> {
        Splitter {
            fields: &self.fields,
            positions: &mut self.positions,
            reads: &mut self.reads,
            data: &mut self.data,
            blocks: &mut self.blocks,
            count: self.count,
        }
    }

    /// Sends the read that is due, if there is one and a place for its request.
    pub fn begin(&mut self) -> bool {
        let reads = &self.reads[..self.count];
        let next = self.schedule.next(reads, self.now);
        let Some(next) = next.filter(|_| self.in_flight.len() < self.places) else {
            return false;
        };
        self.in_flight.push(Flight {
            read: next.index(reads),
            of: next.clone(),
        });
        self.requests += 1;
        self.schedule.begin(reads);
        true
    }

    /// How long nothing is due, in milliseconds, at least 1 and at most `most`.
    pub fn idle(&self, most: u32) -> u32 {
        let reads = &self.reads[..self.count];
        self.schedule.idle(reads, self.now).clamp(1, most)
    }

    pub fn pass(&mut self, milliseconds: u32) {
        self.now = self.now.wrapping_add(milliseconds);
    }

    /// A request ends with a status. Call `settle` some time after it.
    pub fn end(&mut self, nth: usize, status: Status) {
        let flight = self.in_flight.remove(nth);
        if status == Status::OK {
            // Where the request wants its data.
            self.fill(&flight.of);
        }
        let reads = &self.reads[..self.count];
        let before = reads[flight.read].status();
        self.schedule
            .end_divided(reads, &reads[flight.read], status, self.now, &BACKOFF);
        let now = self.now;
        let mut splitter = self.splitter();
        let finding = splitter.end(flight.read, before, now, RETRY_MS);
        self.count = splitter.count;
        if finding != Finding::Nothing {
            self.is_settled = false;
            self.schedule.renew(&self.reads[..self.count], now);
        }
        self.check();
    }

    /// As `end`, without what divides reads: a mistake that a test must find.
    pub fn end_whole(&mut self, nth: usize, status: Status) {
        let read = self.in_flight.remove(nth).read;
        let reads = &self.reads[..self.count];
        self.schedule
            .end_divided(reads, &reads[read], status, self.now, &BACKOFF);
    }

    /// Joins reads as far as they can be.
    pub fn settle(&mut self) {
        let now = self.now;
        if now.wrapping_sub(self.forgiven) >= RETRY_MS {
            self.forgiven = now;
            self.splitter().forgive();
            self.is_settled = false;
        }
        if self.is_settled {
            return;
        }
        let mut moves = Vec::new();
        let mut splitter = self.splitter();
        let is_settled = splitter.join(now, |from, to| moves.push((from, to)));
        self.count = splitter.count;
        for (from, to) in moves {
            assert!(to < from);
            for flight in &mut self.in_flight {
                assert_ne!(flight.read, to, "a read in flight was removed");
                if flight.read == from {
                    flight.read = to;
                }
            }
        }
        self.is_settled = is_settled;
        self.schedule.renew(&self.reads[..self.count], now);
        self.check();
    }

    /// Sends the next read and takes its answer, or lets time pass.
    pub fn step(&mut self, device: &Device, is_lost: bool) {
        if !self.begin() {
            self.pass(self.idle(1000));
            return;
        }
        self.pass(3);
        let status = if is_lost {
            Status::RESPONSE_TIMED_OUT
        } else {
            device.answer(&self.in_flight[0].of)
        };
        self.end(0, status);
        self.settle();
    }

    pub fn run(&mut self, device: &Device, milliseconds: u32) {
        let start = self.now;
        while self.now.wrapping_sub(start) < milliseconds {
            self.step(device, false);
        }
    }

    /// Stores a reply: each register has its place and the number of the reply.
    fn fill(&mut self, read: &Read) {
        self.serial = self.serial.wrapping_add(1);
        let offset = usize::from(read.offset);
        for nth in 0..read.quantity {
            let address = read.address + nth;
            let place = usize::from(nth);
            if read.is_of_bits() {
                let bit = u16::to_le(1 << (place % 16));
                let word = &mut self.data[offset + place / 16];
                let is_on = bit_of(read.unit, read.table, address);
                *word = *word & !bit | if is_on { bit } else { 0 };
            } else {
                self.data[offset + place] =
                    self.serial << 8 | stamp(read.unit, read.table, address);
            }
        }
    }

    pub fn read_of(&self, field: usize) -> &Read {
        &self.reads[self.positions[field].read()]
    }

    pub fn status(&self, field: usize) -> Status {
        self.read_of(field).status()
    }

    /// Every field lies within its read; what it has is from its addresses and from one reply; and
    /// no two reads share data.
    pub fn check(&self) {
        for (index, field) in self.fields.iter().enumerate() {
            assert!(self.positions[index].read() < self.count);
            let read = self.read_of(index);
            assert_eq!(
                (read.unit.into(), read.table, read.interval_ms),
                (field.unit, field.table, field.interval_ms)
            );
            assert!(read.address <= field.address);
            assert!(u32::from(read.address) + u32::from(read.quantity) >= field.end());
            if read.has_data() {
                self.check_value(field, read);
            } else {
                assert_ne!(read.status(), Status::OK);
            }
        }
        let mut areas: Vec<_> = self.reads[..self.count]
            .iter()
            .map(|read| (read.offset, read.offset + read.words()))
            .collect();
        areas.sort_unstable();
        assert!(
            areas.windows(2).all(|two| two[0].1 <= two[1].0),
            "{areas:?}"
        );
        assert!(areas
            .iter()
            .all(|area| usize::from(area.1) <= self.data.len()));
        for read in 0..self.count {
            let own: Vec<_> = Position::fields_of(&self.positions, read).collect();
            assert!(!own.is_empty());
            assert!(own
                .iter()
                .all(|field| self.positions[*field].read() == read));
        }
        for flight in &self.in_flight {
            let read = &self.reads[flight.read];
            let place = |read: &Read| (read.unit, read.table, read.address, read.quantity);
            assert_eq!(place(read), place(&flight.of));
            assert_eq!(read.offset, flight.of.offset, "data moved in flight");
        }
    }

    fn check_value(&self, field: &Field, read: &Read) {
        let offset = usize::from(read.offset);
        let (word, before) = place(field, read.address, 0).expect("it has a value");
        let mut serial = None;
        for nth in 0..field.length() as u16 {
            let address = field.address + nth;
            if field.is_in_bits() {
                let at = usize::from(word) * 16 + usize::from(before) + usize::from(nth);
                let found = u16::from_le(self.data[offset + at / 16]) >> (at % 16) & 1 != 0;
                let is_on = bit_of(read.unit, field.table, address);
                assert_eq!(found, is_on, "{field:?}");
            } else {
                let found = self.data[offset + usize::from(word) + usize::from(nth)];
                let wanted = stamp(read.unit, field.table, address);
                assert_eq!(found & 0xFF, wanted, "{field:?} {read:?}");
                assert_eq!(*serial.get_or_insert(found >> 8), found >> 8, "{field:?}");
            }
        }
    }
}
