//! The limits of a read: its length, the gaps in it, and the addresses that it must not contain.

use super::field::{place, Field};
use crate::error::Status;
use crate::pdu::{MAX_READ_BITS, MAX_READ_REGISTERS};

/// How much one read of a unit may request. 0 means as [`Limits`] says.
///
/// ```
/// use mbm::plan::UnitLimits;
///
/// // Unit 17 answers reads of up to 16 registers.
/// let limits = UnitLimits { bits: 0, registers: 16, unit: 17 };
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnitLimits {
    /// Bits, up to 2000.
    pub bits: u16,
    /// Registers, up to 125.
    pub registers: u16,
    /// The unit. No unit has one above 255.
    pub unit: u16,
}

/// The most bits or registers that the standard lets one read of a field's table request.
pub(super) const fn standard_limit(field: &Field) -> u16 {
    if field.is_in_bits() {
        MAX_READ_BITS
    } else {
        MAX_READ_REGISTERS
    }
}

/// Addresses that no read may touch.
///
/// ```
/// use mbm::plan::field::HOLDING_REGISTERS;
/// use mbm::plan::ExcludedRange;
///
/// // A read of registers 100 to 109 of unit 17 clears a counter there.
/// let range = ExcludedRange { first: 100, last: 109, unit: 17, table: HOLDING_REGISTERS };
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExcludedRange {
    /// The first address.
    pub first: u16,
    /// The last address.
    pub last: u16,
    /// The unit; 0 for every unit. No unit has one above 255.
    pub unit: u16,
    /// The table, as in a field.
    pub table: u8,
}

/// The limits of a read. [`Limits`] implements it; a caller may implement it in another way.
///
/// ```
/// use mbm::plan::{ExcludedRange, ReadLimits, UnitLimits};
///
/// /// No read has a value in it that nobody wants.
/// struct NoGaps;
///
/// impl ReadLimits for NoGaps {
///     fn bits(&self) -> u16 {
///         0
///     }
///     fn registers(&self) -> u16 {
///         0
///     }
///     fn bit_gap(&self) -> u16 {
///         0
///     }
///     fn register_gap(&self) -> u16 {
///         0
///     }
///     fn units(&self) -> &[UnitLimits] {
///         &[]
///     }
///     fn excluded(&self) -> &[ExcludedRange] {
///         &[]
///     }
/// }
/// ```
pub trait ReadLimits {
    /// The most bits that one read requests; 0 or more than 2000 mean 2000.
    fn bits(&self) -> u16;
    /// The most registers that one read requests; 0 or more than 125 mean 125.
    fn registers(&self) -> u16;
    /// The most bits between two fields that one read may cover in passing.
    fn bit_gap(&self) -> u16;
    /// The most registers between two fields that one read may cover in passing.
    fn register_gap(&self) -> u16;
    /// Units with other limits.
    fn units(&self) -> &[UnitLimits];
    /// Addresses that no read may touch.
    fn excluded(&self) -> &[ExcludedRange];

    /// As [`Field::check`]; [`Status::ILLEGAL_DATA_ADDRESS`] also if the field goes into an excluded
    /// range; [`Status::ILLEGAL_DATA_VALUE`] if one read cannot hold it.
    // The plan calls it.
    #[doc(hidden)]
    fn check(&self, field: &Field, has_unit_0: u8) -> Status {
        let status = field.check(has_unit_0);
        if status != Status::OK {
            status
        } else if self.excludes(field.place(), field.end_place()) {
            Status::ILLEGAL_DATA_ADDRESS
        } else if field.length() > self.longest_read(field) {
            Status::ILLEGAL_DATA_VALUE
        } else {
            Status::OK
        }
    }

    /// The most bits or registers of one read from the table of a field.
    // The plan calls it.
    #[doc(hidden)]
    fn longest_read(&self, field: &Field) -> u32 {
        let own = self.units().iter().find(|limits| limits.unit == field.unit);
        let (all, own) = if field.is_in_bits() {
            (self.bits(), own.map_or(0, |own| own.bits))
        } else {
            (self.registers(), own.map_or(0, |own| own.registers))
        };
        let limit = if own > 0 { own } else { all };
        (limit.wrapping_sub(1).min(standard_limit(field) - 1) + 1).into()
    }

    /// The widest gap that a read from the table of a field may cover.
    // The plan calls it.
    #[doc(hidden)]
    fn widest_gap(&self, field: &Field) -> u32 {
        if field.is_in_bits() {
            self.bit_gap().into()
        } else {
            self.register_gap().into()
        }
    }

    /// True if one of the places (see `Field::place`) from `first` up to, but not including,
    /// `end` is excluded.
    // The plan calls it.
    #[doc(hidden)]
    fn excludes(&self, first: u32, end: u32) -> bool {
        self.excluded().iter().any(|range| {
            let unit = match range.unit {
                0 => (first >> 20) as u8,
                unit => unit as u8,
            };
            place(unit, range.table, range.first) < end
                && place(unit, range.table, range.last) >= first
        })
    }
}

/// What a read may be.
///
/// ```
/// use mbm::plan::Limits;
///
/// // Reads of any length, which may cover 10 registers that nobody wants.
/// let limits = Limits {
///     bits: 0,
///     registers: 0,
///     bit_gap: 0,
///     register_gap: 10,
///     units: &[],
///     excluded: &[],
/// };
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Limits<'a> {
    /// See [`ReadLimits::bits`].
    pub bits: u16,
    /// See [`ReadLimits::registers`].
    pub registers: u16,
    /// See [`ReadLimits::bit_gap`].
    pub bit_gap: u16,
    /// See [`ReadLimits::register_gap`].
    pub register_gap: u16,
    /// See [`ReadLimits::units`].
    pub units: &'a [UnitLimits],
    /// See [`ReadLimits::excluded`].
    pub excluded: &'a [ExcludedRange],
}

impl ReadLimits for Limits<'_> {
    fn bits(&self) -> u16 {
        self.bits
    }

    fn registers(&self) -> u16 {
        self.registers
    }

    fn bit_gap(&self) -> u16 {
        self.bit_gap
    }

    fn register_gap(&self) -> u16 {
        self.register_gap
    }

    fn units(&self) -> &[UnitLimits] {
        self.units
    }

    fn excluded(&self) -> &[ExcludedRange] {
        self.excluded
    }
}
