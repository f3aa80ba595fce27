//! Requests and responses as flat structs: their fields, their encoding and decoding,
//! their lengths.

mod fields;
mod groups;

pub use groups::*;

use super::pointers::{overlap, In, Out};
use mbm::error::{Error, Status};
use mbm::packet::{self, PduKind};
use mbm::pdu::custom::Function;
use mbm::pdu::length::Length;
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use mbm::pdu::MAX_PDU;

/// A request: a client sends it.
pub const MBM_PACKET_REQUEST: u8 = 0;
/// A response: a server sends it if the request succeeds.
pub const MBM_PACKET_RESPONSE: u8 = 1;
/// An exception: a server sends it if the request fails (V1.1b3, clause 7).
pub const MBM_PACKET_EXCEPTION: u8 = 2;

/// The longest PDU, function code and data, in bytes (V1.1b3, 4.1).
pub const MBM_MAX_PDU: u16 = 253;

const _: () = assert!(MBM_MAX_PDU as usize == MAX_PDU);

/// The length is exactly `bytes`.
pub const MBM_LENGTH_EXACT: u8 = 0;
/// The length is at least `bytes`. Call the function again once you have that many bytes.
pub const MBM_LENGTH_AT_LEAST: u8 = 1;
/// Silence on the line ends the frame; in ASCII the end character does. `bytes` is 0.
pub const MBM_LENGTH_SILENCE: u8 = 2;
/// The length is not known, because the function is not declared: see mbm_function. In
/// RTU over TCP also for a function whose frames silence ends, because a stream has no
/// silence. `bytes` is 0.
pub const MBM_LENGTH_UNKNOWN: u8 = 3;

/// The length of a PDU or frame, as far as it is known.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_length {
    /// The length in bytes from the first byte on; `kind` says how to read it.
    pub bytes: u16,
    /// MBM_LENGTH_EXACT, MBM_LENGTH_AT_LEAST, MBM_LENGTH_SILENCE or MBM_LENGTH_UNKNOWN.
    pub kind: u8,
}

impl From<Length> for mbm_length {
    fn from(length: Length) -> Self {
        let (kind, bytes) = match length {
            Length::Exactly(bytes) => (MBM_LENGTH_EXACT, bytes),
            Length::AtLeast(bytes) => (MBM_LENGTH_AT_LEAST, bytes),
            Length::Silence => (MBM_LENGTH_SILENCE, 0),
            Length::Unknown => (MBM_LENGTH_UNKNOWN, 0),
        };
        let bytes = bytes as u16;
        mbm_length { bytes, kind }
    }
}

/// A request, response or exception of any function. Each function uses the fields in this
/// table (function codes in hex). Parsing sets them and zeroes all others; building reads
/// them and ignores all others.
///
/// function | request | response
/// ---------|---------|---------
/// 2B, MEI type 0E | meiType, readDeviceIdCode, objectId | see below
/// your own | data | data
///
/// The data of 0C are the events, the latest first; those of 14 and 15 are records. A response
/// of 2B with MEI type 0E has meiType, readDeviceIdCode, conformity, moreFollows,
/// nextObjectId, objectCount and data (objects).
///
/// An exception has exceptionCode, and the function code of the request. Register data are
/// as on the wire, the high byte of each register first. Bits begin with the lowest bit of
/// the first byte. To read records or objects, use mbm_packet_nextRecord and
/// mbm_packet_nextObject; to write them, mbm_packet_addRecord and mbm_packet_addObject.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_packet {
    /// The data, without the byte count before them. Parsing sets a pointer into the
    /// parsed bytes. To build a packet, point it to bytes of yours. May be NULL if
    /// dataLength is 0.
    pub data: *const u8,
    /// Length of `data` in bytes.
    pub dataLength: u16,
    /// The transaction identifier of a TCP frame; 0 in other framings.
    pub transaction: u16,
    /// The first coil, input or register, counted from 0; for function 17 the first that
    /// is read.
    pub address: u16,
    /// How many coils, inputs or registers; for function 17 how many are read.
    pub quantity: u16,
    /// 17: the first register that is written.
    pub writeAddress: u16,
    /// 17: how many registers are written.
    pub writeQuantity: u16,
    /// 05: 0 is off, any other value is on; parsing sets 1 for on. 06: the value of the
    /// register.
    pub value: u16,
    /// 16: the bits that keep their value.
    pub andMask: u16,
    /// 16: the new values of the other bits.
    pub orMask: u16,
    /// 08: the sub-function, one of MBM_DIAGNOSTICS_...
    pub subFunction: u16,
    /// 0B, 0C: FFFF (hex) while the device carries out a command, else 0.
    pub commStatus: u16,
    /// 0B, 0C: the count of successful messages.
    pub eventCount: u16,
    /// 0C: the count of messages.
    pub messageCount: u16,
    /// The unit id that the request addresses, or that replies, 0 to 255. Only frames have it.
    /// mbm_frame_build, mbm_frame_exception and mbm_frame_replyLength refuse a greater number
    /// (MBM_INVALID_ARGUMENT).
    pub unit: u16,
    /// MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE or MBM_PACKET_EXCEPTION.
    pub kind: u8,
    /// The function code, 1 to 127; of an exception the one of the request.
    pub function: u8,
    /// Exception: the code, 1 to 127. The numbers are those of MBM_ILLEGAL_FUNCTION and
    /// the statuses after it.
    pub exceptionCode: u8,
    /// 07: the eight outputs, one bit each.
    pub exceptionStatus: u8,
    /// 11: the byte count, at most dataLength. Some devices count only the id and send
    /// more bytes after it.
    pub byteCount: u8,
    /// 2B: MBM_MEI_READ_DEVICE_IDENTIFICATION or another MEI type.
    pub meiType: u8,
    /// 2B/0E: one of MBM_DEVICE_ID_...
    pub readDeviceIdCode: u8,
    /// 2B/0E: the first object to read, or the only one.
    pub objectId: u8,
    /// 2B/0E: the conformity level, by the standard 01 to 03 or 81 to 83 (hex); not
    /// checked.
    pub conformity: u8,
    /// 2B/0E: 1 if the client has to send another request for the rest, else 0.
    pub moreFollows: u8,
    /// 2B/0E: the object to request next. By the standard 0 if none follows; not checked.
    pub nextObjectId: u8,
    /// 2B/0E: how many objects `data` contains.
    pub objectCount: u8,
}

