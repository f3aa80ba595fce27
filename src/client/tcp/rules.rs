//! Which frames answer a request on a TCP stream, and when requests may be sent.

use crate::client::request::{data_of, store_response, ClientRequest, RequestState};
use crate::engine::Settings;
use crate::error::Status;
use crate::frame::tcp::Header;

/// The rules by which a stream finds responses and sends requests. The defaults are those of the
/// standard.
pub(super) trait Rules {
    /// True if a response with this header answers the request.
    fn matches(&self, state: &RequestState, header: &Header) -> bool {
        is_answered_by(state, header)
    }

    /// Checks the response `pdu` and stores its data in the request. Returns the status of the
    /// request.
    fn validate<J: ClientRequest>(&self, request: &mut J, pdu: &mut [u8]) -> Status {
        validate(request, pdu)
    }

    /// True if a frame with this header, whose PDU does not answer the request, need not be of the
    /// device: then the request goes on.
    fn is_doubtful(&self, _state: &RequestState, _header: &Header) -> bool {
        false
    }

    /// True if the bytes that have arrived are read before a request is sent.
    fn reads_first(&self) -> bool {
        false
    }

    /// Microseconds for which no request is sent. None is in flight.
    fn rest(&mut self, _now: u32) -> u32 {
        0
    }

    /// True if a request that ends, if only for now, lets no other be sent in the same poll.
    fn is_single(&self) -> bool {
        false
    }

    /// Notes that a request is sent, whose response may take `timeout` microseconds.
    fn note_sent(&mut self, _now: u32, _timeout: u32, _settings: &Settings, _state: &RequestState) {
    }

    /// Notes a whole frame that answers a request, or that comes while none is in flight. True if a
    /// request may be sent now that had to wait.
    fn note_frame(&mut self) -> bool {
        false
    }

    /// Notes that a request that was sent ends, if only for now.
    fn note_end(&mut self, _now: u32) {}
}

/// The rules of the standard.
pub(super) struct Strict;

impl Rules for Strict {}

/// True if a response with this header answers the request by the standard.
#[inline(always)]
pub(super) fn is_answered_by(state: &RequestState, header: &Header) -> bool {
    state.is_sent() && state.wire() == header.transaction && state.unit() == header.unit
}

/// Checks the response `pdu` and stores its data in the request. Returns the status of the
/// request.
#[inline(always)]
pub(super) fn validate<J: ClientRequest>(request: &mut J, pdu: &[u8]) -> Status {
    let state = request.state();
    let [function, ..] = *pdu else {
        return Status::MALFORMED_REPLY;
    };
    if function & 0x7F != state.function() {
        return Status::INVALID_FUNCTION;
    }
    let status = state.validate(pdu, data_of(request));
    if status == Status::OK {
        return store_response(request, pdu);
    }
    if let [function, code] = *pdu {
        if function & 0x80 != 0 {
            request.state_mut().exception = code;
        }
    }
    status
}
