//! The record that a trace hands out.

use crate::error::Status;
use crate::packet::PduKind;
use crate::pdu::custom::Function;

/// Whether the object that uses the port received a frame or sent it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Direction {
    /// The port has read the bytes.
    Received,
    /// The port has accepted the bytes.
    Sent,
}

/// A frame on the line, or bytes that are no frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Record<'a> {
    /// Received or sent.
    pub direction: Direction,
    /// The kind of the PDU. If a received frame can be both, it is the kind that the other side
    /// of this link sends.
    pub kind: PduKind,
    /// [`Status::OK`] of a frame; [`Status::INVALID_CRC`] of a frame whose CRC or LRC is wrong;
    /// [`Status::INCOMPLETE_FRAME`] of the beginning of a frame; [`Status::MALFORMED_FRAME`] of
    /// bytes that begin no frame; [`Status::BUFFER_TOO_SMALL`] of a piece of a frame that is
    /// longer than the buffer.
    pub status: Status,
    /// Time of the first byte, in microseconds, by the clock of the port. The time of a frame that
    /// followed other bytes without a pause is estimated.
    pub time: u32,
    /// The bytes, as they are on the line.
    pub bytes: &'a [u8],
}

/// Takes the records of a trace. A closure `FnMut(&Record)` is one.
pub trait Observer {
    /// Takes a frame. It is called from within the functions of the port.
    fn frame(&mut self, record: &Record<'_>);

    /// The declaration of a user-defined function. Without it, silence or the next frame in the
    /// other direction ends a received RTU frame of that function.
    fn declaration(&self, code: u8) -> Option<Function> {
        let _ = code;
        None
    }
}

impl<F: FnMut(&Record<'_>)> Observer for F {
    fn frame(&mut self, record: &Record<'_>) {
        self(record);
    }
}
