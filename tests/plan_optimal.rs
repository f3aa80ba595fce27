//! The grouping of a plan's fields is optimal: held against every way to group a small table.

#[path = "common/plan.rs"]
mod plan;

use mbm::plan::field::{
    BIT, COILS, DOUBLE, HOLDING_REGISTERS, INPUT_REGISTERS, TEXT, UINT16, UINT32,
};
use mbm::plan::{ExcludedRange, Field, Limits, UnitLimits};
use plan::grouped;
use proptest::prelude::*;
use std::ops::Range;

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
