//! Requests and responses as flat structs: built, parsed, measured.

mod fields;
mod groups;

pub use groups::*;

use super::functions::{declared, mbm_function};
use super::pointers::{array_or_empty, overlap, put};
use mbm::error::Status;
use mbm::packet::{self, PduKind};
use mbm::pdu::custom::Function;
use mbm::pdu::length::Length;
use mbm::pdu::limits::MAX_PDU;
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;

/// A request: what a client sends.
pub const MBM_PACKET_REQUEST: u8 = 0;
/// A response: what a server sends if the request succeeds.
pub const MBM_PACKET_RESPONSE: u8 = 1;
/// An exception: what a server sends if the request fails (V1.1b3, clause 7).
pub const MBM_PACKET_EXCEPTION: u8 = 2;

/// Most bytes of a PDU: function code and data (V1.1b3, 4.1).
pub const MBM_MAX_PDU: u16 = 253;

const _: () = assert!(MBM_MAX_PDU as usize == MAX_PDU);

/// `bytes` is the length.
pub const MBM_LENGTH_EXACT: u8 = 0;
/// It has `bytes` at least. Once so many are there, ask again.
pub const MBM_LENGTH_AT_LEAST: u8 = 1;
/// Silence on the line tells, in ASCII the end character. `bytes` is 0.
pub const MBM_LENGTH_SILENCE: u8 = 2;
/// Nobody knows this function: declare it. Also what silence ends, in RTU over TCP,
/// where there is none. `bytes` is 0.
pub const MBM_LENGTH_UNKNOWN: u8 = 3;

/// How long something is.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_length {
    /// All of it, from its first byte, as `kind` says.
    pub bytes: u16,
    /// MBM_LENGTH_EXACT, _AT_LEAST, _SILENCE or _UNKNOWN.
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

/// A request, response or exception of any function. Parsing zeroes it first,
/// and sets what the function has; building reads that and ignores the rest:
///
/// function | request | response
/// ---------|---------|---------
/// 01, 02, 03, 04 | address, quantity | data
/// 05 | address, value | address, value
/// 06 | address, value | address, value
/// 07 | | exceptionStatus
/// 08 | subFunction, data | subFunction, data
/// 0B | | commStatus, eventCount
/// 0C | | commStatus, eventCount, messageCount, data (events, the latest first)
/// 0F, 10 | address, quantity, data | address, quantity
/// 11 | | byteCount, data
/// 14 | data (records) | data (records)
/// 15 | data (records) | data (records)
/// 16 | address, andMask, orMask | address, andMask, orMask
/// 17 | address, quantity, writeAddress, writeQuantity, data | data
/// 18 | address | data (registers)
/// 2B, MEI type 0E | meiType, readDeviceIdCode, objectId | meiType, readDeviceIdCode, conformity, moreFollows, nextObjectId, objectCount, data (objects)
/// 2B, others | meiType, data | meiType, data
/// your own | data | data
///
/// An exception has exceptionCode, and the function of the request. Register
/// data are as on the wire, high bytes first; bits begin with the lowest of the
/// first byte. Records and objects: mbm_packet_nextRecord, mbm_packet_addRecord
/// and their likes for objects.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_packet {
    /// The data, without the byte count in front of them. After parsing they
    /// lie within the bytes that were parsed; to build, they are yours. May be
    /// NULL if dataLength is 0.
    pub data: *const u8,
    /// Bytes of data.
    pub dataLength: u16,
    /// Transaction identifier of a TCP frame; 0 in other framings.
    pub transaction: u16,
    /// First coil, input or register, counted from 0; 17: that is read.
    pub address: u16,
    /// Coils, inputs or registers; 17: that are read.
    pub quantity: u16,
    /// 17: first register that is written.
    pub writeAddress: u16,
    /// 17: registers that are written.
    pub writeQuantity: u16,
    /// 05: 0 is off, anything else is on (parsed: 1). 06: the register.
    pub value: u16,
    /// 16: bits that are kept.
    pub andMask: u16,
    /// 16: bits that replace those that are not kept.
    pub orMask: u16,
    /// 08: one of MBM_DIAGNOSTICS_.
    pub subFunction: u16,
    /// 0B, 0C: FFFF while a command is carried out, else 0.
    pub commStatus: u16,
    /// 0B, 0C: successful messages.
    pub eventCount: u16,
    /// 0C: messages.
    pub messageCount: u16,
    /// MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE or MBM_PACKET_EXCEPTION.
    pub kind: u8,
    /// The unit that is asked, or that answers. Of frames only.
    pub unit: u8,
    /// Function code, 1 to 127; of an exception that of the request.
    pub function: u8,
    /// Exception: 1 to 127, the same numbers as MBM_ILLEGAL_FUNCTION and others.
    pub exceptionCode: u8,
    /// 07: eight outputs.
    pub exceptionStatus: u8,
    /// 11: the byte count. It is dataLength, or less: some devices count the id
    /// only and send more behind it.
    pub byteCount: u8,
    /// 2B: MBM_MEI_READ_DEVICE_IDENTIFICATION or another.
    pub meiType: u8,
    /// 2B/0E: one of MBM_DEVICE_ID_.
    pub readDeviceIdCode: u8,
    /// 2B/0E: the first object, or the only one.
    pub objectId: u8,
    /// 2B/0E: 01 to 03 or 81 to 83 by the standard; not checked.
    pub conformity: u8,
    /// 2B/0E: 1 if another request is needed for the rest, else 0.
    pub moreFollows: u8,
    /// 2B/0E: the object to ask for next; if none follows, 0 by the standard, and
    /// not checked.
    pub nextObjectId: u8,
    /// 2B/0E: how many objects the data are.
    pub objectCount: u8,
}

