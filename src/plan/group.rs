//! Grouping fields into reads: the fewest reads, and of these the fewest bits and registers.

use super::field::Field;
use super::limits::{ExcludedRange, Limits};
use super::read::{Position, Read, NO_SLOT};
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
pub const MAX_FIELDS: usize = 32_767;

/// The cost of one read. It is more than that of all bits or registers of a table, which cost
/// 1 each, and so many as [`MAX_FIELDS`] stay below 2^32.
const READ: u32 = 1 << 17;

/// Groups `fields` into `reads`, with their data in `words` words. Fields are in one read only
/// if they have the same unit, table and interval. Returns the number of reads.
///
/// Of every way to cover all fields within the limits, the result has the fewest reads, and
/// among those with so few the fewest bits and registers. The time that it takes grows with the
/// square of the number of fields.
///
/// # Errors
/// As [`Limits::check`], and [`Status::FIELDS_OVERLAP`] for two fields of one unit and table
/// that share an address, with the greater index; [`Status::BUFFER_TOO_SMALL`] if `positions`,
/// `reads` or `words` do not suffice, with the first field that does not fit.
/// [`Status::INVALID_ARGUMENT`] for no fields, for more than [`MAX_FIELDS`], and for an
/// excluded range whose last address is less than its first.
pub fn group(
    fields: &[Field],
    limits: &Limits,
    positions: &mut [Position],
    reads: &mut [Read],
    words: u16,
) -> Result<usize, Refusal> {
    let refused = |status, field: usize| Err(Refusal { status, field });
    let is_reversed = |range: &ExcludedRange| range.last < range.first;
    if fields.is_empty() || fields.len() > MAX_FIELDS || limits.excluded.iter().any(is_reversed) {
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
        let status = table.insert(index);
        if status != Status::OK {
            return refused(status, index);
        }
    }
    table.find_best();
    table.cut(reads, words)
}

/// The fields, sorted by unit, table, interval and address.
struct Table<'a> {
    fields: &'a [Field],
    positions: &'a mut [Position],
    limits: &'a Limits<'a>,
}

/// True if `one` belongs before `other` in the sorted table.
fn is_before(one: &Field, other: &Field) -> bool {
    if one.unit != other.unit {
        one.unit < other.unit
    } else if one.table != other.table {
        one.table < other.table
    } else if one.interval_ms != other.interval_ms {
        one.interval_ms < other.interval_ms
    } else {
        one.address < other.address
    }
}

impl<'a> Table<'a> {
    /// The field at a place of the sorted table; [`Field::NONE`] past the end.
    #[cfg_attr(target_os = "none", inline(never))]
    fn field(&self, place: usize) -> &'a Field {
        let position = self.positions.get(place);
        let field = position.and_then(|position| self.fields.get(position.field()));
        field.unwrap_or(&Field::NONE)
    }

    /// Checks a field, and puts it at its place among those with a lower index.
    #[cfg_attr(target_os = "none", inline(never))]
    fn insert(&mut self, index: usize) -> Status {
        let field = self.fields.get(index).unwrap_or(&Field::NONE);
        let status = self.limits.check(field);
        if status != Status::OK {
            return status;
        }
        let mut to = index;
        for place in (0..index).rev() {
            let other = self.field(place);
            if field.overlaps(other) {
                return Status::FIELDS_OVERLAP;
            }
            if is_before(field, other) {
                // All that are to be after it move up by one.
                to = place;
            }
        }
        let mut moved = index as u16;
        for position in self.positions.iter_mut().take(index + 1).skip(to) {
            core::mem::swap(&mut position.field, &mut moved);
        }
        Status::OK
    }

    /// Finds for each place, from the last to the first, the best read that begins there: the
    /// reads after it are known by then.
    #[cfg_attr(target_os = "none", inline(never))]
    fn find_best(&mut self) {
        let limits = self.limits;
        for start in (0..self.positions.len()).rev() {
            let first = self.field(start);
            let longest = limits.longest_read(first);
            let mut best = u32::MAX;
            let mut best_last = start;
            let mut last = start;
            let mut field = first;
            loop {
                let end = field.end();
                let length = end.wrapping_sub(first.address.into());
                if length > longest {
                    break;
                }
                let next = self.field(last + 1);
                let is_joined = first.unit == next.unit
                    && first.table == next.table
                    && first.interval_ms == next.interval_ms;
                let mut cost = READ + length;
                if let (true, Some(position)) = (is_joined, self.positions.get(last + 1)) {
                    cost = cost.wrapping_add(position.cost_or_read);
                }
                // Of two ways that cost the same, the later one has the longer first read.
                if cost <= best {
                    (best, best_last) = (cost, last);
                }
                let address = next.address.into();
                if !is_joined
                    || limits.widest_gap(first) < u32::wrapping_sub(address, end)
                    || limits.excludes(next, end, address)
                {
                    break;
                }
                field = next;
                last += 1;
            }
            if let Some(position) = self.positions.get_mut(start) {
                position.cost_or_read = best;
                position.last = best_last as u16;
            }
        }
    }

    /// Makes the reads that [`Table::find_best`] found.
    #[cfg_attr(target_os = "none", inline(never))]
    fn cut(&mut self, reads: &mut [Read], words: u16) -> Result<usize, Refusal> {
        let (mut start, mut count, mut offset) = (0, 0, 0u16);
        while let Some(&Position { field, last, .. }) = self.positions.get(start) {
            let too_small = Err(Refusal {
                status: Status::BUFFER_TOO_SMALL,
                field: field.into(),
            });
            let Some(read) = reads.get_mut(count) else {
                return too_small;
            };
            let first = self.field(start);
            let end = self.field(last.into()).end();
            // Field by field: firmware has no other use for memcpy.
            read.due = 0;
            read.not_before = 0;
            read.read_at = 0;
            read.interval_ms = first.interval_ms;
            read.first = start as u16;
            read.last = last;
            read.address = first.address;
            read.quantity = end.wrapping_sub(first.address.into()) as u16;
            read.offset = offset;
            read.unit = first.unit;
            read.table = first.table;
            read.status = Status::PENDING.code();
            read.slot = NO_SLOT;
            read.failures = 0;
            read.flags = 0;
            if read.words() > words.wrapping_sub(offset) {
                return too_small;
            }
            offset = offset.wrapping_add(read.words());
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
