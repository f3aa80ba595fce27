//! Reads that a device refuses are cut until the fields that it lacks are found: random plans with
//! devices that have holes and limits, lose replies, and gain what they lacked.

#[path = "common/plan.rs"]
mod plan;

use mbm::error::Status;
use mbm::plan::field::{BIT, UINT16, UINT32, UINT64};
use mbm::plan::field::{COILS, DISCRETE_INPUTS, HOLDING_REGISTERS, INPUT_REGISTERS};
use mbm::plan::group::group;
use mbm::plan::schedule::{Backoff, Schedule};
use mbm::plan::split::{Finding, Splitter};
use mbm::plan::value::place;
use mbm::plan::{Field, Limits, Position, Read};
use plan::LIMITS;
use proptest::prelude::*;
use std::collections::BTreeSet;

const RETRY_MS: u32 = 30_000;
const BACKOFF: Backoff = Backoff {
    first_ms: 1000,
    longest_ms: 60_000,
};

/// What a device lacks, and how much one read may request.
#[derive(Clone, Debug, Default)]
struct Device {
    holes: BTreeSet<(u8, u16)>,
    most: u16,
    /// It answers a read that is too long with nothing.
    is_mute: bool,
}

impl Device {
    fn has(&self, table: u8, address: u16, quantity: u16) -> bool {
        (address..address + quantity).all(|own| !self.holes.contains(&(table, own)))
    }