/// The kind of PDU for a number of C.
pub(super) fn side(kind: u8) -> Result<PduKind, Error> {
    match kind {
        MBM_PACKET_REQUEST => Ok(PduKind::Request),
        MBM_PACKET_RESPONSE => Ok(PduKind::Response),
        _ => Err(Error::InvalidArgument),
    }
}

impl mbm_packet {
    /// The data of the packet; an error for a NULL pointer with a length.
    pub(super) fn data<'a>(&self) -> Result<&'a [u8], Error> {
        // SAFETY: C made the packet, and its comment says so of the data.
        unsafe { In::new(self.data) }.slice(self.dataLength.into())
    }

    /// True if the data overlap a buffer that is to be written.
    pub(super) fn lies_in(&self, buffer: *const u8, capacity: u16) -> bool {
        overlap(self.data, self.dataLength, buffer, capacity)
    }

    /// Writes the PDU of this packet, with `data` as its data.
    pub(super) fn emit(
        &mut self,
        data: &[u8],
        functions: &[Function],
        place: &mut [u8],
    ) -> Result<usize, Error> {
        match self.kind {
            MBM_PACKET_REQUEST => self.emit_request(data, functions, place),
            _ => self.emit_response(data, functions, place),
        }
    }

    /// As [`mbm_packet::emit`], for a request. (Not inlined, so that request and response do not
    /// both lie on the stack.)
    #[inline(never)]
    fn emit_request(
        &mut self,
        data: &[u8],
        functions: &[Function],
        place: &mut [u8],
    ) -> Result<usize, Error> {
        packet::emit_request(&self.request(data)?, functions, place)
    }

    /// As [`mbm_packet::emit_request`], for a response.
    #[inline(never)]
    fn emit_response(
        &mut self,
        data: &[u8],
        functions: &[Function],
        place: &mut [u8],
    ) -> Result<usize, Error> {
        packet::emit_response(&self.response(data)?, functions, place)
    }

    /// Sets the fields from a PDU.
    pub(super) fn take(
        &mut self,
        side: PduKind,
        pdu: &[u8],
        functions: &[Function],
    ) -> Result<(), Error> {
        match side {
            PduKind::Request => self.take_request(&Request::parse_with(pdu, functions)?),
            PduKind::Response => self.take_response(&Response::parse_with(pdu, functions)?),
        }
        Ok(())
    }
}

/// Measures the reply to a request. Fails for a request that cannot be built.
pub(super) fn reply_length(
    packet: &mut mbm_packet,
    functions: &[Function],
    measure: impl FnOnce(&Request) -> Length,
) -> Result<Length, Error> {
    if packet.kind != MBM_PACKET_REQUEST {
        return Err(Error::InvalidArgument);
    }
    let request = packet.request(packet.data()?)?;
    packet::emit_request(&request, functions, &mut [0; MAX_PDU])?;
    Ok(measure(&request))
}

/// Writes a length for C. Without a length it writes MBM_LENGTH_UNKNOWN and returns the
/// status that says why.
pub(super) fn put_expected(place: Out<mbm_length>, length: Result<Length, Error>) -> u8 {
    let known = match length {
        Ok(length) => length,
        Err(_) => Length::Unknown,
    };
    let status = place.put(known.into());
    match length {
        Err(refused) if status == Status::OK.code() => refused.code(),
        _ => status,
    }
}
