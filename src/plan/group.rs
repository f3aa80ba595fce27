//! Grouping fields into reads: the fewest reads, and of these the fewest bits and registers.

use super::field::Field;
use super::limits::{ExcludedRange, ReadLimits};
use super::read::{Position, Read};
use crate::error::Status;

/// Why a table is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// What is wrong.
    pub status: Status,
    /// The index of the field that it is wrong with; `usize::MAX` if no field is at fault.
    pub field: usize,
}

/// The most fields of one plan.
pub const MAX_FIELDS: usize = 16_383;

/// The cost of one read. It is more than that of all bits or registers of a table, which cost
/// 1 each, and [`MAX_FIELDS`] of the longest reads stay below 2^32.
const READ: u32 = 1 << 17;

/// Groups `fields` into `reads`, with their data in `words` words. Fields are in one read only
/// if they have the same unit, table and interval. Returns the number of reads.
///
/// Of every way to cover all fields within the limits, the result has the fewest reads, and
/// among those with so few the fewest bits and registers. The time that it takes grows with the
/// square of the number of fields.
///
/// # Errors
/// As [`ReadLimits::check`], and [`Status::FIELDS_OVERLAP`] for two fields of one unit and table
/// that share an address, with the greater index; [`Status::BUFFER_TOO_SMALL`] if `positions`,
/// `reads` or `words` do not suffice, with the first field that does not fit.
/// [`Status::INVALID_ARGUMENT`] for no fields, for more than [`MAX_FIELDS`], and for an
/// excluded range whose last address is less than its first.
pub fn group<L: ReadLimits>(
    fields: &[Field],
    limits: &L,
    positions: &mut [Position],
    reads: &mut [Read],
    words: u16,
) -> Result<usize, Refusal> {
    let refused = |status, field: usize| Err(Refusal { status, field });
    let is_reversed = |range: &ExcludedRange| range.last < range.first;
    if fields.is_empty() || fields.len() > MAX_FIELDS || limits.excluded().iter().any(is_reversed) {
        return refused(Status::INVALID_ARGUMENT, usize::MAX);
    }
    let Some(positions) = positions.get_mut(..fields.len()) else {
        return refused(Status::BUFFER_TOO_SMALL, positions.len());
    };
    let mut table = Table {
        fields,
        positions,
        limits,
    };
    for index in 0..fields.len() {
        let status = table.sort_in(index);
        if status != Status::OK {
            return refused(status, index);
        }
    }
    table.find_best();
    table.cut(reads, words).map_err(|position| Refusal {
        status: Status::BUFFER_TOO_SMALL,
        field: table.positions.get(position).map_or(0, Position::field),
    })
}

/// The fields, sorted by interval, unit, table and address.
struct Table<'a, L> {
    fields: &'a [Field],
    positions: &'a mut [Position],
    limits: &'a L,
}

impl<'a, L: ReadLimits> Table<'a, L> {
    /// The field at a position of the sorted table; [`Field::NONE`] past the end.
    fn field(&self, position: usize) -> &'a Field {
        let position = self.positions.get(position);
        let field = position.and_then(|position| self.fields.get(position.field()));
        field.unwrap_or(&Field::NONE)
    }

    /// Checks a field, and writes its index to the position that it has in the sorted table:
    /// that is the number of fields that are before it.
    #[cfg_attr(target_os = "none", inline(never))]
    fn sort_in(&mut self, index: usize) -> Status {
        let field = self.fields.get(index).unwrap_or(&Field::NONE);
        let status = self.limits.check(field);
        if status != Status::OK {
            return status;
        }
        let (place, end) = (field.place(), field.end_place());
        let mut before = 0;
        for (other_index, other) in self.fields.iter().enumerate() {
            let other_place = other.place();
            if other_index < index && place < other.end_place() && other_place < end {
                return Status::FIELDS_OVERLAP;
            }
            if (other.interval_ms, other_place) < (field.interval_ms, place) {
                before += 1;
            }
        }
        if let Some(position) = self.positions.get_mut(before) {
            position.field = index as u16;
        }
        Status::OK
    }

    /// Finds for each position, from the last to the first, the best read that begins there: the
    /// reads after it are known by then.
    fn find_best(&mut self) {
        let limits = self.limits;
        for start in (0..self.positions.len()).rev() {
            let first = self.field(start);
            let place = first.place();
            let longest = limits.longest_read(first);
            let widest = limits.widest_gap(first);
            let mut best = u32::MAX;
            let mut best_last = start;
            let mut last = start;
            let mut field = first;
            loop {
                let end = field.end_place();
                let length = end.wrapping_sub(place);
                if length > longest {
                    break;
                }
                let next = last + 1;
                let after = self.positions.get(next).map_or(0, |next| next.cost_or_read);
                let cost = (READ + length).wrapping_add(after);
                // Of two ways that cost the same, the later one has the longer first read.
                if cost <= best {
                    (best, best_last) = (cost, last);
                }
                field = self.field(next);
                let next_place = field.place();
                // A field of another table is further away than any gap.
                if field.interval_ms != first.interval_ms
                    || next_place.wrapping_sub(end) > widest
                    || limits.excludes(end, next_place)
                {
                    break;
                }
                last = next;
            }
            if let Some(position) = self.positions.get_mut(start) {
                position.cost_or_read = best;
                position.last = best_last as u16;
            }
        }
    }

    /// Makes the reads that [`Table::find_best`] found. Returns how many.
    ///
    /// # Errors
    /// The position of the first field for which the storage does not suffice.
    fn cut(&mut self, reads: &mut [Read], words: u16) -> Result<usize, usize> {
        let (mut start, mut count, mut offset) = (0, 0, 0u16);
        while let Some(&Position { last, .. }) = self.positions.get(start) {
            let Some(read) = reads.get_mut(count) else {
                return Err(start);
            };
            let first = self.field(start);
            let end = self.field(last.into()).end_place();
            // Field by field: firmware has no other use for memcpy.
            read.not_before.set(0);
            read.read_at.set(0);
            read.interval_ms = first.interval_ms;
            read.first = start as u16;
            read.last = last;
            read.address = first.address;
            read.quantity = end.wrapping_sub(first.place()) as u16;
            read.offset = offset;
            read.unit = first.unit as u8;
            read.table = first.table;
            read.status.set(Status::PENDING.code());
            read.doublings.set(0);
            read.flags.set(0);
            let own = read.words();
            if own > words.wrapping_sub(offset) {
                return Err(start);
            }
            offset = offset.wrapping_add(own);
            while start <= last.into() {
                let field = self.positions.get(start).map_or(0, Position::field);
                if let Some(own) = self.positions.get_mut(field) {
                    own.cost_or_read = count as u32;
                }
                start += 1;
            }
            count += 1;
        }
        Ok(count)
    }
}
