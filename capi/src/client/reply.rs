//! The reply of a request that has ended, as a packet.

use super::request::{mbm_clientRequest, RequestPtr};
use crate::packet::{mbm_packet, MBM_PACKET_RESPONSE};
use crate::pointers::{overlap, Out};
use mbm::client::ClientRequest as _;
use mbm::error::{Error, Status};
use mbm::pdu::custom::{Function, Rule};
use mbm::pdu::response::Response;

/// Writes the PDU of the reply to `pdu`, and returns its fields.
fn packet_of(request: RequestPtr, pdu: &mut [u8]) -> Result<mbm_packet, Error> {
    let state = request.state();
    let function = state.function();
    let length = match state.status {
        Status::OK if function == 0 || !state.has_reply() => return Err(Error::InvalidArgument),
        Status::OK if state.has_data() && !request.wants_data() => {
            return Err(Error::BufferTooSmall);
        }
        Status::OK if state.repeats_data() && !request.has_data() => {
            return Err(Error::InvalidArgument);
        }
        Status::OK => {
            let received = |index| request.received_byte(index);
            let sent = |index| request.byte(index);
            state.restore_response(pdu, state.length, received, sent)?
        }
        status if status.is_exception() && status.code() == state.exception => {
            let place = pdu.first_chunk_mut().ok_or(Error::BufferTooSmall)?;
            *place = state.exception_pdu(state.exception);
            place.len()
        }
        status => {
            status.result()?;
            0
        }
    };
    let pdu = pdu.get(..length).unwrap_or_default();
    let mut packet = mbm_packet::of(MBM_PACKET_RESPONSE, pdu);
    packet.unit = state.unit().into();
    packet.transaction = state.wire();
    // The client has checked the length of a user's function by the rule of the request.
    let own = Function {
        code: function,
        request: Rule::Silence,
        response: Rule::Silence,
    };
    packet.take_response(&Response::parse_with(pdu, &[own])?);
    Ok(packet)
}

/// Returns the reply of a request that has ended as a packet, whose fields have names:
/// commStatus and eventCount of function 0B, moreFollows of 2B/0E and so on. mbm_packet lists
/// the fields of each function. The packet is the one that mbm_frame_parse makes of the
/// reply's frame. Read file records with mbm_packet_nextRecord, objects of a device
/// identification with mbm_packet_nextObject.
///
/// Three differences from the frame: the unused bits of the last byte of functions 01 and 02
/// are 0. The byteCount of function 11 is dataLength, because the client does not keep the
/// count of a device that counts only a part of the data. The frame of mbm_client_forward has
/// both as the device sent them. The response to function 15 repeats the request, and is made
/// of the request's `data`: they must not have changed since.
///
/// It reads `request` and what its `reply` and `data` point to, and changes none of them.
/// `done` of the request may call it. Any thread or interrupt may call it for a request that
/// has ended.
///
/// @param request   a request that has ended
/// @param pdu       receives the PDU of the reply, to which the packet's data point; it must not
///                  overlap `reply` and `data` of the request
/// @param capacity  bytes of `pdu`; MBM_MAX_PDU hold any reply
/// @param packet    receives the packet, with the unit of the request, and in TCP frames the
///                  transaction identifier of the reply; it changes only for MBM_OK
/// @return MBM_OK, also for an exception, whose kind is MBM_PACKET_EXCEPTION; MBM_PENDING if the
///         request has not ended; the request's status if it ended without a reply, or was not
///         queued; MBM_BUFFER_TOO_SMALL if the reply's data did not fit into `reply`, if `reply`
///         is NULL, or if `capacity` is too small; MBM_MALFORMED_REPLY if the data are not those
///         of a reply of the function, although the client accepted them: it does not look into
///         an event log or a device identification; MBM_INVALID_ARGUMENT for overlapping memory,
///         a request that was never queued, one that no device answers: a broadcast, or
///         sub-function 04 of 08, and a write to unit 0 in TCP frames
#[no_mangle]
pub unsafe extern "C" fn mbm_client_reply(
    request: *const mbm_clientRequest,
    pdu: Out<u8>,
    capacity: u16,
    packet: Out<mbm_packet>,
) -> u8 {
    let made = || {
        let request = RequestPtr::new(request.cast_mut());
        let request = request.ok_or(Error::InvalidArgument)?;
        if request.lies_in(|bytes, length| overlap(bytes, length, pdu.pointer(), capacity)) {
            return Err(Error::InvalidArgument);
        }
        packet.required()?;
        packet_of(request, pdu.buffer(capacity)?)
    };
    match made() {
        Ok(made) => packet.put(made),
        Err(refused) => refused.code(),
    }
}
