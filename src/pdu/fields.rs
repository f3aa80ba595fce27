//! The fields of requests and responses, and functions that read and check parts of PDUs. An error is
//! the exception that a server answers to such a request; [`super::response`] converts it to the error
//! of a response.

use super::functions::COIL_ON;
use super::MORE;
use crate::bytes::{Reader, Writer};
use crate::error::Error;

/// A field of one byte.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Byte {
    /// The code of an exception.
    ExceptionCode,
    /// 07: the eight outputs.
    ExceptionStatus,
    /// 11: the byte count, which may be less than the data have.
    ByteCount,
    /// 2B: the MEI type.
    MeiType,
    /// 2B/0E: the read device id code.
    ReadDeviceIdCode,
    /// 2B/0E: the first object to read.
    ObjectId,
    /// 2B/0E: the conformity level.
    Conformity,
    /// 2B/0E: the object to request next.
    NextObjectId,
    /// 2B/0E: the number of objects in the data.
    ObjectCount,
}

/// A field of two bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Word {
    /// The first coil, input or register.
    Address,
    /// How many coils, inputs or registers.
    Quantity,
    /// 17: the first register to read.
    ReadAddress,
    /// 17: the first register to write.
    WriteAddress,
    /// 17: how many registers to write.
    WriteQuantity,
    /// 06: the value of the register.
    Value,
    /// 16: the bits that keep their value.
    AndMask,
    /// 16: the new values of the other bits.
    OrMask,
    /// 08: the sub-function.
    SubFunction,
    /// 0B, 0C: the status word.
    CommStatus,
    /// 0B, 0C: the count of events.
    EventCount,
    /// 0C: the count of messages.
    MessageCount,
}

/// A field that is yes or no.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Flag {
    /// 05, one word: FF00 is on.
    Coil,
    /// 2B/0E, one byte: FF if more objects follow.
    MoreFollows,
}

impl Flag {
    /// The value on the wire.
    const fn value(self, yes: bool) -> u16 {
        match self {
            _ if !yes => 0,
            Flag::Coil => COIL_ON,
            Flag::MoreFollows => MORE as u16,
        }
    }
}

/// The kind of items that data consist of.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Data {
    /// Bits, the first one in the lowest bit of the first byte.
    Bits,
    /// Registers, the high byte first.
    Registers,
    /// Bytes whose meaning the function or the device defines.
    Bytes,
    /// Bytes; some of them are characters.
    Characters,
}

/// A count of the items that follow, up to the end of a PDU.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Count {
    /// One byte counts bytes.
    Byte,
    /// Two bytes count bytes.
    Bytes,
    /// Two bytes count registers.
    Registers,
}

/// The source or the destination of a PDU's fields: its bytes, a packet of C, a description in
/// words. Each request and response passes its fields through one of these in the order of the
/// wire. A destination leaves the fields unchanged.
pub trait Fields<'a> {
    /// True if the fields come from here.
    const IS_SOURCE: bool;

    /// Passes a byte.
    fn byte(&mut self, field: Byte, value: &mut u8);

    /// Passes a word.
    fn word(&mut self, field: Word, value: &mut u16);

    /// Passes a yes or no.
    fn flag(&mut self, field: Flag, value: &mut bool);

    /// Passes data after a byte that counts them.
    fn counted(&mut self, kind: Data, data: &mut &'a [u8]);

    /// Passes data up to the end of the PDU.
    fn rest(&mut self, kind: Data, data: &mut &'a [u8]);

    /// Passes a count of the `bytes` bytes up to the end of the PDU. Only bytes on the wire have it.
    fn count(&mut self, _kind: Count, _bytes: usize) {}
}

/// Takes the fields from the bytes of a PDU.
pub(super) struct Parser<'a> {
    pub(super) reader: Reader<'a>,
    /// The PDU ended too early, or a count or flag in it is wrong.
    pub(super) is_wrong: bool,
}

impl<'a> Parser<'a> {
    fn get<T: Default>(&mut self, found: Result<T, Error>) -> T {
        self.is_wrong |= found.is_err();
        found.unwrap_or_default()
    }

