//! The events that a sniffer reports.

use super::pairing::RequestStart;
use crate::error::Status;
use crate::pdu::custom::Function;
use crate::pdu::request::Request;
use crate::pdu::response::Response;
use crate::text::{self, TextWriter};
use crate::time::Micros;

/// The kind of an event.
///
/// ```
/// use mbm::sniffer::EventKind;
///
/// fn is_fault(kind: EventKind) -> bool {
///     matches!(kind, EventKind::Timeout | EventKind::BadCrc | EventKind::Noise)
/// }
/// assert!(is_fault(EventKind::Timeout));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum EventKind {
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
///
/// ```
/// use mbm::frame::Framing;
/// use mbm::pdu::request::Request;
/// use mbm::sniffer::{BusDirection, EventKind, Sniffer};
/// use mbm::text::TextWriter;
///
/// let mut sniffer = Sniffer::new(Framing::Tcp);
/// let mut buffer = [0; 520];
/// let bytes = [0, 5, 0, 0, 0, 6, 17, 3, 0, 107, 0, 2];
/// sniffer.feed(&mut buffer, BusDirection::Client, &bytes, 0);
///
/// let event = sniffer.next(&mut buffer, &[], 0).unwrap();
/// assert_eq!((event.kind, event.unit), (EventKind::Request, 17));
/// let read = Request::ReadRegisters { function: 3, address: 107, quantity: 2 };
/// assert_eq!((event.request(&[]), event.response(&[])), (Some(read), None));
/// assert_eq!(event.subject().map(|request| request.address()), Some(107));
///
/// let mut text = [0; 80];
/// let mut line = TextWriter::new(&mut text);
/// event.text(&mut line);
/// let length = line.finish()?;
/// assert_eq!(&text[..length], b"unit 17  request    03 read holding registers  107..108");
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Event<'a> {
    /// The kind of event.
    pub kind: EventKind,
    /// [`Status::OK`], or: for a request, the exception that a server would respond with; for
    /// an exception, its code; [`Status::MALFORMED_REPLY`] for a reply that does not answer the
    /// request; [`Status::RESPONSE_TIMED_OUT`] for a timeout; [`Status::INVALID_CRC`] for a
    /// damaged frame; [`Status::BUFFER_TOO_SMALL`] for noise that may have been a frame longer
    /// than the buffer.
    pub status: Status,
    /// Time of the last byte, in microseconds; for a timeout, the time at which it expired.
    pub time: Micros,
    /// Microseconds from the last byte of the request to the last byte of its reply, or to the
    /// timeout; otherwise 0.
    pub response_time: Micros,
    /// The transaction identifier of a TCP frame; otherwise 0.
    pub transaction: u16,
    /// The unit id; for a damaged frame the byte in its place.
    pub unit: u8,
    /// The function code without the exception bit; for a damaged frame the byte in its place.
    pub function: u8,
    /// The frame; empty for a timeout. An ASCII frame is decoded, from the unit to the LRC.
    pub frame: &'a [u8],
    /// The PDU in the frame; empty if there is none.
    pub pdu: &'a [u8],
    /// How many bytes of the line the event covers.
    pub length: usize,
    /// The start of the request, for replies and timeouts.
    pub asked: Option<RequestStart>,
}

impl EventKind {
    /// The kind for a number from the C API.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn from_code(code: u8) -> Option<EventKind> {
        match code {
            0 => Some(EventKind::Request),
            1 => Some(EventKind::Reply),
            2 => Some(EventKind::Exception),
            3 => Some(EventKind::Unpaired),
            4 => Some(EventKind::Timeout),
            5 => Some(EventKind::BadCrc),
            6 => Some(EventKind::Noise),
            _ => None,
        }
    }
}

impl<'a> Event<'a> {
    /// The request, if the event is a request that can be parsed.
    pub fn request(&self, functions: &[Function]) -> Option<Request<'a>> {
        match self.kind {
            EventKind::Request => Request::parse_with(self.pdu, functions).ok(),
            _ => None,
        }
    }

    /// The response, if the event is a reply or exception that can be parsed.
    pub fn response(&self, functions: &[Function]) -> Option<Response<'a>> {
        match self.kind {
            EventKind::Reply | EventKind::Exception | EventKind::Unpaired => {
                Response::parse_with(self.pdu, functions).ok()
            }
            _ => None,
        }
    }

    /// The start of the request that this event is, or that it belongs to, if known.
    pub fn subject(&self) -> Option<RequestStart> {
        match self.kind {
            EventKind::Request => Some(RequestStart::new(self.pdu)),
            _ => self.asked,
        }
    }

    /// Writes the event as one line of text.
    pub fn text(&self, line: &mut TextWriter) {
        let asked = self.asked.as_ref().map_or(&[][..], RequestStart::head);
        match self.kind {
            EventKind::Request => {
                text::start(line, self.unit, "request");
                text::request(line, self.pdu);
            }
            EventKind::Reply => {
                text::start(line, self.unit, "reply");
                text::response(line, self.pdu, asked);
            }
            EventKind::Exception => {
                text::start(line, self.unit, "exception");
                text::response(line, self.pdu, asked);
            }
            EventKind::Unpaired => {
                text::start(line, self.unit, "unpaired");
                text::response(line, self.pdu, asked);
            }
            EventKind::Timeout => {
                text::start(line, self.unit, "timeout");
                text::head(line, asked);
            }
            EventKind::BadCrc => text::bytes(line, "bad CRC", self.length),
            EventKind::Noise if self.status == Status::BUFFER_TOO_SMALL => {
                text::bytes(line, "too long for the buffer", self.length);
            }
            EventKind::Noise => text::bytes(line, "noise", self.length),
        }
    }
}
