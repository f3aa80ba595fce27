//! The four tables: functions 01 to 06, 0F and 10, and 16 and 17 beside them.
//!
//! One function serves every table, registers and bits, so that firmware
//! carries it once. Checks come in the order of the standard (clause 7): the
//! function, the quantity, the address; then it is carried out, whole or not
//! at all.

use super::Reply;
use crate::pdu::bits::{WRITE_MULTIPLE_COILS, WRITE_SINGLE_COIL};
use crate::pdu::limits::{
    MAX_READ_BITS, MAX_READ_REGISTERS, MAX_READ_WRITE_REGISTERS, MAX_WRITE_BITS,
    MAX_WRITE_REGISTERS,
};
use crate::pdu::registers::{MASK_WRITE_REGISTER, READ_WRITE_MULTIPLE_REGISTERS};

/// Which table, by the function that reads it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct Kind(u8);

impl Kind {
    /// Read by 01, written by 05 and 0F.
    pub const COILS: Kind = Kind(1);
    /// Read by 02.
    pub const DISCRETE_INPUTS: Kind = Kind(2);
    /// Read by 03, written by 06 and 10.
    pub const HOLDING_REGISTERS: Kind = Kind(3);
    /// Read by 04.
    pub const INPUT_REGISTERS: Kind = Kind(4);

    /// The kind of a number that C keeps.
    pub const fn from_code(code: u8) -> Kind {
        Kind(code)
    }

    /// The number of this kind.
    pub const fn code(self) -> u8 {
        self.0
    }

    /// True for coils and discrete inputs.
    pub const fn is_bits(self) -> bool {
        self.0 <= Kind::DISCRETE_INPUTS.0
    }

    /// Data bytes of so many cells; 0 where they are more than an address counts, which
    /// is more than a request has.
    const fn bytes(self, quantity: usize) -> usize {
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

/// What is done with cells.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Way {
    /// From the cells into the data.
    Read,
    /// From the data into the cells.
    Write,
}

/// The cells of a table.
pub trait Cells {
    /// True if all of `quantity` cells from `address` on are there, and none
    /// of them lies beyond 65535.
    fn covers(&self, address: u16, quantity: u16) -> bool;

    /// Moves cells that are there from or into data as on the wire: registers
    /// high byte first, bits lowest first, unused bits 0.
    fn transfer(&mut self, way: Way, address: u16, quantity: u16, data: &mut [u8]);

    /// Asked before cells are written, with the data as on the wire; an
    /// exception code refuses, 0 allows.
    fn before(&mut self, address: u16, quantity: u16, data: &[u8]) -> u8 {
        let _ = (address, quantity, data);
        0
    }

    /// Told what was written.
    fn after(&mut self, address: u16, quantity: u16) {
        let _ = (address, quantity);
    }
}

/// What serving a request needs of [`Cells`]; an object, so that firmware carries
/// what serves less common functions once for all kinds of them.
pub trait Access {
    /// Carries out what a request does to `quantity` cells, which are `bytes` bytes of
    /// data: their address stands behind the first byte of `pdu`, their data where `role`
    /// says. The reply; [`Reply::ILLEGAL_DATA_ADDRESS`] where a cell is not there. To read
    /// 0 bytes, for which there is room anywhere, is [`Reply::SERVER_DEVICE_FAILURE`] where
    /// all are there.
    fn access(&mut self, role: Role, quantity: usize, bytes: usize, pdu: &mut [u8]) -> Reply;
}

impl<T: Cells> Access for T {
    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn access(&mut self, role: Role, quantity: usize, bytes: usize, pdu: &mut [u8]) -> Reply {
        let &mut [_, high, low, ..] = pdu else {
            return Reply::SERVER_DEVICE_FAILURE;
        };
        let (address, quantity) = (word(high, low) as u16, quantity as u16);
        if !self.covers(address, quantity) {
            return Reply::ILLEGAL_DATA_ADDRESS;
        }
        let at = role.data();
        let Some(data) = pdu.get_mut(at..at + bytes) else {
            return Reply::SERVER_DEVICE_FAILURE;
        };
        if role == Role::READ {
            if bytes == 0 {
                return Reply::SERVER_DEVICE_FAILURE;
            }
            self.transfer(Way::Read, address, quantity, data);
            return counted(pdu, bytes);
        }
        let refused = self.before(address, quantity, data);
        if refused != 0 {
            return Reply::exception(refused);
        }
        self.transfer(Way::Write, address, quantity, data);
        self.after(address, quantity);
        WRITTEN
    }
}

/// The response of a write repeats the head of the request.
pub const WRITTEN: Reply = Reply::length(5);

/// What a request does to a table: where in its PDU, or in that of its response,
/// the data of cells stand.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct Role(Small);

/// A number below 256 that is passed in a register of its own.
#[cfg(target_arch = "avr")]
pub type Small = u8;
/// A number below 256 that is passed in a register of its own.
#[cfg(not(target_arch = "avr"))]
pub type Small = usize;

impl Role {
    /// Nothing.
    pub const NONE: Role = Role(0);
    /// Reads cells.
    pub const READ: Role = Role(2);
    /// Writes one.
    pub const WRITE_ONE: Role = Role(3);
    /// Writes any number.
    pub const WRITE_SEVERAL: Role = Role(6);

