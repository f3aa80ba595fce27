//! The events of a sniffer, and events as text.

use crate::packet::{mbm_packet, MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE};
use crate::pointers::{In, Out};
use crate::text::{line, outcome};
use core::ffi::c_char;
use mbm::error::{Error, Status};
use mbm::packet::PduKind;
use mbm::pdu::custom::Function;
use mbm::sniffer::{Event, EventKind, RequestStart};
use mbm::text::HEAD;

/// A request.
pub const MBM_EVENT_REQUEST: u8 = 0;
/// The reply to a request.
pub const MBM_EVENT_REPLY: u8 = 1;
/// An exception that answers a request.
pub const MBM_EVENT_EXCEPTION: u8 = 2;
/// A reply or exception without a matching request: it is late, or its request was not
/// received, or it does not match the request.
pub const MBM_EVENT_UNPAIRED: u8 = 3;
/// A request without a reply: none came before the timeout, or on a serial line before
/// the next request.
pub const MBM_EVENT_TIMEOUT: u8 = 4;
/// Bytes that look like a frame, but the CRC or LRC is wrong, or bytes are missing.
pub const MBM_EVENT_BAD_CRC: u8 = 5;
/// Bytes that are no frame.
pub const MBM_EVENT_NOISE: u8 = 6;

const _: () = {
    assert!(MBM_EVENT_REQUEST == EventKind::Request as u8);
    assert!(MBM_EVENT_REPLY == EventKind::Reply as u8);
    assert!(MBM_EVENT_EXCEPTION == EventKind::Exception as u8);
    assert!(MBM_EVENT_UNPAIRED == EventKind::Unpaired as u8);
    assert!(MBM_EVENT_TIMEOUT == EventKind::Timeout as u8);
    assert!(MBM_EVENT_BAD_CRC == EventKind::BadCrc as u8);
    assert!(MBM_EVENT_NOISE == EventKind::Noise as u8);
};

/// One event on the bus.
///
/// Its pointers point into the buffer of the sniffer, and are valid until the next call
/// with that sniffer.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_event {
    /// The bytes of the frame; for MBM_EVENT_NOISE all bytes of the noise. An ASCII frame is
    /// decoded: unit id, PDU, LRC.
    pub frame: *const u8,
    /// The PDU within the frame; NULL without a PDU.
    pub pdu: *const u8,
    /// The fields of the PDU, as mbm_frame_parse sets them. If the PDU is malformed, and
    /// for MBM_EVENT_TIMEOUT, MBM_EVENT_BAD_CRC and MBM_EVENT_NOISE, only kind, unit,
    /// transaction and function are set.
    pub packet: mbm_packet,
    /// When the last byte arrived, in microseconds; for MBM_EVENT_TIMEOUT when the
    /// timeout ended.
    pub timeUs: u32,
    /// Time from the last byte of the request to the last byte of its reply, or to the
    /// timeout, in microseconds; 0 for other events.
    pub responseTimeUs: u32,
    /// Length of `frame` in bytes.
    pub frameLength: u16,
    /// Length of `pdu` in bytes.
    pub pduLength: u16,
    /// How many bytes of the line or stream this event covers, at most 65535.
    pub length: u16,
    /// The first coil, input or register of the request; for function 17 (hex) the first
    /// that is read. Also set for a reply, which does not contain it.
    pub address: u16,
    /// The quantity of the request; for function 17 (hex) the quantity that is read.
    pub quantity: u16,
    /// One of MBM_EVENT_...
    pub kind: u8,
    /// MBM_OK; for a request that a server must refuse, the exception; for an exception, its
    /// code; MBM_MALFORMED_REPLY if a reply does not match its request; MBM_RESPONSE_TIMED_OUT;
    /// MBM_INVALID_CRC; MBM_BUFFER_TOO_SMALL for noise that may be a frame longer than the
    /// buffer.
    pub status: u8,
    /// The unit that the request addresses, or that replies; for MBM_EVENT_BAD_CRC the
    /// byte at that position.
    pub unit: u8,
    /// The function code; for an exception that of the request; for MBM_EVENT_BAD_CRC
    /// the byte at that position.
    pub function: u8,
    /// The first bytes of the request's PDU: for replies, exceptions and timeouts, and
    /// for MBM_EVENT_UNPAIRED if the reply is late and its request is still known.
    pub requestHead: [u8; 9],
    /// How many bytes of requestHead are set; 0 if the request is not known.
    pub requestHeadLength: u8,
}

