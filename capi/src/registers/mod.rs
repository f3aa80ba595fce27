//! `mbm_registers_*`: reads values from received registers, and writes values into
//! registers to be sent.

mod date;
mod get;
mod set;
mod text_form;
mod types;

pub use date::*;
pub use get::*;
pub use set::*;
pub use text_form::*;
pub use types::*;

use super::pointers::{In, Out};
use core::ffi::c_void;
use mbm::data::order::Order;
use mbm::data::view::{RegisterBytes, RegisterBytesMut, Registers};
use mbm::error::{Error, Status};

/// Passed to a function: use the order of the mbm_registers. As that order itself:
/// MBM_ORDER_ABCD.
pub const MBM_ORDER_DEFAULT: u8 = 0;
/// High word first, high byte first, as most devices do. A is the most significant byte.
/// Example: 2923517522, which is 0xAE415652, is transmitted as AE41 5652 (hex).
pub const MBM_ORDER_ABCD: u8 = 1;
/// Low word first, high byte first. The example is transmitted as 5652 AE41.
pub const MBM_ORDER_CDAB: u8 = 2;
/// High word first, low byte first. The example is transmitted as 41AE 5256.
pub const MBM_ORDER_BADC: u8 = 3;
/// Low word first, low byte first. The example is transmitted as 5256 41AE.
pub const MBM_ORDER_DCBA: u8 = 4;
/// Four registers by halves: low half first, and within a half high word first, high byte first.
/// For a value of two registers it is MBM_ORDER_ABCD, which is such a half.
pub const MBM_ORDER_EFGHABCD: u8 = 5;
/// Four registers by halves: high half first, and within a half low word first, as MBM_ORDER_CDAB.
pub const MBM_ORDER_CDABGHEF: u8 = 6;
/// Four registers by halves: low half first, and within a half low byte first, as MBM_ORDER_BADC.
pub const MBM_ORDER_FEHGBADC: u8 = 7;
/// Four registers by halves: high half first, and within a half low word and low byte first, as
/// MBM_ORDER_DCBA.
pub const MBM_ORDER_DCBAHGFE: u8 = 8;

/// mbm_registers.kind: words that may only be read, for example the response words of
/// mbm_node.
pub const MBM_REGISTERS_OF_WORDS: u8 = 1;
/// mbm_registers.kind: bytes that may only be read, the high byte of each register first.
pub const MBM_REGISTERS_OF_BYTES: u8 = 2;
/// mbm_registers.kind: words that may be read and written.
pub const MBM_REGISTERS_INTO_WORDS: u8 = 3;
/// mbm_registers.kind: bytes that may be read and written, the high byte of each register
/// first.
pub const MBM_REGISTERS_INTO_BYTES: u8 = 4;

/// A view of consecutive registers, with the addresses that the device gives them. The
/// view owns nothing: `data` points to memory of the program.
///
/// mbm_registers_ofWords, ofBytes, intoWords and intoBytes fill the view in. You may also
/// set each field yourself. The get and set functions do not change the view. Several
/// threads may use one view at the same time as long as none of them writes the registers.
/// They return MBM_ILLEGAL_DATA_ADDRESS if a register that they need is not in the view.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_registers {
    /// The words or bytes; `kind` says which. If it is NULL, every function returns
    /// MBM_NOT_INITIALISED.
    pub data: *const c_void,
    /// The device's address of the first register.
    pub first: u16,
    /// How many registers; `first + count` is at most 65536.
    pub count: u16,
    /// One of MBM_REGISTERS_...
    pub kind: u8,
    /// One of MBM_ORDER_...: the order for calls with MBM_ORDER_DEFAULT.
    pub order: u8,
}

/// The order that a call names; `default` for MBM_ORDER_DEFAULT.
pub(super) fn order(code: u8, default: Order) -> Result<Order, Error> {
    match code {
        MBM_ORDER_DEFAULT => Ok(default),
        MBM_ORDER_ABCD => Ok(Order::Abcd),
        MBM_ORDER_CDAB => Ok(Order::Cdab),
        MBM_ORDER_BADC => Ok(Order::Badc),
        MBM_ORDER_DCBA => Ok(Order::Dcba),
        MBM_ORDER_EFGHABCD => Ok(Order::Efghabcd),
        MBM_ORDER_CDABGHEF => Ok(Order::Cdabghef),
        MBM_ORDER_FEHGBADC => Ok(Order::Fehgbadc),
        MBM_ORDER_DCBAHGFE => Ok(Order::Dcbahgfe),
        _ => Err(Error::InvalidArgument),
    }
}

fn code(result: Result<(), Error>) -> u8 {
    Status::from(result).code()
}

/// The registers of an `mbm_registers`, as bytes in the order of the wire.
pub(crate) struct BorrowedRegisters {
    bytes: *mut u8,
    length: usize,
    /// 1 if the machine stores the low byte of a word first, so that the two bytes of
    /// each register are exchanged; else 0.
    swapped: usize,
}

// SAFETY, here and below: C filled in the `mbm_registers` as its comment says, so `bytes` points to
// `length` bytes, which nothing else uses meanwhile. Each access is checked against `length`.
impl RegisterBytes for BorrowedRegisters {
    fn length(&self) -> usize {
        self.length
    }

