//! Dividing reads that a device refuses, to find the fields that it does not have.
//!
//! A device answers exception 02 or 03 to a read if it lacks one address of it, or if the read is
//! too long for it. The read is then cut in two, and each half is tried at once, and so on until
//! what is refused is one field. That one is tried again rarely. Two neighbours that the device has
//! are joined again, once: a union that fails is cut where it was joined, until the device has a field
//! again or [`Splitter::forgive`] lets unions be tried anew.
//!
//! The reads that were one at first are a *block*. Their fields stay side by side.

use super::field::Field;
use super::read::{Position, Read, APART, FRESH, HELD, QUEUED, SUSPENDED, TRIAL};
use crate::error::Status;

/// What a plan's reads are divided with: its parts and storage.
///
/// ```
/// use mbm::plan::field::{HOLDING_REGISTERS, UINT16};
/// use mbm::plan::schedule::{Backoff, Schedule};
/// use mbm::plan::split::{Finding, Splitter};
/// use mbm::plan::{group::group, Field, Limits, Position, Read};
/// use mbm::Status;
/// # let limits = Limits {
/// #     bits: 0, registers: 0, bit_gap: 0, register_gap: 0, units: &[], excluded: &[],
/// # };
///
/// let field = |address| Field {
///     unit: 17, table: HOLDING_REGISTERS, value_type: UINT16, address, interval_ms: 1000, ..Field::NONE
/// };
/// // One read has both fields. It may become two, so there is storage for two.
/// let fields = [field(107), field(108)];
/// let (mut positions, mut reads) = ([Position::NONE; 2], [Read::default(), Read::default()]);
/// let count = group(&fields, 0, &limits, &mut positions, &mut reads, 2).unwrap();
/// let (schedule, backoff) = (Schedule::default(), Backoff { first_ms: 1000, longest_ms: 60_000 });
/// schedule.start(&reads[..count], 0);
/// let (mut data, mut blocks) = ([0; 2], [0; 2]);
/// let mut splitter = Splitter {
///     fields: &fields, positions: &mut positions, reads: &mut reads, data: &mut data,
///     blocks: &mut blocks, count,
/// };
/// splitter.start();
///
/// // The device says that it lacks a register of the read.
/// let before = splitter.reads[0].status();
/// let refused = Status::ILLEGAL_DATA_ADDRESS;
/// let read = schedule.next(&splitter.reads[..1], 0).unwrap();
/// schedule.begin(&splitter.reads[..1]);
/// schedule.end_divided(&splitter.reads[..1], read, refused, 20, &backoff);
/// assert_eq!(splitter.end(0, before, 20, 60_000), Finding::Divided);
/// assert_eq!(splitter.count, 2);
/// // Once an hour: perhaps the device has got the register.
/// splitter.forgive();
/// splitter.join(40, |_old, _new| { /* A number of the program moves too. */ });
/// ```
#[derive(Debug)]
pub struct Splitter<'a> {
    /// The fields.
    pub fields: &'a [Field],
    /// One for each field.
    pub positions: &'a mut [Position],
    /// Storage of reads, of which the first `count` are in use.
    pub reads: &'a mut [Read],
    /// The data of the reads.
    pub data: &'a mut [u16],
    /// The block of each read; as many as fields.
    pub blocks: &'a mut [u16],
    /// How many reads there are.
    pub count: usize,
}

/// How a read that has ended changes the plan.
///
/// ```
/// use mbm::plan::split::Finding;
///
/// fn changes_reads(finding: Finding) -> bool {
///     finding != Finding::Nothing
/// }
/// assert!(changes_reads(Finding::Divided));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// Nothing: it is as the plan says.
    Nothing,
    /// It was cut in two. Its fields have the status that they had before.
    Divided,
    /// The device does not have its field, or has it again.
    Settled,
}

/// The part of a read that consists of neighbouring fields.
#[derive(Clone, Copy)]
struct Part {
    address: u32,
    end: u32,
}

impl Part {
    fn words(self, is_of_bits: bool) -> usize {
        let length = (self.end - self.address) as usize;
        if is_of_bits {
            length.div_ceil(16)
        } else {
            length
        }
    }
}

/// True if the device shows by this status that it lacks a part of a read.
fn is_refusal(status: Status) -> bool {
    matches!(
        status,
        Status::ILLEGAL_DATA_ADDRESS | Status::ILLEGAL_DATA_VALUE
    )
}

/// True if a union of reads that were right failed for what it is.
fn is_failure(status: Status) -> bool {
    status != Status::OK && status != Status::LINK_LOST && status != Status::CANCELLED
}