    /// Where in the PDU the data of the cells stand.
    #[inline(always)]
    #[allow(clippy::unnecessary_cast)] // It is needed on an AVR.
    pub const fn data(self) -> usize {
        self.0 as usize
    }
}

// As many bytes of bits as of registers.
const _: () = assert!(MAX_READ_REGISTERS * 16 == MAX_READ_BITS);
const _: () = assert!(MAX_WRITE_REGISTERS * 16 == MAX_WRITE_BITS);

/// What a function does to a table of this kind.
#[inline(always)]
pub const fn role(kind: Kind, function: u8) -> Role {
    if function == kind.0 {
        return Role::READ;
    }
    // The functions that write come in pairs, for coils and holding registers.
    if kind.0 & 1 != 0 {
        match function.wrapping_sub(kind.0 >> 1) {
            WRITE_SINGLE_COIL => return Role::WRITE_ONE,
            WRITE_MULTIPLE_COILS => return Role::WRITE_SEVERAL,
            _ => {}
        }
    }
    Role::NONE
}

/// Serves a request for a table, if it is one: the request PDU is the front
/// `length` bytes of `pdu`, which the response overwrites.
#[cfg_attr(target_os = "none", inline(never))]
pub fn serve(kind: Kind, cells: &mut impl Access, pdu: &mut [u8], length: usize) -> Reply {
    let function = pdu.first().copied().unwrap_or(0);
    serve_as(role(kind, function), kind, cells, pdu, length)
}

/// As [`serve`], of a request that does this to the table.
#[inline(always)]
pub fn serve_as(
    role: Role,
    kind: Kind,
    cells: &mut impl Access,
    pdu: &mut [u8],
    length: usize,
) -> Reply {
    if role == Role::NONE {
        return Reply::NOT_MINE;
    }
    let request = pdu.get(..length).unwrap_or_default();
    let [_, _, _, c, d, rest @ ..] = request else {
        return Reply::ILLEGAL_DATA_VALUE;
    };
    let mut quantity = word(*c, *d);
    if role == Role::WRITE_ONE {
        // A coil is on with FF00, and off with 0000.
        if kind.is_bits() && (*d != 0 || c.wrapping_add(1) > 1) {
            return Reply::ILLEGAL_DATA_VALUE;
        }
        quantity = 1;
    }
    let mut bytes = kind.bytes(quantity);
    let is_right = match rest {
        [] => role != Role::WRITE_SEVERAL,
        [count, data @ ..] => {
            role == Role::WRITE_SEVERAL
                && usize::from(*count) == bytes
                && data.len() == bytes
                && bytes <= MOST_WRITTEN
        }
    };
    if !is_right || bytes.wrapping_sub(1) >= MOST_READ {
        return Reply::ILLEGAL_DATA_VALUE;
    }
    // A response that does not fit fails once its cells have turned out to be there.
    if role == Role::READ && pdu.len() < 2 + bytes {
        bytes = 0;
    }
    cells.access(role, quantity, bytes, pdu)
}

/// Most bytes of cells that one request reads, be they bits or registers.
const MOST_READ: usize = 2 * MAX_READ_REGISTERS as usize;
/// Most bytes of cells that one request writes.
const MOST_WRITTEN: usize = 2 * MAX_WRITE_REGISTERS as usize;

/// A word of the wire, high byte first.
#[inline(always)]
const fn word(high: u8, low: u8) -> usize {
    (high as usize) << 8 | low as usize
}

/// The response of a read whose data are there.
#[inline(always)]
fn counted(pdu: &mut [u8], bytes: usize) -> Reply {
    if let Some(count) = pdu.get_mut(1) {
        *count = bytes as u8;
    }
    Reply::length(2 + bytes)
}

/// True for functions that [`serve_more`] serves.
#[inline(always)]
pub const fn is_more(function: u8) -> bool {
    matches!(
        function,
        MASK_WRITE_REGISTER | READ_WRITE_MULTIPLE_REGISTERS
    )
}

/// Serves 16 and 17 for holding registers, as [`serve`].
#[cfg_attr(target_os = "none", inline(never))]
pub fn serve_more(cells: &mut (impl Access + ?Sized), pdu: &mut [u8], length: usize) -> Reply {
    match pdu.first() {
        Some(&MASK_WRITE_REGISTER) => mask_write(cells, pdu, length),
        Some(&READ_WRITE_MULTIPLE_REGISTERS) => read_write(cells, pdu, length),
        _ => Reply::NOT_MINE,
    }
}

fn mask_write(cells: &mut (impl Access + ?Sized), pdu: &mut [u8], length: usize) -> Reply {
    let Some(&[_, a, b, c, d, e, f]) = pdu.first_chunk().filter(|_| length == 7) else {
        return Reply::ILLEGAL_DATA_VALUE;
    };
    let mut cell = [0, a, b, 0, 0];
    if cells.access(Role::READ, 1, 2, &mut cell) == Reply::ILLEGAL_DATA_ADDRESS {
        return Reply::ILLEGAL_DATA_ADDRESS;
    }
    let [_, _, high, low, _] = cell;
    // The AND mask, and the OR mask.
    let (high, low) = ((high & c) | (e & !c), (low & d) | (f & !d));
    match cells.access(Role::WRITE_ONE, 1, 2, &mut [0, a, b, high, low]) {
        WRITTEN => Reply::length(7),
        refused => refused,
    }
}

fn read_write(cells: &mut (impl Access + ?Sized), pdu: &mut [u8], length: usize) -> Reply {
    let kind = Kind::HOLDING_REGISTERS;
    let Some(&[_, _, _, c, d, _, _, g, h, count]) = pdu.first_chunk() else {
        return Reply::SERVER_DEVICE_FAILURE;
    };
    let (quantity, written) = (word(c, d), word(g, h));
    let (bytes, data) = (kind.bytes(quantity), usize::from(count));
    if quantity.wrapping_sub(1) >= MAX_READ_REGISTERS.into()
        || written.wrapping_sub(1) >= MAX_READ_WRITE_REGISTERS.into()
        || data != kind.bytes(written)
        || length != 10 + data
    {
        return Reply::ILLEGAL_DATA_VALUE;
    }
    let mut has = |start: usize, quantity| {
        let head = pdu.get_mut(start..).unwrap_or_default();
        cells.access(Role::READ, quantity, 0, head) != Reply::ILLEGAL_DATA_ADDRESS
    };
    if !has(0, quantity) || !has(WRITES, written) {
        return Reply::ILLEGAL_DATA_ADDRESS;
    }
    // Nothing is written that could not be answered.
    if pdu.len() < 2 + bytes {
        return Reply::SERVER_DEVICE_FAILURE;
    }
    let write = pdu.get_mut(WRITES..).unwrap_or_default();
    match cells.access(Role::WRITE_SEVERAL, written, data, write) {
        WRITTEN => cells.access(Role::READ, quantity, bytes, pdu),
        refused => refused,
    }
}

/// Where in a request of function 17 a request to write begins, but for its function.
const WRITES: usize = 4;
