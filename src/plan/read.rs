//! The storage of a plan: one [`Position`] for each field, and one [`Read`] for each read.

use super::field::Field;
use crate::error::Status;
use crate::time::Millis;
use core::cell::Cell;

/// One for each field. While the plan groups its fields, position `n` holds the field that is
/// `n`th in the sorted table. Then position `n` names the read that field `n` is in.
///
/// ```
/// use mbm::plan::field::{HOLDING_REGISTERS, UINT16};
/// use mbm::plan::{group::group, Field, Limits, Position, Read};
/// # let limits = Limits {
/// #     bits: 0, registers: 0, bit_gap: 0, register_gap: 0, units: &[], excluded: &[],
/// # };
///
/// let field = |address| Field {
///     unit: 17, table: HOLDING_REGISTERS, value_type: UINT16, address, interval_ms: 1000, ..Field::NONE
/// };
/// // The second and the first field are neighbours, so one read has both.
/// let fields = [field(108), field(107), field(900)];
/// let (mut positions, mut reads) = ([Position::NONE; 3], [Read::default(), Read::default()]);
/// assert_eq!(group(&fields, 0, &limits, &mut positions, &mut reads, 3), Ok(2));
/// assert_eq!(positions.map(|position| position.read()), [0, 0, 1]);
/// assert_eq!((positions[0].field(), positions[1].first()), (1, 2));
/// assert!(Position::fields_of(&positions, 0).eq([1, 0]));
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// While grouping: the sum to which a read that begins here adds; see `find_best`. Then:
    /// the read that the field with this index is in.
    pub(super) sum_or_read: i32,
    /// The index of the field at this place of the sorted table.
    pub(super) field: u16,
    /// The first position of the best read that ends here; then the last one of the read that
    /// begins here; then the first position of the read with this index.
    pub(super) first_or_last: u16,
}

impl Position {
    /// A position without a field.
    pub const NONE: Position = Position {
        sum_or_read: 0,
        field: 0,
        first_or_last: 0,
    };

    /// The index of the field at this place of the sorted table.
    pub const fn field(&self) -> usize {
        self.field as usize
    }

    /// The index of the read that the field with the index of this position is in.
    pub const fn read(&self) -> usize {
        self.sum_or_read as usize
    }

    /// The first position of the read with the index of this position.
    pub const fn first(&self) -> usize {
        self.first_or_last as usize
    }

    /// The index of the field at the position `place`, if it is in the read with this index.
    pub(crate) fn field_of(positions: &[Position], read: usize, place: usize) -> Option<usize> {
        let field = positions.get(place)?.field();
        (positions.get(field)?.read() == read).then_some(field)
    }

    /// The indexes of the fields of the read with this index.
    pub fn fields_of(positions: &[Position], read: usize) -> impl Iterator<Item = usize> + '_ {
        let first = positions.get(read).map_or(0, Position::first);
        (first..).map_while(move |place| Position::field_of(positions, read, place))
    }
}

/// The last two reads of the unit that ended had no answer, and neither had any since.
pub(super) const SUSPENDED: u8 = 1;
/// The read of the unit that ended last had no answer.
pub(super) const DOUBTED: u8 = 2;
/// A reply has arrived at least once.
pub(super) const HAS_DATA: u8 = 4;
/// Another read of its unit, which does not answer, goes before it.
pub(super) const HELD: u8 = 8;
/// It is queued or in flight.
pub(super) const QUEUED: u8 = 16;
/// It was cut out of another read, and has not been answered since.
pub(super) const FRESH: u8 = 32;
/// It is not joined with the read before it: that was tried.
pub(super) const APART: u8 = 64;
/// It was joined of others, and has not been answered since.
pub(super) const TRIAL: u8 = 128;

