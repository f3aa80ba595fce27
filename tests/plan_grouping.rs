//! The grouping of a plan's fields: held against every way to group a small table, and by
//! tables whose reads are known.

use mbm::error::Status;
use mbm::plan::field::{
    BIT, COILS, DISCRETE_INPUTS, DOUBLE, FLOAT, HOLDING_REGISTERS, INPUT_REGISTERS, TEXT, UINT16,
    UINT32,
};
use mbm::plan::group::{group, Refusal, MAX_FIELDS};
use mbm::plan::{ExcludedRange, Field, Limits, Position, Read, UnitLimits};
use proptest::prelude::*;

const LIMITS: Limits = Limits {
    bits: 0,
    registers: 0,
    bit_gap: 0,
    register_gap: 0,
    units: &[],
    excluded: &[],
};

fn field(address: u16) -> Field {
    Field {
        unit: 1,
        table: HOLDING_REGISTERS,
        value_type: UINT16,
        address,
        count: 1,
        interval_ms: 1000,
        ..Field::NONE
    }
}

/// Groups with as much storage as any table needs.
fn grouped(fields: &[Field], limits: &Limits) -> Result<Vec<Read>, Refusal> {
    let mut positions = vec![Position::NONE; fields.len()];
    let mut reads = vec![Read::NONE; fields.len()];
    let count = group(fields, limits, &mut positions, &mut reads, u16::MAX)?;
    reads.truncate(count);
    check_positions(fields, &positions, &reads);
    Ok(reads)
}

/// Every field is in one read, all of it, and no read has anything else's fields.
fn check_positions(fields: &[Field], positions: &[Position], reads: &[Read]) {
    let mut seen = vec![false; fields.len()];
    for (index, read) in reads.iter().enumerate() {
        for position in read.positions() {
            let own = positions[position].field();
            let field = &fields[own];
            assert!(
                !std::mem::replace(&mut seen[own], true),
                "field {own} twice"
            );
            assert_eq!(positions[own].read(), index);
            assert_eq!((read.unit, read.table), (field.unit, field.table));
            assert_eq!(read.interval_ms, field.interval_ms);
            assert!(read.address <= field.address);
            let end = u32::from(read.address) + u32::from(read.quantity);
            assert!(field.end() <= end);
        }
    }
    assert!(seen.into_iter().all(|seen| seen), "a field is in no read");
}

fn plain(reads: &[Read]) -> Vec<(u16, u16)> {
    reads
        .iter()
        .map(|read| (read.address, read.quantity))
        .collect()
}

#[test]
fn neighbours_are_one_read() {
    let fields = [field(12), field(10), field(11)];
    let reads = grouped(&fields, &LIMITS).expect("a plan");
    assert_eq!(plain(&reads), [(10, 3)]);
}

#[test]
fn a_gap_is_covered_up_to_its_limit() {
    let fields = [field(10), field(14)];
    let limits = |register_gap| Limits {
        register_gap,
        ..LIMITS
    };
    let reads = grouped(&fields, &limits(2)).expect("a plan");
    assert_eq!(plain(&reads), [(10, 1), (14, 1)]);
    let reads = grouped(&fields, &limits(3)).expect("a plan");
    assert_eq!(plain(&reads), [(10, 5)]);
}

#[test]
fn a_gap_of_bits_has_its_own_limit() {
    let bit = |address| Field {
        table: COILS,
        value_type: BIT,
        ..field(address)
    };
    let limits = Limits {
        register_gap: 100,
        bit_gap: 16,
        ..LIMITS
    };
    let reads = grouped(&[bit(0), bit(17), bit(35)], &limits).expect("a plan");
    assert_eq!(plain(&reads), [(0, 18), (35, 1)]);
}

#[test]
fn an_excluded_range_is_read_around() {
    let excluded = [ExcludedRange {
        first: 12,
        last: 12,
        unit: 0,
        table: HOLDING_REGISTERS,
    }];
    let limits = Limits {
        register_gap: 100,
        excluded: &excluded,
        ..LIMITS
    };
    let fields = [field(10), field(11), field(13), field(20)];
    let reads = grouped(&fields, &limits).expect("a plan");
    assert_eq!(plain(&reads), [(10, 2), (13, 8)]);
    // Those of another unit and another table are not meant.
    for (unit, table) in [(2, HOLDING_REGISTERS), (1, INPUT_REGISTERS)] {
        let excluded = [ExcludedRange {
            unit,
            table,
            ..excluded[0]
        }];
        let limits = Limits {
            excluded: &excluded,
            ..limits
        };
        let reads = grouped(&fields, &limits).expect("a plan");
        assert_eq!(plain(&reads), [(10, 11)]);
    }
}

