//! Shared by the tests of a plan's grouping: a field, and a table grouped with its result checked.
#![allow(dead_code)] // Not every test uses everything.

use mbm::plan::field::{HOLDING_REGISTERS, UINT16};
use mbm::plan::group::{group, take_groups, Refusal};
use mbm::plan::{Field, Limits, Position, Read};

/// No limits but those of the standard, and no gaps.
pub const LIMITS: Limits = Limits {
    bits: 0,
    registers: 0,
    bit_gap: 0,
    register_gap: 0,
    units: &[],
    excluded: &[],
};

/// A field of one register.
pub fn field(address: u16) -> Field {
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
pub fn grouped(fields: &[Field], limits: &Limits) -> Result<Vec<Read>, Refusal> {
    let mut positions = vec![Position::NONE; fields.len()];
    let mut reads = vec![Read::default(); fields.len()];
    let count = group(fields, 0, limits, &mut positions, &mut reads, u16::MAX)?;
    reads.truncate(count);
    check_positions(fields, &positions, &reads);
    check_groups(fields, &positions, &reads);
    Ok(reads)
}

/// The same fields in the order of their reads, with the number of fields of each read, are the
/// same reads.
fn check_groups(fields: &[Field], positions: &[Position], reads: &[Read]) {
    let order = (0..reads.len()).flat_map(|read| Position::fields_of(positions, read));
    let sorted: Vec<Field> = order.map(|own| fields[own]).collect();
    let counts: Vec<u16> = (0..reads.len())
        .map(|read| Position::fields_of(positions, read).count() as u16)
        .collect();
    let mut taken_positions = vec![Position::NONE; fields.len()];
    let mut taken = vec![Read::default(); reads.len()];
    let (positions, words) = (&mut taken_positions[..], u16::MAX);
    let count = take_groups(&sorted, 0, &counts, positions, &mut taken, words);
    assert_eq!(count, Ok(reads.len()));
    assert_eq!(taken, reads);
    check_positions(&sorted, &taken_positions, &taken);
}

/// Every field lies completely in exactly one read, of its unit, table and interval.
fn check_positions(fields: &[Field], positions: &[Position], reads: &[Read]) {
    let mut seen = vec![false; fields.len()];
    for (index, read) in reads.iter().enumerate() {
        for own in Position::fields_of(positions, index) {
            let field = &fields[own];
            assert!(
                !std::mem::replace(&mut seen[own], true),
                "field {own} twice"
            );
            assert_eq!(positions[own].read(), index);
            assert_eq!((read.unit, read.table), (field.unit as u8, field.table));
            assert_eq!(read.interval_ms, field.interval_ms);
            assert!(read.address <= field.address);
            let end = u32::from(read.address) + u32::from(read.quantity);
            assert!(field.end() <= end);
        }
    }
    assert!(seen.into_iter().all(|seen| seen), "a field is in no read");
}

/// Address and quantity of each read.
pub fn plain(reads: &[Read]) -> Vec<(u16, u16)> {
    reads
        .iter()
        .map(|read| (read.address, read.quantity))
        .collect()
}