/// One request that the plan repeats, and its result. (The changing fields are cells, because
/// the reads of a unit change each other.)
///
/// ```
/// use mbm::plan::field::{HOLDING_REGISTERS, UINT16};
/// use mbm::plan::{group::group, schedule::*, Field, Limits, Position, Read};
/// use mbm::Status;
/// # let limits = Limits {
/// #     bits: 0, registers: 0, bit_gap: 0, register_gap: 0, units: &[], excluded: &[],
/// # };
///
/// let flow = Field {
///     unit: 17, table: HOLDING_REGISTERS, value_type: UINT16, address: 107, interval_ms: 1000, ..Field::NONE
/// };
/// let (mut positions, mut reads) = ([Position::NONE], [Read::default()]);
/// group(&[flow], 0, &limits, &mut positions, &mut reads, 1).unwrap();
/// let (schedule, backoff) = (Schedule::default(), Backoff { first_ms: 100, longest_ms: 1000 });
/// schedule.start(&reads, 0);
/// let read = schedule.next(&reads, 0).unwrap();
/// assert_eq!((read.address, read.quantity, read.words()), (107, 1, 1));
/// assert!(!read.is_of_bits());
///
/// schedule.begin(&reads);
/// schedule.end(&reads, read, Status::OK, 20, &backoff);
/// assert_eq!((read.status(), read.has_data()), (Status::OK, true));
/// assert_eq!((read.age(50), read.index(&reads)), (30, 0));
/// ```
#[repr(C)]
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Read {
    /// When it is next due, in milliseconds.
    pub(super) due: Cell<Millis>,
    /// It is not sent before this time.
    pub(super) not_before: Cell<Millis>,
    /// When its last good reply arrived.
    pub(super) read_at: Cell<u32>,
    /// The time from one read to the next, in milliseconds.
    pub interval_ms: u32,
    /// The indexes of the reads below it in a heap.
    pub(super) left: Cell<u16>,
    pub(super) right: Cell<u16>,
    /// The first bit or register.
    pub address: u16,
    /// The number of bits or registers.
    pub quantity: u16,
    /// Where its data begin, in words from the start of the plan's data.
    pub offset: u16,
    /// The unit.
    pub unit: u8,
    /// The table; its number is that of the function.
    pub table: u8,
    /// How it ended last; [`Status::PENDING`] before it has ended once.
    pub(super) status: Cell<u8>,
    /// How often the wait after a request without an answer is doubled.
    pub(super) doublings: Cell<u8>,
    pub(super) flags: Cell<u8>,
    /// The lowest byte of the place at which a union was joined.
    pub(super) seam: u8,
}

impl Read {
    /// Makes it a read of fields; `first` has the lowest address. Its data begin at `offset` of
    /// `words` words. Returns where they end; `None` if there are too few words. (Out of line
    /// it takes 24 to 60 bytes more firmware.)
    #[inline(always)]
    pub(super) fn set_up(
        &mut self,
        first: &Field,
        quantity: u16,
        offset: u16,
        words: u16,
    ) -> Option<u16> {
        // Field by field: firmware has no other use for memcpy.
        self.read_at.set(0);
        self.interval_ms = first.interval_ms;
        self.address = first.address;
        self.quantity = quantity;
        self.offset = offset;
        self.unit = first.unit as u8;
        self.table = first.table;
        self.status.set(Status::PENDING.code());
        self.doublings.set(0);
        self.flags.set(0);
        let own = self.words();
        (own <= words.wrapping_sub(offset)).then_some(offset.wrapping_add(own))
    }

    /// True if the read requests bits.
    pub const fn is_of_bits(&self) -> bool {
        self.table <= super::field::DISCRETE_INPUTS
    }

    /// The number of words that its data take.
    pub const fn words(&self) -> u16 {
        if self.is_of_bits() {
            self.quantity.div_ceil(16)
        } else {
            self.quantity
        }
    }

    /// How it ended last; [`Status::PENDING`] before it has ended once.
    pub const fn status(&self) -> Status {
        Status::from_code(self.status.get())
    }

    /// True if a good reply has arrived at least once.
    pub const fn has_data(&self) -> bool {
        self.flags.get() & HAS_DATA != 0
    }

    /// The milliseconds since the last good reply. Undefined before the first one.
    pub const fn age(&self, now: u32) -> u32 {
        now.wrapping_sub(self.read_at.get())
    }

    /// Its index among all reads of its plan.
    pub fn index(&self, reads: &[Read]) -> usize {
        let first = reads.as_ptr().addr();
        core::ptr::from_ref(self).addr().wrapping_sub(first) / size_of::<Read>()
    }

    pub(super) fn set(&self, flags: u8) {
        self.flags.set(self.flags.get() | flags);
    }
}
