//! `mbm_registers_*`: received words or bytes as values, and values into what
//! is to be sent.

mod get;
mod set;

pub use get::*;
pub use set::*;

use super::pointers;
use core::ffi::c_void;
use mbm::data::order::Order;
use mbm::data::view::{RegisterBytes, RegisterBytesMut, Registers};
use mbm::error::Status;

/// The order of the registers that a function is given; in these, MBM_ORDER_ABCD.
pub const MBM_ORDER_DEFAULT: u8 = 0;
/// High word first, high byte first: what most devices do. A is the most
/// significant byte; 2923517522, which is 0xAE415652, arrives as AE41 5652.
pub const MBM_ORDER_ABCD: u8 = 1;
/// Low word first, high byte first: 5652 AE41.
pub const MBM_ORDER_CDAB: u8 = 2;
/// High word first, low byte first: 41AE 5256.
pub const MBM_ORDER_BADC: u8 = 3;
/// Low word first, low byte first: 5256 41AE.
pub const MBM_ORDER_DCBA: u8 = 4;

/// mbm_registers.kind: words to read, as those of mbm_master.
pub const MBM_REGISTERS_OF_WORDS: u8 = 1;
/// mbm_registers.kind: bytes to read, high byte first.
pub const MBM_REGISTERS_OF_BYTES: u8 = 2;
/// mbm_registers.kind: words to write and to read.
pub const MBM_REGISTERS_INTO_WORDS: u8 = 3;
/// mbm_registers.kind: bytes to write and to read, high byte first.
pub const MBM_REGISTERS_INTO_BYTES: u8 = 4;

/// Registers in a row, seen as values by the addresses that the device gives
/// them. It owns nothing: what `data` points to is the caller's.
///
/// One of the functions mbm_registers_of... and mbm_registers_into... fills it
/// in, as do mbm_master_getResponseRegisters and mbm_master_getTransmitRegisters;
/// each field may be set by hand too. Functions that get or set do not change
/// it, so any thread may use it beside others that only get.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_registers {
    /// The words or bytes, as `kind` says. NULL: none, MBM_NOT_INITIALISED.
    pub data: *const c_void,
    /// The device's address of the first register.
    pub first: u16,
    /// How many registers there are; `first + count` is 65536 at most.
    pub count: u16,
    /// One of MBM_REGISTERS_...
    pub kind: u8,
    /// One of MBM_ORDER_..., for calls that say MBM_ORDER_DEFAULT.
    pub order: u8,
}

/// The order that a call names, or `default` where it names none.
pub(super) fn order(code: u8, default: Order) -> Result<Order, Status> {
    match code {
        MBM_ORDER_DEFAULT => Ok(default),
        MBM_ORDER_ABCD => Ok(Order::Abcd),
        MBM_ORDER_CDAB => Ok(Order::Cdab),
        MBM_ORDER_BADC => Ok(Order::Badc),
        MBM_ORDER_DCBA => Ok(Order::Dcba),
        _ => Err(Status::INVALID_ARGUMENT),
    }
}

fn code(result: Result<(), Status>) -> u8 {
    result.err().unwrap_or(Status::OK).code()
}

/// The registers of an `mbm_registers`, as bytes in the order of the wire.
struct BorrowedRegisters {
    bytes: *mut u8,
    length: usize,
    /// 1 where words have their low byte first, so that each two bytes have
    /// changed places.
    swapped: usize,
}

// SAFETY, here and below: [`lent`] was promised so many bytes, which nobody
// else uses meanwhile; one beyond them is not touched.
impl RegisterBytes for BorrowedRegisters {
    fn length(&self) -> usize {
        self.length
    }

    fn byte(&self, place: usize) -> Option<u8> {
        // SAFETY: see above; both bytes of a register are there, or none.
        (place < self.length).then(|| unsafe { *self.bytes.add(place ^ self.swapped) })
    }
}

impl RegisterBytesMut for BorrowedRegisters {
    fn set_byte(&mut self, place: usize, value: u8) {
        if place < self.length {
            // SAFETY: see above; lent to write, as the kind says.
            unsafe { *self.bytes.add(place ^ self.swapped) = value };
        }
    }
}

