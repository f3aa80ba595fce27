//! A request PDU: built head first, sent with the words behind it, read back
//! by whoever receives it.

use super::{bits, registers};
use crate::bytes::Reader;
use crate::data::words::{self, Order};
use crate::error::Status;

/// Function code, and at most four words of address and quantity.
const HEAD: usize = 9;

/// What a function does, as far as its sender needs to know.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Kind {
    /// The response repeats the head.
    Write,
    /// As above; the words sent are packed bits.
    WriteBits,
    /// The response is a byte count and registers.
    ReadRegisters,
    /// The response is a byte count and packed bits.
    ReadBits,
}

/// A request as its sender keeps it until the reply is there: the fixed head,
/// and how much of the caller's words to send behind it.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    pub(super) head: [u8; HEAD],
    pub(super) head_length: u8,
    pub(super) kind: Kind,
    /// Bytes that follow the head and its byte count; 0: neither.
    pub(super) data_length: u8,
    /// Keeps the used bits of the last data byte.
    pub(super) last_mask: u8,
    /// Length of the response PDU if the request succeeds.
    pub(super) response_length: u8,
}

impl Request {
    /// No request.
    pub const NONE: Request = Request::new(Kind::Write, 0, 0, 0);

    /// A request that is `function` and two words; the response to a read is
    /// yet to be told.
    pub(super) const fn new(kind: Kind, function: u8, first: u16, second: u16) -> Request {
        let ([a, b], [c, d]) = (first.to_be_bytes(), second.to_be_bytes());
        Request {
            head: [function, a, b, c, d, 0, 0, 0, 0],
            head_length: 5,
            kind,
            data_length: 0,
            last_mask: 0xFF,
            response_length: 5,
        }
    }

    /// The function code.
    pub const fn function(&self) -> u8 {
        self.head[0]
    }

    /// The head as sent.
    pub(super) fn head(&self) -> &[u8] {
        self.head
            .get(..usize::from(self.head_length))
            .unwrap_or_default()
    }

    /// Length of the response PDU if the request succeeds.
    pub const fn response_length(&self) -> u8 {
        self.response_length
    }

    /// True if the response carries data behind a byte count, false if it
    /// repeats the request's head.
    pub const fn is_read(&self) -> bool {
        matches!(self.kind, Kind::ReadRegisters | Kind::ReadBits)
    }

    /// How data bytes and words correspond for this function.
    pub const fn order(&self) -> Order {
        match self.kind {
            Kind::ReadBits | Kind::WriteBits => Order::LowFirst,
            Kind::ReadRegisters | Kind::Write => Order::HighFirst,
        }
    }

    /// The mask that keeps what was asked for of the last word received.
    pub const fn last_word_mask(&self) -> u16 {
        match (self.order(), self.head[4] & 15) {
            (Order::HighFirst, _) | (_, 0) => 0xFFFF,
            (Order::LowFirst, used) => (1 << used) - 1,
        }
    }

    /// How many of the caller's words are sent.
    pub const fn words(&self) -> u8 {
        self.data_length.div_ceil(2)
    }

    /// Length of the PDU.
    pub fn length(&self) -> usize {
        let data = match self.data_length {
            0 => 0,
            length => 1 + usize::from(length),
        };
        usize::from(self.head_length) + data
    }

    /// Writes the PDU into `pdu`, which has [`Request::length`] bytes. Words
    /// that `source` lacks are zero; the sender checks [`Request::words`].
    pub fn emit(&self, pdu: &mut [u8], source: &[u16]) {
        let mut bytes = pdu.iter_mut();
        for (byte, place) in self.head().iter().zip(bytes.by_ref()) {
            *place = *byte;
        }
        let Some(count) = bytes.next() else {
            return;
        };
        *count = self.data_length;
        let data = bytes.into_slice();
        words::send(data, source, self.order());
        if let Some(last) = data.last_mut() {
            *last &= self.last_mask;
        }
    }

