//! The arguments of a plan in C: its table, its limits and its storage.

use super::mbm_plan;
use crate::client::mbm_clientRequest;
use crate::pointers::In;
use core::ffi::c_void;
use core::mem::offset_of;
use core::slice::from_raw_parts;

use mbm::plan::schedule::Backoff;
use mbm::plan::{ExcludedRange, Field, Position, Read, ReadLimits, UnitLimits};

/// A field of a plan: a value, or several of one type in a row, that a program wants from a
/// unit again and again. A table of them may be constant.
#[repr(C)]
pub struct mbm_planField {
    /// The unit, 1 to 255; in TCP frames also 0. mbm_plan_begin refuses any other number.
    pub unit: u16,
    /// One of MBM_TABLE_...
    pub table: u8,
    /// One of MBM_TYPE_...: MBM_TYPE_BIT for coils and discrete inputs, each for registers.
    /// MBM_TYPE_BIT of a register is `count` of its bits from `bit` on, as one number.
    pub r#type: u8,
    /// One of MBM_ORDER_...; MBM_ORDER_DEFAULT is MBM_ORDER_ABCD.
    pub order: u8,
    /// For MBM_TYPE_BIT in a table of registers: the lowest bit, 0 (the least significant) to 15.
    /// Otherwise 0.
    pub bit: u8,
    /// The first bit or register, 0 to 65535, as on the wire.
    pub address: u16,
    /// The number of values, of the characters of a text, of the bits of a register, or of the
    /// registers of MBM_TYPE_REGISTERS. 0 means 1.
    pub count: u16,
    /// The time from one read to the next in milliseconds, 1 to MBM_PLAN_LONGEST_INTERVAL.
    pub intervalMs: u32,
    /// mbm_plan_getNumber, mbm_plan_getInteger and mbm_plan_getInt32 multiply by this; 0 means 1.
    /// It is 0 for a text and for MBM_TYPE_REGISTERS.
    pub multiplier: i32,
    /// They divide by this after that; 0 means 1. It must not be negative, and must be 0 for a
    /// text and for MBM_TYPE_REGISTERS.
    pub divisor: i32,
}

/// How much one read of a unit may request, if not as much as the plan's other reads.
#[repr(C)]
pub struct mbm_planUnitLimits {
    /// Bits, 1 to 2000; 0 means as `bitsPerRead` of the plan.
    pub bitsPerRead: u16,
    /// Registers, 1 to 125; 0 means as `registersPerRead` of the plan.
    pub registersPerRead: u16,
    /// The unit, 0 to 255. mbm_plan_begin refuses a greater number.
    pub unit: u16,
}

/// Addresses that no read of a plan may touch.
#[repr(C)]
pub struct mbm_planExcludedRange {
    /// The first address.
    pub first: u16,
    /// The last address, not less than `first`.
    pub last: u16,
    /// The unit, 1 to 255; 0 for every unit. mbm_plan_begin refuses a greater number.
    pub unit: u16,
    /// One of MBM_TABLE_...
    pub table: u8,
}

/// Storage of a plan, one for each field.
#[repr(C)]
pub struct mbm_planPosition {
    /// Private.
    words: [u32; 2],
}

/// Storage of a plan, one for each read.
#[repr(C)]
pub struct mbm_planRead {
    /// Private.
    words: [u32; 8],
}

/// The parts of a plan. The struct may be constant. It must stay valid and unchanged, with
/// everything that it points to, for as long as the plan is used.
#[repr(C)]
pub struct mbm_planSetup {
    /// The fields, in any order.
    pub fields: *const mbm_planField,
    /// Storage: as many as fields.
    pub positions: *mut mbm_planPosition,
    /// Storage: as many as reads; there are never more reads than fields.
    pub reads: *mut mbm_planRead,
    /// Storage: the registers of all reads and the bits of all reads, 16 to a word.
    pub data: *mut u16,
    /// Storage: the requests with which the plan reads, initialised with MBM_INIT; they are the
    /// plan's alone. With one it sends one read after the other; more are for Modbus TCP, where
    /// several may be in flight at once.
    pub requests: *mut mbm_clientRequest,
    /// Units with limits of their own; NULL for none.
    pub units: *const mbm_planUnitLimits,
    /// Addresses that no read may touch; NULL for none.
    pub excluded: *const mbm_planExcludedRange,
    /// Optional: called by mbm_plan_poll for each field of a read that has ended, and for each
    /// field of a unit that the plan takes for silent. It may call every function on the plan
    /// and on the client.
    pub update: Option<unsafe extern "C" fn(context: *mut c_void, plan: *mut mbm_plan, field: u16)>,
    /// Handed to `update`. Yours, may be NULL.
    pub context: *mut c_void,
    /// How long the plan leaves a unit alone after a first request without an answer, in
    /// milliseconds; each further one doubles it. 0 means 1000.
    pub backoffMs: u32,
    /// The longest such time in milliseconds; 0 means 60000.
    pub longestBackoffMs: u32,
    /// How many fields, 1 to MBM_PLAN_MAX_FIELDS.
    pub fieldCount: u16,
    /// How many reads there is storage for.
    pub readCount: u16,
    /// How many words there are in `data`.
    pub dataWords: u16,
    /// The most bits that one read requests, 1 to 2000; 0 means 2000.
    pub bitsPerRead: u16,
    /// The most bits between two fields that one read may cover as well.
    pub bitGap: u16,
    /// The most registers that one read requests, 1 to 125; 0 means 125.
    pub registersPerRead: u16,
    /// The most registers between two fields that one read may cover as well.
    pub registerGap: u16,
    /// How many requests, 1 to 16.
    pub requestCount: u8,
    /// How many units with limits of their own.
    pub unitCount: u8,
    /// How many excluded ranges.
    pub excludedCount: u8,
}