const _: () = assert!(HEAD == 9);

impl mbm_event {
    /// Converts an event of the core to one of C.
    pub(super) fn from_event(event: &Event, functions: &[Function]) -> mbm_event {
        let pdu_kind = match event.kind {
            EventKind::Request | EventKind::Timeout | EventKind::BadCrc | EventKind::Noise => {
                PduKind::Request
            }
            _ => PduKind::Response,
        };
        let kind = match pdu_kind {
            PduKind::Request => MBM_PACKET_REQUEST,
            PduKind::Response => MBM_PACKET_RESPONSE,
        };
        let mut packet = mbm_packet::of(kind, &[event.function]);
        if !matches!(event.kind, EventKind::BadCrc | EventKind::Noise) {
            // A malformed PDU leaves the packet unchanged.
            let _ = packet.take(pdu_kind, event.pdu, functions);
        }
        packet.unit = event.unit.into();
        packet.transaction = event.transaction;
        let subject = event.subject();
        let mut asked = [0; HEAD];
        let head = event.asked.as_ref().map_or(&[][..], RequestStart::head);
        for (place, byte) in asked.iter_mut().zip(head) {
            *place = *byte;
        }
        mbm_event {
            frame: event.frame.as_ptr(),
            pdu: if event.pdu.is_empty() {
                core::ptr::null()
            } else {
                event.pdu.as_ptr()
            },
            packet,
            timeUs: event.time,
            responseTimeUs: event.response_time,
            frameLength: event.frame.len() as u16,
            pduLength: event.pdu.len() as u16,
            length: event.length.min(u16::MAX.into()) as u16,
            address: subject.map_or(0, |asked| asked.address()),
            quantity: subject.map_or(0, |asked| asked.quantity()),
            kind: event.kind as u8,
            status: event.status.code(),
            unit: event.unit,
            function: event.function,
            requestHead: asked,
            requestHeadLength: head.len() as u8,
        }
    }

    /// Converts an event of C to one of the core.
    fn core_event<'a>(&self) -> Result<Event<'a>, Error> {
        // SAFETY: a sniffer made the event, or C did as its comment says.
        let (frame, pdu) = unsafe { (In::new(self.frame), In::new(self.pdu)) };
        let head = self.requestHead.get(..self.requestHeadLength.into());
        let asked = head
            .map(RequestStart::new)
            .filter(|_| self.requestHeadLength > 0);
        Ok(Event {
            kind: EventKind::from_code(self.kind).ok_or(Error::InvalidArgument)?,
            status: Status::from_code(self.status),
            time: self.timeUs,
            response_time: self.responseTimeUs,
            transaction: self.packet.transaction,
            unit: self.unit,
            function: self.function,
            frame: frame.slice(self.frameLength.into())?,
            pdu: pdu.slice(self.pduLength.into())?,
            length: self.length.into(),
            asked,
        })
    }
}

/// Writes an event as one line of text, for example
/// "unit 17  reply      03 read holding registers  107..109: 555 0 100".
///
/// Any thread may call it while the event is valid.
/// On a Cortex-M it takes 590 bytes of stack.
///
/// @param event  an event that mbm_sniffer_next returned
/// @param text   receives the line; always ends with a NUL
/// @param size   size of `text` in bytes; 200 are enough for most events, 2400 for all
/// @return a status; MBM_BUFFER_TOO_SMALL if the line was cut
#[no_mangle]
pub extern "C" fn mbm_event_text(event: In<mbm_event>, text: Out<c_char>, size: u16) -> u8 {
    let write = || {
        let mut line = line(text, size)?;
        let event = event.get()?;
        event.core_event()?.text(&mut line);
        Ok(line)
    };
    outcome(write())
}
