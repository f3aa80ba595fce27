//! The four tables: functions 01 to 06, 0F and 10, and 16 and 17 beside them.
//!
//! One function serves every table, registers and bits, so that firmware
//! carries it once. Checks come in the order of the standard (clause 7): the
//! function, the quantity, the address; then it is carried out, whole or not
//! at all.

use super::Reply;
use crate::pdu::bits::{READ_COILS, WRITE_MULTIPLE_COILS, WRITE_SINGLE_COIL};
use crate::pdu::limits::{
    MAX_READ_BITS, MAX_READ_REGISTERS, MAX_READ_WRITE_REGISTERS, MAX_WRITE_BITS,
    MAX_WRITE_REGISTERS,
};
use crate::pdu::registers::{
    MASK_WRITE_REGISTER, READ_WRITE_MULTIPLE_REGISTERS, WRITE_MULTIPLE_REGISTERS,
    WRITE_SINGLE_REGISTER,
};

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

    /// Data bytes of so many cells, if those are no more than a request has.
    const fn bytes(self, quantity: u16) -> usize {
        let bytes = if self.is_bits() {
            quantity.wrapping_add(7) >> 3
        } else {
            quantity << 1
        };
        bytes as usize
    }
}

/// Which way cells travel.
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

/// Serves a request for a table, if it is one: the request PDU is the front
/// `length` bytes of `pdu`, which the response overwrites.
#[inline(never)]
pub fn serve(kind: Kind, cells: &mut impl Cells, pdu: &mut [u8], length: usize) -> Reply {
    let Some(&[function, a, b, c, d, count]) = pdu.first_chunk() else {
        return Reply::NOT_MINE;
    };
    if kind_of(function) != kind.0 {
        return Reply::NOT_MINE;
    }
    let address = u16::from_be_bytes([a, b]);
    let mut quantity = u16::from_be_bytes([c, d]);
    let bits = kind.is_bits();
    let several = function > WRITE_SINGLE_REGISTER;
    let most = match (bits, function < WRITE_SINGLE_COIL) {
        (true, true) => MAX_READ_BITS,
        (true, false) => MAX_WRITE_BITS,
        (false, true) => MAX_READ_REGISTERS,
        (false, false) => MAX_WRITE_REGISTERS,
    };
    if !several && function >= WRITE_SINGLE_COIL {
        // A coil is on with FF00, and off with 0000.
        quantity = u16::from(!bits || quantity == 0 || quantity == 0xFF00);
    }
    let bytes = kind.bytes(quantity);
    // Where the data to write stand.
    let (mut at, mut expected) = (3, 5);
    if several {
        at = 6;
        expected = 6 + bytes;
        if bytes != usize::from(count) {
            quantity = 0;
        }
    }
    if length != expected || quantity.wrapping_sub(1) >= most {
        return Reply::ILLEGAL_DATA_VALUE;
    }
    if !cells.covers(address, quantity) {
        return Reply::ILLEGAL_DATA_ADDRESS;
    }
    if function == kind.0 {
        return read(cells, pdu, address, quantity, bytes);
    }
    let Some(data) = pdu.get_mut(at..at + bytes) else {
        return Reply::SERVER_DEVICE_FAILURE;
    };
    write_cells(cells, address, quantity, data, 5)
}

/// The kind of the table that a function is about; 0 if it is about none. (Not a
/// match: a microcontroller would keep a table of it.)
pub(crate) const fn kind_of(function: u8) -> u8 {
    // The functions that write come in pairs, for coils and holding registers.
    let (first, next) = if function >= WRITE_MULTIPLE_COILS {
        (WRITE_MULTIPLE_COILS, WRITE_MULTIPLE_REGISTERS)
    } else if function >= WRITE_SINGLE_COIL {
        (WRITE_SINGLE_COIL, WRITE_SINGLE_REGISTER)
    } else {
        return function;
    };
    if function > next {
        return 0;
    }
    READ_COILS + 2 * (function - first)
}

/// Writes the response of a read: behind the function a byte count and data.
fn read(
    cells: &mut impl Cells,
    pdu: &mut [u8],
    address: u16,
    quantity: u16,
    bytes: usize,
) -> Reply {
    let Some([_, count, data @ ..]) = pdu.get_mut(..2 + bytes) else {
        return Reply::SERVER_DEVICE_FAILURE;
    };
    *count = bytes as u8;
    cells.transfer(Way::Read, address, quantity, data);
    Reply::length(2 + bytes)
}

/// Writes cells that are there from data as on the wire, hooks around it; the
/// response is of `length`.
fn write_cells(
    cells: &mut impl Cells,
    address: u16,
    quantity: u16,
    data: &mut [u8],
    length: usize,
) -> Reply {
    let refused = cells.before(address, quantity, data);
    if refused != 0 {
        return Reply::exception(refused);
    }
    cells.transfer(Way::Write, address, quantity, data);
    cells.after(address, quantity);
    Reply::length(length)
}

/// Serves 16 and 17 for holding registers, as [`serve`].
#[cfg_attr(target_os = "none", inline(never))]
pub fn serve_more(cells: &mut impl Cells, pdu: &mut [u8], length: usize) -> Reply {
    let kind = Kind::HOLDING_REGISTERS;
    let Some(&[function, a, b, c, d, e, f, g, h, count]) = pdu.first_chunk() else {
        return Reply::NOT_MINE;
    };
    let words = [[a, b], [c, d], [e, f], [g, h]].map(u16::from_be_bytes);
    let [address, quantity, write_address, written] = words;
    match function {
        MASK_WRITE_REGISTER if length != 7 => Reply::ILLEGAL_DATA_VALUE,
        MASK_WRITE_REGISTER if !cells.covers(address, 1) => Reply::ILLEGAL_DATA_ADDRESS,
        MASK_WRITE_REGISTER => {
            // The second word is the AND mask, the third the OR mask.
            let mut value = [0; 2];
            cells.transfer(Way::Read, address, 1, &mut value);
            let value = u16::from_be_bytes(value);
            let value = (value & quantity) | (write_address & !quantity);
            write_cells(cells, address, 1, &mut value.to_be_bytes(), 7)
        }
        READ_WRITE_MULTIPLE_REGISTERS => {
            let bytes = usize::from(count);
            if quantity.wrapping_sub(1) >= MAX_READ_REGISTERS
                || written.wrapping_sub(1) >= MAX_READ_WRITE_REGISTERS
                || bytes != kind.bytes(written)
                || length != 10 + bytes
            {
                return Reply::ILLEGAL_DATA_VALUE;
            }
            if !cells.covers(address, quantity) || !cells.covers(write_address, written) {
                return Reply::ILLEGAL_DATA_ADDRESS;
            }
            // Nothing is written that could not be answered.
            if pdu.len() < 2 + kind.bytes(quantity) {
                return Reply::SERVER_DEVICE_FAILURE;
            }
            let data = pdu.get_mut(10..length).unwrap_or_default();
            let reply = write_cells(cells, write_address, written, data, 0);
            if reply.exception_code() != 0 {
                return reply;
            }
            read(cells, pdu, address, quantity, kind.bytes(quantity))
        }
        _ => Reply::NOT_MINE,
    }
}
