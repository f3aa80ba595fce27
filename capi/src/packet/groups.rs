//! Records and objects: the groups in the data of some packets.

use super::{mbm_packet, side, MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE};
use crate::functions::MBM_MEI_READ_DEVICE_IDENTIFICATION;
use crate::pointers::{overlap, In, Out};
use mbm::error::{Error, Status};
use mbm::packet::groups;
use mbm::pdu::files::Record;
use mbm::pdu::functions;

/// Registers of a file: one group of function 14 or 15 (hex), in a request or a response.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_record {
    /// The registers, the high byte of each first; 2 * length bytes. A request of
    /// function 14 reads registers and has no data: NULL after parsing, ignored for
    /// building.
    pub data: *const u8,
    /// The file number, 1 to 65535; 0 in a response of function 14, which does not
    /// contain it.
    pub file: u16,
    /// The first record, 0 to 9999; 0 in a response of function 14.
    pub record: u16,
    /// How many registers.
    pub length: u16,
}

/// An object of a device identification.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_object {
    /// The value, usually text, without a NUL.
    pub data: *const u8,
    /// Length of the value in bytes.
    pub length: u8,
    /// The object id: 0 vendor name, 1 product code, 2 revision and so on (V1.1b3, 6.21).
    pub id: u8,
}

/// Reads the group at the cursor with `first`, and moves the cursor past it.
fn next<T>(
    packet: In<mbm_packet>,
    cursor: Out<u16>,
    group: Out<T>,
    first: impl FnOnce(&mbm_packet, &[u8]) -> Option<(T, usize)>,
) -> u8 {
    let found = || {
        group.required().ok()?;
        let (packet, at) = (packet.get().ok()?, cursor.get().ok()?);
        let rest = packet.data().ok()?.get(at.into()..)?;
        let (found, length) = first(&packet, rest)?;
        cursor.put(at.saturating_add(length as u16));
        group.put(found);
        Some(())
    };
    found().is_some().into()
}

/// Reads the records of function 14 or 15 (hex) one by one:
/// `for (cursor = 0; mbm_packet_nextRecord(&packet, &cursor, &record);)`
///
/// Any thread or interrupt may call it.
///
/// @param packet  a request or response of function 14 or 15, parsed or to be built
/// @param cursor  the position in the data; a variable of yours, 0 for the first record
/// @param record  receives the record; its data pointer points into the data of the packet
/// @return 1 if there is a record. 0, with `cursor` and `record` unchanged, if there are no more
///         records, and for NULL
#[no_mangle]
pub extern "C" fn mbm_packet_nextRecord(
    packet: In<mbm_packet>,
    cursor: Out<u16>,
    record: Out<mbm_record>,
) -> u8 {
    let first = |packet: &mbm_packet, rest: &[u8]| {
        let side = side(packet.kind).ok()?;
        let (head, data, length) = groups::record(side, packet.function, rest)?;
        let record = mbm_record {
            data: if data.is_empty() {
                core::ptr::null()
            } else {
                data.as_ptr()
            },
            file: head.file,
            record: head.record,
            length: head.length,
        };
        Some((record, length))
    };
    next(packet, cursor, record, first)
}

/// Reads the objects of a device identification one by one, as mbm_packet_nextRecord
/// reads records.
///
/// Any thread or interrupt may call it.
///
/// @param packet  a response of function 2B/0E (hex), parsed or to be built
/// @param cursor  the position in the data; a variable of yours, 0 for the first object
/// @param object  receives the object; its data pointer points into the data of the packet
/// @return 1 if there is an object. 0, with `cursor` and `object` unchanged, if there are no
///         more objects, and for NULL
#[no_mangle]
pub extern "C" fn mbm_packet_nextObject(
    packet: In<mbm_packet>,
    cursor: Out<u16>,
    object: Out<mbm_object>,
) -> u8 {
    let first = |packet: &mbm_packet, rest: &[u8]| {
        if !packet.has_objects() {
            return None;
        }
        let (id, value, bytes) = groups::object(rest)?;
        let object = mbm_object {
            data: value.as_ptr(),
            length: value.len() as u8,
            id,
        };
        Some((object, bytes))
    };
    next(packet, cursor, object, first)
}

impl mbm_packet {
    fn has_objects(&self) -> bool {
        self.kind == MBM_PACKET_RESPONSE
            && self.function == functions::ENCAPSULATED_INTERFACE_TRANSPORT
            && self.meiType == MBM_MEI_READ_DEVICE_IDENTIFICATION
    }
}

