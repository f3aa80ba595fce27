//! Gets and sets dates, and converts them to seconds.

use super::get::get_value;
use super::mbm_registers;
use super::set::with;
use crate::pointers::{In, Out};
use core::ffi::c_char;
use core::mem::offset_of;
use mbm::data::clock::Layout;
use mbm::data::date::{self, Date};
use mbm::error::{Error, Status};

/// A flag of mbm_date: the device's clock shows summer time. Only IEC 870-5-4 has it.
pub const MBM_DATE_SUMMER_TIME: u8 = 1;
/// A flag of mbm_date: the device says that its clock may be wrong. Only IEC 870-5-4 has it.
pub const MBM_DATE_UNRELIABLE: u8 = 2;

/// A date and a time of day, in the time zone of the device. If year, month and day are 0, a time
/// of day without a date.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_date {
    /// 1 to 9999.
    pub year: u16,
    /// 0 to 999.
    pub millisecond: u16,
    /// 1 to 12.
    pub month: u8,
    /// 1 to 31.
    pub day: u8,
    /// 0 to 23.
    pub hour: u8,
    /// 0 to 59.
    pub minute: u8,
    /// 0 to 59.
    pub second: u8,
    /// MBM_DATE_..., added up.
    pub flags: u8,
}

const _: () = {
    assert!(MBM_DATE_SUMMER_TIME == date::SUMMER_TIME);
    assert!(MBM_DATE_UNRELIABLE == date::UNRELIABLE);
    assert!(size_of::<mbm_date>() == size_of::<Date>());
    assert!(align_of::<mbm_date>() == align_of::<Date>());
    assert!(offset_of!(mbm_date, millisecond) == offset_of!(Date, millisecond));
    assert!(offset_of!(mbm_date, month) == offset_of!(Date, month));
    assert!(offset_of!(mbm_date, day) == offset_of!(Date, day));
    assert!(offset_of!(mbm_date, hour) == offset_of!(Date, hour));
    assert!(offset_of!(mbm_date, minute) == offset_of!(Date, minute));
    assert!(offset_of!(mbm_date, second) == offset_of!(Date, second));
    assert!(offset_of!(mbm_date, flags) == offset_of!(Date, flags));
};

/// The longest layout: 32 registers of two letters, and the spaces between them.
const LONGEST_LAYOUT: usize = 95;

fn layout_of<'a>(layout: In<c_char>, is_bcd: u8) -> Result<Layout<'a>, Error> {
    Layout::new(layout.cast().text(LONGEST_LAYOUT)?, is_bcd != 0)
}

functions! {
    safe (registers: In<mbm_registers>)

    /// Reads a date, or a time of day, from registers of which `layout` says what they hold. It has
    /// a letter for each register, or two for its high and low byte, and a space between two
    /// registers: "Y M D h m s" are six registers, "yM Dh ms" three.
    ///
    /// Y is the year, such as 2026, as a register; y the years since 2000; n those since 1900; C and
    /// y together the first and the last two digits of the year. M and D are month and day from 1
    /// on, h, m and s the time, and f, as a register, milliseconds. What - stands for is not read,
    /// and written as 0. A part that is missing is 0. Without year, month and day it is a time of
    /// day.
    ///
    /// @param address  the device's address of the first register
    /// @param order    one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`. The
    ///                 registers follow each other in every order; one with the low byte first swaps
    ///                 the bytes of each
    /// @param layout   what the registers hold, up to 95 characters
    /// @param isBcd    not 0 if the numbers are in BCD
    /// @param value    receives the date, without flags
    /// @return a status; see mbm_registers. MBM_MALFORMED_VALUE for a date that does not exist, or a
    ///         digit above 9
    fn mbm_registers_getDate(
        address: u16, order: u8, layout: In<c_char>, isBcd: u8, value: Out<mbm_date>
    ) = get_value(order, value.cast(), |registers| {
        registers.date(&layout_of(layout, isBcd)?, registers.order, address)
    });

    /// Writes a date, as mbm_registers_getDate reads it. Its flags do not count.
    ///
    /// @param value    the date
    /// @return as mbm_registers_setUint16; MBM_INVALID_ARGUMENT for a date that does not exist;
    ///         MBM_OUT_OF_RANGE for one that the layout cannot hold exactly
    fn mbm_registers_setDate(
        address: u16, order: u8, layout: In<c_char>, isBcd: u8, value: In<mbm_date>
    ) = with(order, |registers| {
        let date: Date = value.cast().get()?;
        registers.set_date(&layout_of(layout, isBcd)?, registers.order, address, &date)
    });

    /// Reads a date of IEC 870-5-4, with its flags, from three registers, or from four with
    /// milliseconds: DATETIME and TI081 of Schneider's devices. With MBM_ORDER_CDAB the first
    /// register is the last one.
    ///
    /// @param count    how many registers, 3 or 4
    /// @param value    receives the date, 2000 to 2127
    /// @return as mbm_registers_getDate
    fn mbm_registers_getIecDate(address: u16, count: u16, order: u8, value: Out<mbm_date>)
        = get_value(order, value.cast(), |registers| {
            registers.iec870_date(registers.order, address, count)
        });

    /// Writes a date, as mbm_registers_getIecDate reads it, with its flags and no day of the week.
    ///
    /// @param value    the date
    /// @return as mbm_registers_setDate
    fn mbm_registers_setIecDate(address: u16, count: u16, order: u8, value: In<mbm_date>)
        = with(order, |registers| {
            let date: Date = value.cast().get()?;
            registers.set_iec870_date(registers.order, address, count, &date)
        });
}

/// The seconds from 1970-01-01 00:00:00 to a date, as if both were in UTC. Milliseconds and flags do
/// not count.
///
/// @param date     the date; not a time of day alone
/// @param seconds  receives the number, below 0 before 1970
/// @return a status; MBM_INVALID_ARGUMENT for a date that does not exist
#[no_mangle]
pub extern "C" fn mbm_date_getSeconds(date: In<mbm_date>, seconds: Out<i64>) -> u8 {
    Status::from(seconds.put_result(|| date.cast::<Date>().get()?.seconds())).code()
}

/// Sets the date that is so many seconds after 1970-01-01 00:00:00, both in UTC.
///
/// @param date     receives the date, without milliseconds and flags
/// @param seconds  points to the number
/// @return a status; MBM_OUT_OF_RANGE before the year 1 and after 9999
#[no_mangle]
pub extern "C" fn mbm_date_setSeconds(date: Out<mbm_date>, seconds: In<i64>) -> u8 {
    Status::from(date.cast().put_result(|| Date::of_seconds(seconds.get()?))).code()
}
