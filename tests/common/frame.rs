//! Frames of PDUs.

// Each user takes only a part of this module.
#![allow(dead_code)]

use mbm::frame::rtu::crc16;
use mbm::frame::{ascii, Framing};

/// The frame of a PDU. Only Modbus TCP has the transaction.
pub fn framed(framing: Framing, transaction: u16, unit: u8, pdu: &[u8]) -> Vec<u8> {
    let mut buffer = [0; ascii::MAX_FRAME];
    let length = framing.emit(&mut buffer, transaction, unit, ascii::END, |place| {
        place[..pdu.len()].copy_from_slice(pdu);
        Ok(pdu.len())
    });
    buffer[..length.expect("the frame fits")].to_vec()
}

/// The frame of a unit and its PDU.
pub fn adu(framing: Framing, content: &[u8]) -> Vec<u8> {
    framed(framing, 1, content[0], &content[1..])
}

/// The bytes followed by their CRC.
pub fn sealed(bytes: &[u8]) -> Vec<u8> {
    [bytes, &crc16(bytes).to_bytes()].concat()
}