const _: () = {
    assert!(size_of::<mbm_planField>() == size_of::<Field>());
    assert!(align_of::<mbm_planField>() == align_of::<Field>());
    assert!(offset_of!(mbm_planField, r#type) == offset_of!(Field, value_type));
    assert!(offset_of!(mbm_planField, bit) == offset_of!(Field, bit));
    assert!(offset_of!(mbm_planField, address) == offset_of!(Field, address));
    assert!(offset_of!(mbm_planField, count) == offset_of!(Field, count));
    assert!(offset_of!(mbm_planField, intervalMs) == offset_of!(Field, interval_ms));
    assert!(offset_of!(mbm_planField, multiplier) == offset_of!(Field, multiplier));
    assert!(offset_of!(mbm_planField, divisor) == offset_of!(Field, divisor));
    assert!(size_of::<mbm_planUnitLimits>() == size_of::<UnitLimits>());
    assert!(offset_of!(mbm_planUnitLimits, unit) == offset_of!(UnitLimits, unit));
    assert!(size_of::<mbm_planExcludedRange>() == size_of::<ExcludedRange>());
    assert!(offset_of!(mbm_planExcludedRange, table) == offset_of!(ExcludedRange, table));
    assert!(size_of::<mbm_planPosition>() == size_of::<Position>());
    assert!(align_of::<mbm_planPosition>() >= align_of::<Position>());
    assert!(size_of::<mbm_planRead>() == size_of::<Read>());
    assert!(align_of::<mbm_planRead>() >= align_of::<Read>());
};

/// True if a unit may have this identifier.
fn is_unit(unit: u16) -> bool {
    unit <= u8::MAX.into()
}

impl mbm_planSetup {
    /// True if every pointer that must be there is, and the number of requests is in range.
    pub(super) fn is_complete(&self) -> bool {
        !self.fields.is_null()
            && !self.positions.is_null()
            && !self.reads.is_null()
            && !self.data.is_null()
            && !self.requests.is_null()
            && self.requestCount.wrapping_sub(1) < crate::client::MBM_CLIENT_DEPTH
    }

    /// True if the limits are there, and each is of a unit that may exist.
    pub(super) fn has_limits(&self) -> bool {
        (!self.units.is_null() || self.unitCount == 0)
            && (!self.excluded.is_null() || self.excludedCount == 0)
            && self.units().iter().all(|limits| is_unit(limits.unit))
            && self.excluded().iter().all(|range| is_unit(range.unit))
    }

    pub(super) fn backoff(&self) -> Backoff {
        let or = |value: u32, default| if value == 0 { default } else { value };
        let longest = or(self.longestBackoffMs, 60_000);
        Backoff {
            first_ms: or(self.backoffMs, 1000),
            longest_ms: longest.min(super::MBM_PLAN_LONGEST_INTERVAL),
        }
    }

    /// The fields.
    ///
    /// # Safety
    /// The program passed this setup to mbm_plan_begin, whose comment demands arrays of these
    /// lengths, and it is complete.
    pub(super) unsafe fn fields<'a>(&self) -> &'a [Field] {
        // The types of C and of the core have the same layout.
        from_raw_parts(self.fields.cast(), self.fieldCount.into())
    }
}

impl ReadLimits for mbm_planSetup {
    fn bits(&self) -> u16 {
        self.bitsPerRead
    }

    fn registers(&self) -> u16 {
        self.registersPerRead
    }

    fn bit_gap(&self) -> u16 {
        self.bitGap
    }

    fn register_gap(&self) -> u16 {
        self.registerGap
    }

    fn units(&self) -> &[UnitLimits] {
        // SAFETY: as above.
        unsafe { In::new(self.units.cast()).slice_or_empty(self.unitCount.into()) }
    }

    fn excluded(&self) -> &[ExcludedRange] {
        // SAFETY: as above.
        unsafe { In::new(self.excluded.cast()).slice_or_empty(self.excludedCount.into()) }
    }
}
