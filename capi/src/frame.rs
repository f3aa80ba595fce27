//! Building, parsing and measuring of whole frames, and the exception for a refused request.

use super::framing::mbm_framing;
use super::functions::declared;
use super::packet::{
    mbm_length, mbm_packet, put_expected, reply_length, side, MBM_PACKET_EXCEPTION,
    MBM_PACKET_REQUEST,
};
use super::pointers::{In, Out};
use mbm::error::{Error, Status};
use mbm::frame::ascii::lrc;
use mbm::frame::rtu::{crc16, Crc16};
use mbm::frame::{Adu, Framing};
use mbm::packet::refusal::{Exception, Head};
use mbm::packet::{length, PduKind};
use mbm::pdu::custom::Function;
use mbm::pdu::length::Length;
use mbm::pdu::MAX_PDU;

/// The content of an `mbm_framing`, in the core's types.
struct FrameFormat {
    /// `None`: PDUs without a frame.
    framing: Option<Framing>,
    end: u8,
    own: Option<Function>,
}

/// The function code of a frame or PDU, if it has arrived.
fn function(framing: Option<Framing>, bytes: &[u8]) -> Option<u8> {
    match framing {
        Some(framing) => length::function(framing, bytes),
        None => bytes.first().copied(),
    }
}

/// Converts an `mbm_framing`. `code` returns the function code whose declaration is needed.
fn format(
    framing: In<mbm_framing>,
    code: impl FnOnce(Option<Framing>) -> Option<u8>,
) -> Result<FrameFormat, Error> {
    let description = framing.get()?;
    let framing = description.core()?;
    Ok(FrameFormat {
        framing,
        end: description.end(),
        own: declared(description.functions()?, code(framing))?,
    })
}

/// Writes the frame of a packet: a request, a response or an exception. It never builds a
/// malformed frame.
///
/// Any thread or interrupt may call it. On a Cortex-M it takes 600 bytes of stack.
///
/// @param packet    the packet, with its unit, and for TCP its transaction
/// @param frame     receives the frame; it must not overlap the packet's data
/// @param capacity  bytes of `frame`; MBM_MAX_FRAME suffice for RTU, MBM_MAX_TCP_FRAME for TCP,
///                  MBM_MAX_PDU for MBM_FRAMING_NONE, MBM_MAX_ASCII_FRAME for all
/// @param length    receives the frame's length in bytes; 0 if the status is not MBM_OK
/// @return a status; MBM_BUFFER_TOO_SMALL; otherwise the status that mbm_frame_parse would return
///         for such a frame
#[no_mangle]
pub extern "C" fn mbm_frame_build(
    framing: In<mbm_framing>,
    packet: In<mbm_packet>,
    frame: Out<u8>,
    capacity: u16,
    length: Out<u16>,
) -> u8 {
    // Data and buffer do not overlap.
    let build = || {
        let mut packet = packet.get()?;
        if packet.lies_in(frame.pointer(), capacity) {
            return Err(Error::InvalidArgument);
        }
        let format = format(framing, |_| Some(packet.function))?;
        length.required()?;
        let buffer = frame.buffer(capacity)?;
        let data = packet.data()?;
        let Head {
            transaction, unit, ..
        } = packet.head()?;
        let own = format.own.as_slice();
        match format.framing {
            Some(framing) => framing.emit(buffer, transaction, unit, format.end, |pdu| {
                packet.emit(data, own, pdu)
            }),
            None => packet.emit(data, own, buffer),
        }
    };
    length.put_length(build())
}