#[test]
fn the_first_read_that_fits_is_not_always_the_best() {
    // Two reads of 10 at most: 0 to 9 and 10 to 12, or without the gap 0 to 3 and 9 to 12.
    let fields = [field(0), field(3), field(9), field(10), field(12)];
    let limits = Limits {
        registers: 10,
        register_gap: 100,
        ..LIMITS
    };
    let reads = grouped(&fields, &limits).expect("a plan");
    assert_eq!(plain(&reads), [(0, 4), (9, 4)]);
}

#[test]
fn a_unit_may_have_shorter_reads_than_the_others() {
    let units = [UnitLimits {
        bits: 0,
        registers: 2,
        unit: 2,
    }];
    let limits = Limits {
        units: &units,
        ..LIMITS
    };
    let of = |unit, address| Field {
        unit,
        ..field(address)
    };
    let fields = [of(2, 0), of(1, 0), of(2, 1), of(1, 1), of(2, 2), of(1, 2)];
    let reads = grouped(&fields, &limits).expect("a plan");
    assert_eq!(plain(&reads)[0], (0, 3));
    assert_eq!(reads.len(), 3);
    assert!(reads[1..].iter().all(|read| read.quantity <= 2));
}

#[test]
fn units_tables_and_intervals_have_reads_of_their_own() {
    let one = field(0);
    let fields = [
        one,
        Field {
            unit: 2,
            ..field(1)
        },
        Field {
            table: INPUT_REGISTERS,
            ..field(2)
        },
        Field {
            interval_ms: 5000,
            ..field(3)
        },
        field(4),
    ];
    let limits = Limits {
        register_gap: 100,
        ..LIMITS
    };
    let reads = grouped(&fields, &limits).expect("a plan");
    assert_eq!(reads.len(), 4);
    assert!(plain(&reads).contains(&(0, 5)));
}

#[test]
fn the_longest_reads_are_those_of_the_standard() {
    let registers: Vec<_> = (0..126).map(field).collect();
    let reads = grouped(&registers, &LIMITS).expect("a plan");
    assert_eq!(reads.len(), 2);
    let bits: Vec<_> = (0..2001)
        .map(|address| Field {
            table: DISCRETE_INPUTS,
            value_type: BIT,
            ..field(address)
        })
        .collect();
    assert_eq!(grouped(&bits[..2000], &LIMITS).expect("a plan").len(), 1);
    assert_eq!(grouped(&bits, &LIMITS).expect("a plan").len(), 2);
}

#[track_caller]
fn refused(status: Status, index: usize, fields: &[Field], limits: &Limits) {
    let refusal = grouped(fields, limits).expect_err("a refusal");
    assert_eq!((refusal.status, refusal.field), (status, index));
}

#[test]
fn a_wrong_field_is_refused_with_its_index() {
    let wrong = |change: fn(&mut Field)| {
        let mut field = field(100);
        change(&mut field);
        [super_field(0), super_field(50), field]
    };
    fn super_field(address: u16) -> Field {
        field(address)
    }
    let invalid: [fn(&mut Field); 11] = [
        |field| field.table = 0,
        |field| field.table = 5,
        |field| field.value_type = 0,
        |field| field.value_type = 11,
        |field| field.value_type = BIT,
        |field| field.table = COILS,
        |field| field.order = 5,
        |field| field.interval_ms = 0,
        |field| field.divisor = -1,
        |field| (field.value_type, field.divisor) = (FLOAT, 1),
        |field| (field.value_type, field.multiplier) = (TEXT, 2),
    ];
    for change in invalid {
        refused(Status::INVALID_ARGUMENT, 2, &wrong(change), &LIMITS);
    }
    let fields = wrong(|field| field.interval_ms = 86_400_001);
    refused(Status::INVALID_ARGUMENT, 2, &fields, &LIMITS);
    let fields = wrong(|field| field.unit = 0);
    refused(Status::BROADCAST_NOT_ALLOWED, 2, &fields, &LIMITS);
    let fields = wrong(|field| (field.address, field.value_type) = (65535, UINT32));
    refused(Status::ILLEGAL_DATA_ADDRESS, 2, &fields, &LIMITS);
    let fields = wrong(|field| (field.value_type, field.count) = (DOUBLE, 32));
    refused(Status::ILLEGAL_DATA_VALUE, 2, &fields, &LIMITS);
    let fields = wrong(|field| (field.value_type, field.count) = (TEXT, 251));
    refused(Status::ILLEGAL_DATA_VALUE, 2, &fields, &LIMITS);
}

