//! Whole frames: built, parsed, measured, and refused with an exception.

use super::framing::mbm_framing;
use super::packet::{
    mbm_length, mbm_packet, own, put_expected, reply_length, side, MBM_PACKET_REQUEST,
};
use super::pointers::{array, buffer, get, put, put_length};
use mbm::error::Status;
use mbm::frame::checksum::{crc16, lrc, Crc16};
use mbm::frame::{Adu, Framing};
use mbm::packet::refusal::{Exception, Head};
use mbm::packet::{length, PduKind};
use mbm::pdu::custom::Function;
use mbm::pdu::length::Length;
use mbm::pdu::limits::MAX_PDU;

/// How frames look, in the core's words; without a framing, PDUs alone.
struct Look {
    framing: Option<Framing>,
    end: u8,
    own: Option<Function>,
}

/// The function code at the start of a frame or PDU.
fn function(framing: Option<Framing>, bytes: &[u8]) -> Option<u8> {
    match framing {
        Some(framing) => length::function(framing, bytes),
        None => bytes.first().copied(),
    }
}

/// What C says of frames, of one that carries the function that `code` tells.
///
/// # Safety
/// `framing` is NULL or points to one that is valid.
unsafe fn look(
    framing: *const mbm_framing,
    code: impl FnOnce(Option<Framing>) -> Option<u8>,
) -> Result<Look, Status> {
    // SAFETY: as the caller promises.
    unsafe {
        let told = get(framing).ok_or(Status::INVALID_ARGUMENT)?;
        let framing = told.core()?;
        Ok(Look {
            framing,
            end: told.end(),
            own: own(told.functions, told.functionCount, code(framing))?,
        })
    }
}

/// Writes the frame of a packet: request, response or exception. Nothing
/// malformed is ever built.
///
/// Any thread or interrupt may call it.
///
/// @param framing   how frames look
/// @param packet    what to build, with its unit, and for TCP the transaction
/// @param frame     receives the frame; may not overlap the packet's data
/// @param capacity  bytes of `frame`; MBM_MAX_FRAME do for RTU, MBM_MAX_TCP_FRAME for
///                  TCP, MBM_MAX_PDU for a PDU alone, MBM_MAX_ASCII_FRAME for all
/// @param length    receives the frame's length; 0 if the status is not MBM_OK
/// @return MBM_OK; MBM_BUFFER_TOO_SMALL; MBM_INVALID_ARGUMENT; else the fault
///         that mbm_frame_parse finds in such a frame
#[no_mangle]
pub unsafe extern "C" fn mbm_frame_build(
    framing: *const mbm_framing,
    packet: *const mbm_packet,
    frame: *mut u8,
    capacity: u16,
    length: *mut u16,
) -> u8 {
    // SAFETY: as the header demands; data and buffer do not overlap.
    unsafe {
        let build = || {
            let packet = get(packet).filter(|packet| !packet.lies_in(frame, capacity));
            let packet = packet.ok_or(Status::INVALID_ARGUMENT)?;
            let look = look(framing, |_| Some(packet.function))?;
            let buffer = buffer(frame, capacity).filter(|_| !length.is_null());
            let buffer = buffer.ok_or(Status::INVALID_ARGUMENT)?;
            let data = packet.data()?;
            let Head {
                transaction, unit, ..
            } = packet.head();
            let own = look.own.as_slice();
            match look.framing {
                Some(framing) => framing.emit(buffer, transaction, unit, look.end, |pdu| {
                    packet.emit(data, own, pdu)
                }),
                None => packet.emit(data, own, buffer),
            }
        };
        put_length(length, build())
    }
}