/// Parses a frame into a packet. The packet's data point into the frame.
///
/// If it returns an exception code for a request, mbm_frame_exception writes the exception
/// that answers the request.
///
/// Any thread or interrupt may call it.
///
/// @param kind         MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses and exceptions
/// @param frame        the frame, from its first byte to its last. An ASCII frame is decoded in
///                     place, which overwrites it; other frames do not change
/// @param frameLength  the number of bytes of `frame`
/// @param packet       receives the packet. If the frame is valid but its PDU is not, it receives
///                     only kind, unit, transaction and function. If the frame is not valid, it
///                     receives only the kind. For MBM_INVALID_ARGUMENT it does not change
/// @return MBM_OK, also for an exception. If the frame is not valid: MBM_INCOMPLETE_FRAME,
///         MBM_MALFORMED_FRAME, or MBM_INVALID_CRC, also for a wrong LRC. If its request is not
///         valid, the exception that answers it: MBM_ILLEGAL_FUNCTION, MBM_ILLEGAL_DATA_ADDRESS or
///         MBM_ILLEGAL_DATA_VALUE. If its response is not valid: MBM_MALFORMED_REPLY, or
///         MBM_INVALID_FUNCTION for a function code that the standard does not define and `framing`
///         does not declare
#[no_mangle]
pub extern "C" fn mbm_frame_parse(
    framing: In<mbm_framing>,
    kind: u8,
    frame: Out<u8>,
    frameLength: u16,
    packet: Out<mbm_packet>,
) -> u8 {
    parse::<true>(framing, kind, frame, frameLength, packet)
}

/// As mbm_frame_parse, but does not check the CRC of an RTU frame: for bytes that another layer has
/// checked, or a log that does not keep the CRC. The two bytes of the CRC must be there, with any
/// value. Other framings are parsed as by mbm_frame_parse.
///
/// Any thread or interrupt may call it.
///
/// @return as mbm_frame_parse. MBM_INVALID_CRC is returned only for the LRC of an ASCII frame
#[no_mangle]
pub extern "C" fn mbm_frame_parseWithoutCrc(
    framing: In<mbm_framing>,
    kind: u8,
    frame: Out<u8>,
    frameLength: u16,
    packet: Out<mbm_packet>,
) -> u8 {
    parse::<false>(framing, kind, frame, frameLength, packet)
}

/// Parses a frame into a packet, and `CHECKS_CRC`.
#[inline(always)]
fn parse<const CHECKS_CRC: bool>(
    framing: In<mbm_framing>,
    kind: u8,
    frame: Out<u8>,
    frameLength: u16,
    packet: Out<mbm_packet>,
) -> u8 {
    let arguments = side(kind).and_then(|pdu_kind| {
        packet.required()?;
        let bytes = frame.buffer(frameLength)?;
        let format = format(framing, |framing| function(framing, bytes))?;
        Ok((pdu_kind, bytes, format))
    });
    let (pdu_kind, bytes, format) = match arguments {
        Ok(arguments) => arguments,
        Err(refused) => return refused.code(),
    };
    let mut found = mbm_packet::of(kind, &[]);
    let adu = match format.framing {
        Some(framing) if CHECKS_CRC => framing.parse(bytes, format.end),
        Some(framing) => framing.parse_without_crc(bytes, format.end),
        None => Ok(Adu {
            transaction: 0,
            unit: 0,
            pdu: bytes,
        }),
    };
    let status = match adu {
        Ok(adu) => {
            found = mbm_packet::of(kind, adu.pdu);
            found.unit = adu.unit.into();
            found.transaction = adu.transaction;
            let taken = found.take(pdu_kind, adu.pdu, format.own.as_slice());
            Status::from(taken)
        }
        Err(refused) => refused.status(),
    };
    packet.put(found);
    status.code()
}

/// Takes the exception out of a frame, without the code for other responses.
///
/// Any thread or interrupt may call it.
///
/// @param frame        the frame, from its first byte to its last. An ASCII frame is decoded in
///                     place, which overwrites it
/// @param frameLength  the number of bytes of `frame`
/// @param packet       receives the exception: its kind is MBM_PACKET_EXCEPTION, `function` is the
///                     function code of the request, without the bit 0x80. It does not change
///                     unless the status is MBM_OK
/// @return a status; MBM_INVALID_FUNCTION if the frame is valid but no exception;
///         MBM_INCOMPLETE_FRAME, MBM_MALFORMED_FRAME or MBM_INVALID_CRC if it is not valid;
///         MBM_MALFORMED_REPLY for an exception of another length, or with a code that is not 1 to
///         127; MBM_INVALID_ARGUMENT also for MBM_FRAMING_NONE
#[no_mangle]
pub extern "C" fn mbm_frame_asException(
    framing: In<mbm_framing>,
    frame: Out<u8>,
    frameLength: u16,
    packet: Out<mbm_packet>,
) -> u8 {
    let take = || {
        packet.required()?;
        let bytes = frame.buffer(frameLength)?;
        let format = format(framing, |_| None)?;
        let framing = format.framing.ok_or(Error::InvalidArgument)?;
        let exception = Exception::parse(framing, bytes, format.end)?;
        let Head {
            transaction,
            unit,
            function,
        } = exception.head();
        packet.put(mbm_packet {
            transaction,
            unit: unit.into(),
            function,
            exceptionCode: exception.code(),
            ..mbm_packet::of(MBM_PACKET_EXCEPTION, &[])
        });
        Ok(())
    };
    Status::from(take()).code()
}

