//! The four tables of the data model: functions 01 to 06, 0F and 10, and 16 and 17.
//!
//! One function serves all four tables, so firmware carries it once. Checks come in the order
//! of the standard (V1.1b3, clause 7): function, quantity, address. Then the request is
//! carried out completely or not at all.

use super::Reply;
use crate::pdu::functions::{
    MASK_WRITE_REGISTER, READ_WRITE_MULTIPLE_REGISTERS, WRITE_MULTIPLE_COILS, WRITE_SINGLE_COIL,
};
use crate::pdu::{
    MAX_READ_BITS, MAX_READ_REGISTERS, MAX_READ_WRITE_REGISTERS, MAX_WRITE_BITS,
    MAX_WRITE_REGISTERS,
};

/// One of the four tables, named by the function that reads it.
// For the C API; it may change in any version.
#[doc(hidden)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct TableKind(u8);

impl TableKind {
    /// Read by 01, written by 05 and 0F.
    pub const COILS: TableKind = TableKind(1);
    /// Read by 02.
    pub const DISCRETE_INPUTS: TableKind = TableKind(2);
    /// Read by 03, written by 06 and 10.
    pub const HOLDING_REGISTERS: TableKind = TableKind(3);
    /// Read by 04.
    pub const INPUT_REGISTERS: TableKind = TableKind(4);

    /// The table for a number that the C API stores.
    pub const fn from_code(code: u8) -> TableKind {
        TableKind(code)
    }

    /// The number of this table.
    pub const fn code(self) -> u8 {
        self.0
    }

    /// True for coils and discrete inputs.
    pub const fn is_bits(self) -> bool {
        self.0 <= TableKind::DISCRETE_INPUTS.0
    }

    /// How many data bytes `quantity` cells have; 0 for more cells than a request can have.
    pub const fn bytes(self, quantity: usize) -> usize {
        if self.is_bits() {
            quantity.wrapping_add(7) >> 3
        } else {
            match quantity.checked_mul(2) {
                Some(bytes) => bytes,
                None => 0,
            }
        }
    }
}

/// The direction of a transfer.
///
/// ```
/// use mbm::server::table::Direction;
///
/// fn is_allowed(direction: Direction, is_locked: bool) -> bool {
///     direction == Direction::Read || !is_locked
/// }
/// assert!(is_allowed(Direction::Read, true));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Direction {
    /// From the cells into the data.
    Read,
    /// From the data into the cells.
    Write,
}

/// The cells of a table: registers or bits.
///
/// ```
/// use mbm::server::storage::HoldingRegisters;
/// use mbm::server::table::{DataModel, Direction};
///
/// /// Register 107 is the speed of a pump.
/// struct Pump {
///     speed: [u8; 2],
///     starts: u32,
/// }
///
/// impl DataModel for Pump {
///     fn contains(&self, address: u16, quantity: u16) -> bool {
///         address == 107 && quantity == 1
///     }
///
///     fn transfer(&mut self, direction: Direction, _: u16, _: u16, data: &mut [u8]) {
///         match direction {
///             Direction::Read => data.copy_from_slice(&self.speed),
///             Direction::Write => self.speed.copy_from_slice(data),
///         }
///     }
///
///     fn before(&mut self, direction: Direction, _: u16, _: u16, data: &[u8]) -> u8 {
///         match (direction, data) {
///             (Direction::Write, [4..=255, _]) => 3, // Too fast: exception 03.
///             _ => 0,
///         }
///     }
///
///     fn after_write(&mut self, _: u16, _: u16, data: &[u8]) {
///         self.starts += u32::from(data != [0, 0]);
///     }
/// }
/// let service = HoldingRegisters(Pump { speed: [0, 0], starts: 0 });
/// ```
pub trait DataModel {
    /// True if all of the `quantity` cells from `address` on exist. None may lie beyond
    /// address 65535.
    fn contains(&self, address: u16, quantity: u16) -> bool;

    /// Copies existing cells to or from `data`, which is as on the wire: registers high byte
    /// first, bits lowest first, unused bits 0.
    fn transfer(&mut self, direction: Direction, address: u16, quantity: u16, data: &mut [u8]);