/// Reads a frame. The packet's data point into it.
///
/// A request that is refused with an exception code can be answered with that:
/// see mbm_frame_exception.
///
/// Any thread or interrupt may call it.
///
/// @param framing      how frames look
/// @param kind         MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses
///                     and exceptions
/// @param frame        the frame, from its first byte to its last. ASCII is
///                     decoded where it stands, which overwrites it; others are
///                     only read
/// @param frameLength  its bytes
/// @param packet       receives what it says. If the frame is sound, but not
///                     what it carries: kind, unit, transaction and function
///                     alone; if the frame is not sound: kind alone; unchanged
///                     for MBM_INVALID_ARGUMENT
/// @return MBM_OK, also for an exception; MBM_INVALID_ARGUMENT. Of the frame
///         MBM_INCOMPLETE_FRAME, MBM_MALFORMED_FRAME, or MBM_INVALID_CRC, also for a
///         wrong LRC. Of a request in it the exception that answers it:
///         MBM_ILLEGAL_FUNCTION, MBM_ILLEGAL_DATA_ADDRESS or MBM_ILLEGAL_DATA_VALUE.
///         Of a response in it MBM_INVALID_FUNCTION for a function that is neither the
///         standard's nor declared, or MBM_MALFORMED_REPLY
#[no_mangle]
pub unsafe extern "C" fn mbm_frame_parse(
    framing: *const mbm_framing,
    kind: u8,
    frame: *mut u8,
    frameLength: u16,
    packet: *mut mbm_packet,
) -> u8 {
    // SAFETY: as the header demands.
    let arguments = unsafe {
        side(kind).and_then(|side| {
            let bytes = buffer(frame, frameLength).filter(|_| !packet.is_null());
            let bytes = bytes.ok_or(Status::INVALID_ARGUMENT)?;
            let look = look(framing, |framing| function(framing, bytes))?;
            Ok((side, bytes, look))
        })
    };
    let (side, bytes, look) = match arguments {
        Ok(arguments) => arguments,
        Err(refused) => return refused.code(),
    };
    let mut found = mbm_packet::of(kind, &[]);
    let adu = match look.framing {
        Some(framing) => framing.parse(bytes, look.end),
        None => Ok(Adu {
            transaction: 0,
            unit: 0,
            pdu: bytes,
        }),
    };
    let status = match adu {
        Ok(adu) => {
            found = mbm_packet::of(kind, adu.pdu);
            found.unit = adu.unit;
            found.transaction = adu.transaction;
            let taken = found.take(side, adu.pdu, look.own.as_slice());
            taken.err().unwrap_or(Status::OK)
        }
        Err(refused) => refused,
    };
    // SAFETY: as the header demands.
    unsafe { put(packet, found) };
    status.code()
}

/// Writes the exception that answers a request, where one may: to a request
/// that mbm_frame_parse refused, with its status; to one that your device
/// refuses, with the exception code of your choice.
///
/// Any thread or interrupt may call it.
///
/// @param framing   how frames look
/// @param request   the request, as mbm_frame_parse left it
/// @param code      1 to 127, MBM_ILLEGAL_FUNCTION for example
/// @param frame     receives the frame; it may be that of the request
/// @param capacity  bytes of `frame`; 11 always do
/// @param length    receives the frame's length; 0 if the status is not MBM_OK
/// @return MBM_OK; MBM_BROADCAST_NOT_ALLOWED: on a serial line nobody answers
///         unit 0; MBM_ILLEGAL_FUNCTION for a function from 0x80, which no
///         exception can name; MBM_BUFFER_TOO_SMALL; MBM_INVALID_ARGUMENT, also
///         for a status that is no exception code, and for MBM_FRAMING_NONE
#[no_mangle]
pub unsafe extern "C" fn mbm_frame_exception(
    framing: *const mbm_framing,
    request: *const mbm_packet,
    code: u8,
    frame: *mut u8,
    capacity: u16,
    length: *mut u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let build = || {
            let request = get(request).filter(|packet| packet.kind == MBM_PACKET_REQUEST);
            let request = request.ok_or(Status::INVALID_ARGUMENT)?;
            let look = look(framing, |_| None)?;
            let buffer = buffer(frame, capacity).filter(|_| !length.is_null());
            let buffer = buffer.ok_or(Status::INVALID_ARGUMENT)?;
            let code = Status::from_code(code);
            let framing = look.framing.ok_or(Status::INVALID_ARGUMENT)?;
            let exception = Exception::new(framing, request.head(), code)?;
            exception.emit(framing, look.end, buffer)
        };
        put_length(length, build())
    }
}

/// How long the frame is that begins with these bytes.
///
/// A response to function 11 may be longer than it counts: some devices count the id
/// alone. In RTU frames it is MBM_LENGTH_EXACT once a right CRC stands where the count
/// says, MBM_LENGTH_AT_LEAST before, and if the CRC is wrong there MBM_LENGTH_SILENCE,
/// or MBM_LENGTH_UNKNOWN in a stream. A PDU alone (MBM_FRAMING_NONE) has no CRC that would
/// tell: its length is the one that it counts, and mbm_frame_parse takes the longer PDU too.
///
/// Any thread or interrupt may call it. For ASCII it takes 260 bytes of stack.
///
/// @param framing   how frames look
/// @param kind      MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses and
///                  exceptions
/// @param bytes     the frame's first bytes; more may follow
/// @param have      how many; may be 0
/// @param expected  receives the length; MBM_LENGTH_UNKNOWN and 0 if the status is
///                  not MBM_OK
/// @return MBM_OK; MBM_MALFORMED_FRAME if no frame begins like that, or none is
///         so long; MBM_INVALID_ARGUMENT
#[no_mangle]
pub unsafe extern "C" fn mbm_frame_expectedLength(
    framing: *const mbm_framing,
    kind: u8,
    bytes: *const u8,
    have: u16,
    expected: *mut mbm_length,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let measure = || {
            let side = side(kind)?;
            let bytes = array(bytes, have.into()).ok_or(Status::INVALID_ARGUMENT)?;
            let look = look(framing, |framing| function(framing, bytes))?;
            let own = look.own.as_slice();
            match look.framing {
                Some(framing) => length::expected(framing, side, bytes, look.end, own),
                None => pdu_length(side, bytes, own),
            }
        };
        put_expected(expected, measure())
    }
}