/// Writes the frame of the exception that answers a request. Pass the status of
/// mbm_frame_parse if that refused the request, or an exception code of your choice if your
/// device refuses it.
///
/// Any thread or interrupt may call it.
///
/// @param request   the request, as mbm_frame_parse filled it in
/// @param code      the exception code, 1 to 127, for example MBM_ILLEGAL_FUNCTION
/// @param frame     receives the frame; it may be the buffer of the request's frame
/// @param capacity  bytes of `frame`; 11 always suffice
/// @param length    receives the frame's length in bytes; 0 if the status is not MBM_OK
/// @return a status; MBM_BROADCAST_NOT_ALLOWED for unit 0 on a serial line, which no device
///         answers; MBM_ILLEGAL_FUNCTION for a function code from 0x80 on, which no exception can
///         contain; MBM_BUFFER_TOO_SMALL; MBM_INVALID_ARGUMENT also for MBM_FRAMING_NONE
#[no_mangle]
pub extern "C" fn mbm_frame_exception(
    framing: In<mbm_framing>,
    request: In<mbm_packet>,
    code: u8,
    frame: Out<u8>,
    capacity: u16,
    length: Out<u16>,
) -> u8 {
    let build = || {
        let request = request.get()?;
        if request.kind != MBM_PACKET_REQUEST {
            return Err(Error::InvalidArgument);
        }
        let format = format(framing, |_| None)?;
        length.required()?;
        let buffer = frame.buffer(capacity)?;
        let code = Status::from_code(code);
        let framing = format.framing.ok_or(Error::InvalidArgument)?;
        let exception = Exception::new(framing, request.head()?, code)?;
        exception.emit(framing, format.end, buffer)
    };
    length.put_length(build())
}

/// Computes the length of a frame from its first bytes.
///
/// A response to function 11 may be longer than its byte count says, because some devices
/// count only the id. In RTU frames the length is MBM_LENGTH_AT_LEAST until the bytes of the
/// CRC have arrived at the position that the byte count gives. Then it is MBM_LENGTH_EXACT
/// if that CRC is right. If it is wrong, it is MBM_LENGTH_SILENCE, or MBM_LENGTH_UNKNOWN in
/// RTU over TCP. A PDU without a frame (MBM_FRAMING_NONE) has no CRC: its length is the one
/// that the byte count gives, and mbm_frame_parse accepts a longer PDU too.
///
/// Any thread or interrupt may call it. On a Cortex-M it takes 500 bytes of stack.
///
/// @param kind      MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses and exceptions
/// @param bytes     the frame's first bytes; more may follow
/// @param have      the number of bytes; may be 0
/// @param expected  receives the length; MBM_LENGTH_UNKNOWN and 0 if the status is not MBM_OK
/// @return a status; MBM_MALFORMED_FRAME if no frame starts with these bytes, or if no frame may be
///         as long as they say
#[no_mangle]
pub extern "C" fn mbm_frame_expectedLength(
    framing: In<mbm_framing>,
    kind: u8,
    bytes: In<u8>,
    have: u16,
    expected: Out<mbm_length>,
) -> u8 {
    let measure = || {
        let pdu_kind = side(kind)?;
        let bytes = bytes.slice(have.into())?;
        let format = format(framing, |framing| function(framing, bytes))?;
        let own = format.own.as_slice();
        match format.framing {
            Some(framing) => length::expected(framing, pdu_kind, bytes, format.end, own),
            None => pdu_length(pdu_kind, bytes, own),
        }
    };
    put_expected(expected, measure())
}