#[test]
fn a_field_at_the_last_address_is_allowed() {
    let last = Field {
        value_type: FLOAT,
        ..field(65534)
    };
    assert_eq!(
        plain(&grouped(&[last], &LIMITS).expect("a plan")),
        [(65534, 2)]
    );
}

#[test]
fn fields_that_overlap_are_refused_with_the_greater_index() {
    let wide = Field {
        value_type: UINT32,
        ..field(9)
    };
    refused(
        Status::FIELDS_OVERLAP,
        1,
        &[field(10), wide, field(20)],
        &LIMITS,
    );
    refused(
        Status::FIELDS_OVERLAP,
        2,
        &[wide, field(20), field(10)],
        &LIMITS,
    );
    // Other intervals do not change that, another unit does.
    let slow = Field {
        interval_ms: 1,
        ..field(10)
    };
    refused(Status::FIELDS_OVERLAP, 1, &[wide, slow], &LIMITS);
    let other = Field {
        unit: 2,
        ..field(10)
    };
    assert_eq!(grouped(&[wide, other], &LIMITS).expect("a plan").len(), 2);
}

#[test]
fn a_field_in_an_excluded_range_is_refused() {
    let excluded = [ExcludedRange {
        first: 0,
        last: 10,
        unit: 1,
        table: HOLDING_REGISTERS,
    }];
    let limits = Limits {
        excluded: &excluded,
        ..LIMITS
    };
    refused(
        Status::ILLEGAL_DATA_ADDRESS,
        1,
        &[field(11), field(10)],
        &limits,
    );
}

#[test]
fn an_excluded_range_that_is_reversed_is_refused() {
    let excluded = [ExcludedRange {
        first: 11,
        last: 10,
        unit: 1,
        table: HOLDING_REGISTERS,
    }];
    let limits = Limits {
        excluded: &excluded,
        ..LIMITS
    };
    let fields = [field(0), field(20)];
    refused(Status::INVALID_ARGUMENT, usize::MAX, &fields, &limits);
}

#[test]
fn a_field_longer_than_the_reads_of_its_unit_is_refused() {
    let units = [UnitLimits {
        bits: 0,
        registers: 1,
        unit: 1,
    }];
    let limits = Limits {
        units: &units,
        ..LIMITS
    };
    let wide = Field {
        value_type: UINT32,
        ..field(0)
    };
    refused(Status::ILLEGAL_DATA_VALUE, 1, &[field(5), wide], &limits);
}

#[test]
fn storage_that_does_not_suffice_is_refused_with_the_first_field_left_over() {
    let fields = [field(20), field(0), field(10)];
    let run = |positions: usize, reads: usize, words| {
        let mut positions = vec![Position::NONE; positions];
        let mut reads = vec![Read::NONE; reads];
        group(&fields, &LIMITS, &mut positions, &mut reads, words)
    };
    let small = |field| {
        Err(Refusal {
            status: Status::BUFFER_TOO_SMALL,
            field,
        })
    };
    assert_eq!(run(2, 3, 3), small(2));
    assert_eq!(run(3, 2, 3), small(0));
    assert_eq!(run(3, 3, 1), small(2));
    assert_eq!(run(3, 3, 2), small(0));
    assert_eq!(run(3, 3, 3), Ok(3));
}

#[test]
fn no_field_and_too_many_fields_are_refused() {
    refused(Status::INVALID_ARGUMENT, usize::MAX, &[], &LIMITS);
    let fields = vec![field(0); MAX_FIELDS + 1];
    refused(Status::INVALID_ARGUMENT, usize::MAX, &fields, &LIMITS);
}

#[test]
fn a_thousand_fields_in_reverse_are_grouped() {
    let fields: Vec<_> = (0..1000).rev().map(|place| field(place * 7)).collect();
    let limits = Limits {
        register_gap: 6,
        ..LIMITS
    };
    // 18 fields are 120 registers, 19 would be 127.
    assert_eq!(grouped(&fields, &limits).expect("a plan").len(), 56);
}

