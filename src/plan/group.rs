//! Grouping fields into reads: the fewest reads, and of these the fewest bits and registers.

use super::field::Field;
use super::limits::{standard_limit, ExcludedRange, ReadLimits};
use super::read::{Position, Read};
use crate::error::Status;

/// Why a table is refused.
///
/// ```
/// use mbm::plan::{group::{group, Refusal}, Field, Limits, Position, Read};
/// use mbm::Status;
/// # let limits = Limits {
/// #     bits: 0, registers: 0, bit_gap: 0, register_gap: 0, units: &[], excluded: &[],
/// # };
///
/// // A field without a table.
/// let (mut positions, mut reads) = ([Position::NONE], [Read::default()]);
/// let grouped = group(&[Field::NONE], 0, &limits, &mut positions, &mut reads, 1);
/// assert_eq!(grouped, Err(Refusal { status: Status::INVALID_ARGUMENT, field: 0 }));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// What is wrong.
    pub status: Status,
    /// The index of the field at fault; `usize::MAX` if no field is at fault.
    pub field: usize,
}

/// The most fields of one plan.
pub const MAX_FIELDS: usize = 16_383;

/// Groups `fields` into `reads`, with their data in `words` words. Fields are in one read only
/// if they have the same unit, table and interval; they may overlap. `has_unit_0` is 1 in TCP frames,
/// in which unit 0 is a unit, and otherwise 0. Returns the number of reads.
///
/// The result covers all fields within the limits by the fewest reads, and among such results
/// by the fewest bits and registers. The time that it takes grows with n log n.
///
/// # Errors
/// As [`Field::check`](super::Field::check); [`Status::BUFFER_TOO_SMALL`] if `positions`, `reads` or
/// `words` do not suffice, with the first field that does not fit.
/// [`Status::INVALID_ARGUMENT`] for no fields, for more than [`MAX_FIELDS`], and for an
/// excluded range whose last address is less than its first.
///
/// ```
/// use mbm::plan::field::{HOLDING_REGISTERS, UINT16};
/// use mbm::plan::{group::group, Field, Limits, Position, Read};
///
/// let field = |address| Field {
///     unit: 17, table: HOLDING_REGISTERS, value_type: UINT16, address, interval_ms: 1000, ..Field::NONE
/// };
/// let limits = Limits {
///     bits: 0, registers: 0, bit_gap: 0, register_gap: 10, units: &[], excluded: &[],
/// };
/// let (mut positions, mut reads) = ([Position::NONE; 3], [Read::default(), Read::default()]);
/// let fields = [field(107), field(110), field(900)];
/// // The first two are near each other, so one read of four registers has both.
/// assert_eq!(group(&fields, 0, &limits, &mut positions, &mut reads, 5), Ok(2));
/// assert_eq!((reads[0].address, reads[0].quantity), (107, 4));
/// ```
pub fn group<L: ReadLimits>(
    fields: &[Field],
    has_unit_0: u8,
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
    for (index, field) in fields.iter().enumerate() {
        let status = limits.check(field, has_unit_0);
        if status != Status::OK {
            return refused(status, index);
        }
        table.put(index, index as u16);
    }
    table.sort();
    table.find_best();
    table.cut(reads, words).map_err(|position| Refusal {
        status: Status::BUFFER_TOO_SMALL,
        field: table.positions.get(position).map_or(0, Position::field),
    })
}

