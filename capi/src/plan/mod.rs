//! `mbm_plan_*`: a table of fields that is read from units again and again, for C.

mod begin;
mod conversion;
mod object;
mod poll;
mod setup;
mod split;
mod values;

pub use begin::*;
pub use conversion::*;
pub use poll::*;
pub use setup::*;
pub use split::*;
pub use values::*;

use core::ffi::c_void;
use mbm::plan::field;

/// A table of the data model (V1.1b3, 4.3): coils. The number of each table is that of the
/// function that reads it.
pub const MBM_TABLE_COILS: u8 = 1;
/// The discrete inputs.
pub const MBM_TABLE_DISCRETE_INPUTS: u8 = 2;
/// The holding registers.
pub const MBM_TABLE_HOLDING_REGISTERS: u8 = 3;
/// The input registers.
pub const MBM_TABLE_INPUT_REGISTERS: u8 = 4;

/// The type of a value: a coil or a discrete input, 0 or 1.
pub const MBM_TYPE_BIT: u8 = 1;
/// One register, 0 to 65535.
pub const MBM_TYPE_UINT16: u8 = 2;
/// One register, -32768 to 32767.
pub const MBM_TYPE_INT16: u8 = 3;
/// Two registers.
pub const MBM_TYPE_UINT32: u8 = 4;
/// Two registers, two's complement.
pub const MBM_TYPE_INT32: u8 = 5;
/// Four registers.
pub const MBM_TYPE_UINT64: u8 = 6;
/// Four registers, two's complement.
pub const MBM_TYPE_INT64: u8 = 7;
/// Two registers, an IEEE 754 binary32.
pub const MBM_TYPE_FLOAT: u8 = 8;
/// Four registers, an IEEE 754 binary64.
pub const MBM_TYPE_DOUBLE: u8 = 9;
/// A text, two characters a register, which ends at its first NUL or with its field.
pub const MBM_TYPE_TEXT: u8 = 10;
/// `count` registers as they are, for a type that the plan does not know. mbm_plan_getRegisters
/// returns them, and a function mbm_registers_get... their value.
pub const MBM_TYPE_REGISTERS: u8 = 11;

/// The longest interval of a field in milliseconds: a day.
pub const MBM_PLAN_LONGEST_INTERVAL: u32 = 86_400_000;
/// The most fields of one plan.
pub const MBM_PLAN_MAX_FIELDS: u16 = 16_383;

const _: () = {
    assert!(MBM_TABLE_COILS == field::COILS);
    assert!(MBM_TABLE_DISCRETE_INPUTS == field::DISCRETE_INPUTS);
    assert!(MBM_TABLE_HOLDING_REGISTERS == field::HOLDING_REGISTERS);
    assert!(MBM_TABLE_INPUT_REGISTERS == field::INPUT_REGISTERS);
    assert!(MBM_TYPE_BIT == field::BIT);
    assert!(MBM_TYPE_UINT16 == field::UINT16);
    assert!(MBM_TYPE_INT16 == field::INT16);
    assert!(MBM_TYPE_UINT32 == field::UINT32);
    assert!(MBM_TYPE_INT32 == field::INT32);
    assert!(MBM_TYPE_UINT64 == field::UINT64);
    assert!(MBM_TYPE_INT64 == field::INT64);
    assert!(MBM_TYPE_FLOAT == field::FLOAT);
    assert!(MBM_TYPE_DOUBLE == field::DOUBLE);
    assert!(MBM_TYPE_TEXT == field::TEXT);
    assert!(MBM_TYPE_REGISTERS == field::REGISTERS);
    assert!(MBM_PLAN_LONGEST_INTERVAL == field::LONGEST_INTERVAL_MS);
    assert!(MBM_PLAN_MAX_FIELDS as usize == mbm::plan::group::MAX_FIELDS);
};

/// A plan: a table of fields that a client reads from units again and again.
///
/// You own the storage. Initialise it with MBM_INIT. Call mbm_plan_begin first. Use it from
/// the thread that uses its client, and never from an interrupt. It stays where it is until
/// mbm_plan_end.
#[repr(C)]
pub struct mbm_plan {
    /// Private.
    pointers: [*mut c_void; 3],
    /// Private.
    words: [u32; 4],
}
