//! A field of the table, and the errors that it may have.

use crate::error::Status;

/// The tables of the data model (V1.1b3, 4.3). Each number is the function that reads it.
pub const COILS: u8 = 1;
/// The discrete inputs.
pub const DISCRETE_INPUTS: u8 = 2;
/// The holding registers.
pub const HOLDING_REGISTERS: u8 = 3;
/// The input registers.
pub const INPUT_REGISTERS: u8 = 4;

/// The types of a value: a coil or a discrete input, or bits of one register.
pub const BIT: u8 = 1;
/// One register.
pub const UINT16: u8 = 2;
/// One register, two's complement.
pub const INT16: u8 = 3;
/// Two registers.
pub const UINT32: u8 = 4;
/// Two registers, two's complement.
pub const INT32: u8 = 5;
/// Four registers.
pub const UINT64: u8 = 6;
/// Four registers, two's complement.
pub const INT64: u8 = 7;
/// An IEEE 754 binary32 in two registers.
pub const FLOAT: u8 = 8;
/// An IEEE 754 binary64 in four registers.
pub const DOUBLE: u8 = 9;
/// A text, two characters a register.
pub const TEXT: u8 = 10;
/// Registers as they are, for a type that the plan does not know.
pub const REGISTERS: u8 = 11;

/// The longest interval: a day.
pub const LONGEST_INTERVAL_MS: u32 = 86_400_000;

/// A value, or several of one type in a row, that a program wants of a unit.
///
/// ```
/// use mbm::plan::field::{HOLDING_REGISTERS, UINT32};
/// use mbm::plan::Field;
/// use mbm::Status;
///
/// // Two energies of 32 bits from register 107 on, once a second.
/// const ENERGIES: Field = Field {
///     unit: 17,
///     table: HOLDING_REGISTERS,
///     value_type: UINT32,
///     address: 107,
///     count: 2,
///     interval_ms: 1000,
///     ..Field::NONE
/// };
/// assert_eq!(ENERGIES.check(0), Status::OK);
/// assert_eq!((ENERGIES.count(), ENERGIES.values()), (2, 2));
/// assert_eq!((ENERGIES.length(), ENERGIES.end()), (4, 111));
/// assert!(!ENERGIES.is_in_bits());
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// The unit, 1 to 255; in TCP frames also 0.
    pub unit: u16,
    /// [`COILS`] to [`INPUT_REGISTERS`].
    pub table: u8,
    /// [`BIT`] to [`REGISTERS`].
    pub value_type: u8,
    /// The order of the bytes: 0 and 1 for [`Abcd`](crate::data::order::Order::Abcd), 2 to 4 for
    /// the orders that follow.
    pub order: u8,
    /// For [`BIT`] in a table of registers: the lowest of `count` bits of the register, which are
    /// one number; 0 is the least significant. Otherwise 0.
    pub bit: u8,
    /// The first bit or register, 0 to 65535, as on the wire.
    pub address: u16,
    /// The number of values, of the characters of a text, or of registers; 0 means 1.
    pub count: u16,
    /// The time from one read to the next, 1 to [`LONGEST_INTERVAL_MS`].
    pub interval_ms: u32,
    /// Each number is multiplied by this; 0 means 1.
    pub multiplier: i32,
    /// Each number is then divided by this; 0 means 1; not negative.
    pub divisor: i32,
}

impl Field {
    /// A field of nothing. It stands for a field that does not exist.
    pub const NONE: Field = Field {
        unit: 0,
        table: 0,
        value_type: 0,
        order: 0,
        bit: 0,
        address: 0,
        count: 0,
        interval_ms: 0,
        multiplier: 0,
        divisor: 0,
    };