/// As [`group`], for fields that were grouped before: the fields of a read stand side by side in
/// `fields`, the one with the lowest address first, and `counts` says how many each read has.
/// Only the standard limits what a read requests. Returns the number of reads.
///
/// # Errors
/// Those of a field by itself and [`Status::BUFFER_TOO_SMALL`] as [`group`].
/// [`Status::INVALID_ARGUMENT`] also for a field that does not fit into its read: it differs from
/// the first one in unit, table or interval, has a lower address, or makes the read too long; without
/// a field at fault for more than [`MAX_FIELDS`], if a count is 0, or if the counts do not add up to
/// the fields.
/// [`Status::BUFFER_TOO_SMALL`] without a field at fault for fewer `reads` than counts.
///
/// ```
/// use mbm::plan::field::{HOLDING_REGISTERS, UINT16};
/// use mbm::plan::{group::take_groups, Field, Position, Read};
///
/// let field = |address| Field {
///     unit: 17, table: HOLDING_REGISTERS, value_type: UINT16, address, interval_ms: 1000, ..Field::NONE
/// };
/// let (mut positions, mut reads) = ([Position::NONE; 3], [Read::default(), Read::default()]);
/// let fields = [field(107), field(110), field(900)];
/// // Two fields in the first read, one in the second.
/// assert_eq!(take_groups(&fields, 0, &[2, 1], &mut positions, &mut reads, 5), Ok(2));
/// assert_eq!((reads[0].address, reads[0].quantity), (107, 4));
/// ```
pub fn take_groups(
    fields: &[Field],
    has_unit_0: u8,
    counts: &[u16],
    positions: &mut [Position],
    reads: &mut [Read],
    words: u16,
) -> Result<usize, Refusal> {
    let refused = |status, field: usize| Err(Refusal { status, field });
    if fields.len() > MAX_FIELDS {
        return refused(Status::INVALID_ARGUMENT, usize::MAX);
    }
    let Some(reads) = reads.get_mut(..counts.len()) else {
        return refused(Status::BUFFER_TOO_SMALL, usize::MAX);
    };
    let (mut start, mut offset) = (0usize, 0);
    for (index, (read, count)) in reads.iter_mut().zip(counts).enumerate() {
        let end = start.wrapping_add((*count).into());
        let (Some(own @ [first, ..]), Some(places)) =
            (fields.get(start..end), positions.get_mut(start..end))
        else {
            return refused(Status::INVALID_ARGUMENT, usize::MAX);
        };
        let mut quantity = 0;
        for (place, (field, position)) in (start..).zip(own.iter().zip(places)) {
            let status = field.check(has_unit_0);
            if status != Status::OK {
                return refused(status, place);
            }
            // Another unit or table, and a lower address, are further away than any read is long.
            let distance = field.place().wrapping_sub(first.place());
            let length = distance.wrapping_add(field.length());
            let longest = standard_limit(first).into();
            if field.interval_ms != first.interval_ms || distance > longest || length > longest {
                return refused(Status::INVALID_ARGUMENT, place);
            }
            quantity = quantity.max(length as u16);
            position.field = place as u16;
            position.sum_or_read = index as i32;
        }
        let Some(next) = read.set_up(first, quantity, offset, words) else {
            return refused(Status::BUFFER_TOO_SMALL, start);
        };
        // Every read has a field, so that this position is not after its first.
        if let Some(own) = positions.get_mut(index) {
            own.first_or_last = start as u16;
        }
        offset = next;
        start = end;
    }
    if start == 0 || start != fields.len() {
        return refused(Status::INVALID_ARGUMENT, usize::MAX);
    }
    Ok(counts.len())
}

/// The fields, sorted by interval, unit, table and address.
struct Table<'a, L> {
    fields: &'a [Field],
    positions: &'a mut [Position],
    limits: &'a L,
}