impl Splitter<'_> {
    /// Makes each read of a plan a block. Call it when the plan has begun.
    pub fn start(&mut self) {
        for (block, label) in self.blocks.iter_mut().zip(0..) {
            *block = label;
        }
    }

    /// Takes the end of a read, which `Schedule::end` has noted; `before` is its status before that.
    /// A field that the device does not have waits for `retry_ms`. Call `Schedule::renew` after
    /// anything but [`Finding::Nothing`].
    pub fn end(&mut self, read: usize, before: Status, now: u32, retry_ms: u32) -> Finding {
        let Some(ended) = self.reads.get(read) else {
            return Finding::Nothing;
        };
        let (status, flags) = (ended.status(), ended.flags.get());
        let refusal = is_refusal(status);
        if refusal || flags & TRIAL != 0 && is_failure(status) {
            let (first, end) = self.places(read);
            let cut = if flags & TRIAL != 0 {
                self.seam(read, first, end)
            } else {
                self.find_cut(first, end)
            };
            if let Some(cut) = cut {
                if self.divide(read, (first, cut, end), before, now) {
                    return Finding::Divided;
                }
                // There is no storage: the read is as any other.
            } else if refusal {
                ended.not_before.set(now.wrapping_add(retry_ms));
                self.clear(read, FRESH | TRIAL);
                return Finding::Settled;
            }
        }
        if status == Status::OK && is_refusal(before) {
            // The device has it again: what was cut may be one again.
            self.clear_block(read, APART);
            return Finding::Settled;
        }
        if status == Status::OK || status.is_exception() {
            self.clear(read, FRESH | TRIAL);
            if flags & (FRESH | TRIAL) != 0 {
                return Finding::Settled;
            }
        }
        Finding::Nothing
    }

    /// Lets unions be tried again that have failed. Call it rarely, and `join` after it.
    pub fn forgive(&mut self) {
        for read in 0..self.count {
            self.clear(read, APART);
        }
    }

    /// Joins pairs of neighbours that the device has, in blocks of which every read has ended. `moved`
    /// gets the old and the new index of each read that moves. Returns false if it must be called
    /// again after the next read has ended.
    pub fn join(&mut self, now: u32, mut moved: impl FnMut(usize, usize)) -> bool {
        let (mut place, mut is_done) = (0, true);
        while let Some(read) = self.read_at(place) {
            let block = self.block(read);
            let (mut end, mut flags) = (place, 0);
            while let Some(own) = self.read_at(end).filter(|own| self.block(*own) == block) {
                flags |= self.reads.get(own).map_or(0, |read| read.flags.get());
                end = self.places(own).1;
            }
            if flags & (FRESH | TRIAL) == 0 {
                is_done &= self.join_block(place, end, now, &mut moved);
            } else {
                is_done = false;
            }
            place = end;
        }
        is_done
    }

    /// Joins the reads of a block in pairs. It has the places from `place` up to `end`. Returns false
    /// if one of them is in flight.
    fn join_block(
        &mut self,
        mut place: usize,
        end: usize,
        now: u32,
        moved: &mut impl FnMut(usize, usize),
    ) -> bool {
        let mut is_done = true;
        while let Some(left) = self.read_at(place) {
            let (first, seam) = self.places(left);
            let Some(right) = self.read_at(seam).filter(|_| seam < end) else {
                break;
            };
            place = seam;
            // Of more than 256 places the lowest byte does not tell which one is the seam.
            if self.is_apart(right) || self.places(right).1 - first > 256 {
                continue;
            }
            if self.are_queued(left, right) {
                is_done = false;
            } else if self.unite(left, right, now) {
                if let Some(read) = self.reads.get_mut(left) {
                    read.seam = seam as u8;
                }
                place = self.places(left).1;
                self.remove(right, moved);
            }
        }
        is_done
    }

    /// True if a read was joined with the one before it in vain.
    fn is_apart(&self, read: usize) -> bool {
        let read = self.reads.get(read);
        read.is_some_and(|read| read.flags.get() & APART != 0)
    }

    // --- what is where ---

    fn block(&self, read: usize) -> usize {
        self.blocks
            .get(read)
            .map_or(usize::MAX, |own| (*own).into())
    }

    fn clear(&self, read: usize, flags: u8) {
        if let Some(read) = self.reads.get(read) {
            read.flags.set(read.flags.get() & !flags);
        }
    }

    /// Clears flags of all reads of the block that a read is in.
    fn clear_block(&self, read: usize, flags: u8) {
        let block = self.block(read);
        for other in 0..self.count {
            if self.block(other) == block {
                self.clear(other, flags);
            }
        }
    }

    fn field(&self, place: usize) -> &Field {
        let position = self.positions.get(place);
        let field = position.and_then(|position| self.fields.get(position.field()));
        field.unwrap_or(&Field::NONE)
    }

    /// The read of the field at a place; `None` past the end.
    fn read_at(&self, place: usize) -> Option<usize> {
        let field = self.positions.get(place)?.field();
        self.positions.get(field).map(Position::read)
    }

    /// The first place of a read, and the one after its last.
    fn places(&self, read: usize) -> (usize, usize) {
        let first = self.positions.get(read).map_or(0, Position::first);
        let count = Position::fields_of(self.positions, read).count();
        // Of a read without fields, which does not exist, the walk goes on.
        (first, first + count.max(1))
    }

    /// The addresses of the fields from one place up to another.
    fn part(&self, first: usize, end: usize) -> Part {
        let mut part = Part {
            address: u32::MAX,
            end: 0,
        };
        for place in first..end {
            let field = self.field(place);
            part.address = part.address.min(field.address.into());
            part.end = part.end.max(field.end());
        }
        part
    }

    /// The place nearest to the middle at which a read can be cut: a field there shares no address
    /// with those before it, or if there is no such place, is not where the one before it is. `None`
    /// if all fields are at one place.
    fn find_cut(&self, first: usize, end: usize) -> Option<usize> {
        let middle = first.midpoint(end);
        let mut before = self.field(first);
        let mut reach = before.end();
        let mut best = None;
        for place in first + 1..end {
            let field = self.field(place);
            let is_clean = u32::from(field.address) >= reach;
            let is_same = (field.address, field.end()) == (before.address, before.end());
            let rank = (!is_clean, place.abs_diff(middle));
            if (is_clean || !is_same) && best.is_none_or(|(found, _)| rank < found) {
                best = Some((rank, place));
            }
            reach = reach.max(field.end());
            before = field;
        }
        best.map(|(_, place)| place)
    }

    /// The place at which a union was joined of two reads.
    fn seam(&self, read: usize, first: usize, end: usize) -> Option<usize> {
        let seam = self.reads.get(read).map_or(0, |read| read.seam);
        (first + 1..end).find(|place| *place as u8 == seam)
    }

    // --- data ---

    /// The words after the data of all reads.
    fn used(&self) -> usize {
        let reads = self.reads.get(..self.count).unwrap_or(&[]);
        let end = |read: &Read| usize::from(read.offset) + usize::from(read.words());
        reads.iter().map(end).max().unwrap_or(0)
    }

    /// The words from the data of a read on that no other read but `except` has.
    fn room(&self, read: &Read, except: usize) -> usize {
        let reads = self.reads.get(..self.count).unwrap_or(&[]);
        let after = |(index, other): (usize, &Read)| {
            (index != except && other.offset > read.offset).then_some(usize::from(other.offset))
        };
        let end = reads.iter().enumerate().filter_map(after).min();
        end.unwrap_or(self.data.len()) - usize::from(read.offset)
    }

    /// Moves registers or bits to another place of the data. Both places are in units of one.
    fn shift(&mut self, is_of_bits: bool, from: usize, to: usize, count: usize) {
        if from == to {
            return;
        }
        for nth in 0..count {
            let nth = if to > from { count - 1 - nth } else { nth };
            if is_of_bits {
                let bit = |at: usize| u16::to_le(1 << (at % 16));
                let is_set =
                    self.data.get((from + nth) / 16).copied().unwrap_or(0) & bit(from + nth) != 0;
                if let Some(word) = self.data.get_mut((to + nth) / 16) {
                    *word = *word & !bit(to + nth) | if is_set { bit(to + nth) } else { 0 };
                }
            } else {
                let word = self.data.get(from + nth).copied().unwrap_or(0);
                if let Some(place) = self.data.get_mut(to + nth) {
                    *place = word;
                }
            }
        }
    }

    // --- cutting and joining ---

    /// Cuts a read at a place. Both halves get the status `before`. Returns false if there is no
    /// storage for another read or its data.
    fn divide(
        &mut self,
        read: usize,
        places: (usize, usize, usize),
        before: Status,
        now: u32,
    ) -> bool {
        let (first, cut, end) = places;
        let (left, right) = (self.part(first, cut), self.part(cut, end));
        let new = self.count;
        let Some(old) = self.reads.get(read) else {
            return false;
        };
        let is_of_bits = old.is_of_bits();
        let (base, offset) = (u32::from(old.address), usize::from(old.offset));
        let unit = if is_of_bits { 16 } else { 1 };
        let (left_words, right_words) = (left.words(is_of_bits), right.words(is_of_bits));
        // The data of the right part stay, or follow those of the left one, if the parts share no
        // address and there is space; else they are copied to the end.
        let place = if right.address < left.end {
            self.used()
        } else if !is_of_bits {
            offset + (right.address - base) as usize
        } else if left_words + right_words <= old.words().into() {
            offset + left_words
        } else {
            self.used()
        };
        if place + right_words > self.data.len() || new >= self.reads.len() {
            return false;
        }
        let has_data = old.has_data();
        if has_data {
            let from = offset * unit + (right.address - base) as usize;
            let length = (right.end - right.address) as usize;
            self.shift(is_of_bits, from, place * unit, length);
        }
        let Some([old, half]) = self.pair(read, new) else {
            return false;
        };
        old.quantity = (left.end - left.address) as u16;
        half.interval_ms = old.interval_ms;
        half.address = right.address as u16;
        half.quantity = (right.end - right.address) as u16;
        half.offset = place as u16;
        half.unit = old.unit;
        half.table = old.table;
        half.read_at.set(old.read_at.get());
        half.doublings.set(old.doublings.get());
        half.not_before.set(old.not_before.get());
        let flags = old.flags.get();
        let apart = if flags & TRIAL != 0 { APART } else { 0 };
        let flags = flags & !(QUEUED | TRIAL) | FRESH;
        old.flags.set(flags);
        // A unit that does not answer is tried with one read.
        let held = if flags & SUSPENDED != 0 { HELD } else { 0 };
        half.flags.set(flags & !APART | held | apart);
        for half in [old, half] {
            half.due.set(now);
            half.status.set(before.code());
        }
        self.count += 1;
        let block = self.block(read) as u16;
        if let Some(own) = self.blocks.get_mut(new) {
            *own = block;
        }
        self.hand_over(cut, end, new);
        true
    }

    /// Two different reads.
    fn pair(&mut self, one: usize, other: usize) -> Option<[&mut Read; 2]> {
        self.reads.get_disjoint_mut([one, other]).ok()
    }

    /// Makes a read that of the fields from one place up to another.
    fn hand_over(&mut self, first: usize, end: usize, read: usize) {
        for place in first..end {
            let field = self
                .positions
                .get(place)
                .map_or(usize::MAX, Position::field);
            if let Some(position) = self.positions.get_mut(field) {
                position.sum_or_read = read as i32;
            }
        }
        if let Some(position) = self.positions.get_mut(read) {
            position.first_or_last = first as u16;
        }
    }

    fn are_queued(&self, one: usize, other: usize) -> bool {
        let is_queued = |read: usize| {
            let read = self.reads.get(read);
            read.is_some_and(|read| read.flags.get() & QUEUED != 0)
        };
        is_queued(one) || is_queued(other)
    }

    /// Makes the left read one with its neighbour to the right, if the device has both and there is
    /// space for their data side by side. The right one is to be removed then.
    fn unite(&mut self, left: usize, right: usize, now: u32) -> bool {
        let (Some(one), Some(other)) = (self.reads.get(left), self.reads.get(right)) else {
            return false;
        };
        let is_right = |read: &Read| read.has_data() && read.status() == Status::OK;
        let distance = u32::from(other.address).wrapping_sub(one.address.into());
        let is_of_bits = one.is_of_bits();
        if !is_right(one) || !is_right(other) || distance < one.quantity.into() || distance > 0xFFFF
        {
            return false;
        }
        let whole = Part {
            address: one.address.into(),
            end: u32::from(other.address) + u32::from(other.quantity),
        };
        let words = whole.words(is_of_bits);
        let place = if words <= self.room(one, right) {
            one.offset.into()
        } else {
            self.used()
        };
        if place + words > self.data.len() {
            return false;
        }
        let unit = if is_of_bits { 16 } else { 1 };
        let from = [one.offset, other.offset].map(|offset| usize::from(offset) * unit);
        let lengths = [one.quantity, other.quantity].map(usize::from);
        self.shift(is_of_bits, from[0], place * unit, lengths[0]);
        self.shift(
            is_of_bits,
            from[1],
            place * unit + distance as usize,
            lengths[1],
        );
        let (first, end) = (self.places(left).0, self.places(right).1);
        let Some([one, other]) = self.pair(left, right) else {
            return false;
        };
        one.quantity = (whole.end - whole.address) as u16;
        one.offset = place as u16;
        if one.age(now) < other.age(now) {
            one.read_at.set(other.read_at.get());
        }
        one.due.set(now);
        one.set(TRIAL);
        self.hand_over(first, end, left);
        true
    }

    /// Removes a read without fields: the last one takes its place.
    fn remove(&mut self, read: usize, moved: &mut impl FnMut(usize, usize)) {
        self.count -= 1;
        let last = self.count;
        if read == last {
            return;
        }
        let (first, end) = self.places(last);
        if let Some([to, from]) = self.pair(read, last) {
            *to = from.clone();
        }
        let block = self.block(last) as u16;
        if let Some(own) = self.blocks.get_mut(read) {
            *own = block;
        }
        self.hand_over(first, end, read);
        moved(last, read);
    }
}
