//! The events that a sniffer reports.

use super::pairing::Asked;
use crate::error::Status;
use crate::explain::{self, Line};
use crate::pdu::custom::Function;
use crate::pdu::request::Request;
use crate::pdu::response::Response;

/// The kind of an event.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Kind {
    /// A request.
    Request,
    /// The reply to a request.
    Reply,
    /// The exception that answers a request.
    Exception,
    /// A reply or exception without an open request: it is late, its request was not seen, or
    /// it is malformed.
    Unpaired,
    /// A request without a reply.
    Timeout,
    /// A damaged frame.
    BadCrc,
    /// Bytes that are not a frame.
    Noise,
}

/// An event on the bus.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Event<'a> {
    /// The kind of event.
    pub kind: Kind,
    /// [`Status::OK`], or: of a request, the exception that a server would respond with; of an
    /// exception, its code; [`Status::MALFORMED_REPLY`] of a reply that does not answer the
    /// request; [`Status::RESPONSE_TIMED_OUT`] of a timeout; [`Status::INVALID_CRC`] of a
    /// damaged frame; [`Status::BUFFER_TOO_SMALL`] of noise that may have been a frame longer
    /// than the buffer.
    pub status: Status,
    /// Time of the last byte, in microseconds; of a timeout, the time at which it expired.
    pub time: u32,
    /// Microseconds from the last byte of the request to the last byte of its reply, or to the
    /// timeout; otherwise 0.
    pub response_time: u32,
    /// The transaction identifier of a TCP frame; otherwise 0.
    pub transaction: u16,
    /// The unit id. Of a damaged frame, the byte in its place.
    pub unit: u8,
    /// The function code without the exception bit. Of a damaged frame, the byte in its place.
    pub function: u8,
    /// The frame; empty for a timeout. An ASCII frame is decoded, from the unit to the LRC.
    pub frame: &'a [u8],
    /// The PDU in the frame; empty if there is none.
    pub pdu: &'a [u8],
    /// How many bytes of the line the event covers.
    pub length: usize,
    /// The start of the request, for replies and timeouts.
    pub asked: Option<Asked>,
}

impl Kind {
    /// The kind for a number from the C API.
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
    /// The request, if the event is a request that can be parsed.
    pub fn request(&self, functions: &[Function]) -> Option<Request<'a>> {
        match self.kind {
            Kind::Request => Request::parse_with(self.pdu, functions).ok(),
            _ => None,
        }
    }

    /// The response, if the event is a reply or exception that can be parsed.
    pub fn response(&self, functions: &[Function]) -> Option<Response<'a>> {
        match self.kind {
            Kind::Reply | Kind::Exception | Kind::Unpaired => {
                Response::parse_with(self.pdu, functions).ok()
            }
            _ => None,
        }
    }

    /// The start of the request that this event is, or that it belongs to, if known.
    pub fn subject(&self) -> Option<Asked> {
        match self.kind {
            Kind::Request => Some(Asked::new(self.pdu)),
            _ => self.asked,
        }
    }

    /// Writes the event as one line of text.
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