/// The side that C names.
pub(super) fn side(kind: u8) -> Result<PduKind, Status> {
    match kind {
        MBM_PACKET_REQUEST => Ok(PduKind::Request),
        MBM_PACKET_RESPONSE => Ok(PduKind::Response),
        _ => Err(Status::INVALID_ARGUMENT),
    }
}

impl mbm_packet {
    /// Its data; an error for a NULL pointer.
    ///
    /// # Safety
    /// `data` is NULL or points to `dataLength` bytes.
    pub(super) unsafe fn data<'a>(&self) -> Result<&'a [u8], Status> {
        // SAFETY: as the caller promises.
        let data = unsafe { array_or_empty(self.data, self.dataLength.into()) };
        data.ok_or(Status::INVALID_ARGUMENT)
    }

    /// True if its data lie in a buffer that is to be written.
    pub(super) fn lies_in(&self, buffer: *const u8, capacity: u16) -> bool {
        overlap(self.data, self.dataLength, buffer, capacity)
    }

    /// Writes the PDU with these data.
    pub(super) fn emit(
        &self,
        data: &[u8],
        functions: &[Function],
        place: &mut [u8],
    ) -> Result<usize, Status> {
        match self.kind {
            MBM_PACKET_REQUEST => packet::emit_request(&self.request(data)?, functions, place),
            _ => packet::emit_response(&self.response(data)?, functions, place),
        }
    }

    /// Takes over the PDU from one side.
    pub(super) fn take(
        &mut self,
        side: PduKind,
        pdu: &[u8],
        functions: &[Function],
    ) -> Result<(), Status> {
        match side {
            PduKind::Request => self.take_request(&Request::parse_with(pdu, functions)?),
            PduKind::Response => self.take_response(&Response::parse_with(pdu, functions)?),
        }
        Ok(())
    }
}

/// The declaration of a function code among what C declares.
///
/// # Safety
/// `functions` is NULL or points to `count` declarations.
pub(super) unsafe fn own(
    functions: *const mbm_function,
    count: u8,
    code: Option<u8>,
) -> Result<Option<Function>, Status> {
    // SAFETY: as the caller promises.
    let functions = unsafe { array_or_empty(functions, count.into()) };
    declared(functions.ok_or(Status::INVALID_ARGUMENT)?, code)
}

/// Measures the reply to a request, which must be one that can be built.
///
/// # Safety
/// As for [`mbm_packet::data`].
pub(super) unsafe fn reply_length(
    packet: &mbm_packet,
    functions: &[Function],
    measure: impl FnOnce(&Request) -> Length,
) -> Result<Length, Status> {
    if packet.kind != MBM_PACKET_REQUEST {
        return Err(Status::INVALID_ARGUMENT);
    }
    // SAFETY: as the caller promises.
    let request = packet.request(unsafe { packet.data() }?)?;
    packet::emit_request(&request, functions, &mut [0; MAX_PDU])?;
    Ok(measure(&request))
}

/// Hands a length to C; MBM_LENGTH_UNKNOWN with the status that says why there is
/// none.
///
/// # Safety
/// As for [`put`].
pub(super) unsafe fn put_expected(place: *mut mbm_length, length: Result<Length, Status>) -> u8 {
    let told = match length {
        Ok(length) => length,
        Err(_) => Length::Unknown,
    };
    // SAFETY: as the caller promises.
    let status = unsafe { put(place, told.into()) };
    match length {
        Err(refused) if status == Status::OK.code() => refused.code(),
        _ => status,
    }
}
