//! Values with an offset, with a power of ten that the device holds, and values that are not
//! available: of a plan, or of registers that a program has read in another way.

use super::mbm_plan;
use super::setup::mbm_planField;
use super::values::{double, find, find_words};
use crate::pointers::{In, Out};
use crate::registers::{mbm_registers, view, MBM_ORDER_DEFAULT};
use core::mem::MaybeUninit;
use mbm::data::order::Order;
use mbm::error::{Error, Status};
use mbm::plan::conversion::{power, Conversion};
use mbm::plan::field::TEXT;
use mbm::plan::value::{place, Words};
use mbm::plan::Field;

/// mbm_planConversion.flags: the number that SunSpec reserves in the type of the field means "not
/// available": 0x8000 of MBM_TYPE_INT16, 0xFFFF of MBM_TYPE_UINT16, the numbers like them of 32 and
/// 64 bits; of a text that all its registers are 0.
pub const MBM_CONVERSION_STANDARD: u8 = 1;
/// mbm_planConversion.flags: `powerField` has the power of ten.
pub const MBM_CONVERSION_POWER: u8 = 2;

/// What the numbers of a field mean, beyond what mbm_planField says of it: the value is number *
/// multiplier / divisor * 10^power + offset, or it is not available. A float that is not a number
/// is not available even without a conversion. A struct of zeros changes nothing else.
///
/// It may be constant. A program that calls no function with a conversion does not contain them.
#[repr(C)]
pub struct mbm_planConversion {
    /// The numbers that mean "not available", as the bits that the registers have in
    /// MBM_ORDER_ABCD: each has as many words as a value of the field has registers, the most
    /// significant first. Of bits of a register each is the number that these bits are. NULL if
    /// `notAvailableCount` is 0. A text has none.
    pub notAvailable: *const u16,
    /// Is added, times 10^-`offsetDecimals`: -27315 with 2 decimals is -273.15.
    pub offset: i32,
    /// With MBM_CONVERSION_POWER: the index of the field that has the power of ten. That field has
    /// an integer, the same unit, and no scale. If its number is not -10 to 10, the value is not
    /// available.
    pub powerField: u16,
    /// How many words there are in `notAvailable`: for a type of two registers twice as many as
    /// numbers.
    pub notAvailableCount: u16,
    /// 0 to 9.
    pub offsetDecimals: u8,
    /// MBM_CONVERSION_..., added.
    pub flags: u8,
}

/// What a conversion says of a field by itself, and its power field.
fn conversion<'a>(from: In<mbm_planConversion>) -> Result<(Conversion<'a>, Option<u16>), Error> {
    let Some(from) = from.value() else {
        return Ok((Conversion::default(), None));
    };
    // SAFETY: C filled in the conversion as its comment says.
    let not_available = unsafe { In::new(from.notAvailable) };
    let conversion = Conversion {
        not_available: not_available.slice(from.notAvailableCount.into())?,
        is_standard: from.flags & MBM_CONVERSION_STANDARD != 0,
        offset: from.offset,
        offset_decimals: from.offsetDecimals,
    };
    let has_power = from.flags & MBM_CONVERSION_POWER != 0;
    Ok((conversion, has_power.then_some(from.powerField)))
}

/// The power of ten that a field of a plan holds for another one.
unsafe fn power_of(plan: *const mbm_plan, field: u16, of: u16) -> Result<i8, Error> {
    let (mut own, mut other) = (MaybeUninit::uninit(), MaybeUninit::uninit());
    find(plan, field, &mut own).result()?;
    find(plan, of, &mut other).result()?;
    let (own, other) = (own.assume_init().read, other.assume_init().read);
    // A power that failed to arrive lately is not used for a number that did arrive. (In one read
    // both have its status.)
    let is_late = own.status() != Status::OK && other.status() == Status::OK;
    let mut words = MaybeUninit::uninit();
    if is_late || !own.has_data() {
        return Err(Error::NotAvailable);
    }
    find_words(plan, field, 0, &mut words).result()?;
    power(words.assume_init_ref())
}

/// Finds a value of a plan and puts it where C wants it.
unsafe fn get<T>(
    plan: *const mbm_plan,
    field: u16,
    index: u16,
    from: In<mbm_planConversion>,
    place: Out<T>,
    get: impl FnOnce(&Words, &Conversion, i8) -> Result<T, Error>,
) -> u8 {
    let result = place.put_result(|| {
        let mut words = MaybeUninit::uninit();
        find_words(plan, field, index, &mut words).result()?;
        let (conversion, power_field) = conversion(from)?;
        let power = match power_field {
            Some(of) => power_of(plan, of, field)?,
            None => 0,
        };
        get(words.assume_init_ref(), &conversion, power)
    });
    Status::from(result).code()
}

/// Finds a value in registers and puts it where C wants it.
fn find_in<T>(
    registers: In<mbm_registers>,
    fields: In<mbm_planField>,
    field: u16,
    index: u16,
    from: In<mbm_planConversion>,
    place: Out<T>,
    get: impl FnOnce(&Words, &Conversion, i8) -> Result<T, Error>,
) -> u8 {
    let result = place.put_result(|| {
        fields.required()?;
        let (conversion, power_field) = conversion(from)?;
        let power = match power_field {
            Some(of) => with_words(registers, fields, of, 0, power)?,
            None => 0,
        };
        with_words(registers, fields, field, index, |words| {
            get(words, &conversion, power)
        })
    });
    Status::from(result).code()
}