    /// Called before cells are read or written. Before a read, it may change the cells; before a
    /// write, `data` has the new values as on the wire. An exception code refuses the request;
    /// 0 allows it.
    fn before(&mut self, direction: Direction, address: u16, quantity: u16, data: &[u8]) -> u8 {
        let _ = (direction, address, quantity, data);
        0
    }

    /// Called after cells were written, with the data as on the wire.
    fn after_write(&mut self, address: u16, quantity: u16, data: &[u8]) {
        let _ = (address, quantity, data);
    }
}

/// The part of [`DataModel`] that functions need. The less common ones take it as a trait
/// object, so firmware carries them once for all tables.
// For the C API; it may change in any version.
#[doc(hidden)]
pub trait TableAccess {
    /// Carries out `operation` on `quantity` cells, which are `bytes` bytes of data. The first
    /// byte of `pdu` is the function code of the request. The address of the cells follows it,
    /// and unless one cell is written the quantity; `operation` says where the data are.
    ///
    /// Returns [`Reply::ABSENT`] if a cell does not exist. A read of 0 bytes only
    /// checks that: it returns [`Reply::SERVER_DEVICE_FAILURE`] if all cells exist.
    fn access(
        &mut self,
        operation: TableOperation,
        quantity: usize,
        bytes: usize,
        pdu: &mut [u8],
    ) -> Reply;
}

impl<T: DataModel> TableAccess for T {
    #[cfg_attr(target_os = "none", inline(never))]
    fn access(
        &mut self,
        operation: TableOperation,
        quantity: usize,
        bytes: usize,
        pdu: &mut [u8],
    ) -> Reply {
        let &mut [_, high, low, ..] = pdu else {
            return Reply::SERVER_DEVICE_FAILURE;
        };
        let (address, quantity) = (word(high, low) as u16, quantity as u16);
        if !self.contains(address, quantity) {
            return Reply::ABSENT;
        }
        let (mut direction, mut at) = (Direction::Read, TableOperation::READ.data());
        if !operation.reads() {
            (direction, at) = (Direction::Write, operation.data());
        }
        let Some(data) = pdu.get_mut(at..at + bytes).filter(|_| bytes != 0) else {
            return Reply::SERVER_DEVICE_FAILURE;
        };
        if operation != TableOperation::LOAD {
            let refused = self.before(direction, address, quantity, data);
            if refused != 0 {
                return Reply::exception(refused);
            }
            if operation == TableOperation::ASK {
                return Reply::NOT_HANDLED;
            }
        }
        self.transfer(direction, address, quantity, data);
        if direction == Direction::Read {
            return counted(pdu, bytes);
        }
        self.after_write(address, quantity, data);
        WRITTEN
    }
}

/// The response of a write repeats the first five bytes of the request.
pub const WRITTEN: Reply = Reply::length(5);

/// The action of a request on a table. The number is the index of the data in the PDU, for a
/// read in the PDU of the response.
// For the C API; it may change in any version.
#[doc(hidden)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct TableOperation(MachineByte);

/// A number below 256, in the type that the machine passes in one register.
#[cfg(target_arch = "avr")]
pub type MachineByte = u8;
/// A number below 256, in the type that the machine passes in one register.
#[cfg(not(target_arch = "avr"))]
pub type MachineByte = usize;

impl TableOperation {
    /// The function does nothing to the table.
    pub const NONE: TableOperation = TableOperation(0);
    /// Reads cells.
    pub const READ: TableOperation = TableOperation(2);
    /// The first part of a read, for functions that also write: asks whether the cells may be
    /// read. Returns [`Reply::NOT_HANDLED`] if so.
    pub const ASK: TableOperation = TableOperation(10);
    /// The other part of a read: reads cells that may be read.
    pub const LOAD: TableOperation = TableOperation(18);
    /// Writes one cell.
    pub const WRITE_ONE: TableOperation = TableOperation(3);
    /// Writes several cells.
    pub const WRITE_SEVERAL: TableOperation = TableOperation(6);

