//! A life of a plan that divides its reads: random fields, devices that lack some of them, gain and lose
//! them, refuse long reads, are busy, silent and lost, and replies in any order. Two properties hold:
//! - Safety: a value is that of its own registers (see `divided`). A field that the device had all the
//!   time, and that it may read, never has the status of one that is not there.
//! - Liveness: once the devices stay as they are, each field is read within [`BOUND_MS`], or has the
//!   exception of one that is not there, and this stays so.

use super::divided::{Device, World, BACKOFF, RETRY_MS};
use mbm::error::Status;
use mbm::plan::field::{BIT, REGISTERS, UINT16, UINT32, UINT64};
use mbm::plan::field::{DISCRETE_INPUTS, HOLDING_REGISTERS, INPUT_REGISTERS};
use mbm::plan::{Field, Limits};

/// Chooses what happens.
pub trait Choices {
    /// A number below `limit`.
    fn below(&mut self, limit: u32) -> u32;
    /// True if nothing more is to happen.
    fn is_over(&self) -> bool;
}

/// The units that fields may have.
const UNITS: u16 = 3;
/// The longest interval, and the time that a request takes, in milliseconds.
const LONGEST_MS: u32 = 1000;
const REQUEST_MS: u32 = 3;
/// A unit that was silent is left alone, a field that was not there is tried again, what was cut is
/// found anew; then everything is read.
const BOUND_MS: u32 = BACKOFF.longest_ms + 2 * RETRY_MS + 10 * LONGEST_MS;
/// More words than any plan needs here.
const SPARE: usize = 4000;

fn one_of<T: Copy>(choices: &mut dyn Choices, items: &[T]) -> T {
    items[choices.below(items.len() as u32) as usize]
}

fn field(choices: &mut dyn Choices) -> Field {
    let table = 1 + choices.below(4) as u8;
    let of_registers = one_of(choices, &[UINT16, UINT16, UINT32, UINT64, REGISTERS]);
    Field {
        unit: 1 + choices.below(UNITS.into()) as u16,
        table,
        value_type: if table <= DISCRETE_INPUTS {
            BIT
        } else {
            of_registers
        },
        address: choices.below(60) as u16,
        count: one_of(choices, &[1, 1, 1, 2, 3]),
        interval_ms: one_of(choices, &[200, LONGEST_MS]),
        ..Field::NONE
    }
}

/// What one unit does.
struct Unit {
    device: Device,
    is_silent: bool,
}

/// A life at work.
struct Life<'a> {
    choices: &'a mut dyn Choices,
    world: World,
    units: Vec<Unit>,
    /// For each field whether the device has always had it so far.
    was_there: Vec<bool>,
    /// Each read can be cut as far as it needs to.
    has_storage: bool,
}

impl Life<'_> {
    fn device_of(&self, field: &Field) -> &Device {
        &self.units[usize::from(field.unit) - 1].device
    }

    fn is_there(&self, field: &Field) -> bool {
        let device = self.device_of(field);
        device.status_of(field) == Status::OK && field.length() <= device.most.into()
    }

    fn note_fields(&mut self) {
        for at in 0..self.was_there.len() {
            self.was_there[at] &= self.is_there(&self.world.fields[at]);
        }
    }

    /// A device changes.
    fn change(&mut self) {
        let at = self.choices.below(UNITS.into()) as usize;
        match self.choices.below(6) {
            0 | 1 => {
                let place = if self.choices.below(4) == 0 {
                    let table = 1 + self.choices.below(4) as u8;
                    (table, self.choices.below(70) as u16)
                } else {
                    let fields = &self.world.fields;
                    let field = one_of(self.choices, fields);
                    let nth = self.choices.below(field.length()) as u16;
                    (field.table, field.address + nth)
                };
                self.units[at].device.holes.insert(place);
            }
            2 => {
                let holes = &mut self.units[at].device.holes;
                let nth = self.choices.below(1 + holes.len() as u32) as usize;
                if let Some(hole) = holes.iter().nth(nth).copied() {
                    holes.remove(&hole);
                }
            }
            3 => self.units[at].device.most = one_of(self.choices, &[2000, 2000, 40, 12]),
            4 => self.units[at].device.is_mute = self.choices.below(2) == 0,
            _ => self.units[at].is_silent = !self.units[at].is_silent,
        }
        self.note_fields();
    }

    /// A request ends.
    fn end(&mut self, is_disturbed: bool) {
        let count = self.world.in_flight.len() as u32;
        if count == 0 {
            return;
        }
        let nth = self.choices.below(count) as usize;
        let read = &self.world.in_flight[nth].of;
        let unit = &self.units[usize::from(read.unit) - 1];
        let mut status = unit.device.answer(read);
        if unit.is_silent {
            status = Status::RESPONSE_TIMED_OUT;
        }
        if is_disturbed && self.choices.below(5) == 0 {
            let disturbances = [
                Status::RESPONSE_TIMED_OUT,
                Status::LINK_LOST,
                Status::CANCELLED,
                Status::INVALID_CRC,
                Status::exception(6),
                Status::exception(4),
                Status::exception(0x0B),
            ];
            status = one_of(self.choices, &disturbances);
        }
        self.world.end(nth, status);
        if self.has_storage {
            for (at, was_there) in self.was_there.iter().enumerate() {
                let status = self.world.status(at);
                assert!(
                    !was_there || !is_refusal(status),
                    "{:?} is there, and is {status:?}",
                    self.world.fields[at]
                );
            }
        }
    }

    /// Anything happens.
    fn disturb(&mut self) {
        match self.choices.below(16) {
            0..=4 => {
                self.world.begin();
            }
            5..=9 => self.end(true),
            10 | 11 => self.world.settle(),
            12 => self.change(),
            13 => {
                let at = self.choices.below(self.world.fields.len() as u32) as usize;
                let world = &self.world;
                let reads = &world.reads[..world.count];
                world.schedule.hasten(reads, world.read_of(at), world.now);
            }
            14 => self.world.pass(1 << self.choices.below(17)),
            _ => self.world.pass(self.world.idle(5000)),
        }
    }

    /// The devices answer each request for some time. Calls `look` after each end of a request.
    fn run(&mut self, milliseconds: u32, mut look: impl FnMut(&Self)) {
        let start = self.world.now;
        while self.world.now.wrapping_sub(start) < milliseconds {
            while self.world.begin() {}
            if self.world.in_flight.is_empty() {
                self.world.pass(self.world.idle(1000));
            } else {
                self.world.pass(REQUEST_MS);
                self.end(false);
                self.world.settle();
                look(self);
            }
        }
    }

    /// Each field is read, or has the exception of one that is not there.
    fn check(&self, is_first: bool) {
        for (at, field) in self.world.fields.iter().enumerate() {
            let status = self.world.status(at);
            if !self.is_there(field) {
                assert!(!is_first || is_refusal(status), "{field:?} is {status:?}");
                continue;
            }
            let age = self.world.read_of(at).age(self.world.now);
            assert_eq!(status, Status::OK, "{field:?}");
            assert!(age <= 4 * LONGEST_MS, "{field:?} is {age} ms old");
        }
    }
}