/// Calls `use_words` with the words of a value in registers.
fn with_words<T>(
    registers: In<mbm_registers>,
    fields: In<mbm_planField>,
    field: u16,
    index: u16,
    use_words: impl FnOnce(&Words) -> Result<T, Error>,
) -> Result<T, Error> {
    // SAFETY: the table has this field, as C says.
    let mut own: Field = unsafe { *fields.pointer().add(field.into()).cast() };
    own.check(1).result()?;
    if own.is_in_bits() {
        return Err(Error::InvalidArgument);
    }
    let (first, before) = place(&own, own.address, index)?;
    let view = view(registers, MBM_ORDER_DEFAULT, false)?;
    let mut words = [0; 4];
    let length = own.length() - u32::from(first);
    if own.value_type >= TEXT {
        // Only whether all of its registers are 0 counts.
        own.count = 1;
        for at in 0..length {
            words[0] |= view.get_in::<u16>(Order::Abcd, own.address + at as u16)?;
        }
    } else {
        for (at, word) in words.iter_mut().enumerate().take(length as usize) {
            *word = view.get_in(Order::Abcd, own.address + first + at as u16)?;
        }
    }
    use_words(&Words {
        words: &words,
        before,
        field: &own,
    })
}

functions! {
    (plan: *const mbm_plan)

    /// A value as a double, converted: with the multiplier and the divisor of its field, the power
    /// of ten and the offset, rounded once, to the nearest. On AVR, where C's double has 32 bits,
    /// it is rounded to these after that.
    ///
    /// The power and the number are of one reply if one read of the plan has both, as it has if
    /// they stand side by side with one interval.
    ///
    /// @param field       the index of the field, of a bit, an integer or a float
    /// @param index       which of its values, 0 for the first
    /// @param conversion  that of the field; NULL for none
    /// @param value       gets the number; a float that is infinite stays so
    /// @return a status; MBM_NOT_AVAILABLE if the device says that it has no value, if its power of
    ///         ten was never read, if that is not -10 to 10, or if the last read of the power
    ///         failed although that of the number did not; MBM_INVALID_ARGUMENT for a text or
    ///         MBM_TYPE_REGISTERS, and for a conversion that is not as it must be; if no value has
    ///         arrived yet the status that mbm_plan_getStatus returns
    fn mbm_plan_getConverted(
        field: u16, index: u16, conversion: In<mbm_planConversion>, value: Out<f64>
    ) = get(field, index, conversion, value.cast(), |words, with, power| {
        words.converted(with, power).map(double)
    });

    /// As mbm_plan_getConverted, as an integer: the value times 10^`decimals`, rounded to the
    /// nearest, halves away from 0. It needs no arithmetic on floats: less code on a
    /// microcontroller.
    ///
    /// @param field     the index of the field, of a bit or of an integer of 16 or 32 bits
    /// @param decimals  0 to 9: 21.5 is 215 with 1 decimal
    /// @return as mbm_plan_getConverted; MBM_OUT_OF_RANGE if the result, or a number on the way to
    ///         it, is too large: number * multiplier * 10^(power + decimals) must be below 2^64
    fn mbm_plan_getDecimal(
        field: u16, index: u16, conversion: In<mbm_planConversion>, decimals: u8, value: Out<i32>
    ) = get(field, index, conversion, value, |words, with, power| {
        words.decimal(with, power, decimals)
    });

    /// Whether the last value that was read is available: for a value that the program takes in
    /// another way, such as with mbm_plan_getInt32 or mbm_plan_getText.
    ///
    /// @param field  the index of the field, of any type
    /// @return MBM_OK or MBM_NOT_AVAILABLE, or another status as mbm_plan_getConverted
    fn mbm_plan_checkAvailable(field: u16, index: u16, conversion: In<mbm_planConversion>)
        = get(field, index, conversion, Out::from(&mut ()), |words, with, _| words.available(with));
}

functions! {
    safe (registers: In<mbm_registers>)

    /// As mbm_plan_getConverted, for registers that a program has read without a plan. On a
    /// Cortex-M it takes 420 bytes of stack.
    ///
    /// @param registers   the registers of the field, and of its power of ten
    /// @param fields      a table of fields, each as for mbm_plan_begin; they say where in the
    ///                    registers the numbers are; their unit does not count
    /// @param field       the index of the field in the table
    /// @param index       which of its values, 0 for the first
    /// @param conversion  that of the field; NULL for none
    /// @param value       gets the number
    /// @return as mbm_plan_getConverted; MBM_ILLEGAL_DATA_ADDRESS if `registers` lack one that is
    ///         needed; otherwise a status as mbm_plan_begin for the field; see mbm_registers
    fn mbm_registers_getConverted(
        fields: In<mbm_planField>, field: u16, index: u16, conversion: In<mbm_planConversion>,
        value: Out<f64>
    ) = find_in(fields, field, index, conversion, value.cast(), |words, with, power| {
        words.converted(with, power).map(double)
    });

    /// As mbm_plan_getDecimal, for registers that a program has read without a plan.
    ///
    /// @param decimals  0 to 9
    /// @return as mbm_registers_getConverted and mbm_plan_getDecimal
    fn mbm_registers_getDecimal(
        fields: In<mbm_planField>, field: u16, index: u16, conversion: In<mbm_planConversion>,
        decimals: u8, value: Out<i32>
    ) = find_in(fields, field, index, conversion, value, |words, with, power| {
        words.decimal(with, power, decimals)
    });

    /// As mbm_plan_checkAvailable, for registers that a program has read without a plan.
    ///
    /// @return MBM_OK or MBM_NOT_AVAILABLE, or another status as mbm_registers_getConverted
    fn mbm_registers_checkAvailable(
        fields: In<mbm_planField>, field: u16, index: u16, conversion: In<mbm_planConversion>
    ) = find_in(fields, field, index, conversion, Out::from(&mut ()), |words, with, _| words.available(with));
}