    fn byte(&self, place: usize) -> Option<u8> {
        // SAFETY: see above; `length` is even, so the other byte of the register exists too.
        (place < self.length).then(|| unsafe { *self.bytes.add(place ^ self.swapped) })
    }
}

impl RegisterBytesMut for BorrowedRegisters {
    fn set_byte(&mut self, place: usize, value: u8) {
        if place < self.length {
            // SAFETY: see above; `view` has checked that the kind allows writing.
            unsafe { *self.bytes.add(place ^ self.swapped) = value };
        }
    }
}

/// The registers of an `mbm_registers`, with the order of this call.
pub(crate) fn view(
    registers: In<mbm_registers>,
    call_order: u8,
    to_write: bool,
) -> Result<Registers<BorrowedRegisters>, Error> {
    let fields = registers.get()?;
    if fields.data.is_null() {
        return Err(Error::NotInitialised);
    }
    let words = match fields.kind {
        MBM_REGISTERS_INTO_WORDS => true,
        MBM_REGISTERS_INTO_BYTES => false,
        MBM_REGISTERS_OF_WORDS if !to_write => true,
        MBM_REGISTERS_OF_BYTES if !to_write => false,
        _ => return Err(Error::InvalidArgument),
    };
    let default = order(fields.order, Order::Abcd)?;
    let cells = BorrowedRegisters {
        bytes: fields.data.cast_mut().cast(),
        length: usize::from(fields.count).saturating_mul(2),
        swapped: (words && cfg!(target_endian = "little")).into(),
    };
    Registers::new(cells, fields.first, order(call_order, default)?)
}

/// The mask that converts an index of a byte of a number, most significant byte first, to
/// the index in this machine's byte order.
const fn machine_order_mask(size: usize) -> usize {
    if cfg!(target_endian = "little") {
        size - 1
    } else {
        0
    }
}

/// Fills a view in. If the arguments are invalid, the view has no data. `data` may be NULL only
/// if `length`, in words or bytes, is 0.
fn fill(
    registers: Out<mbm_registers>,
    data: *const c_void,
    kind: u8,
    length: u16,
    first: u16,
) -> u8 {
    if registers.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    let mut data = data;
    if length == 0 && data.is_null() {
        // A view of no registers, from which nothing is ever read.
        data = core::ptr::dangling();
    }
    let in_bytes = matches!(kind, MBM_REGISTERS_OF_BYTES | MBM_REGISTERS_INTO_BYTES);
    let count = if in_bytes { length / 2 } else { length };
    let status = if data.is_null() || in_bytes && !length.is_multiple_of(2) {
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
    registers.put(mbm_registers {
        data,
        first,
        count,
        kind,
        order,
    });
    status.code()
}

functions! {
    safe (registers: Out<mbm_registers>)

    /// Fills in a view of words that were read as registers. The order is MBM_ORDER_ABCD
    /// until you set `registers->order`. Nothing is copied: the view always shows the present
    /// words.
    ///
    /// @param registers  the view to fill in; without data after an error
    /// @param words      the words, for example the response words of mbm_node; must stay valid
    ///                   while the view is used. NULL only if `count` is 0
    /// @param count      how many words
    /// @param first      the device's address of the first register, 0 to 65535
    /// @return a status; MBM_ILLEGAL_DATA_ADDRESS if the last address is greater than 65535
    fn mbm_registers_ofWords(words: In<u16>, count: u16, first: u16)
        = fill(words.pointer().cast(), MBM_REGISTERS_OF_WORDS, count, first);

    /// As mbm_registers_ofWords, for the data bytes of a reply or a request.
    ///
    /// @param bytes      the bytes, the high byte of each register first (V1.1b3, 4.2); must stay
    ///                   valid while the view is used
    /// @param length     how many bytes, an even number
    /// @return a status; see mbm_registers_ofWords. MBM_INVALID_ARGUMENT for an odd length
    fn mbm_registers_ofBytes(bytes: In<u8>, length: u16, first: u16)
        = fill(bytes.pointer().cast(), MBM_REGISTERS_OF_BYTES, length, first);

    /// As mbm_registers_ofWords, for words that you also write, for example the transmit
    /// words of mbm_node.
    ///
    /// @return a status; see mbm_registers_ofWords
    fn mbm_registers_intoWords(words: Out<u16>, count: u16, first: u16)
        = fill(words.pointer().cast(), MBM_REGISTERS_INTO_WORDS, count, first);

    /// As mbm_registers_ofBytes, for bytes that you also write.
    ///
    /// @return a status; see mbm_registers_ofBytes
    fn mbm_registers_intoBytes(bytes: Out<u8>, length: u16, first: u16)
        = fill(bytes.pointer().cast(), MBM_REGISTERS_INTO_BYTES, length, first);

    /// Sets the order of the values that calls with MBM_ORDER_DEFAULT read and write.
    ///
    /// @param registers  the view, filled in
    /// @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for MBM_ORDER_ABCD
    fn mbm_registers_setByteOrder(order: u8) = set_order(order);
}

/// Sets the order of a view.
fn set_order(registers: Out<mbm_registers>, code: u8) -> u8 {
    let status = match registers.value() {
        None => Status::INVALID_ARGUMENT,
        Some(registers) if registers.data.is_null() => Status::NOT_INITIALISED,
        Some(registers) => {
            let known = order(code, Order::Abcd).map(|_| registers.order = code);
            known.into()
        }
    };
    status.code()
}
