//! Records and objects: the groups that the data of some packets consist of.

use super::{mbm_packet, side, MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE};
use crate::functions::{
    MBM_FC_ENCAPSULATED_INTERFACE, MBM_FC_READ_FILE_RECORD, MBM_MEI_READ_DEVICE_IDENTIFICATION,
};
use crate::pointers::{array_or_empty, buffer, get, overlap, put};
use mbm::error::Status;
use mbm::packet::groups;
use mbm::pdu::files::Record;

/// Registers of a file: a sub-request of 14 or 15, or what answers it.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_record {
    /// The registers, high bytes first, 2 * length bytes. A request of 14,
    /// which reads them, has none: NULL, and ignored.
    pub data: *const u8,
    /// File number, 1 to 65535; 0 in a response of 14, which does not say.
    pub file: u16,
    /// The first record, 0 to 9999; 0 in a response of 14.
    pub record: u16,
    /// How many registers.
    pub length: u16,
}

/// An object of a device identification.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_object {
    /// Its value, most often text, without an end.
    pub data: *const u8,
    /// Bytes of the value.
    pub length: u8,
    /// 0 vendor name, 1 product code, 2 revision and so on (V1.1b3, 6.21).
    pub id: u8,
}

/// The next group of a packet's data, found by `first` at the cursor, which
/// moves behind it.
///
/// # Safety
/// The pointers are NULL or valid.
unsafe fn next<T>(
    packet: *const mbm_packet,
    cursor: *mut u16,
    group: *mut T,
    first: impl FnOnce(&mbm_packet, &[u8]) -> Option<(T, usize)>,
) -> u8 {
    // SAFETY: as the caller promises.
    unsafe {
        let found = || {
            let (packet, at) = (get(packet).filter(|_| !group.is_null())?, get(cursor)?);
            let rest = packet.data().ok()?.get(at.into()..)?;
            let (found, length) = first(&packet, rest)?;
            put(cursor, at.saturating_add(length as u16));
            put(group, found);
            Some(())
        };
        found().is_some().into()
    }
}

/// Gives the records of 14 or 15 one by one:
/// `for (cursor = 0; mbm_packet_nextRecord(&packet, &cursor, &record);)`
///
/// Any thread or interrupt may call it.
///
/// @param packet  a request or response of 14 or 15, as parsed or built
/// @param cursor  where it goes on; yours, 0 to begin
/// @param record  receives the record, whose data point into the packet's
/// @return 1; 0, with cursor and record unchanged, if there is none left, or for NULL
#[no_mangle]
pub unsafe extern "C" fn mbm_packet_nextRecord(
    packet: *const mbm_packet,
    cursor: *mut u16,
    record: *mut mbm_record,
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
    // SAFETY: as the header demands.
    unsafe { next(packet, cursor, record, first) }
}

/// Gives the objects of a device identification one by one, as
/// mbm_packet_nextRecord does records.
///
/// Any thread or interrupt may call it.
///
/// @param packet  a response of 2B/0E, as parsed or built
/// @param cursor  where it goes on; yours, 0 to begin
/// @param object  receives the object, whose data point into the packet's
/// @return 1; 0, with cursor and object unchanged, if there is none left, or for NULL
#[no_mangle]
pub unsafe extern "C" fn mbm_packet_nextObject(
    packet: *const mbm_packet,
    cursor: *mut u16,
    object: *mut mbm_object,
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
    // SAFETY: as the header demands.
    unsafe { next(packet, cursor, object, first) }
}

impl mbm_packet {
    fn has_objects(&self) -> bool {
        self.kind == MBM_PACKET_RESPONSE
            && self.function == MBM_FC_ENCAPSULATED_INTERFACE
            && self.meiType == MBM_MEI_READ_DEVICE_IDENTIFICATION
    }
}

