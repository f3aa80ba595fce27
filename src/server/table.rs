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

    /// Data bytes of so many cells, if those are no more than a request has.
    const fn bytes(self, quantity: u16) -> usize {
        let quantity = quantity as usize;
        if self.is_bits() {
            quantity.wrapping_add(7) >> 3
        } else {
            quantity << 1
        }
    }
}

/// What is done with cells.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Way {
    /// Nothing: whether they are there is all that is wanted.
    Check,
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
    /// Moves cells, hooks around it where they are written: exception code 2 where one
    /// of them is not there, that of a hook that refuses, or 0.
    fn access(&mut self, way: Way, address: u16, quantity: u16, data: &mut [u8]) -> u8;
}

impl<T: Cells> Access for T {
    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn access(&mut self, way: Way, address: u16, quantity: u16, data: &mut [u8]) -> u8 {
        if !self.covers(address, quantity) {
            return NOT_THERE;
        }
        let writes = way == Way::Write;
        if writes {
            let refused = self.before(address, quantity, data);
            if refused != 0 {
                return refused;
            }
        }
        if way != Way::Check {
            self.transfer(way, address, quantity, data);
        }
        if writes {
            self.after(address, quantity);
        }
        0
    }
}

/// Exception 02.
const NOT_THERE: u8 = Reply::ILLEGAL_DATA_ADDRESS.exception_code();

/// What a request does to a table: where in its PDU, or in that of its response,
/// the data of cells stand.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct Role(u8);

impl Role {
    /// Nothing.
    pub const NONE: Role = Role(0);
    /// Reads cells.
    pub const READ: Role = Role(2);
    /// Writes one.
    pub const WRITE_ONE: Role = Role(3);
    /// Writes any number.
    pub const WRITE_SEVERAL: Role = Role(6);
}

// As many bytes of bits as of registers.
const _: () = assert!(MAX_READ_REGISTERS * 16 == MAX_READ_BITS);
const _: () = assert!(MAX_WRITE_REGISTERS * 16 == MAX_WRITE_BITS);

/// What a function does to a table of this kind.
#[inline(always)]
pub(crate) const fn role(kind: Kind, function: u8) -> Role {
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
    let [_, a, b, c, d, count, ..] = &*pdu else {
        return Reply::NOT_MINE;
    };
    let (address, count) = (u16::from_be_bytes([*a, *b]), *count);
    let mut quantity = u16::from_be_bytes([*c, *d]);
    let mut most = MAX_READ_REGISTERS;
    if role == Role::WRITE_SEVERAL {
        most = MAX_WRITE_REGISTERS;
    }
    if role == Role::WRITE_ONE {
        // A coil is on with FF00, and off with 0000.
        let is_right = !kind.is_bits() || quantity == 0 || quantity == 0xFF00;
        quantity = is_right.into();
    }
    if kind.is_bits() {
        most <<= 4;
    }
    if quantity.wrapping_sub(1) >= most {
        return Reply::ILLEGAL_DATA_VALUE;
    }
    let bytes = kind.bytes(quantity);
    let mut end = 5;
    if role == Role::WRITE_SEVERAL {
        end = 6 + bytes;
        if bytes != usize::from(count) {
            return Reply::ILLEGAL_DATA_VALUE;
        }
    }
    if length != end {
        return Reply::ILLEGAL_DATA_VALUE;
    }
    let at = usize::from(role.0);
    let (mut way, mut failure) = (Way::Write, 0);
    if role == Role::READ {
        way = Way::Read;
    }
    let data = match pdu.get_mut(at..at + bytes) {
        Some(data) => data,
        None => {
            (way, failure) = (Way::Check, Reply::SERVER_DEVICE_FAILURE.exception_code());
            &mut []
        }
    };
    let mut refused = cells.access(way, address, quantity, data);
    if refused == 0 {
        refused = failure;
    }
    if refused != 0 {
        Reply::exception(refused)
    } else if role == Role::READ {
        counted(pdu, bytes)
    } else {
        Reply::length(5)
    }
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
pub(crate) const fn is_more(function: u8) -> bool {
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
    let address = u16::from_be_bytes([a, b]);
    let mut value = [0; 2];
    if cells.access(Way::Read, address, 1, &mut value) != 0 {
        return Reply::ILLEGAL_DATA_ADDRESS;
    }
    // The AND mask, and the OR mask.
    let [high, low] = &mut value;
    *high = (*high & c) | (e & !c);
    *low = (*low & d) | (f & !d);
    match cells.access(Way::Write, address, 1, &mut value) {
        0 => Reply::length(7),
        refused => Reply::exception(refused),
    }
}

fn read_write(cells: &mut (impl Access + ?Sized), pdu: &mut [u8], length: usize) -> Reply {
    let kind = Kind::HOLDING_REGISTERS;
    let Some(&[_, a, b, c, d, e, f, g, h, count]) = pdu.first_chunk() else {
        return Reply::SERVER_DEVICE_FAILURE;
    };
    let (address, quantity) = (u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d]));
    let (write_address, written) = (u16::from_be_bytes([e, f]), u16::from_be_bytes([g, h]));
    let bytes = usize::from(count);
    if quantity.wrapping_sub(1) >= MAX_READ_REGISTERS
        || written.wrapping_sub(1) >= MAX_READ_WRITE_REGISTERS
        || bytes != kind.bytes(written)
        || length != 10 + bytes
    {
        return Reply::ILLEGAL_DATA_VALUE;
    }
    let mut has = |address, quantity| cells.access(Way::Check, address, quantity, &mut []) == 0;
    if !has(address, quantity) || !has(write_address, written) {
        return Reply::ILLEGAL_DATA_ADDRESS;
    }
    // Nothing is written that could not be answered.
    let bytes = kind.bytes(quantity);
    if pdu.len() < 2 + bytes {
        return Reply::SERVER_DEVICE_FAILURE;
    }
    let data = pdu.get_mut(10..length).unwrap_or_default();
    let refused = cells.access(Way::Write, write_address, written, data);
    if refused != 0 {
        return Reply::exception(refused);
    }
    let data = pdu.get_mut(2..2 + bytes).unwrap_or_default();
    cells.access(Way::Read, address, quantity, data);
    counted(pdu, bytes)
}
