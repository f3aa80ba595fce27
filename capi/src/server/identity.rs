//! The data with which a device describes itself: exception status, server id and device
//! identification.

use super::units::{add_only, request};
use super::{mbm_service, mbm_unit};
use crate::packet::mbm_object;
use crate::pointers::In;
use core::ffi::c_void;
use mbm::pdu::functions::{
    ENCAPSULATED_INTERFACE_TRANSPORT, READ_EXCEPTION_STATUS, REPORT_SERVER_ID,
};
use mbm::server::identity::{self, Objects};

/// The eight exception status outputs of function 07. Initialise the struct with MBM_INIT and
/// pass it to mbm_unit_serveExceptionStatus.
#[repr(C)]
pub struct mbm_exceptionStatus {
    /// Private.
    pub service: mbm_service,
    /// The outputs, one bit each. You may change them at any time.
    pub outputs: u8,
}

/// The response of function 11 (hex), Report Server ID. Initialise the struct with MBM_INIT,
/// set the fields that you need, and pass it to mbm_unit_serveServerId. The id, the run
/// indicator (1 byte) and the additional data together have at most 251 bytes, fewer if the
/// frame buffer holds less than a whole frame. If they are longer, the server answers with
/// exception 04.
#[repr(C)]
pub struct mbm_serverId {
    /// Private.
    pub service: mbm_service,
    /// The server id; NULL only if idLength is 0.
    pub id: *const u8,
    /// The data after the run indicator; NULL only if additionalLength is 0.
    pub additional: *const u8,
    /// Length of `id` in bytes.
    pub idLength: u8,
    /// Length of `additional` in bytes.
    pub additionalLength: u8,
    /// The run indicator: 0 is sent as 00, any other value as FF (hex).
    pub running: u8,
}

/// A device identification. Initialise the struct with MBM_INIT, set `objects` and `count`,
/// and pass it to mbm_unit_serveIdentification.
#[repr(C)]
pub struct mbm_serverIdentification {
    /// Private.
    pub service: mbm_service,
    /// The objects, in any order. Every device has the ids 0 (vendor name), 1 (product
    /// code) and 2 (revision). Optional are 3 (vendor URL), 4 (product name), 5 (model
    /// name) and 6 (application name), and from 0x80 on your own. An object has at most
    /// 244 bytes.
    pub objects: *const mbm_object,
    /// How many objects.
    pub count: u16,
}

unsafe extern "C" fn serve_exception_status(
    service: *mut mbm_service,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    let outputs = (*service.cast::<mbm_exceptionStatus>()).outputs;
    let (pdu, length) = request(pdu, info);
    identity::serve_exception_status(outputs, pdu, length).code()
}

unsafe extern "C" fn serve_server_id(
    service: *mut mbm_service,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    let record = service.cast::<mbm_serverId>();
    let id = In::new((*record).id).slice_or_empty((*record).idLength.into());
    let additional =
        In::new((*record).additional).slice_or_empty((*record).additionalLength.into());
    let running = (*record).running != 0;
    let (pdu, length) = request(pdu, info);
    identity::serve_server_id(id, running, additional, pdu, length).code()
}

/// The objects of C.
struct CObjects(*const mbm_serverIdentification);

impl Objects for CObjects {
    fn object(&self, id: u8) -> Option<&[u8]> {
        // SAFETY: the header requires that the struct stays valid, at the same address,
        // with `count` objects.
        unsafe {
            let mut object = (*self.0).objects;
            if object.is_null() {
                return None;
            }
            for _ in 0..(*self.0).count {
                if (*object).id == id {
                    return Some(In::new((*object).data).slice_or_empty((*object).length.into()));
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
    let (pdu, length) = request(pdu, info);
    identity::serve_identification(&CObjects(service.cast()), pdu, length).code()
}

functions! {
    (unit: *mut mbm_unit)

    /// Serves function 07, Read Exception Status.
    ///
    /// @return a status; see mbm_unit_serveFiles. MBM_BUSY if the unit serves another such record
    fn mbm_unit_serveExceptionStatus(status: *mut mbm_exceptionStatus)
        = add_only(status.cast(), READ_EXCEPTION_STATUS, serve_exception_status);

    /// Serves function 11 (hex), Report Server ID.
    ///
    /// @return a status; see mbm_unit_serveFiles. MBM_BUSY if the unit serves another such record
    fn mbm_unit_serveServerId(id: *mut mbm_serverId) = add_only(id.cast(), REPORT_SERVER_ID, serve_server_id);

    /// Serves function 2B/0E (hex), Read Device Identification: streams of objects, and
    /// single objects. If the objects do not fit into one response, the client reads the rest
    /// with further requests. The server computes the conformity level from the objects that
    /// exist.
    ///
    /// @return a status; see mbm_unit_serveFiles. MBM_BUSY if the unit serves another such record
    fn mbm_unit_serveIdentification(identification: *mut mbm_serverIdentification)
        = add_only(identification.cast(), ENCAPSULATED_INTERFACE_TRANSPORT, serve_identification);
}
