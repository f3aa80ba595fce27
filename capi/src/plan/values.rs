//! The values of a plan, how old they are, and its reads.

use super::mbm_plan;
use super::object::{time, Object};
use crate::pointers::{self, Out};
use crate::registers::{mbm_registers, MBM_REGISTERS_OF_WORDS};
use core::ffi::c_char;
use core::mem::MaybeUninit;
use core::slice::from_raw_parts;
#[cfg(target_arch = "avr")]
use mbm::data::value::{ShortDouble, Value as _};
use mbm::error::{Error, Status};
use mbm::plan::value::{place, Words};
use mbm::plan::{Field, Position, Read};

/// A read of a plan: one request that it repeats.
#[repr(C)]
pub struct mbm_planReadInfo {
    /// The time from one read to the next, in milliseconds.
    pub intervalMs: u32,
    /// The first bit or register, as on the wire.
    pub address: u16,
    /// How many bits or registers.
    pub quantity: u16,
    /// The unit.
    pub unit: u8,
    /// One of MBM_TABLE_...
    pub table: u8,
    /// How it ended last; MBM_PENDING before it has ended once.
    pub status: u8,
}

/// A field of a plan, and its read.
pub(super) struct Found<'a> {
    object: *mut Object,
    field: &'a Field,
    pub(super) read: &'a Read,
}

/// Finds a field. Returns [`Status::OK`] with `found` set, or says why not.
#[inline(always)]
pub(super) unsafe fn find(
    plan: *const mbm_plan,
    field: u16,
    found: &mut MaybeUninit<Found>,
) -> Status {
    // Every field has a position and a read.
    match pointers::check(plan) {
        Status::OK => {}
        refused => return refused,
    }
    let object = pointers::object(plan);
    let setup = (*object).setup();
    if field >= setup.fieldCount {
        return Status::INVALID_ARGUMENT;
    }
    let position: *const Position = setup.positions.add(field.into()).cast();
    let read: *const Read = setup.reads.add((*position).read()).cast();
    found.write(Found {
        object,
        field: &*setup.fields.add(field.into()).cast(),
        read: &*read,
    });
    Status::OK
}

/// Finds the words of a field that has a value. Without a value it returns the status of the
/// field.
///
/// # Safety
/// Nothing changes the data while `words` lives.
pub(super) unsafe fn find_words(
    plan: *const mbm_plan,
    field: u16,
    index: u16,
    words: &mut MaybeUninit<Words>,
) -> Status {
    // The data of a read lie within the plan's words.
    let mut found = MaybeUninit::uninit();
    match find(plan, field, &mut found) {
        Status::OK => {}
        refused => return refused,
    }
    let Found {
        object,
        field,
        read,
    } = found.assume_init();
    if !read.has_data() {
        return read.status();
    }
    let (first, before) = match place(field, read.address, index) {
        Ok(place) => place,
        Err(refused) => return refused.status(),
    };
    let data = (*object).setup().data.add((read.offset + first).into());
    words.write(Words {
        words: from_raw_parts(data, (read.words() - first).into()),
        before,
        field,
    });
    Status::OK
}

/// Finds something in the words of a field and puts it where C wants it. Without a value it is
/// refused with the status of the field.
unsafe fn get<T>(
    plan: *const mbm_plan,
    field: u16,
    index: u16,
    place: Out<T>,
    find: impl FnOnce(&Words) -> Result<T, Error>,
) -> u8 {
    let mut words = MaybeUninit::uninit();
    let result = place.put_result(|| {
        find_words(plan, field, index, &mut words).result()?;
        find(words.assume_init_ref())
    });
    Status::from(result).code()
}

/// How the last read of a field ended, and how old its value is. The functions that get a value
/// return the last one that was read, also after a read has failed: this function says how old
/// that value is.
///
/// @param field  the index of the field
/// @param ageMs  gets the milliseconds since the value arrived, 2147483647 (24 days) at most;
///               0xFFFFFFFF if none ever did; may be NULL
/// @return MBM_PENDING before the first read has ended, then as it ended: MBM_OK, an exception of
///         the device, or a failure such as MBM_RESPONSE_TIMED_OUT
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_getStatus(
    plan: *mut mbm_plan,
    field: u16,
    ageMs: Out<u32>,
) -> u8 {
    let mut found = MaybeUninit::uninit();
    match find(plan, field, &mut found) {
        Status::OK => {}
        refused => return refused.code(),
    }
    let Found { object, read, .. } = found.assume_init();
    let now = time(object);
    ageMs.put(if read.has_data() {
        read.age(now)
    } else {
        u32::MAX
    });
    read.status().code()
}

/// A double of C, as its bits.
#[cfg(not(target_arch = "avr"))]
pub(super) fn double(bits: u64) -> u64 {
    bits
}

/// A double of C, which is a float here.
#[cfg(target_arch = "avr")]
pub(super) fn double(bits: u64) -> f32 {
    ShortDouble::from_bytes(bits.to_be_bytes()).0
}