    /// Checks the field by itself: [`Status::OK`]; [`Status::INVALID_ARGUMENT`] for an unknown
    /// table, type or order, a type that the table does not have, bits beyond those of a register,
    /// a unit above 255, an interval out of range, a negative divisor, or a scale of a text or of
    /// [`REGISTERS`]; [`Status::BROADCAST_NOT_ALLOWED`] for unit 0, unless `has_unit_0` is 1, as it is
    /// in TCP frames; [`Status::ILLEGAL_DATA_ADDRESS`] if the field goes beyond address 65535.
    pub fn check(&self, has_unit_0: u8) -> Status {
        let known = self.table.wrapping_sub(1) < INPUT_REGISTERS
            && self.value_type.wrapping_sub(1) < REGISTERS
            && (self.value_type == BIT || !self.is_in_bits())
            && u32::from(self.bit) + self.bits() <= u16::BITS
            && self.order <= 4
            && self.unit <= u8::MAX.into()
            && self.divisor >= 0
            && (self.value_type < TEXT || self.multiplier | self.divisor == 0)
            && self.interval_ms.wrapping_sub(1) < LONGEST_INTERVAL_MS;
        if !known {
            Status::INVALID_ARGUMENT
        } else if self.unit as u8 | has_unit_0 == 0 {
            Status::BROADCAST_NOT_ALLOWED
        } else if self.end() > 0x1_0000 {
            Status::ILLEGAL_DATA_ADDRESS
        } else {
            Status::OK
        }
    }

    /// The number of values, of the characters of a text, or of bits of a register; at least 1.
    pub const fn count(&self) -> u16 {
        if self.count == 0 {
            1
        } else {
            self.count
        }
    }

    /// True if it is bits of a register.
    pub(crate) const fn is_part_of_register(&self) -> bool {
        self.value_type == BIT && !self.is_in_bits()
    }

    /// The number of bits of a value that consists of bits of a register; 16 for any other value.
    pub(super) const fn bits(&self) -> u32 {
        if self.is_part_of_register() {
            self.count() as u32
        } else {
            u16::BITS
        }
    }

    /// The number of values.
    pub const fn values(&self) -> u16 {
        if self.value_type == TEXT || self.is_part_of_register() {
            1
        } else {
            self.count()
        }
    }

    /// The registers of one value, as a power of 2; 0 for a type without registers.
    pub(super) const fn value_shift(&self) -> u32 {
        // Two bits for each type. (A table would be a constant of its own in flash.)
        const SHIFTS: u32 = 1 << (2 * UINT32)
            | 1 << (2 * INT32)
            | 2 << (2 * UINT64)
            | 2 << (2 * INT64)
            | 1 << (2 * FLOAT)
            | 2 << (2 * DOUBLE);
        SHIFTS >> (2 * (self.value_type & 15)) & 3
    }

    /// The number of bits or registers that the field takes.
    pub const fn length(&self) -> u32 {
        if self.value_type == TEXT {
            (self.count() as u32).div_ceil(2)
        } else {
            (self.values() as u32) << self.value_shift()
        }
    }

    /// The position of the first bit or register, if the tables of all units stand one after
    /// the other. There are more than 65535 places between two tables.
    pub(super) const fn place(&self) -> u32 {
        place(self.unit as u8, self.table, self.address)
    }

    /// The address after the last bit or register, up to 65536.
    pub const fn end(&self) -> u32 {
        self.address as u32 + self.length()
    }

    /// The place after the last bit or register.
    pub(super) const fn end_place(&self) -> u32 {
        self.place().wrapping_add(self.length())
    }

    /// True if the field is in a table of bits.
    pub const fn is_in_bits(&self) -> bool {
        self.table <= DISCRETE_INPUTS
    }

    /// True if the values are integers.
    pub(crate) const fn is_integer(&self) -> bool {
        self.value_type.wrapping_sub(UINT16) <= INT64 - UINT16
    }

    /// True if the values are integers with a sign.
    pub(crate) const fn is_signed(&self) -> bool {
        self.is_integer() && self.value_type % 2 == INT16 % 2
    }
}

/// See [`Field::place`].
pub(super) const fn place(unit: u8, table: u8, address: u16) -> u32 {
    (unit as u32 * 8 + table as u32) << 17 | address as u32
}