impl<'a, L: ReadLimits> Table<'a, L> {
    /// The field at a position of the table; [`Field::NONE`] past the end.
    fn field(&self, position: usize) -> &'a Field {
        let position = self.positions.get(position);
        let field = position.and_then(|position| self.fields.get(position.field()));
        field.unwrap_or(&Field::NONE)
    }

    /// True if the field at the position `left` is before that at `right`.
    fn is_before(&self, left: usize, right: usize) -> bool {
        let key = |field: &Field| (field.interval_ms, field.place());
        key(self.field(left)) < key(self.field(right))
    }

    fn swap(&mut self, left: usize, right: usize) {
        let of_left = self.field_index(left);
        let of_right = self.field_index(right);
        self.put(left, of_right);
        self.put(right, of_left);
    }

    fn field_index(&self, position: usize) -> u16 {
        self.positions.get(position).map_or(0, |own| own.field)
    }

    fn put(&mut self, position: usize, field: u16) {
        if let Some(position) = self.positions.get_mut(position) {
            position.field = field;
        }
    }

    /// Sorts by heapsort.
    fn sort(&mut self) {
        let mut end = self.positions.len();
        let mut root = end / 2;
        loop {
            // While there is a root left, the heap is being made; after that, the last field of
            // the heap goes to its end.
            if root > 0 {
                root -= 1;
            } else {
                end -= 1;
                if end == 0 {
                    return;
                }
                self.swap(0, end);
            }
            let mut parent = root;
            loop {
                let mut child = 2 * parent + 1;
                if child + 1 < end && self.is_before(child, child + 1) {
                    child += 1;
                }
                if child >= end || !self.is_before(parent, child) {
                    break;
                }
                self.swap(parent, child);
                parent = child;
            }
        }
    }

    /// Finds for each position the best read that ends there: the reads before it are known by
    /// then. Its first position is kept in `first_or_last`.
    ///
    /// A longer read never needs more reads before it. So the best read begins at a position
    /// from `start`, where the longest read begins, up to `end`: all these need the fewest
    /// reads before them. The best one is that for which the length of all reads before it,
    /// less its own place, is least.
    ///
    /// A field that lies within an earlier one is in the read of that one at no cost.
    fn find_best(&mut self) {
        let limits = self.limits;
        let mut before = &Field::NONE;
        let (mut length, mut start, mut end, mut best) = (0, 0, 0, 0);
        for index in 0..self.positions.len() {
            let field = self.field(index);
            let (place, own_end) = (field.place(), field.end_place());
            let before_end = before.end_place();
            let is_same = field.interval_ms == before.interval_ms;
            if is_same && own_end <= before_end {
                self.set_sum(index, i32::MAX);
            } else {
                self.set_sum(index, length - place.cast_signed());
                // A field of another table is further away than any gap.
                if !is_same
                    || place.saturating_sub(before_end) > limits.widest_gap(field)
                    || limits.excludes(before_end, place)
                {
                    start = index;
                }
                let longest = limits.longest_read(field);
                while own_end.wrapping_sub(self.field(start).place()) > longest {
                    start += 1;
                }
                if start >= end {
                    end = index + 1;
                    self.keep_least(start, end);
                }
                // If two are equally good, the later one leaves the longer reads before it.
                if start > best {
                    best = start;
                }
                while best + 1 < end && self.sum(best + 1) == self.sum(best) {
                    best += 1;
                }
                length = own_end.cast_signed() + self.sum(best);
                before = field;
            }
            if let Some(position) = self.positions.get_mut(index) {
                position.first_or_last = best as u16;
            }
        }
    }

    fn sum(&self, position: usize) -> i32 {
        self.positions
            .get(position)
            .map_or(0, |own| own.sum_or_read)
    }

    fn set_sum(&mut self, position: usize, sum: i32) {
        if let Some(position) = self.positions.get_mut(position) {
            position.sum_or_read = sum;
        }
    }

    /// Replaces the sum of each position from `start` up to `end` by the least from there on.
    fn keep_least(&mut self, start: usize, end: usize) {
        let mut least = i32::MAX;
        for index in (start..end).rev() {
            least = least.min(self.sum(index));
            self.set_sum(index, least);
        }
    }

    /// Makes the reads that [`Table::find_best`] found. Returns how many.
    ///
    /// # Errors
    /// The position of the first field for which the storage does not suffice.
    fn cut(&mut self, reads: &mut [Read], words: u16) -> Result<usize, usize> {
        let mut next = self.positions.len();
        while let Some(end) = next.checked_sub(1) {
            next = self
                .positions
                .get(end)
                .map_or(0, |end| end.first_or_last.into());
            if let Some(start) = self.positions.get_mut(next) {
                start.first_or_last = end as u16;
            }
        }
        let (mut start, mut count, mut offset) = (0, 0, 0u16);
        while let Some(&Position {
            first_or_last: last,
            ..
        }) = self.positions.get(start)
        {
            let Some(read) = reads.get_mut(count) else {
                return Err(start);
            };
            let first = self.field(start);
            let mut quantity = 0;
            for position in start..=last.into() {
                let field = self.field(position);
                quantity = quantity.max(field.end() - u32::from(first.address));
                let field = self.field_index(position).into();
                self.set_sum(field, count as i32);
            }
            offset = read
                .set_up(first, quantity as u16, offset, words)
                .ok_or(start)?;
            // Every read has a field, so the position that this replaces is not needed any more.
            if let Some(own) = self.positions.get_mut(count) {
                own.first_or_last = start as u16;
            }
            start = usize::from(last) + 1;
            count += 1;
        }
        Ok(count)
    }
}
