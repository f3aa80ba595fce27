//! Reads that a device refuses are cut until the fields that it lacks are found: random plans with
//! devices that have holes and limits, lose replies, and gain what they lacked.

#[path = "common/divided.rs"]
mod divided;
#[path = "common/plan.rs"]
mod plan;

use divided::{Device, World, RETRY_MS};
use mbm::error::Status;
use mbm::plan::field::{BIT, UINT16, UINT32, UINT64};
use mbm::plan::field::{COILS, DISCRETE_INPUTS, HOLDING_REGISTERS, INPUT_REGISTERS};
use mbm::plan::{Field, Limits};
use plan::LIMITS;
use proptest::prelude::*;

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
    (0..30u16, 0..100u16).prop_map(|(of_registers, of_bits)| gaps(of_registers, of_bits))
}

fn gaps(register_gap: u16, bit_gap: u16) -> Limits<'static> {
    Limits {
        register_gap,
        bit_gap,
        ..LIMITS
    }
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

/// A device that lacks these.
fn lacking<const N: usize>(holes: [(u8, u16); N]) -> Device {
    Device {
        holes: holes.into(),
        ..Device::whole()
    }
}

/// A device that has all, and refuses reads of more.
fn refusing_more_than(most: u16) -> Device {
    Device {
        most,
        ..Device::default()
    }
}

fn is_found(world: &World, device: &Device) {
    for (index, field) in world.fields.iter().enumerate() {
        let wanted = device.status_of(field);
        assert_eq!(world.status(index), wanted, "{field:?}");
        if wanted == Status::OK {
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
        let mut world = World::new(fields, &limits, usize::MAX, SPARE);
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
        let mut world = World::new(fields, &limits, usize::MAX, SPARE);
        let first = world.count;
        world.run(&device, 20_000);
        let whole = Device::whole();
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
        let mut world = World::new(fields, &limits, usize::MAX, spare);
        let whole = Device::whole();
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
    let mut world = World::new(registers(0..100), &LIMITS, usize::MAX, 0);
    let device = lacking([(HOLDING_REGISTERS, 37)]);
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
        let limits = gaps(1, 0);
        let fields = registers((0..count).filter(|address| *address != hole));
        let mut world = World::new(fields, &limits, usize::MAX, SPARE);
        let device = lacking([(HOLDING_REGISTERS, hole)]);
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
fn each_of_600_coils_is_read_although_the_device_ignores_reads_of_more_than_400() {
    let mut fields = registers((0..600).filter(|address| *address != 300));
    for field in &mut fields {
        field.table = COILS;
        field.value_type = BIT;
    }
    let limits = gaps(0, 1);
    let mut world = World::new(fields, &limits, usize::MAX, SPARE);
    let lacking = lacking([(COILS, 300)]);
    world.run(&lacking, 900);
    is_found(&world, &lacking);
    // Later it answers reads of each side, and nothing if both are read at once.
    let silent = Device {
        most: 400,
        is_mute: true,
        ..Device::default()
    };
    world.run(&silent, 200_000);
    is_found(&world, &silent);
}

#[test]
fn a_device_that_refuses_long_reads_is_read_in_parts_after_one_union_was_tried() {
    let mut world = World::new(registers(0..120), &LIMITS, usize::MAX, 0);
    let device = refusing_more_than(80);
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
    let mut world = World::new(registers(0..120), &LIMITS, usize::MAX, 0);
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
fn a_device_that_is_silent_on_long_reads_is_read_in_short_ones_all_the_time() {
    let mut world = World::new(registers(0..120), &LIMITS, usize::MAX, 0);
    let refuses = refusing_more_than(35);
    // All parts are found. Longer ones are tried after that.
    while world.count < 4 {
        world.step(&refuses, false);
    }
    let device = Device {
        is_mute: true,
        ..refuses
    };
    let start = world.now;
    while world.now.wrapping_sub(start) < 100_000 {
        world.step(&device, false);
        for field in 0..120 {
            // The unit is left alone for some seconds after unions without an answer.
            let age = world.read_of(field).age(world.now);
            assert!(world.now.wrapping_sub(start) < 20_000 || age < 15_000);
        }
    }
}

#[test]
fn what_was_read_before_stays_while_a_device_is_searched() {
    let mut world = World::new(registers(0..20), &LIMITS, usize::MAX, 0);
    let whole = refusing_more_than(2000);
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
    let limits = gaps(2, 0);
    let mut world = World::new(fields, &limits, usize::MAX, 0);
    let device = lacking([(COILS, 21), (HOLDING_REGISTERS, 70)]);
    // The coil is found before the first read of the registers is refused.
    world.run(&device, 900);
    is_found(&world, &device);
    assert_eq!(needless_cuts(&world, &device), 0);
}