    /// True if `pdu`, complete or not, agrees with the head of this request.
    pub fn agrees(&self, pdu: &[u8]) -> bool {
        self.head()
            .iter()
            .zip(pdu)
            .all(|(ours, theirs)| ours == theirs)
    }
}

/// Checks a range of addresses as every device would (application protocol,
/// figures 11 and following: quantity first, then addresses).
pub(super) fn check_range(address: u16, quantity: u16, most: u16) -> Result<(), Status> {
    if quantity == 0 || quantity > most {
        Err(Status::ILLEGAL_DATA_VALUE)
    } else if address.checked_add(quantity - 1).is_none() {
        Err(Status::ILLEGAL_DATA_ADDRESS)
    } else {
        Ok(())
    }
}

/// A request PDU as its receiver sees it. Data borrow from the bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs)]
pub enum Received<'a> {
    ReadBits {
        function: u8,
        address: u16,
        quantity: u16,
    },
    ReadRegisters {
        function: u8,
        address: u16,
        quantity: u16,
    },
    WriteSingleCoil {
        address: u16,
        on: bool,
    },
    WriteSingleRegister {
        address: u16,
        value: u16,
    },
    WriteMultipleCoils {
        address: u16,
        quantity: u16,
        data: &'a [u8],
    },
    WriteMultipleRegisters {
        address: u16,
        quantity: u16,
        data: &'a [u8],
    },
    MaskWriteRegister {
        address: u16,
        and_mask: u16,
        or_mask: u16,
    },
    ReadWriteMultipleRegisters {
        read_address: u16,
        read_quantity: u16,
        write_address: u16,
        write_quantity: u16,
        data: &'a [u8],
    },
}

impl<'a> Received<'a> {
    /// Reads a request PDU.
    ///
    /// # Errors
    /// The exception that a server answers: [`Status::ILLEGAL_FUNCTION`] for
    /// an unknown function, [`Status::ILLEGAL_DATA_VALUE`] for a length,
    /// quantity or value out of order, [`Status::ILLEGAL_DATA_ADDRESS`] for
    /// addresses beyond 65535.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, Status> {
        let mut reader = Reader::new(pdu);
        let function = reader.u8().ok_or(Status::ILLEGAL_FUNCTION)?;
        let request = match function {
            bits::READ_COILS | bits::READ_DISCRETE_INPUTS => {
                bits::parse_read(function, &mut reader)
            }
            bits::WRITE_SINGLE_COIL => bits::parse_write_single(&mut reader),
            bits::WRITE_MULTIPLE_COILS => bits::parse_write_multiple(&mut reader),
            registers::READ_HOLDING_REGISTERS | registers::READ_INPUT_REGISTERS => {
                registers::parse_read(function, &mut reader)
            }
            registers::WRITE_SINGLE_REGISTER => registers::parse_write_single(&mut reader),
            registers::WRITE_MULTIPLE_REGISTERS => registers::parse_write_multiple(&mut reader),
            registers::MASK_WRITE_REGISTER => registers::parse_mask_write(&mut reader),
            registers::READ_WRITE_MULTIPLE_REGISTERS => registers::parse_read_write(&mut reader),
            _ => return Err(Status::ILLEGAL_FUNCTION),
        }?;
        if reader.is_empty() {
            Ok(request)
        } else {
            Err(Status::ILLEGAL_DATA_VALUE)
        }
    }
}

/// The next word of a request that must have it.
pub(super) fn word(reader: &mut Reader) -> Result<u16, Status> {
    reader.u16().ok_or(Status::ILLEGAL_DATA_VALUE)
}

/// The byte count and the data that end a request.
pub(super) fn counted<'a>(reader: &mut Reader<'a>, bytes: u16) -> Result<&'a [u8], Status> {
    let count = reader.u8().ok_or(Status::ILLEGAL_DATA_VALUE)?;
    let data = reader.rest();
    if u16::from(count) == bytes && data.len() == usize::from(bytes) {
        Ok(data)
    } else {
        Err(Status::ILLEGAL_DATA_VALUE)
    }
}