    /// True if the PDU had all fields, and nothing follows.
    pub(super) fn is_right(&self) -> bool {
        !self.is_wrong && self.reader.is_empty()
    }
}

impl<'a> Fields<'a> for Parser<'a> {
    const IS_SOURCE: bool = true;

    fn byte(&mut self, _: Byte, value: &mut u8) {
        let found = byte(&mut self.reader);
        *value = self.get(found);
    }

    fn word(&mut self, _: Word, value: &mut u16) {
        let found = word(&mut self.reader);
        *value = self.get(found);
    }

    fn flag(&mut self, field: Flag, value: &mut bool) {
        let found = match field {
            Flag::Coil => word(&mut self.reader),
            Flag::MoreFollows => byte(&mut self.reader).map(u16::from),
        };
        let found = self.get(found);
        *value = found != 0;
        self.is_wrong |= found != field.value(*value);
    }

    fn counted(&mut self, _: Data, data: &mut &'a [u8]) {
        let found = counted(&mut self.reader);
        *data = self.get(found);
    }

    fn rest(&mut self, _: Data, data: &mut &'a [u8]) {
        *data = self.reader.rest();
    }

    fn count(&mut self, kind: Count, _: usize) {
        let found = match kind {
            Count::Byte => byte(&mut self.reader).map(usize::from),
            Count::Bytes => word(&mut self.reader).map(usize::from),
            Count::Registers => word(&mut self.reader).map(|count| 2 * usize::from(count)),
        };
        self.is_wrong |= found != Ok(self.reader.length());
    }
}

/// Writes the fields as bytes of a PDU.
impl<'a> Fields<'a> for Writer<'_> {
    const IS_SOURCE: bool = false;

    fn byte(&mut self, _: Byte, value: &mut u8) {
        self.u8(*value);
    }

    fn word(&mut self, _: Word, value: &mut u16) {
        self.u16(*value);
    }

    fn flag(&mut self, field: Flag, value: &mut bool) {
        let value = field.value(*value);
        match field {
            Flag::Coil => self.u16(value),
            Flag::MoreFollows => self.u8(value as u8),
        }
    }

    fn counted(&mut self, _: Data, data: &mut &'a [u8]) {
        Writer::counted(self, data);
    }

    fn rest(&mut self, _: Data, data: &mut &'a [u8]) {
        self.put(data);
    }

    fn count(&mut self, kind: Count, bytes: usize) {
        match kind {
            Count::Byte => self.u8(bytes as u8),
            Count::Bytes => self.u16(bytes as u16),
            Count::Registers => self.u16(bytes as u16 / 2),
        }
    }
}

/// The error of a wrong length, count or value, unless `is_right`.
pub(super) fn expect(is_right: bool) -> Result<(), Error> {
    if is_right {
        Ok(())
    } else {
        Err(Error::IllegalDataValue)
    }
}

/// Reads a byte; an error if the PDU has ended.
pub(super) fn byte(reader: &mut Reader) -> Result<u8, Error> {
    reader.u8().ok_or(Error::IllegalDataValue)
}

/// Reads a word; an error if the PDU has ended.
pub(super) fn word(reader: &mut Reader) -> Result<u16, Error> {
    reader.u16().ok_or(Error::IllegalDataValue)
}

/// Reads a byte count and as many bytes of data.
pub(super) fn counted<'a>(reader: &mut Reader<'a>) -> Result<&'a [u8], Error> {
    let count = usize::from(byte(reader)?);
    reader.take(count).ok_or(Error::IllegalDataValue)
}

/// Checks that `count` is within `limits`, the least and the greatest value.
pub(super) fn check_within(count: usize, limits: (usize, usize)) -> Result<(), Error> {
    expect((limits.0..=limits.1).contains(&count))
}

/// The number of data bytes that `quantity` bits take.
pub(super) const fn byte_count(quantity: u16) -> u8 {
    quantity.div_ceil(8) as u8
}
