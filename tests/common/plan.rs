//! What the tests of a plan's grouping share: a field, and a table grouped with its result checked.
#![allow(dead_code)] // Not every test uses everything.

use mbm::plan::field::{HOLDING_REGISTERS, UINT16};
use mbm::plan::group::{group, Refusal};
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
    let count = group(fields, limits, &mut positions, &mut reads, u16::MAX)?;
    reads.truncate(count);
    check_positions(fields, &positions, &reads);
    Ok(reads)
}

/// Every field is in one read, all of it, and no read has anything else's fields.
fn check_positions(fields: &[Field], positions: &[Position], reads: &[Read]) {
    let mut seen = vec![false; fields.len()];
    for (index, read) in reads.iter().enumerate() {
        for own in read.fields(positions) {
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