    fn answer(&self, read: &Read) -> Status {
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
}

fn bit_of(table: u8, address: u16) -> bool {
    (u32::from(address) + u32::from(table)).wrapping_mul(2_654_435_761) >> 16 & 1 != 0
}

/// A plan at work on a device.
struct World {
    fields: Vec<Field>,
    positions: Vec<Position>,
    reads: Vec<Read>,
    data: Vec<u16>,
    blocks: Vec<u16>,
    count: usize,
    schedule: Schedule,
    now: u32,
    serial: u16,
    requests: usize,
    is_settled: bool,
    forgiven: u32,
}

impl World {
    fn new(fields: Vec<Field>, limits: &Limits, spare: usize) -> World {
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
            serial: 0,
            requests: 0,
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
        world.splitter().start();
        world.schedule.start(&world.reads[..world.count], world.now);
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

    /// Sends the next read and takes its answer, or lets time pass.
    fn step(&mut self, device: &Device, is_lost: bool) {
        let reads = &self.reads[..self.count];
        let Some(next) = self.schedule.next(reads, self.now) else {
            let idle = self.schedule.idle(reads, self.now).clamp(1, 1000);
            self.now = self.now.wrapping_add(idle);
            return;
        };
        let index = next.index(reads);
        self.requests += 1;
        self.schedule.begin(reads);
        self.now = self.now.wrapping_add(3);
        let (before, read) = (reads[index].status(), reads[index].clone());
        let status = if is_lost {
            Status::RESPONSE_TIMED_OUT
        } else {
            device.answer(&read)
        };
        if status == Status::OK {
            self.fill(&read);
        }
        let reads = &self.reads[..self.count];
        self.schedule
            .end(reads, &reads[index], status, self.now, &BACKOFF);
        let now = self.now;
        let mut splitter = self.splitter();
        let finding = splitter.end(index, before, now, RETRY_MS);
        let count = splitter.count;
        self.count = count;
        if finding != Finding::Nothing {
            self.is_settled = false;
        }
        if now.wrapping_sub(self.forgiven) >= RETRY_MS {
            self.forgiven = now;
            self.splitter().forgive();
            self.is_settled = false;
        }
        if !self.is_settled {
            let mut splitter = self.splitter();
            let is_settled = splitter.join(now, |from, to| assert!(to < from));
            self.count = splitter.count;
            self.is_settled = is_settled;
        }
        self.schedule.renew(&self.reads[..self.count], now);
        self.check();
    }

    /// Stores a reply: each register has its address and the number of the reply.
    fn fill(&mut self, read: &Read) {
        self.serial = self.serial.wrapping_add(1);
        let offset = usize::from(read.offset);
        for nth in 0..read.quantity {
            let address = read.address + nth;
            let place = usize::from(nth);
            if read.is_of_bits() {
                let bit = u16::to_le(1 << (place % 16));
                let word = &mut self.data[offset + place / 16];
                *word = *word & !bit | if bit_of(read.table, address) { bit } else { 0 };
            } else {
                self.data[offset + place] = self.serial << 8 | address & 0xFF;
            }
        }
    }

    fn read_of(&self, field: usize) -> &Read {
        &self.reads[self.positions[field].read()]
    }

    /// Every field lies within its read; what it has is from its addresses and from one reply; and
    /// no two reads share data.
    fn check(&self) {
        for (index, field) in self.fields.iter().enumerate() {
            assert!(self.positions[index].read() < self.count);
            let read = self.read_of(index);
            assert_eq!(
                (read.unit.into(), read.table, read.interval_ms),
                (field.unit, field.table, field.interval_ms)
            );
            assert!(read.address <= field.address);
            assert!(u32::from(read.address) + u32::from(read.quantity) >= field.end());
            if !read.has_data() {
                continue;
            }
            let offset = usize::from(read.offset);
            let (word, before) = place(field, read.address, 0).expect("it has a value");
            let mut serial = None;
            for nth in 0..field.length() as u16 {
                let address = field.address + nth;
                if field.is_in_bits() {
                    let at = usize::from(word) * 16 + usize::from(before) + usize::from(nth);
                    let found = u16::from_le(self.data[offset + at / 16]) >> (at % 16) & 1 != 0;
                    assert_eq!(found, bit_of(field.table, address), "{field:?}");
                } else {
                    let found = self.data[offset + usize::from(word) + usize::from(nth)];
                    assert_eq!(found & 0xFF, address & 0xFF, "{field:?} {read:?}");
                    assert_eq!(*serial.get_or_insert(found >> 8), found >> 8, "{field:?}");
                }
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
    }

    fn run(&mut self, device: &Device, milliseconds: u32) {
        let start = self.now;
        while self.now.wrapping_sub(start) < milliseconds {
            self.step(device, false);
        }
    }

    fn status(&self, field: usize) -> Status {
        self.read_of(field).status()
    }
}

fn field() -> impl Strategy<Value = Field> {
    let types = prop_oneof![Just(UINT16), Just(UINT32), Just(UINT64)];
    (
        COILS..=INPUT_REGISTERS,
        types,
        0..120u16,
        1..4u16,
        0..6u8,
        any::<bool>(),
    )
        .prop_map(
            |(table, of_registers, address, count, few, is_slow)| Field {
                unit: 3,
                table,
                value_type: if table <= DISCRETE_INPUTS {
                    BIT
                } else {
                    of_registers
                },
                address,
                count: if few == 0 { count } else { 1 },
                interval_ms: if is_slow { 1000 } else { 200 },
                ..Field::NONE
            },
        )
}

fn limits() -> impl Strategy<Value = Limits<'static>> {
    (0..30u16, 0..100u16).prop_map(|(register_gap, bit_gap)| Limits {
        register_gap,
        bit_gap,
        ..LIMITS
    })
}

fn device(is_mute: bool) -> impl Strategy<Value = Device> {
    let hole = (COILS..=INPUT_REGISTERS, 0..130u16);
    let most = prop_oneof![3 => Just(2000u16), 1 => 12..60u16];
    (prop::collection::btree_set(hole, 0..20), most).prop_map(move |(holes, most)| Device {
        holes,
        most,
        is_mute,
    })
}

fn is_found(world: &World, device: &Device) {
    for (index, field) in world.fields.iter().enumerate() {
        let is_there = device.has(field.table, field.address, field.length() as u16);
        let wanted = if is_there {
            Status::OK
        } else {
            Status::ILLEGAL_DATA_ADDRESS
        };
        assert_eq!(world.status(index), wanted, "{field:?}");
        if is_there {
            let age = world.read_of(index).age(world.now);
            assert!(age <= 3 * field.interval_ms, "{field:?} is {age} ms old");
        }
    }
}

/// The neighbours of one read at first that are two reads, although the device has both with what
/// is between them, and they share no address.
fn needless_cuts(world: &World, device: &Device) -> usize {
    let mut cuts = 0;
    for place in 1..world.positions.len() {
        let of = |place: usize| world.positions[world.positions[place].field()].read();
        let (left, right) = (of(place - 1), of(place));
        let (one, other) = (&world.reads[left], &world.reads[right]);
        if left != right
            && world.blocks[left] == world.blocks[right]
            && (one.status(), other.status()) == (Status::OK, Status::OK)
            && other.address >= one.address + one.quantity
            && device.has(
                one.table,
                one.address,
                other.address + other.quantity - one.address,
            )
        {
            cuts += 1;
        }
    }
    cuts
}

/// More than any plan of these tests needs.
const SPARE: usize = 4000;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(miri) { 2 } else { 40 }))]

    #[test]
    fn every_field_that_a_device_has_is_read_and_the_others_are_found(
        fields in prop::collection::vec(field(), 1..60),
        limits in limits(),
        device in device(false),
    ) {
        let mut world = World::new(fields, &limits, SPARE);
        world.run(&device, 20_000);
        is_found(&world, &device);
        if device.most == 2000 {
            prop_assert_eq!(needless_cuts(&world, &device), 0);
        }
        // What is not there costs nothing before it is tried again, 30 s after it was found.
        let before = world.requests;
        let reads = world.reads[..world.count].iter().filter(|read| read.status() == Status::OK);
        let each: u32 = reads.map(|read| 8000 / read.interval_ms + 1).sum();
        world.run(&device, 8000);
        prop_assert!(world.requests - before <= each as usize);
    }

    #[test]
    fn a_device_that_gains_its_fields_has_its_first_reads_again(
        fields in prop::collection::vec(field(), 1..60),
        limits in limits(),
        device in device(false),
    ) {
        let mut world = World::new(fields, &limits, SPARE);
        let first = world.count;
        world.run(&device, 20_000);
        let whole = Device { most: 2000, ..Device::default() };
        world.run(&whole, RETRY_MS + 20_000);
        is_found(&world, &whole);
        prop_assert_eq!(needless_cuts(&world, &whole), 0);
        prop_assert!(world.count >= first);
        // It loses them once more.
        world.run(&device, 30_000);
        is_found(&world, &device);
    }

    #[test]
    fn lost_replies_and_too_little_storage_never_give_a_wrong_value(
        fields in prop::collection::vec(field(), 1..40),
        limits in limits(),
        device in device(true),
        lost in prop::collection::vec(any::<u8>(), 50..400),
        spare in 0..40usize,
        change in 0..200usize,
    ) {
        let mut world = World::new(fields, &limits, spare);
        let whole = Device { most: 2000, ..Device::default() };
        for (nth, lost) in lost.iter().enumerate() {
            let now = if nth > change { &whole } else { &device };
            world.step(now, lost % 7 == 0);
        }
        // With storage or without, a device that has all is read in the end.
        world.run(&whole, RETRY_MS + 100_000);
        for index in 0..world.fields.len() {
            prop_assert_eq!(world.status(index), Status::OK);
        }
    }
}

