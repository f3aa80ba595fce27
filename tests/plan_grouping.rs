//! The grouping of a plan's fields, by tables whose reads are known and against every other way,
//! and the tables that a plan refuses.

#[path = "common/plan.rs"]
mod plan;

use mbm::error::Status;
use mbm::plan::field::{
    BIT, COILS, DISCRETE_INPUTS, DOUBLE, FLOAT, HOLDING_REGISTERS, INPUT_REGISTERS, REGISTERS,
    TEXT, UINT16, UINT32,
};
use mbm::plan::group::{group, take_groups, Refusal, MAX_FIELDS};
use mbm::plan::{ExcludedRange, Field, Limits, Position, Read, UnitLimits};
use plan::{field, grouped, plain, LIMITS};
use proptest::prelude::*;
use std::ops::Range;

/// A field with a change.
fn with(mut field: Field, change: impl FnOnce(&mut Field)) -> Field {
    change(&mut field);
    field
}

/// The limits of the standard alone. A read may cross gaps of up to this number of registers.
fn gap(register_gap: u16) -> Limits<'static> {
    Limits {
        register_gap,
        ..LIMITS
    }
}

/// No limits but ranges that are not read.
fn around(excluded: &[ExcludedRange]) -> Limits<'_> {
    Limits { excluded, ..LIMITS }
}

/// Registers of a unit that are not read.
fn range(first: u16, last: u16, unit: u16) -> ExcludedRange {
    ExcludedRange {
        first,
        last,
        unit,
        table: HOLDING_REGISTERS,
    }
}

fn refusal(status: Status, field: usize) -> Refusal {
    Refusal { status, field }
}

fn too_small(field: usize) -> Result<usize, Refusal> {
    Err(refusal(Status::BUFFER_TOO_SMALL, field))
}

#[test]
fn neighbours_are_one_read() {
    let fields = [field(12), field(10), field(11)];
    let reads = grouped(&fields, &LIMITS).expect("a plan");
    assert_eq!(plain(&reads), [(10, 3)]);
}

#[test]
fn fields_that_overlap_are_read_once() {
    let wide = |address| with(field(address), |own| own.value_type = UINT32);
    // A value and its words, two names of one register, and two values that share a register.
    let fields = [field(11), wide(10), field(10), field(11), wide(11)];
    let reads = grouped(&fields, &LIMITS).expect("a plan");
    assert_eq!(plain(&reads), [(10, 3)]);
    // Another interval is another read.
    let slow = with(field(10), |own| own.interval_ms = 5000);
    let reads = grouped(&[wide(10), slow], &LIMITS).expect("a plan");
    assert_eq!(plain(&reads), [(10, 2), (10, 1)]);
}

#[test]
fn fields_that_overlap_are_parted_if_one_read_cannot_hold_them() {
    let text = |address, count| {
        with(field(address), |own| {
            (own.value_type, own.count) = (TEXT, count)
        })
    };
    let fields = [text(0, 200), text(50, 200), field(120), field(60)];
    let reads = grouped(&fields, &LIMITS).expect("a plan");
    assert_eq!(plain(&reads), [(0, 100), (50, 100)]);
}

#[test]
fn many_fields_of_one_register_are_one_read() {
    let fields: Vec<_> = (0..16_000)
        .map(|number| {
            with(field(7), |own| {
                (own.value_type, own.bit) = (BIT, (number % 16) as u8)
            })
        })
        .collect();
    let reads = grouped(&fields, &LIMITS).expect("a plan");
    assert_eq!(plain(&reads), [(7, 1)]);
}

#[test]
fn a_gap_is_covered_up_to_its_limit() {
    let fields = [field(10), field(14)];
    let reads = grouped(&fields, &gap(2)).expect("a plan");
    assert_eq!(plain(&reads), [(10, 1), (14, 1)]);
    let reads = grouped(&fields, &gap(3)).expect("a plan");
    assert_eq!(plain(&reads), [(10, 5)]);
}

