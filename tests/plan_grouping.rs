//! The grouping of a plan's fields, by tables whose reads are known.

#[path = "common/plan.rs"]
mod plan;

use mbm::plan::field::{
    BIT, COILS, DISCRETE_INPUTS, HOLDING_REGISTERS, INPUT_REGISTERS, TEXT, UINT32,
};
use mbm::plan::{ExcludedRange, Field, Limits, UnitLimits};
use plan::{field, grouped, plain, LIMITS};

#[test]
fn neighbours_are_one_read() {
    let fields = [field(12), field(10), field(11)];
    let reads = grouped(&fields, &LIMITS).expect("a plan");
    assert_eq!(plain(&reads), [(10, 3)]);
}

#[test]
fn fields_that_overlap_are_read_once() {
    let wide = |address| Field {
        value_type: UINT32,
        ..field(address)
    };
    // A value and its words, two names of one register, and two values that share a register.
    let fields = [field(11), wide(10), field(10), field(11), wide(11)];
    let reads = grouped(&fields, &LIMITS).expect("a plan");
    assert_eq!(plain(&reads), [(10, 3)]);
    // Another interval is another read.
    let slow = Field {
        interval_ms: 5000,
        ..field(10)
    };
    let reads = grouped(&[wide(10), slow], &LIMITS).expect("a plan");
    assert_eq!(plain(&reads), [(10, 2), (10, 1)]);
}

#[test]
fn fields_that_overlap_are_parted_if_one_read_cannot_hold_them() {
    let text = |address, count| Field {
        value_type: TEXT,
        count,
        ..field(address)
    };
    let fields = [text(0, 200), text(50, 200), field(120), field(60)];
    let reads = grouped(&fields, &LIMITS).expect("a plan");
    assert_eq!(plain(&reads), [(0, 100), (50, 100)]);
}

#[test]
fn many_fields_of_one_register_are_one_read() {
    let fields: Vec<_> = (0..16_000)
        .map(|number| Field {
            value_type: BIT,
            bit: (number % 16) as u8,
            ..field(7)
        })
        .collect();
    let reads = grouped(&fields, &LIMITS).expect("a plan");
    assert_eq!(plain(&reads), [(7, 1)]);
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
