//! Tables that a plan refuses, each with its status and the index of the field.

#[path = "common/plan.rs"]
mod plan;

use mbm::error::Status;
use mbm::plan::field::{
    BIT, COILS, DOUBLE, FLOAT, HOLDING_REGISTERS, INPUT_REGISTERS, REGISTERS, TEXT, UINT32,
};
use mbm::plan::group::{group, take_groups, Refusal, MAX_FIELDS};
use mbm::plan::{ExcludedRange, Field, Limits, Position, Read, UnitLimits};
use plan::{field, grouped, plain, LIMITS};

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
        let mut reads = vec![Read::default(); reads];
        group(&fields, 0, &LIMITS, &mut positions, &mut reads, words)
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
fn too_many_grouped_fields_are_refused_as_too_many_fields_are() {
    let counts = [1; MAX_FIELDS + 1];
    let fields = vec![field(0); counts.len()];
    let take = |count| taken(&fields[..count], &counts[..count], count, u16::MAX);
    let too_many = Refusal {
        status: Status::INVALID_ARGUMENT,
        field: usize::MAX,
    };
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
        let refusal = wrong(change).expect_err("a refusal");
        assert_eq!(
            (refusal.status, refusal.field),
            (Status::INVALID_ARGUMENT, 2)
        );
    }
}

#[test]
fn a_field_longer_than_a_read_is_refused_in_groups_too() {
    let long = Field {
        value_type: DOUBLE,
        count: 32,
        ..field(0)
    };
    let refusal = taken(&[field(0), long], &[1, 1], 2, u16::MAX).expect_err("a refusal");
    assert_eq!(
        (refusal.status, refusal.field),
        (Status::INVALID_ARGUMENT, 1)
    );
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
        let refusal = taken(&fields, counts, counts.len(), u16::MAX).expect_err("a refusal");
        let none = (Status::INVALID_ARGUMENT, usize::MAX);
        assert_eq!((refusal.status, refusal.field), none, "{counts:?}");
    }
    assert!(taken(&[], &[], 0, u16::MAX).is_err());
}

#[test]
fn groups_without_storage_are_refused() {
    let fields = [field(0), field(1), field(20)];
    let small = |field| {
        Err(Refusal {
            status: Status::BUFFER_TOO_SMALL,
            field,
        })
    };
    assert_eq!(taken(&fields, &[2, 1], 1, 3), small(usize::MAX));
    assert_eq!(taken(&fields, &[2, 1], 2, 1), small(0));
    assert_eq!(taken(&fields, &[2, 1], 2, 2), small(2));
    assert_eq!(taken(&fields, &[2, 1], 2, 3), Ok(2));
}
