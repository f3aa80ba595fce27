//! What a sniffer tells of.

use super::pairing::Asked;
use crate::error::Status;
use crate::explain::{self, Line};
use crate::pdu::custom::Function;
use crate::pdu::request::Request;
use crate::pdu::response::Response;

/// What happened on the bus.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Kind {
    /// A request.
    Request,
    /// The reply to a request.
    Reply,
    /// The exception that answers a request.
    Exception,
    /// A reply or exception that answers no request that waits for one: a late
    /// one, or one whose request was not seen, or that is malformed.
    Unpaired,
    /// A request that nobody answered.
    Timeout,
    /// What looks like a frame, but is damaged.
    BadCrc,
    /// Bytes that are no frame.
    Noise,
}

/// Something that happened on the bus.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Event<'a> {
    /// What happened.
    pub kind: Kind,
    /// [`Status::OK`]; of a request the fault that a server answers; the
    /// exception's code; [`Status::MALFORMED_REPLY`] if a reply answers not what
    /// was asked; [`Status::RESPONSE_TIMED_OUT`]; [`Status::INVALID_CRC`];
    /// [`Status::BUFFER_TOO_SMALL`] of noise that may have been a frame longer
    /// than the buffer.
    pub status: Status,
    /// When its last byte arrived, in microseconds; of a timeout when the request
    /// was given up.
    pub time: u32,
    /// From the last byte of the request to the last byte of its reply, or until
    /// it was given up; else 0.
    pub response_time: u32,
    /// The transaction identifier of a TCP frame, else 0.
    pub transaction: u16,
    /// Who was asked or answers; of a damaged frame what stands in its place.
    pub unit: u8,
    /// The function code, without the mark of exceptions; as [`Event::unit`].
    pub function: u8,
    /// The frame. An ASCII frame is decoded, from the unit to the LRC. Empty for
    /// a timeout.
    pub frame: &'a [u8],
    /// The PDU in it; empty if there is none.
    pub pdu: &'a [u8],
    /// How many bytes on the line this was.
    pub length: usize,
    /// What was asked; of replies and timeouts.
    pub asked: Option<Asked>,
}

impl Kind {
    /// The kind of a number that C hands back.
    pub const fn from_code(code: u8) -> Option<Kind> {
        match code {
            0 => Some(Kind::Request),
            1 => Some(Kind::Reply),
            2 => Some(Kind::Exception),
            3 => Some(Kind::Unpaired),
            4 => Some(Kind::Timeout),
            5 => Some(Kind::BadCrc),
            6 => Some(Kind::Noise),
            _ => None,
        }
    }
}

impl<'a> Event<'a> {
    /// What a request asks for, if it can be read.
    pub fn request(&self, functions: &[Function]) -> Option<Request<'a>> {
        match self.kind {
            Kind::Request => Request::parse_with(self.pdu, functions).ok(),
            _ => None,
        }
    }

    /// What a reply or exception says, if it can be read.
    pub fn response(&self, functions: &[Function]) -> Option<Response<'a>> {
        match self.kind {
            Kind::Reply | Kind::Exception | Kind::Unpaired => {
                Response::parse_with(self.pdu, functions).ok()
            }
            _ => None,
        }
    }

    /// What this is about: its request, or what of that a reply is known to answer.
    pub fn subject(&self) -> Option<Asked> {
        match self.kind {
            Kind::Request => Some(Asked::new(self.pdu)),
            _ => self.asked,
        }
    }

    /// Writes the event as one line of words.
    pub fn explain(&self, line: &mut Line) {
        let asked = self.asked.as_ref().map_or(&[][..], Asked::head);
        match self.kind {
            Kind::Request => {
                explain::start(line, self.unit, "request");
                explain::request(line, self.pdu);
            }
            Kind::Reply => {
                explain::start(line, self.unit, "reply");
                explain::response(line, self.pdu, asked);
            }
            Kind::Exception => {
                explain::start(line, self.unit, "exception");
                explain::response(line, self.pdu, asked);
            }
            Kind::Unpaired => {
                explain::start(line, self.unit, "unpaired");
                explain::response(line, self.pdu, asked);
            }
            Kind::Timeout => {
                explain::start(line, self.unit, "timeout");
                explain::head(line, asked);
            }
            Kind::BadCrc => explain::bytes(line, "bad CRC", self.length),
            Kind::Noise if self.status == Status::BUFFER_TOO_SMALL => {
                explain::bytes(line, "too long for the buffer", self.length);
            }
            Kind::Noise => explain::bytes(line, "noise", self.length),
        }
    }
}