#[test]
fn a_gap_of_bits_has_its_own_limit() {
    let bit = |address| {
        with(field(address), |own| {
            (own.table, own.value_type) = (COILS, BIT)
        })
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
    let excluded = [range(12, 12, 0)];
    let limits = Limits {
        register_gap: 100,
        ..around(&excluded)
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
    let of = |unit, address| with(field(address), |own| own.unit = unit);
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
        with(field(1), |own| own.unit = 2),
        with(field(2), |own| own.table = INPUT_REGISTERS),
        with(field(3), |own| own.interval_ms = 5000),
        field(4),
    ];
    let limits = gap(100);
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
        .map(|address| {
            with(field(address), |own| {
                (own.table, own.value_type) = (DISCRETE_INPUTS, BIT)
            })
        })
        .collect();
    assert_eq!(grouped(&bits[..2000], &LIMITS).expect("a plan").len(), 1);
    assert_eq!(grouped(&bits, &LIMITS).expect("a plan").len(), 2);
}

#[test]
fn a_thousand_fields_in_reverse_are_grouped() {
    let fields: Vec<_> = (0..1000).rev().map(|place| field(place * 7)).collect();
    let limits = gap(6);
    // 18 fields are 120 registers, 19 would be 127.
    assert_eq!(grouped(&fields, &limits).expect("a plan").len(), 56);
}

// --- tables that a plan refuses, each with its status and the index of the field ---

#[track_caller]
fn refused(status: Status, index: usize, fields: &[Field], limits: &Limits) {
    assert_eq!(grouped(fields, limits), Err(refusal(status, index)));
}

#[test]
fn a_wrong_field_is_refused_with_its_index() {
    let wrong = |change: fn(&mut Field)| {
        let mut field = field(100);
        change(&mut field);
        [self::field(0), self::field(50), field]
    };
    let invalid: [fn(&mut Field); 14] = [
        |field| field.table = 0,
        |field| field.table = 5,
        |field| field.value_type = 0,
        |field| field.value_type = 12,
        |field| field.table = COILS,
        |field| field.bit = 1,
        |field| (field.value_type, field.bit) = (BIT, 16),
        |field| (field.value_type, field.bit, field.count) = (BIT, 9, 8),
        |field| field.order = 5,
        |field| field.interval_ms = 0,
        |field| field.divisor = -1,
        |field| (field.value_type, field.multiplier) = (TEXT, 2),
        |field| (field.value_type, field.multiplier) = (REGISTERS, 2),
        |field| (field.value_type, field.divisor) = (REGISTERS, 10),
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
    let fields = wrong(|field| (field.value_type, field.count) = (REGISTERS, 126));
    refused(Status::ILLEGAL_DATA_VALUE, 2, &fields, &LIMITS);
}

#[test]
fn a_field_at_the_last_address_is_allowed() {
    let last = with(field(65534), |own| own.value_type = FLOAT);
    assert_eq!(
        plain(&grouped(&[last], &LIMITS).expect("a plan")),
        [(65534, 2)]
    );
}

#[test]
fn a_field_in_an_excluded_range_is_refused() {
    let excluded = [range(0, 10, 1)];
    let limits = around(&excluded);
    refused(
        Status::ILLEGAL_DATA_ADDRESS,
        1,
        &[field(11), field(10)],
        &limits,
    );
}

#[test]
fn an_excluded_range_that_is_reversed_is_refused() {
    let excluded = [range(11, 10, 1)];
    let limits = around(&excluded);
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
    let wide = with(field(0), |own| own.value_type = UINT32);
    refused(Status::ILLEGAL_DATA_VALUE, 1, &[field(5), wide], &limits);
}

#[test]
fn storage_that_does_not_suffice_is_refused_with_the_first_field_left_over() {
    let fields = [field(20), field(0), field(10)];
    let run = |positions: usize, reads: usize, words| {
        let mut positions = vec![Position::NONE; positions];
        let mut reads = vec![Read::default(); reads];
        group(&fields, 0, &LIMITS, &mut positions, &mut reads, words)
    };
    assert_eq!(run(2, 3, 3), too_small(2));
    assert_eq!(run(3, 2, 3), too_small(0));
    assert_eq!(run(3, 3, 1), too_small(2));
    assert_eq!(run(3, 3, 2), too_small(0));
    assert_eq!(run(3, 3, 3), Ok(3));
}

#[test]
fn no_field_and_too_many_fields_are_refused() {
    refused(Status::INVALID_ARGUMENT, usize::MAX, &[], &LIMITS);
    let fields = vec![field(0); MAX_FIELDS + 1];
    refused(Status::INVALID_ARGUMENT, usize::MAX, &fields, &LIMITS);
}

#[test]
fn too_many_grouped_fields_are_refused_as_too_many_fields_are() {
    let counts = [1; MAX_FIELDS + 1];
    let fields = vec![field(0); counts.len()];
    let take = |count| taken(&fields[..count], &counts[..count], count, u16::MAX);
    let too_many = refusal(Status::INVALID_ARGUMENT, usize::MAX);
    assert_eq!(take(MAX_FIELDS), Ok(MAX_FIELDS));
    assert_eq!(take(MAX_FIELDS + 1), Err(too_many));
}

/// Takes groups of fields, with the storage for `reads` reads and `words` words.
fn taken(fields: &[Field], counts: &[u16], reads: usize, words: u16) -> Result<usize, Refusal> {
    let mut positions = vec![Position::NONE; fields.len()];
    let mut reads = vec![Read::default(); reads];
    take_groups(fields, 0, counts, &mut positions, &mut reads, words)
}

#[test]
fn a_field_that_does_not_fit_into_its_read_is_refused_with_its_index() {
    let wrong = |change: fn(&mut Field)| {
        let mut last = field(101);
        change(&mut last);
        let fields = [field(0), field(100), last];
        taken(&fields, &[1, 2], 2, u16::MAX)
    };
    assert_eq!(wrong(|_| ()), Ok(2));
    assert_eq!(wrong(|field| field.address = 224), Ok(2));
    let changes: [fn(&mut Field); 7] = [
        |field| field.address = 225,
        |field| field.address = 99,
        |field| (field.address, field.value_type) = (99, DOUBLE),
        |field| (field.address, field.value_type) = (223, DOUBLE),
        |field| field.interval_ms = 999,
        |field| field.unit = 2,
        |field| field.table = INPUT_REGISTERS,
    ];
    for change in changes {
        assert_eq!(wrong(change), Err(refusal(Status::INVALID_ARGUMENT, 2)));
    }
}

#[test]
fn a_field_longer_than_a_read_is_refused_in_groups_too() {
    let long = with(field(0), |own| (own.value_type, own.count) = (DOUBLE, 32));
    let result = taken(&[field(0), long], &[1, 1], 2, u16::MAX);
    assert_eq!(result, Err(refusal(Status::INVALID_ARGUMENT, 1)));
}

#[test]
fn counts_that_do_not_add_up_to_the_fields_are_refused() {
    let fields = [field(0), field(1), field(2)];
    for counts in [
        &[1, 1][..],
        &[4],
        &[1, 0, 2],
        &[3, 1],
        &[0],
        &[u16::MAX, 4],
        &[],
    ] {
        let none = Err(refusal(Status::INVALID_ARGUMENT, usize::MAX));
        let result = taken(&fields, counts, counts.len(), u16::MAX);
        assert_eq!(result, none, "{counts:?}");
    }
    assert!(taken(&[], &[], 0, u16::MAX).is_err());
}

#[test]
fn groups_without_storage_are_refused() {
    let fields = [field(0), field(1), field(20)];
    assert_eq!(taken(&fields, &[2, 1], 1, 3), too_small(usize::MAX));
    assert_eq!(taken(&fields, &[2, 1], 2, 1), too_small(0));
    assert_eq!(taken(&fields, &[2, 1], 2, 2), too_small(2));
    assert_eq!(taken(&fields, &[2, 1], 2, 3), Ok(2));
}

// --- the grouping is optimal: held against every way to group a small table ---

/// The least number of reads and registers, of every way to part the fields into sets, each of
/// them one read.
fn exhaustive(fields: &[Field], limits: &Limits) -> (usize, u32) {
    let mut groups: Vec<(u16, u8, u32)> = fields
        .iter()
        .map(|field| (field.unit, field.table, field.interval_ms))
        .collect();
    groups.sort_unstable();
    groups.dedup();
    let mut total = (0, 0);
    for group in groups {
        let is_own = |field: &&Field| (field.unit, field.table, field.interval_ms) == group;
        let own: Vec<&Field> = fields.iter().filter(is_own).collect();
        let best = least(&own, &mut Vec::new(), limits);
        total.0 += best.0;
        total.1 += best.1;
    }
    total
}

/// The least that the sets cost, with the rest of the fields in any of them or in sets of their own.
fn least<'a>(rest: &[&'a Field], sets: &mut Vec<Vec<&'a Field>>, limits: &Limits) -> (usize, u32) {
    let Some((&field, rest)) = rest.split_first() else {
        if !sets.iter().all(|set| is_allowed(set, limits)) {
            return (usize::MAX, u32::MAX);
        }
        return (
            sets.len(),
            sets.iter().map(|set| span(set).len() as u32).sum(),
        );
    };
    let mut best = (usize::MAX, u32::MAX);
    for place in 0..sets.len() {
        sets[place].push(field);
        best = best.min(least(rest, sets, limits));
        sets[place].pop();
    }
    sets.push(vec![field]);
    best = best.min(least(rest, sets, limits));
    sets.pop();
    best
}