functions! {
    (plan: *const mbm_plan)

    /// A value as an integer: multiplied and divided as its field says, rounded to the nearest,
    /// halves away from 0.
    ///
    /// @param field  the index of the field, of a bit or an integer
    /// @param index  which of its values, 0 for the first
    /// @param value  gets the number
    /// @return a status; MBM_OUT_OF_RANGE if it is not in the range of `value`; MBM_INVALID_ARGUMENT
    ///         for a float, a text or MBM_TYPE_REGISTERS; if no value has arrived yet the status that
    ///         mbm_plan_getStatus returns
    fn mbm_plan_getInteger(field: u16, index: u16, value: Out<i64>)
        = get(field, index, value, |words| words.integer());

    /// As mbm_plan_getInteger, but with 32 bits throughout: less code on a microcontroller.
    ///
    /// @param field  the index of the field, of a bit or of an integer of 16 or 32 bits
    /// @return as mbm_plan_getInteger; MBM_OUT_OF_RANGE also if the value, multiplied, plus half of the
    ///         divisor is not less than 2^32; MBM_INVALID_ARGUMENT also for an integer of 64 bits
    fn mbm_plan_getInt32(field: u16, index: u16, value: Out<i32>)
        = get(field, index, value, |words| words.int32());

    /// A bit, an integer or a float as a double: multiplied and divided as its field says, and
    /// rounded once, to the nearest. On AVR, where C's double has 32 bits, it is rounded to these after
    /// that.
    ///
    /// @param value  gets the number; a float that is infinite or not a number stays so
    /// @return as mbm_plan_getInteger; MBM_INVALID_ARGUMENT only for a text or
    ///         MBM_TYPE_REGISTERS
    fn mbm_plan_getNumber(field: u16, index: u16, value: Out<f64>)
        = get(field, index, value.cast(), |words| words.number().map(double));

    /// A value of type MBM_TYPE_FLOAT, whose bits are copied, or MBM_TYPE_DOUBLE, which is rounded
    /// to the nearest; without the scale of its field.
    ///
    /// @return as mbm_plan_getInteger; MBM_INVALID_ARGUMENT for other types
    fn mbm_plan_getFloat(field: u16, index: u16, value: Out<f32>)
        = get(field, index, value.cast(), |words| words.float());
}

/// A text, which ends at its first NUL or with its field. In an order with the low byte first,
/// the first of two characters is a register's low byte.
///
/// @param field     the index of the field, of type MBM_TYPE_TEXT
/// @param text      gets the text and a NUL
/// @param capacity  bytes of `text`; the field's count and one are always enough
/// @return as mbm_plan_getInteger; MBM_BUFFER_TOO_SMALL if the text does not fit
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_getText(
    plan: *const mbm_plan,
    field: u16,
    text: Out<c_char>,
    capacity: u16,
) -> u8 {
    if text.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    let copy = |words: &Words| {
        let text = text.cast::<u8>().slice(capacity.into())?;
        let (end, place) = text.split_last_mut().ok_or(Error::BufferTooSmall)?;
        let count = words.text(place)?;
        *place.get_mut(count).unwrap_or(end) = 0;
        Ok(())
    };
    let mut words = MaybeUninit::uninit();
    match find_words(plan, field, 0, &mut words) {
        Status::OK => Status::from(copy(words.assume_init_ref())).code(),
        refused => refused.code(),
    }
}

/// The registers of a field as they were read, for mbm_registers_get... functions, in the order
/// of the field. It copies nothing: the next reply changes the words that it shows.
///
/// @param field      the index of the field, of registers
/// @param registers  the view to fill in
/// @return as mbm_plan_getInteger
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_getRegisters(
    plan: *const mbm_plan,
    field: u16,
    registers: Out<mbm_registers>,
) -> u8 {
    get(plan, field, 0, registers, |words| {
        if words.field.is_in_bits() {
            return Err(Error::InvalidArgument);
        }
        Ok(mbm_registers {
            data: words.words.as_ptr().cast(),
            first: words.field.address,
            count: words.field.length() as u16,
            kind: MBM_REGISTERS_OF_WORDS,
            order: words.field.order,
        })
    })
}

/// Makes the read of a field due at once, for a value that is wanted now. A unit that does not
/// answer is left alone all the same.
///
/// @param field  the index of the field
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_refresh(plan: *mut mbm_plan, field: u16) -> u8 {
    let mut found = MaybeUninit::uninit();
    match find(plan, field, &mut found) {
        Status::OK => {}
        refused => return refused.code(),
    }
    let Found { object, read, .. } = found.assume_init();
    if pointers::check((*object).client) == Status::BUSY {
        return Status::BUSY.code();
    }
    let now = time(object);
    let reads = (*object).reads();
    (*object).schedule.hasten(reads, read, now);
    Status::OK.code()
}

/// The reads that the plan has made of the fields: one request each.
///
/// @param index  0 for the first read
/// @param read   gets the read
/// @return a status; MBM_INVALID_ARGUMENT after the last read
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_getRead(
    plan: *const mbm_plan,
    index: u16,
    read: Out<mbm_planReadInfo>,
) -> u8 {
    let find = || {
        pointers::check(plan).result()?;
        let own = (*pointers::object(plan)).reads().get(usize::from(index));
        let own = own.ok_or(Error::InvalidArgument)?;
        Ok(mbm_planReadInfo {
            intervalMs: own.interval_ms,
            address: own.address,
            quantity: own.quantity,
            unit: own.unit,
            table: own.table,
            status: own.status().code(),
        })
    };
    let found = read.put_result(find);
    Status::from(found).code()
}