/// Writes a group behind those of a packet, in storage that holds them, and
/// counts it to the packet's data.
///
/// # Safety
/// The pointers are NULL or valid.
unsafe fn add(
    packet: *mut mbm_packet,
    storage: *mut u8,
    capacity: u16,
    (data, length): (*const u8, u16),
    write: impl FnOnce(&mut mbm_packet, &[u8], &mut [u8]) -> Result<usize, Status>,
) -> Result<(), Status> {
    let refused = Status::INVALID_ARGUMENT;
    // SAFETY: as the caller promises; data and storage do not overlap.
    unsafe {
        let mut grown = get(packet).ok_or(refused)?;
        let behind_others = grown.dataLength == 0 || core::ptr::eq(grown.data, storage);
        if !behind_others || (length > 0 && overlap(data, length, storage, capacity)) {
            return Err(refused);
        }
        let data = array_or_empty(data, length.into()).ok_or(refused)?;
        let place = buffer(storage, capacity).ok_or(refused)?;
        let used = grown.dataLength;
        let space = place.get_mut(used.into()..).ok_or(refused)?;
        let more = write(&mut grown, data, space)?;
        grown.data = storage;
        grown.dataLength = used.saturating_add(more as u16);
        put(packet, grown);
    }
    Ok(())
}

/// Adds a record to a packet of 14 or 15, to be built then. Set the packet's
/// kind and function first, and dataLength to 0.
///
/// @param packet    grows by the record; unchanged if it is refused
/// @param storage   receives the packet's data, for all its records the same
/// @param capacity  bytes of `storage`; 251 always do
/// @param record    the record; its data may not lie in `storage`
/// @return MBM_OK; MBM_BUFFER_TOO_SMALL; MBM_ILLEGAL_FUNCTION if this is not 14
///         or 15; MBM_ILLEGAL_DATA_ADDRESS or MBM_ILLEGAL_DATA_VALUE for a
///         record that there cannot be; MBM_INVALID_ARGUMENT, also for data
///         that are elsewhere
#[no_mangle]
pub unsafe extern "C" fn mbm_packet_addRecord(
    packet: *mut mbm_packet,
    storage: *mut u8,
    capacity: u16,
    record: *const mbm_record,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let Some((added, whose)) = get(record).zip(get(packet)) else {
            return Status::INVALID_ARGUMENT.code();
        };
        // A request of 14 names the registers, and carries none.
        let reads = whose.kind == MBM_PACKET_REQUEST && whose.function == MBM_FC_READ_FILE_RECORD;
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
        done.err().unwrap_or(Status::OK).code()
    }
}

/// Adds an object to a response of 2B/0E, to be built then. Set the packet's
/// kind, function and meiType first, and dataLength and objectCount to 0.
///
/// @param packet    grows by the object; unchanged if it is refused
/// @param storage   receives the packet's data, for all its objects the same
/// @param capacity  bytes of `storage`; 246 always do
/// @param object    the object; its data may not lie in `storage`
/// @return MBM_OK; MBM_BUFFER_TOO_SMALL: if 246 bytes are, set moreFollows and
///         nextObjectId; MBM_ILLEGAL_FUNCTION if this is no such response;
///         MBM_INVALID_ARGUMENT, also for data that are elsewhere
#[no_mangle]
pub unsafe extern "C" fn mbm_packet_addObject(
    packet: *mut mbm_packet,
    storage: *mut u8,
    capacity: u16,
    object: *const mbm_object,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let Some(added) = get(object) else {
            return Status::INVALID_ARGUMENT.code();
        };
        let write = |packet: &mut mbm_packet, value: &[u8], space: &mut [u8]| {
            if !packet.has_objects() {
                return Err(Status::ILLEGAL_FUNCTION);
            }
            let count = packet.objectCount.checked_add(1);
            packet.objectCount = count.ok_or(Status::BUFFER_TOO_SMALL)?;
            groups::put_object(added.id, value, space)
        };
        let value = (added.data, added.length.into());
        let done = add(packet, storage, capacity, value, write);
        done.err().unwrap_or(Status::OK).code()
    }
}