/// The length of a PDU, from its first bytes.
fn pdu_length(pdu_kind: PduKind, bytes: &[u8], own: &[Function]) -> Result<Length, Error> {
    match pdu_kind.length(bytes, own) {
        Length::Exactly(bytes) | Length::AtLeast(bytes) if bytes > MAX_PDU => {
            Err(Error::MalformedFrame)
        }
        length => Ok(length),
    }
}

/// Computes the length of the response frame to a request. If the device refuses the
/// request, it sends an exception instead: 5 bytes in RTU, 9 in TCP, 11 characters in
/// ASCII, 2 for MBM_FRAMING_NONE.
///
/// Any thread or interrupt may call it. On a Cortex-M it takes 700 bytes of stack.
///
/// @param request   the request, as for mbm_frame_build
/// @param expected  receives the length. It is MBM_LENGTH_EXACT and 0 for a request that no device
///                  answers: a broadcast, or 08 with sub-function 04. It is MBM_LENGTH_UNKNOWN and
///                  0 if the status is not MBM_OK
/// @return a status; MBM_INVALID_ARGUMENT if the packet is not a request; otherwise the status for
///         which mbm_frame_build refuses the request
#[no_mangle]
pub extern "C" fn mbm_frame_replyLength(
    framing: In<mbm_framing>,
    request: In<mbm_packet>,
    expected: Out<mbm_length>,
) -> u8 {
    let measure = || {
        let mut packet = request.get()?;
        let format = format(framing, |_| Some(packet.function))?;
        let own = format.own.as_slice();
        let unit = packet.head()?.unit;
        reply_length(&mut packet, own, |request| match format.framing {
            Some(framing) => length::of_reply(framing, unit, request, own),
            None => request.response_length(own),
        })
    };
    put_expected(expected, measure())
}

/// Decides whether bytes look like the start of a Modbus TCP frame, a request or a
/// response, and computes the frame's length. It needs 8 bytes. The length in the MBAP
/// header must be one that a request or a response of the function may have, as far as the
/// bytes show.
///
/// Any thread or interrupt may call it.
///
/// @param bytes         the first bytes
/// @param have          the number of bytes
/// @param allowUnknown  0: the function code must be one that the standard defines or leaves to
///                      users; any other value: every function code but 0 will do
/// @param expected      receives the length of the frame in bytes; 0 if the status is not MBM_OK
/// @return a status; MBM_INCOMPLETE_FRAME if more bytes are needed to decide;
///         MBM_MALFORMED_FRAME if the bytes are not a Modbus TCP frame
#[no_mangle]
pub extern "C" fn mbm_frame_looksLikeTcp(
    bytes: In<u8>,
    have: u16,
    allowUnknown: u8,
    expected: Out<u16>,
) -> u8 {
    let measure = || {
        expected.required()?;
        let bytes = bytes.slice(have.into())?;
        length::looks_like_tcp(bytes, allowUnknown != 0, &[])
    };
    expected.put_length(measure())
}

/// Computes the CRC-16 of an RTU frame (serial line guide V1.02, 6.2.2). A frame carries
/// its low byte first.
///
/// Any thread or interrupt may call it.
///
/// @param bytes   unit and PDU
/// @param length  the number of bytes
/// @return the CRC; 0xFFFF if `bytes` is NULL or `length` is 0
#[no_mangle]
pub extern "C" fn mbm_frame_crc16(bytes: In<u8>, length: u16) -> u16 {
    let crc = bytes.slice(length.into()).map_or(Crc16::START, crc16);
    u16::from_le_bytes(crc.to_bytes())
}

/// Computes the LRC of an ASCII frame (serial line guide V1.02, 6.2.1).
///
/// Any thread or interrupt may call it.
///
/// @param bytes   unit and PDU as bytes, not as characters
/// @param length  the number of bytes
/// @return the LRC; 0 if `bytes` is NULL or `length` is 0
#[no_mangle]
pub extern "C" fn mbm_frame_lrc(bytes: In<u8>, length: u16) -> u8 {
    bytes.slice(length.into()).map_or(0, lrc)
}