/// The addresses from the first to the last of some fields.
fn span(fields: &[&Field]) -> Range<u32> {
    let first = fields.iter().map(|field| field.address.into()).min();
    let end = fields.iter().map(|field| field.end()).max();
    first.expect("a field")..end.expect("a field")
}

/// Whether one read may hold these, by the words of the limits alone.
fn is_allowed(fields: &[&Field], limits: &Limits) -> bool {
    let first = fields[0];
    let own = limits.units.iter().find(|own| own.unit == first.unit);
    let bits = first.table <= 2;
    let (mut most, gap) = if bits {
        (u32::from(limits.bits), u32::from(limits.bit_gap))
    } else {
        (u32::from(limits.registers), u32::from(limits.register_gap))
    };
    if let Some(own) = own {
        let own = if bits { own.bits } else { own.registers };
        if own > 0 {
            most = own.into();
        }
    }
    let standard = if bits { 2000 } else { 125 };
    if most == 0 || most > standard {
        most = standard;
    }
    let touched = span(fields);
    let excluded = limits.excluded.iter().any(|range| {
        (range.unit == 0 || range.unit == first.unit)
            && range.table == first.table
            && (range.first..=range.last).any(|address| touched.contains(&address.into()))
    });
    let is_of_a_field = |address: &u32| {
        let mut spans = fields.iter().map(|field| span(&[field]));
        spans.any(|span| span.contains(address))
    };
    let mut passed = 0;
    let gaps = touched.clone().all(|address| {
        passed = if is_of_a_field(&address) {
            0
        } else {
            passed + 1
        };
        passed <= gap
    });
    touched.len() as u32 <= most && gaps && !excluded
}

prop_compose! {
    /// A field of two units, three tables and two intervals, next to others.
    fn fields_near()(
        unit in 1u16..=2,
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
        fields in prop::collection::vec(fields_near(), 1..10),
        (bits, registers) in (0u16..40, 0u16..30),
        (bit_gap, register_gap) in (0u16..20, 0u16..12),
        own in prop::option::of((1u16..=2, 0u16..30, 0u16..20)),
        range in prop::option::of((0u16..=2, 1u8..=4, 0u16..60, 0u16..4)),
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
        // Takes only fields that the plan accepts, one after the other.
        let mut accepted: Vec<Field> = Vec::new();
        for field in fields {
            accepted.push(field);
            let alone = is_allowed(&[&field], &limits);
            match grouped(&accepted, &limits) {
                Ok(_) => prop_assert!(alone),
                Err(refusal) => {
                    prop_assert_eq!(refusal.field, accepted.len() - 1);
                    prop_assert!(!alone);
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