    /// True for a read and for both parts of one.
    #[inline(always)]
    pub const fn reads(self) -> bool {
        self.0 & 7 == TableOperation::READ.0
    }

    /// Index of the data in the PDU, if this is no part of a read.
    #[inline(always)]
    #[allow(clippy::unnecessary_cast)] // It is needed on an AVR.
    pub const fn data(self) -> usize {
        self.0 as usize
    }
}

// The greatest requests for bits and for registers have as many data bytes.
const _: () = assert!(MAX_READ_REGISTERS * 16 == MAX_READ_BITS);
const _: () = assert!(MAX_WRITE_REGISTERS * 16 == MAX_WRITE_BITS);

/// The action of a function on this table.
// For the C API; it may change in any version.
#[doc(hidden)]
#[inline(always)]
pub const fn operation(kind: TableKind, function: u8) -> TableOperation {
    if function == kind.0 {
        return TableOperation::READ;
    }
    // The functions that write come in pairs, for coils and holding registers.
    if kind.0 & 1 != 0 {
        match function.wrapping_sub(kind.0 >> 1) {
            WRITE_SINGLE_COIL => return TableOperation::WRITE_ONE,
            WRITE_MULTIPLE_COILS => return TableOperation::WRITE_SEVERAL,
            _ => {}
        }
    }
    TableOperation::NONE
}

/// Serves a request to a table. The request PDU is the first `length` bytes of `pdu`; the
/// response overwrites it. [`Reply::NOT_HANDLED`] if the function is not for this table.
// For the C API; it may change in any version.
#[doc(hidden)]
#[cfg_attr(target_os = "none", inline(never))]
pub fn serve(
    kind: TableKind,
    cells: &mut impl TableAccess,
    pdu: &mut [u8],
    length: usize,
) -> Reply {
    let function = pdu.first().copied().unwrap_or(0);
    serve_as(operation(kind, function), kind, cells, pdu, length)
}

/// As [`serve`], with the action of the function.
// For the C API; it may change in any version.
#[doc(hidden)]
#[inline(always)]
pub fn serve_as(
    operation: TableOperation,
    kind: TableKind,
    cells: &mut impl TableAccess,
    pdu: &mut [u8],
    length: usize,
) -> Reply {
    if operation == TableOperation::NONE {
        return Reply::NOT_HANDLED;
    }
    let request = pdu.get(..length).unwrap_or_default();
    let [_, _, _, c, d, rest @ ..] = request else {
        return Reply::ILLEGAL_DATA_VALUE;
    };
    let mut quantity = word(*c, *d);
    if operation == TableOperation::WRITE_ONE {
        // FF00 switches a coil on, 0000 off.
        if kind.is_bits() && (*d != 0 || c.wrapping_add(1) > 1) {
            return Reply::ILLEGAL_DATA_VALUE;
        }
        quantity = 1;
    }
    let mut bytes = kind.bytes(quantity);
    let is_right = match rest {
        [] => operation != TableOperation::WRITE_SEVERAL,
        [count, data @ ..] => {
            operation == TableOperation::WRITE_SEVERAL
                && usize::from(*count) == bytes
                && data.len() == bytes
                && bytes <= MOST_WRITTEN
        }
    };
    if !is_right || bytes.wrapping_sub(1) >= MOST_READ {
        return Reply::ILLEGAL_DATA_VALUE;
    }
    // A response that does not fit is exception 04, but only after the address check.
    if operation == TableOperation::READ && pdu.len() < 2 + bytes {
        bytes = 0;
    }
    cells.access(operation, quantity, bytes, pdu)
}

/// Most data bytes that one request reads, of bits or registers.
const MOST_READ: usize = 2 * MAX_READ_REGISTERS as usize;
/// Most data bytes that one request writes.
const MOST_WRITTEN: usize = 2 * MAX_WRITE_REGISTERS as usize;

/// A 16-bit word from the wire, high byte first.
#[inline(always)]
const fn word(high: u8, low: u8) -> usize {
    (high as usize) << 8 | low as usize
}