/// The registers behind a pointer, their values in the order of this call.
///
/// # Safety
/// `registers` is NULL or points to an `mbm_registers`, whose data, unless NULL,
/// is what its other fields say; nobody else uses that while the result lives.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn lent(
    registers: *const mbm_registers,
    call: u8,
    to_write: bool,
) -> Result<Registers<BorrowedRegisters>, Status> {
    // SAFETY: as the caller promises.
    let fields = unsafe { pointers::get(registers) }.ok_or(Status::INVALID_ARGUMENT)?;
    if fields.data.is_null() {
        return Err(Status::NOT_INITIALISED);
    }
    let words = match fields.kind {
        MBM_REGISTERS_INTO_WORDS => true,
        MBM_REGISTERS_INTO_BYTES => false,
        MBM_REGISTERS_OF_WORDS if !to_write => true,
        MBM_REGISTERS_OF_BYTES if !to_write => false,
        _ => return Err(Status::INVALID_ARGUMENT),
    };
    let own = order(fields.order, Order::Abcd)?;
    let cells = BorrowedRegisters {
        bytes: fields.data.cast_mut().cast(),
        length: usize::from(fields.count).saturating_mul(2),
        swapped: (words && cfg!(target_endian = "little")).into(),
    };
    Registers::new(cells, fields.first, order(call, own)?)
}

/// What the places of a number's bytes on this machine differ by from those of
/// the bytes with the most significant first.
const fn native(size: usize) -> usize {
    if cfg!(target_endian = "little") {
        size - 1
    } else {
        0
    }
}

/// Fills a view in; one that cannot be is left without data.
///
/// # Safety
/// `registers` is NULL or points to an `mbm_registers`, which may be anything.
unsafe fn fill(
    registers: *mut mbm_registers,
    data: *const c_void,
    kind: u8,
    count: u16,
    first: u16,
) -> u8 {
    if registers.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    let status = if data.is_null() {
        Status::INVALID_ARGUMENT
    } else if count > 1 && count - 1 > u16::MAX - first {
        Status::ILLEGAL_DATA_ADDRESS
    } else {
        Status::OK
    };
    let data = if status == Status::OK {
        data
    } else {
        core::ptr::null()
    };
    let order = MBM_ORDER_ABCD;
    // SAFETY: not NULL, so room for a view.
    unsafe {
        registers.write(mbm_registers {
            data,
            first,
            count,
            kind,
            order,
        })
    };
    status.code()
}

/// Sees words that were read as registers, in order MBM_ORDER_ABCD until
/// `registers->order` is set. Copies nothing: it sees what the words are then.
///
/// @param registers  the view to fill in
/// @param words      words as mbm_master's response words; valid while it is used
/// @param count      how many words
/// @param first      the device's address of the first, 0 to 65535
/// @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS if they pass address 65535, or
///         MBM_INVALID_ARGUMENT for a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_ofWords(
    registers: *mut mbm_registers,
    words: *const u16,
    count: u16,
    first: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        fill(
            registers,
            words.cast(),
            MBM_REGISTERS_OF_WORDS,
            count,
            first,
        )
    }
}

/// As mbm_registers_ofWords, of the data bytes of a reply or a request.
///
/// @param registers  the view to fill in
/// @param bytes      register bytes, each high byte first (V1.1b3, 4.2); valid
///                   while it is used
/// @param length     how many bytes, an even number
/// @param first      the device's address of the first register, 0 to 65535
/// @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS if they pass address 65535, or
///         MBM_INVALID_ARGUMENT for a NULL pointer or odd bytes
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_ofBytes(
    registers: *mut mbm_registers,
    bytes: *const u8,
    length: u16,
    first: u16,
) -> u8 {
    let bytes = if length.is_multiple_of(2) {
        bytes
    } else {
        core::ptr::null()
    };
    // SAFETY: as the header demands.
    unsafe {
        fill(
            registers,
            bytes.cast(),
            MBM_REGISTERS_OF_BYTES,
            length / 2,
            first,
        )
    }
}

/// As mbm_registers_ofWords, of words that are also written, such as
/// mbm_master's transmit words.
///
/// @param registers  the view to fill in
/// @param words      words to write; valid while it is used
/// @param count      how many words
/// @param first      the device's address of the first, 0 to 65535
/// @return as mbm_registers_ofWords
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_intoWords(
    registers: *mut mbm_registers,
    words: *mut u16,
    count: u16,
    first: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        fill(
            registers,
            words.cast(),
            MBM_REGISTERS_INTO_WORDS,
            count,
            first,
        )
    }
}

/// As mbm_registers_ofBytes, of bytes that are also written.
///
/// @param registers  the view to fill in
/// @param bytes      register bytes to write; valid while it is used
/// @param length     how many bytes, an even number
/// @param first      the device's address of the first register, 0 to 65535
/// @return as mbm_registers_ofBytes
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_intoBytes(
    registers: *mut mbm_registers,
    bytes: *mut u8,
    length: u16,
    first: u16,
) -> u8 {
    let bytes = if length.is_multiple_of(2) {
        bytes
    } else {
        core::ptr::null_mut()
    };
    // SAFETY: as the header demands.
    unsafe {
        fill(
            registers,
            bytes.cast(),
            MBM_REGISTERS_INTO_BYTES,
            length / 2,
            first,
        )
    }
}
