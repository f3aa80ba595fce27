//! The work, done by mbm.

use mbm::client::RequestState;
use mbm::data::bits;
use mbm::data::view::{send_words, take_words};
use mbm::error::{Error, Status};
use mbm::frame::{ascii, rtu, tcp, Adu, Framing};
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use std::hint::black_box;

pub const UNIT: u8 = 17;
pub const TRANSACTION: u16 = 1;

/// What a server holds.
pub struct Model {
    pub words: [u16; 512],
    pub coils: [u16; 128],
    /// Where the data of a response are put together.
    pub place: [u8; 256],
}

impl Model {
    pub fn new() -> Self {
        Model {
            words: std::array::from_fn(|index| (index as u16).wrapping_mul(40503)),
            coils: std::array::from_fn(|index| (index as u16).wrapping_mul(25717)),
            place: [0; 256],
        }
    }
}

#[inline(always)]
pub fn emit(
    framing: Framing,
    buffer: &mut [u8],
    pdu: impl FnOnce(&mut [u8]) -> Result<usize, Error>,
) -> Result<usize, Error> {
    match framing {
        Framing::Rtu => rtu::emit(buffer, UNIT, pdu),
        Framing::Ascii => ascii::emit(buffer, UNIT, ascii::END, pdu),
        _ => tcp::emit(buffer, TRANSACTION, UNIT, pdu),
    }
}

#[inline(always)]
pub fn open(framing: Framing, frame: &[u8]) -> Result<Adu<'_>, Error> {
    match framing {
        Framing::Rtu => rtu::parse(frame),
        _ => tcp::parse(frame),
    }
}

/// Parses a request and emits the response to it, from and to the model.
#[inline(always)]
pub fn answer(
    framing: Framing,
    frame: &[u8],
    buffer: &mut [u8],
    model: &mut Model,
) -> Result<usize, Error> {
    let request = Request::parse(open(framing, frame)?.pdu)?;
    let response = match request {
        // The addresses begin a word, as those of the peers' tables begin a byte.
        Request::ReadBits {
            function,
            address,
            quantity,
        } => {
            let words = model.coils.get(usize::from(address / 16)..);
            let data = &mut model.place[..usize::from(quantity).div_ceil(8)];
            bits::send(
                data,
                words.ok_or(Error::IllegalDataAddress)?,
                quantity as u8,
            );
            Response::ReadBits { function, data }
        }
        Request::ReadRegisters {
            function,
            address,
            quantity,
        } => {
            let from = usize::from(address);
            let words = model.words.get(from..from + usize::from(quantity));
            let data = &mut model.place[..2 * usize::from(quantity)];
            send_words(data, words.ok_or(Error::IllegalDataAddress)?);
            Response::ReadRegisters { function, data }
        }
        Request::WriteSingleCoil { address, on } => {
            let word = model.coils.get_mut(usize::from(address / 16));
            let bit = 1 << (address % 16);
            let word = word.ok_or(Error::IllegalDataAddress)?;
            *word = if on { *word | bit } else { *word & !bit };
            Response::WriteSingleCoil { address, on }
        }
        Request::WriteSingleRegister { address, value } => {
            let word = model.words.get_mut(usize::from(address));
            *word.ok_or(Error::IllegalDataAddress)? = value;
            Response::WriteSingleRegister { address, value }
        }
        Request::WriteMultipleCoils {
            address,
            quantity,
            data,
        } => {
            let from = usize::from(address / 16);
            let words = model
                .coils
                .get_mut(from..from + usize::from(quantity).div_ceil(16));
            bits::take(
                words.ok_or(Error::IllegalDataAddress)?,
                data,
                quantity as u8,
            );
            Response::WriteMultiple {
                function: 15,
                address,
                quantity,
            }
        }
        Request::WriteMultipleRegisters {
            address,
            quantity,
            data,
        } => {
            let from = usize::from(address);
            let words = model.words.get_mut(from..from + usize::from(quantity));
            take_words(words.ok_or(Error::IllegalDataAddress)?, data);
            Response::WriteMultiple {
                function: 16,
                address,
                quantity,
            }
        }
        Request::MaskWriteRegister {
            address,
            and_mask,
            or_mask,
        } => {
            let word = model.words.get_mut(usize::from(address));
            let word = word.ok_or(Error::IllegalDataAddress)?;
            *word = (*word & and_mask) | (or_mask & !and_mask);
            Response::MaskWriteRegister {
                address,
                and_mask,
                or_mask,
            }
        }
        Request::ReadWriteMultipleRegisters {
            read_address,
            read_quantity,
            write_address,
            write_quantity,
            data,
        } => {
            let from = usize::from(write_address);
            let words = model
                .words
                .get_mut(from..from + usize::from(write_quantity));
            take_words(words.ok_or(Error::IllegalDataAddress)?, data);
            let from = usize::from(read_address);
            let words = model.words.get(from..from + usize::from(read_quantity));
            let data = &mut model.place[..2 * usize::from(read_quantity)];
            send_words(data, words.ok_or(Error::IllegalDataAddress)?);
            Response::ReadRegisters {
                function: 0x17,
                data,
            }
        }
        _ => return Err(Error::IllegalFunction),
    };
    emit(framing, buffer, |pdu| response.emit(pdu))
}

/// Parses a response and takes nothing out: bits stay where they are.
#[inline(always)]
pub fn receive_bits(framing: Framing, frame: &[u8]) {
    let adu = open(framing, frame).expect("a frame");
    let response = Response::parse(adu.pdu);
    assert!(response.is_ok());
    black_box(&response);
}

/// Parses a response and takes the registers out of it.
#[inline(always)]
pub fn receive(framing: Framing, frame: &[u8], words: &mut [u16]) {
    let adu = open(framing, frame).expect("a frame");
    let response = Response::parse(adu.pdu);
    assert!(response.is_ok());
    if let Ok(Response::ReadRegisters { data, .. }) = response {
        take_words(words, data);
    }
    black_box(&response);
}

/// Finds that a frame is the response to a write, and repeats what was written, as
/// the client does.
#[inline(always)]
pub fn validate(framing: Framing, asked: &RequestState, frame: &[u8]) {
    let (adu, transaction) = match framing {
        Framing::Rtu => (rtu::parse(frame), 0),
        _ => (tcp::parse(frame), TRANSACTION),
    };
    let adu = adu.expect("a frame");
    assert!(adu.unit == UNIT && adu.transaction == transaction);
    let length = asked.expected(adu.pdu, adu.pdu.len());
    assert!(length.is_some_and(|length| usize::from(length.get()) == adu.pdu.len()));
    assert_eq!(asked.validate(adu.pdu, |_| 0), Status::OK);
}
