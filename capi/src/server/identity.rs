//! What a device tells of itself.

use super::units::{add, request};
use super::{mbm_service, mbm_unit};
use crate::packet::mbm_object;
use core::ffi::c_void;
use core::slice::from_raw_parts;
use mbm::server::identity::{self, Objects};

/// The eight outputs of function 07. Zero it, and hand it to
/// mbm_unit_serveExceptionStatus.
#[repr(C)]
pub struct mbm_exceptionStatus {
    /// Private.
    pub service: mbm_service,
    /// The outputs; change them at any time.
    pub outputs: u8,
}

/// What function 11 answers. Zero it, set what you need, and hand it to
/// mbm_unit_serveServerId. All together at most 251 bytes, less what the frame
/// buffer lacks; more is answered with exception 04.
#[repr(C)]
pub struct mbm_serverId {
    /// Private.
    pub service: mbm_service,
    /// The id; NULL only with 0 bytes.
    pub id: *const u8,
    /// What stands behind the run indicator; NULL only with 0 bytes.
    pub additional: *const u8,
    /// Bytes of the id.
    pub idLength: u8,
    /// Bytes behind the run indicator.
    pub additionalLength: u8,
    /// The run indicator: 0 is answered as 00, anything else as FF.
    pub running: u8,
}

/// A device identification. Zero it, set both, and hand it to
/// mbm_unit_serveIdentification.
#[repr(C)]
pub struct mbm_identification {
    /// Private.
    pub service: mbm_service,
    /// The objects, in any order: ids 0 vendor name, 1 product code and 2 revision,
    /// which every device has; 3 vendor URL, 4 product name, 5 model name, 6 application
    /// name; from 0x80 on yours. Each has 244 bytes at most.
    pub objects: *const mbm_object,
    /// How many.
    pub count: u16,
}

/// # Safety
/// `service` is the head of a record of its kind; `pdu` has the bytes and room of
/// `info`. So of the functions below.
unsafe extern "C" fn serve_exception_status(
    service: *mut mbm_service,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    // SAFETY: as the caller promises.
    unsafe {
        let outputs = (*service.cast::<mbm_exceptionStatus>()).outputs;
        let (pdu, length) = request(pdu, info);
        identity::serve_exception_status(outputs, pdu, length).code()
    }
}

/// The bytes at a pointer; none at NULL.
///
/// # Safety
/// There are so many, which nothing changes while the slice lives.
unsafe fn bytes<'a>(first: *const u8, length: u8) -> &'a [u8] {
    if first.is_null() {
        return &[];
    }
    // SAFETY: not NULL; the rest as the caller promises.
    unsafe { from_raw_parts(first, length.into()) }
}

unsafe extern "C" fn serve_server_id(
    service: *mut mbm_service,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    // SAFETY: as the caller promises.
    unsafe {
        let record = service.cast::<mbm_serverId>();
        let id = bytes((*record).id, (*record).idLength);
        let additional = bytes((*record).additional, (*record).additionalLength);
        let running = (*record).running != 0;
        let (pdu, length) = request(pdu, info);
        identity::serve_server_id(id, running, additional, pdu, length).code()
    }
}

/// Objects of C.
struct ObjectsByC(*const mbm_identification);

impl Objects for ObjectsByC {
    fn object(&self, id: u8) -> Option<&[u8]> {
        // SAFETY: the record is the caller's and stays where it is, as the header
        // demands, with so many objects behind its pointer.
        unsafe {
            let mut object = (*self.0).objects;
            if object.is_null() {
                return None;
            }
            for _ in 0..(*self.0).count {
                if (*object).id == id {
                    return Some(bytes((*object).data, (*object).length));
                }
                object = object.add(1);
            }
        }
        None
    }
}

unsafe extern "C" fn serve_identification(
    service: *mut mbm_service,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    // SAFETY: as the caller promises.
    let (pdu, length) = unsafe { request(pdu, info) };
    identity::serve_identification(&ObjectsByC(service.cast()), pdu, length).code()
}

/// Serves the exception status: function 07.
///
/// @param unit    the unit
/// @param status  yours, for as long as the unit is used
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer; MBM_BUFFER_TOO_SMALL if
///         the unit has no place
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveExceptionStatus(
    unit: *mut mbm_unit,
    status: *mut mbm_exceptionStatus,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add(unit, status.cast(), serve_exception_status) }
}

/// Serves the server id: function 11.
///
/// @param unit  the unit
/// @param id    yours, for as long as the unit is used
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer; MBM_BUFFER_TOO_SMALL if
///         the unit has no place
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveServerId(unit: *mut mbm_unit, id: *mut mbm_serverId) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add(unit, id.cast(), serve_server_id) }
}

/// Serves the device identification: function 2B/0E, as streams of objects and
/// one by one. What does not fit into one response follows in the next that the
/// client asks for. The conformity level is that of the objects there are.
///
/// @param unit            the unit
/// @param identification  yours, for as long as the unit is used
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer; MBM_BUFFER_TOO_SMALL if
///         the unit has no place
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveIdentification(
    unit: *mut mbm_unit,
    identification: *mut mbm_identification,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add(unit, identification.cast(), serve_identification) }
}