/// The least number of reads and registers, of every way to cut the sorted fields of a group.
fn exhaustive(fields: &[Field], limits: &Limits) -> (usize, u32) {
    let mut groups: Vec<(u8, u8, u32)> = fields
        .iter()
        .map(|field| (field.unit, field.table, field.interval_ms))
        .collect();
    groups.sort_unstable();
    groups.dedup();
    let mut total = (0, 0);
    for (unit, table, interval) in groups {
        let mut own: Vec<&Field> = fields
            .iter()
            .filter(|field| (field.unit, field.table, field.interval_ms) == (unit, table, interval))
            .collect();
        own.sort_by_key(|field| field.address);
        let mut best = (usize::MAX, u32::MAX);
        for cuts in 0..1u32 << (own.len() - 1) {
            let mut cost = (0, 0);
            let mut start = 0;
            let mut allowed = true;
            for place in 0..own.len() {
                if place + 1 < own.len() && cuts & 1 << place == 0 {
                    continue;
                }
                allowed &= is_allowed(&own[start..=place], limits);
                cost.0 += 1;
                cost.1 += own[place].end() - u32::from(own[start].address);
                start = place + 1;
            }
            if allowed && cost < best {
                best = cost;
            }
        }
        total.0 += best.0;
        total.1 += best.1;
    }
    total
}

/// Whether one read may hold these, by the words of the limits alone.
fn is_allowed(fields: &[&Field], limits: &Limits) -> bool {
    let (first, last) = (fields[0], fields[fields.len() - 1]);
    let own = limits.units.iter().find(|own| own.unit == first.unit);
    let bits = first.table <= 2;
    let (mut most, gap) = if bits {
        (u32::from(limits.bits), u32::from(limits.bit_gap))
    } else {
        (u32::from(limits.registers), u32::from(limits.register_gap))
    };
    if let Some(own) = own {
        let own = if bits { own.bits } else { own.registers.into() };
        if own > 0 {
            most = own.into();
        }
    }
    let standard = if bits { 2000 } else { 125 };
    if most == 0 || most > standard {
        most = standard;
    }
    let touched = u32::from(first.address)..last.end();
    let excluded = limits.excluded.iter().any(|range| {
        (range.unit == 0 || range.unit == first.unit)
            && range.table == first.table
            && (range.first..=range.last).any(|address| touched.contains(&address.into()))
    });
    let gaps = fields
        .windows(2)
        .all(|pair| u32::from(pair[1].address) - pair[0].end() <= gap);
    touched.end - touched.start <= most && gaps && !excluded
}

prop_compose! {
    /// A field of two units, three tables and two intervals, next to others.
    fn fields_near()(
        unit in 1u8..=2,
        table in prop_oneof![1 => Just(COILS), 3 => Just(HOLDING_REGISTERS), 1 => Just(INPUT_REGISTERS)],
        value_type in prop_oneof![Just(UINT16), Just(UINT32), Just(DOUBLE), Just(TEXT)],
        address in 0u16..60,
        count in 0u16..4,
        slow in any::<bool>(),
    ) -> Field {
        let value_type = if table == COILS { BIT } else { value_type };
        let interval_ms = if slow { 60_000 } else { 1000 };
        Field { unit, table, value_type, address, count, interval_ms, ..Field::NONE }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn no_other_way_to_group_is_better(
        fields in prop::collection::vec(fields_near(), 1..12),
        (bits, registers) in (0u16..40, 0u8..30),
        (bit_gap, register_gap) in (0u16..20, 0u8..12),
        own in prop::option::of((1u8..=2, 0u16..30, 0u8..20)),
        range in prop::option::of((0u8..=2, 1u8..=4, 0u16..60, 0u16..4)),
    ) {
        let units: Vec<_> = own
            .map(|(unit, bits, registers)| UnitLimits { bits, registers, unit })
            .into_iter()
            .collect();
        let excluded: Vec<_> = range
            .map(|(unit, table, first, more)| ExcludedRange { first, last: first + more, unit, table })
            .into_iter()
            .collect();
        let limits = Limits { bits, registers, bit_gap, register_gap, units: &units, excluded: &excluded };
        // Only what the plan accepts, one field after the other.
        let mut accepted: Vec<Field> = Vec::new();
        for field in fields {
            accepted.push(field);
            let alone = is_allowed(&[&field], &limits);
            match grouped(&accepted, &limits) {
                Ok(_) => prop_assert!(alone),
                Err(refusal) => {
                    prop_assert_eq!(refusal.field, accepted.len() - 1);
                    prop_assert!(!alone || refusal.status == Status::FIELDS_OVERLAP);
                    accepted.pop();
                }
            }
        }
        if !accepted.is_empty() {
            let reads = grouped(&accepted, &limits).expect("a plan");
            let quantity = reads.iter().map(|read| u32::from(read.quantity)).sum::<u32>();
            prop_assert_eq!((reads.len(), quantity), exhaustive(&accepted, &limits));
        }
    }
}