/// Completes the response of a read whose data have been copied.
#[inline(always)]
pub(super) fn counted(pdu: &mut [u8], bytes: usize) -> Reply {
    if let Some(count) = pdu.get_mut(1) {
        *count = bytes as u8;
    }
    Reply::length(2 + bytes)
}

/// True for functions that [`serve_mask_and_read_write`] serves.
// For the C API; it may change in any version.
#[doc(hidden)]
#[inline(always)]
pub const fn is_mask_or_read_write(function: u8) -> bool {
    matches!(
        function,
        MASK_WRITE_REGISTER | READ_WRITE_MULTIPLE_REGISTERS
    )
}

/// Serves 16 and 17 for holding registers, as [`serve`].
// For the C API; it may change in any version.
#[doc(hidden)]
#[cfg_attr(target_os = "none", inline(never))]
pub fn serve_mask_and_read_write(
    cells: &mut (impl TableAccess + ?Sized),
    pdu: &mut [u8],
    length: usize,
) -> Reply {
    match pdu.first() {
        Some(&MASK_WRITE_REGISTER) => mask_write(cells, pdu, length),
        Some(&READ_WRITE_MULTIPLE_REGISTERS) => read_write(cells, pdu, length),
        _ => Reply::NOT_HANDLED,
    }
}

fn mask_write(cells: &mut (impl TableAccess + ?Sized), pdu: &mut [u8], length: usize) -> Reply {
    let Some(&[code, a, b, c, d, e, f]) = pdu.first_chunk().filter(|_| length == 7) else {
        return Reply::ILLEGAL_DATA_VALUE;
    };
    let mut cell = [code, a, b, 0, 1];
    let refused = cells.access(TableOperation::ASK, 1, 2, &mut cell);
    if refused != Reply::NOT_HANDLED {
        return refused;
    }
    cells.access(TableOperation::LOAD, 1, 2, &mut cell);
    let [_, _, high, low, _] = cell;
    // c and d are the AND mask, e and f the OR mask.
    let (high, low) = ((high & c) | (e & !c), (low & d) | (f & !d));
    match cells.access(
        TableOperation::WRITE_ONE,
        1,
        2,
        &mut [code, a, b, high, low],
    ) {
        WRITTEN => Reply::length(7),
        refused => refused,
    }
}

fn read_write(cells: &mut (impl TableAccess + ?Sized), pdu: &mut [u8], length: usize) -> Reply {
    let kind = TableKind::HOLDING_REGISTERS;
    let Some(&[_, _, _, c, d, _, _, g, h, count]) = pdu.first_chunk() else {
        return Reply::SERVER_DEVICE_FAILURE;
    };
    let (quantity, written) = (word(c, d), word(g, h));
    let (mut bytes, data) = (kind.bytes(quantity), usize::from(count));
    if quantity.wrapping_sub(1) >= MAX_READ_REGISTERS.into()
        || written.wrapping_sub(1) >= MAX_READ_WRITE_REGISTERS.into()
        || data != kind.bytes(written)
        || length != 10 + data
    {
        return Reply::ILLEGAL_DATA_VALUE;
    }
    // Do not write if the response would not fit, or if the read is refused.
    if pdu.len() < 2 + bytes {
        bytes = 0;
    }
    let exists = cells.access(TableOperation::READ, written, 0, write_part(pdu));
    if exists == Reply::ABSENT {
        return exists;
    }
    let refused = cells.access(TableOperation::ASK, quantity, bytes, pdu);
    if refused != Reply::NOT_HANDLED {
        return refused;
    }
    let write = write_part(pdu);
    if let Some(code) = write.first_mut() {
        *code = READ_WRITE_MULTIPLE_REGISTERS;
    }
    match cells.access(TableOperation::WRITE_SEVERAL, written, data, write) {
        WRITTEN => cells.access(TableOperation::LOAD, quantity, bytes, pdu),
        refused => refused,
    }
}

/// The write part of a request of function 17.
fn write_part(pdu: &mut [u8]) -> &mut [u8] {
    pdu.get_mut(WRITES..).unwrap_or_default()
}

/// Index in a request of function 17 at which its write part begins. That part is laid out as
/// a write request without function code.
const WRITES: usize = 4;
