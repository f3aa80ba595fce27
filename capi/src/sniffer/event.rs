//! What a sniffer reports: events, and events in words.

use crate::packet::{mbm_packet, MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE};
use crate::pointers::{array_or_empty, get};
use crate::text::{line, outcome};
use core::ffi::c_char;
use mbm::error::Status;
use mbm::packet::PduKind;
use mbm::pdu::custom::Function;
use mbm::sniffer::{Event, EventKind, RequestStart};
use mbm::text::HEAD;

/// A request.
pub const MBM_EVENT_REQUEST: u8 = 0;
/// The reply to a request.
pub const MBM_EVENT_REPLY: u8 = 1;
/// The exception that answers a request.
pub const MBM_EVENT_EXCEPTION: u8 = 2;
/// A reply or exception to no request that waits for one: a late one, one whose
/// request was not seen, or one that does not answer what was asked.
pub const MBM_EVENT_UNPAIRED: u8 = 3;
/// A request that nobody answered within the timeout, or before the next request.
pub const MBM_EVENT_TIMEOUT: u8 = 4;
/// What looks like a frame, but has a wrong CRC or LRC, or too few bytes.
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

/// Something that happened on the bus.
///
/// What it points to lies in the sniffer's buffer, and is valid until the next
/// call with that sniffer.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_event {
    /// The frame; of noise the bytes. An ASCII frame is decoded: unit, PDU, LRC.
    pub frame: *const u8,
    /// The PDU in the frame; NULL if there is none.
    pub pdu: *const u8,
    /// What the PDU says, as mbm_frame_parse reads it. If it cannot be read, of a
    /// timeout and of what is no frame: kind, unit, transaction and function alone.
    pub packet: mbm_packet,
    /// When its last byte arrived, in microseconds; of a timeout when the request
    /// was given up.
    pub timeUs: u32,
    /// From the last byte of the request to the last byte of its reply, or until it
    /// was given up, in microseconds; else 0.
    pub responseTimeUs: u32,
    /// Bytes of `frame`.
    pub frameLength: u16,
    /// Bytes of `pdu`.
    pub pduLength: u16,
    /// How many bytes on the line this was.
    pub length: u16,
    /// What this is about, also of a reply that does not say so itself: the first
    /// coil, input or register of the request; 17: that is read.
    pub address: u16,
    /// How many; 17: that are read.
    pub quantity: u16,
    /// One of MBM_EVENT_.
    pub kind: u8,
    /// MBM_OK; of a request the exception that a server answers to it; the code of
    /// an exception; MBM_MALFORMED_REPLY if a reply does not answer what was asked;
    /// MBM_RESPONSE_TIMED_OUT; MBM_INVALID_CRC; MBM_BUFFER_TOO_SMALL of noise that
    /// may have been a frame longer than the buffer.
    pub status: u8,
    /// The unit that is asked, or answers; of a bad CRC the byte in its place.
    pub unit: u8,
    /// The function code, of an exception that of the request; of a bad CRC the
    /// byte in its place.
    pub function: u8,
    /// The first bytes of the request's PDU, of replies and timeouts.
    pub requestHead: [u8; 9],
    /// How many those are; 0 if the request is not known.
    pub requestHeadLength: u8,
}

const _: () = assert!(HEAD == 9);

impl mbm_event {
    /// What C sees of an event.
    pub(super) fn of(event: &Event, functions: &[Function]) -> mbm_event {
        let side = match event.kind {
            EventKind::Request | EventKind::Timeout | EventKind::BadCrc | EventKind::Noise => {
                PduKind::Request
            }
            _ => PduKind::Response,
        };
        let kind = match side {
            PduKind::Request => MBM_PACKET_REQUEST,
            PduKind::Response => MBM_PACKET_RESPONSE,
        };
        let mut packet = mbm_packet::of(kind, &[event.function]);
        if !matches!(event.kind, EventKind::BadCrc | EventKind::Noise) {
            // What cannot be read leaves the packet as it is.
            let _ = packet.take(side, event.pdu, functions);
        }
        packet.unit = event.unit;
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

    /// The event that C hands back.
    ///
    /// # Safety
    /// `frame` and `pdu` are NULL or point to their lengths' bytes.
    unsafe fn told<'a>(&self) -> Result<Event<'a>, Status> {
        // SAFETY: as the caller promises.
        let (frame, pdu) = unsafe {
            (
                array_or_empty(self.frame, self.frameLength.into()),
                array_or_empty(self.pdu, self.pduLength.into()),
            )
        };
        let head = self.requestHead.get(..self.requestHeadLength.into());
        let asked = head
            .map(RequestStart::new)
            .filter(|_| self.requestHeadLength > 0);
        Ok(Event {
            kind: EventKind::from_code(self.kind).ok_or(Status::INVALID_ARGUMENT)?,
            status: Status::from_code(self.status),
            time: self.timeUs,
            response_time: self.responseTimeUs,
            transaction: self.packet.transaction,
            unit: self.unit,
            function: self.function,
            frame: frame.ok_or(Status::INVALID_ARGUMENT)?,
            pdu: pdu.ok_or(Status::INVALID_ARGUMENT)?,
            length: self.length.into(),
            asked,
        })
    }
}

/// Explains an event in one line of words, for example
/// "unit 17  reply      03 read holding registers  107..109: 555 0 100".
///
/// Any thread may call it while the event is valid.
///
/// @param event  what mbm_sniffer_next gave
/// @param text   receives the line, which a zero byte ends in any case
/// @param size   bytes of `text`; 200 do for most events, 2400 for all
/// @return MBM_OK; MBM_BUFFER_TOO_SMALL: the line is cut; MBM_INVALID_ARGUMENT
#[no_mangle]
pub unsafe extern "C" fn mbm_event_text(
    event: *const mbm_event,
    text: *mut c_char,
    size: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let write = || {
            let mut line = line(text, size)?;
            let event = get(event).ok_or(Status::INVALID_ARGUMENT)?;
            event.told()?.text(&mut line);
            Ok(line)
        };
        outcome(write())
    }
}