/// Writes a group after the other groups of a packet, which are in `storage`, and adds
/// its length to dataLength.
fn add(
    packet: Out<mbm_packet>,
    storage: Out<u8>,
    capacity: u16,
    (data, length): (*const u8, u16),
    write: impl FnOnce(&mut mbm_packet, &[u8], &mut [u8]) -> Result<usize, Error>,
) -> Result<(), Error> {
    let refused = Error::InvalidArgument;
    // Data and storage do not overlap.
    let mut extended = packet.get()?;
    let is_contiguous = extended.dataLength == 0 || core::ptr::eq(extended.data, storage.pointer());
    if !is_contiguous || (length > 0 && overlap(data, length, storage.pointer(), capacity)) {
        return Err(refused);
    }
    // SAFETY: the record or object has these data, as C says.
    let data = unsafe { In::new(data) }.slice(length.into())?;
    let place = storage.buffer(capacity)?;
    let used = extended.dataLength;
    let space = place.get_mut(used.into()..).ok_or(refused)?;
    let more = write(&mut extended, data, space)?;
    extended.data = place.as_ptr();
    extended.dataLength = used.saturating_add(more as u16);
    packet.put(extended);
    Ok(())
}

/// Adds a record to the data of a packet of function 14 or 15 (hex) that you are going to
/// build. Set the kind and the function of the packet first, and dataLength to 0. mbm_client_forward
/// takes the data of a request as its `body`.
///
/// @param packet    gets the record; unchanged if the call fails
/// @param storage   receives the data of the packet; use the same storage for all its records
/// @param capacity  size of `storage` in bytes; 251 are always enough
/// @param record    the record; its data must not overlap `storage`
/// @return a status; MBM_BUFFER_TOO_SMALL; MBM_ILLEGAL_FUNCTION if the function is not 14 or 15;
///         MBM_ILLEGAL_DATA_ADDRESS or MBM_ILLEGAL_DATA_VALUE for an invalid record;
///         MBM_INVALID_ARGUMENT for an exception packet, record data that overlap `storage`, or
///         packet data that are not in `storage`
#[no_mangle]
pub extern "C" fn mbm_packet_addRecord(
    packet: Out<mbm_packet>,
    storage: Out<u8>,
    capacity: u16,
    record: In<mbm_record>,
) -> u8 {
    let (Ok(added), Ok(current)) = (record.get(), packet.get()) else {
        return Status::INVALID_ARGUMENT.code();
    };
    // A request of function 14 names the registers and has no data.
    let reads =
        current.kind == MBM_PACKET_REQUEST && current.function == functions::READ_FILE_RECORD;
    let bytes = match added.length.checked_mul(2) {
        _ if reads => 0,
        Some(bytes) => bytes,
        None => return Status::ILLEGAL_DATA_VALUE.code(),
    };
    let write = |packet: &mut mbm_packet, data: &[u8], space: &mut [u8]| {
        let head = Record {
            file: added.file,
            record: added.record,
            length: added.length,
        };
        groups::put_record(side(packet.kind)?, packet.function, head, data, space)
    };
    let done = add(packet, storage, capacity, (added.data, bytes), write);
    Status::from(done).code()
}

/// Adds an object to the data of a response of function 2B/0E (hex) that you are going to
/// build. Set the kind, the function and the meiType of the packet first, and dataLength
/// and objectCount to 0.
///
/// @param packet    gets the object; unchanged if the call fails
/// @param storage   receives the data of the packet; use the same storage for all its objects
/// @param capacity  size of `storage` in bytes; 246 are always enough
/// @param object    the object; its data must not overlap `storage`
/// @return a status; MBM_BUFFER_TOO_SMALL: if `storage` has 246 bytes, the object belongs into
///         the next response, so set moreFollows and nextObjectId; MBM_ILLEGAL_FUNCTION if the
///         packet is no such response; MBM_INVALID_ARGUMENT for object data that overlap
///         `storage`, or packet data that are not in `storage`
#[no_mangle]
pub extern "C" fn mbm_packet_addObject(
    packet: Out<mbm_packet>,
    storage: Out<u8>,
    capacity: u16,
    object: In<mbm_object>,
) -> u8 {
    let Ok(added) = object.get() else {
        return Status::INVALID_ARGUMENT.code();
    };
    let write = |packet: &mut mbm_packet, value: &[u8], space: &mut [u8]| {
        if !packet.has_objects() {
            return Err(Error::IllegalFunction);
        }
        let count = packet.objectCount.checked_add(1);
        packet.objectCount = count.ok_or(Error::BufferTooSmall)?;
        groups::put_object(added.id, value, space)
    };
    let value = (added.data, added.length.into());
    let done = add(packet, storage, capacity, value, write);
    Status::from(done).code()
}