fn registers(addresses: impl IntoIterator<Item = u16>) -> Vec<Field> {
    let field = |address| Field {
        unit: 3,
        table: HOLDING_REGISTERS,
        value_type: UINT16,
        address,
        interval_ms: 1000,
        ..Field::NONE
    };
    addresses.into_iter().map(field).collect()
}

#[test]
fn one_missing_field_of_a_hundred_leaves_three_reads() {
    let mut world = World::new(registers(0..100), &LIMITS, 0);
    let device = Device {
        holes: [(HOLDING_REGISTERS, 37)].into(),
        most: 2000,
        is_mute: false,
    };
    assert_eq!(world.count, 1);
    world.run(&device, 900);
    assert_eq!(world.count, 3);
    assert!(world.requests <= 20, "{}", world.requests);
    is_found(&world, &device);
}

#[test]
fn one_missing_register_between_fields_leaves_two_reads() {
    for count in [4, 10, 20, 40, 100] {
        let hole = count / 2;
        let limits = Limits {
            register_gap: 1,
            ..LIMITS
        };
        let fields = registers((0..count).filter(|address| *address != hole));
        let mut world = World::new(fields, &limits, SPARE);
        let device = Device {
            holes: [(HOLDING_REGISTERS, hole)].into(),
            most: 2000,
            is_mute: false,
        };
        assert_eq!(world.count, 1);
        world.run(&device, 900);
        is_found(&world, &device);
        assert_eq!(world.count, 2);
        assert!(world.requests <= 25, "{}", world.requests);
        let before = world.requests;
        world.run(&device, 10_000);
        assert_eq!(world.requests - before, 20);
    }
}

#[test]
fn a_device_that_refuses_long_reads_is_read_in_parts_after_one_union_was_tried() {
    let mut world = World::new(registers(0..120), &LIMITS, 0);
    let device = Device {
        most: 80,
        ..Device::default()
    };
    world.run(&device, 900);
    is_found(&world, &device);
    assert_eq!(world.count, 2);
    let before = world.requests;
    world.run(&device, 100_000);
    assert!(
        world.requests - before <= 220,
        "{}",
        world.requests - before
    );
}

#[test]
fn a_union_that_the_device_does_not_answer_is_cut_again() {
    let mut world = World::new(registers(0..120), &LIMITS, 0);
    let refuses = Device {
        holes: [(HOLDING_REGISTERS, 5)].into(),
        most: 70,
        is_mute: false,
    };
    world.run(&refuses, 1);
    let device = Device {
        is_mute: true,
        ..refuses
    };
    world.run(&device, 60_000);
    is_found(&world, &device);
}

#[test]
fn what_was_read_before_stays_while_a_device_is_searched() {
    let mut world = World::new(registers(0..20), &LIMITS, 0);
    let whole = Device {
        most: 2000,
        ..Device::default()
    };
    world.run(&whole, 500);
    let device = Device {
        holes: [(HOLDING_REGISTERS, 3)].into(),
        ..whole
    };
    let before = world.requests;
    while world.requests < before + 3 {
        world.step(&device, false);
        for field in 0..20 {
            assert_eq!(world.status(field), Status::OK);
            assert!(world.read_of(field).has_data());
        }
    }
    world.run(&device, 2000);
    is_found(&world, &device);
    assert!(world.read_of(3).has_data());
}

#[test]
fn the_search_of_one_block_leaves_others_as_they_are() {
    let mut fields = registers([21, 65, 67, 70]);
    fields[0].table = COILS;
    fields[0].value_type = BIT;
    let limits = Limits {
        register_gap: 2,
        ..LIMITS
    };
    let mut world = World::new(fields, &limits, 0);
    let device = Device {
        holes: [(COILS, 21), (HOLDING_REGISTERS, 70)].into(),
        most: 2000,
        is_mute: false,
    };
    // The coil is found before the first read of the registers is refused.
    world.run(&device, 900);
    is_found(&world, &device);
    assert_eq!(needless_cuts(&world, &device), 0);
}