fn is_refusal(status: Status) -> bool {
    matches!(
        status,
        Status::ILLEGAL_DATA_ADDRESS | Status::ILLEGAL_DATA_VALUE
    )
}

/// Lives one life.
pub fn live(choices: &mut dyn Choices) {
    let limits = Limits {
        bits: 0,
        registers: one_of(choices, &[0, 0, 20]),
        bit_gap: one_of(choices, &[0, 30]),
        register_gap: one_of(choices, &[0, 4, 30]),
        units: &[],
        excluded: &[],
    };
    let count = 1 + choices.below(24);
    let mut fields: Vec<Field> = (0..count).map(|_| field(choices)).collect();
    if choices.below(4) == 0 {
        // One block.
        for (field, address) in fields.iter_mut().zip(0..) {
            (field.unit, field.table, field.interval_ms) = (1, HOLDING_REGISTERS, LONGEST_MS);
            (field.value_type, field.address, field.count) = (UINT16, address, 1);
        }
    }
    debug_assert!(fields.iter().all(|field| field.table <= INPUT_REGISTERS));
    let has_storage = choices.below(4) != 0;
    let (storage, spare) = if has_storage {
        (usize::MAX, SPARE)
    } else {
        (choices.below(count) as usize, choices.below(20) as usize)
    };
    let mut world = World::new(fields, &limits, storage, spare);
    world.places = 1 + choices.below(4) as usize;
    let device = || Unit {
        device: Device::whole(),
        is_silent: false,
    };
    let mut life = Life {
        was_there: vec![true; world.fields.len()],
        choices,
        world,
        units: (0..UNITS).map(|_| device()).collect(),
        has_storage,
    };
    for _ in 0..life.choices.below(8) {
        life.change();
    }
    while !life.choices.is_over() {
        life.disturb();
    }
    for unit in &mut life.units {
        unit.is_silent = false;
        unit.device.is_mute = false;
        if !has_storage {
            unit.device = Device::whole();
        }
    }
    life.run(BOUND_MS, |_| ());
    life.check(true);
    life.run(2 * RETRY_MS, |life| life.check(false));
    life.check(true);
    // Reads that are too long have no answer from now on. All are short enough, but some unions are not.
    for unit in &mut life.units {
        unit.device.is_mute = has_storage;
    }
    life.run(BOUND_MS, |_| ());
    for (at, field) in life.world.fields.iter().enumerate() {
        let age = life.world.read_of(at).age(life.world.now);
        assert!(
            !life.is_there(field) || age <= RETRY_MS,
            "{field:?} is {age} ms old"
        );
    }
    // The devices have all registers again, so all fields are read again.
    for unit in &mut life.units {
        unit.device = Device::whole();
    }
    life.run(BOUND_MS, |_| ());
    life.check(true);
}