/// How long the PDU is that begins with these bytes.
fn pdu_length(side: PduKind, bytes: &[u8], own: &[Function]) -> Result<Length, Status> {
    match side.length(bytes, own) {
        Length::Exactly(bytes) | Length::AtLeast(bytes) if bytes > MAX_PDU => {
            Err(Status::MALFORMED_FRAME)
        }
        length => Ok(length),
    }
}

/// How long the frame will be that answers a request, if that succeeds. Else it
/// is an exception: 5 bytes in RTU, 9 in TCP, 11 characters in ASCII, 2 of a PDU alone.
///
/// Any thread or interrupt may call it. It takes 260 bytes of stack.
///
/// @param framing   how frames look
/// @param request   the request, as for mbm_frame_build
/// @param expected  receives the length; MBM_LENGTH_EXACT and 0 if nothing ever
///                  answers it: a broadcast, 08 with sub-function 04;
///                  MBM_LENGTH_UNKNOWN and 0 if the status is not MBM_OK
/// @return MBM_OK; MBM_INVALID_ARGUMENT, also for a packet that is no request;
///         else why such a request is never built
#[no_mangle]
pub unsafe extern "C" fn mbm_frame_replyLength(
    framing: *const mbm_framing,
    request: *const mbm_packet,
    expected: *mut mbm_length,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let measure = || {
            let packet = get(request).ok_or(Status::INVALID_ARGUMENT)?;
            let look = look(framing, |_| Some(packet.function))?;
            let own = look.own.as_slice();
            reply_length(&packet, own, |request| match look.framing {
                Some(framing) => length::of_reply(framing, packet.unit, request, own),
                None => request.response_length(own),
            })
        };
        put_expected(expected, measure())
    }
}

/// Says whether bytes look like a Modbus TCP frame, request or response, and how
/// long that is. Eight are needed. The length in the header must be one that a
/// request or a response of this function may have, as far as the bytes tell.
///
/// Any thread or interrupt may call it.
///
/// @param bytes         the first bytes
/// @param have          how many
/// @param allowUnknown  0: only with a function code of the standard, or one
///                      that it leaves to users; else: with any but 0
/// @param expected      receives the bytes of the frame; 0 if the status is not
///                      MBM_OK
/// @return MBM_OK; MBM_INCOMPLETE_FRAME if more bytes must tell;
///         MBM_MALFORMED_FRAME if this is something else; MBM_INVALID_ARGUMENT
#[no_mangle]
pub unsafe extern "C" fn mbm_frame_looksLikeTcp(
    bytes: *const u8,
    have: u16,
    allowUnknown: u8,
    expected: *mut u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let bytes = array(bytes, have.into()).filter(|_| !expected.is_null());
        let length = match bytes {
            Some(bytes) => length::looks_like_tcp(bytes, allowUnknown != 0, &[]),
            None => Err(Status::INVALID_ARGUMENT),
        };
        put_length(expected, length)
    }
}

/// The CRC-16 of an RTU frame (serial line guide V1.02, 6.2.2). On the line its
/// low byte comes first.
///
/// Any thread or interrupt may call it.
///
/// @param bytes   unit and PDU
/// @param length  how many
/// @return the CRC; 0xFFFF for NULL or no bytes
#[no_mangle]
pub unsafe extern "C" fn mbm_frame_crc16(bytes: *const u8, length: u16) -> u16 {
    // SAFETY: as the header demands.
    let bytes = unsafe { array(bytes, length.into()) };
    let crc = bytes.map_or(Crc16::START, crc16);
    u16::from_le_bytes(crc.to_bytes())
}

/// The LRC of an ASCII frame (serial line guide V1.02, 6.2.1).
///
/// Any thread or interrupt may call it.
///
/// @param bytes   unit and PDU as bytes, not as characters
/// @param length  how many
/// @return the LRC; 0 for NULL or no bytes
#[no_mangle]
pub unsafe extern "C" fn mbm_frame_lrc(bytes: *const u8, length: u16) -> u8 {
    // SAFETY: as the header demands.
    unsafe { array(bytes, length.into()) }.map_or(0, lrc)
}
