//! The record that a trace passes to its hook, and the same record for a sniffer's event.

use crate::functions::{declared, mbm_function};
use crate::packet::{MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE};
use crate::pointers::{In, Out};
use crate::sniffer::{mbm_event, MBM_EVENT_BAD_CRC, MBM_EVENT_NOISE, MBM_EVENT_TIMEOUT};
use core::ffi::c_void;
use mbm::error::Status;
use mbm::packet::PduKind;
use mbm::pdu::custom::Function;
use mbm::trace::{Direction, Observer, Record};

/// The bytes were received.
pub const MBM_TRACE_RECEIVED: u8 = 0;
/// The bytes were sent.
pub const MBM_TRACE_SENT: u8 = 1;

const _: () = {
    assert!(MBM_TRACE_RECEIVED == Direction::Received as u8);
    assert!(MBM_TRACE_SENT == Direction::Sent as u8);
};

/// One frame on a line or connection, or bytes that are no frame.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_traceRecord {
    /// The bytes as they are on the line. For a sniffer's event in ASCII they are decoded, from
    /// the unit to the LRC.
    pub bytes: *const u8,
    /// When the first byte was sent or read, in microseconds by the clock of the port. The time
    /// of a frame that followed other bytes without a pause is estimated. For a sniffer's event
    /// it is the time at which the last byte arrived.
    pub timeUs: u32,
    /// The number of bytes.
    pub length: u16,
    /// MBM_TRACE_RECEIVED or MBM_TRACE_SENT.
    pub direction: u8,
    /// MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses and exceptions. On a serial
    /// line a received frame may be the echo of a request, or may be meant for others; if a
    /// frame can be both, it is the kind that the other side of this link sends.
    pub kind: u8,
    /// MBM_OK of a whole frame; MBM_INVALID_CRC if its CRC or LRC is wrong;
    /// MBM_INCOMPLETE_FRAME of the beginning of a frame whose rest did not come;
    /// MBM_MALFORMED_FRAME of bytes that begin no frame; MBM_BUFFER_TOO_SMALL of a piece of
    /// a frame that is longer than half of the trace's buffer.
    pub status: u8,
}

/// The type of the hook of a trace.
pub(super) type TraceHook =
    Option<unsafe extern "C" fn(context: *mut c_void, record: *const mbm_traceRecord)>;

/// The hook of a trace, and the functions that the user declared.
pub struct CObserver {
    pub(super) hook: TraceHook,
    pub(super) context: *mut c_void,
    pub(super) functions: *const mbm_function,
    pub(super) function_count: u8,
}

impl Observer for CObserver {
    fn frame(&mut self, record: &Record<'_>) {
        let record = mbm_traceRecord {
            bytes: record.bytes.as_ptr(),
            timeUs: record.time,
            length: record.bytes.len() as u16,
            direction: record.direction as u8,
            kind: match record.kind {
                PduKind::Request => MBM_PACKET_REQUEST,
                PduKind::Response => MBM_PACKET_RESPONSE,
            },
            status: record.status.code(),
        };
        if let Some(hook) = self.hook {
            // SAFETY: the hook keeps the contract of its comment.
            unsafe { hook(self.context, &record) }
        }
    }

    fn declaration(&self, code: u8) -> Option<Function> {
        // SAFETY: the begin functions demand that the declarations stay valid.
        let functions = unsafe { In::new(self.functions) };
        let functions = functions.slice(self.function_count.into()).ok()?;
        declared(functions, Some(code)).ok().flatten()
    }
}

/// Makes the record of an event of a sniffer, so that one hook serves the frames that this
/// program sends and those that it overhears. The direction is MBM_TRACE_RECEIVED; `kind` says
/// whether a client or a server sent the frame.
///
/// @param event   an event that mbm_sniffer_next returned
/// @param record  receives the record; its bytes are valid as long as those of the event
/// @return a status; MBM_INVALID_ARGUMENT for MBM_EVENT_TIMEOUT, which has no bytes
#[no_mangle]
pub extern "C" fn mbm_trace_ofEvent(event: In<mbm_event>, record: Out<mbm_traceRecord>) -> u8 {
    let event = event
        .get()
        .ok()
        .filter(|event| event.kind != MBM_EVENT_TIMEOUT);
    let Some(event) = event else {
        return Status::INVALID_ARGUMENT.code();
    };
    record.put(mbm_traceRecord {
        bytes: event.frame,
        timeUs: event.timeUs,
        length: event.frameLength,
        direction: MBM_TRACE_RECEIVED,
        kind: match event.packet.kind {
            MBM_PACKET_REQUEST => MBM_PACKET_REQUEST,
            _ => MBM_PACKET_RESPONSE,
        },
        status: match event.kind {
            MBM_EVENT_BAD_CRC => Status::INVALID_CRC.code(),
            MBM_EVENT_NOISE if event.status == Status::OK.code() => Status::MALFORMED_FRAME.code(),
            MBM_EVENT_NOISE => event.status,
            _ => Status::OK.code(),
        },
    })
}
