//! The records that a unit knows: the head of every record, a user's function, and the
//! diagnostics.

use crate::functions::mbm_rule;
use core::ffi::c_void;
use mbm::server::diagnostics::Diagnostics;
#[cfg(doc)]
use mbm::server::Reply;

/// The head of each record that a mbm_unit_serve function takes. Private.
#[repr(C)]
pub struct mbm_service {
    /// Serves a request if its function belongs to this record. NULL in a zeroed record,
    /// which serves nothing.
    pub serve: Option<
        unsafe extern "C" fn(service: *mut mbm_service, pdu: *mut u8, info: *const c_void) -> usize,
    >,
    /// The kind of the record within its family, from 1 on; 0 in a zeroed record.
    pub kind: u8,
}

/// The function of a service. `pdu` points to the PDU of the request that `info`
/// describes. `info` is the field `request` of the server that received the request, and
/// valid for that whole server. Returns the number of a [`Reply`].
pub(super) type Serve =
    unsafe extern "C" fn(service: *mut mbm_service, pdu: *mut u8, info: *const c_void) -> usize;

/// A request for a function of yours.
#[repr(C)]
pub struct mbm_request {
    /// The data of the request: the bytes after the function code.
    pub data: *const u8,
    /// The line or connection that the request came from: the `context` of the port of the
    /// server that received it, or the `connection` of mbm_unit_respond.
    pub connection: *mut c_void,
    /// Length of `data` in bytes, 0 to 252.
    pub length: u16,
    /// The unit id in the request. 0 on a serial line is a broadcast: the server then
    /// sends no response.
    pub unit: u8,
    /// The function code.
    pub function: u8,
}

/// A function of yours. Initialise the struct with MBM_INIT, set the fields that you need, and
/// pass it to mbm_unit_serveCustom.
///
/// A unit asks its records in the order of their registration. So a function that is
/// registered before the record that serves the same code is asked first. It answers the
/// request itself, for example with an exception, or it returns MBM_REPLY_DECLINED: then the
/// record after it answers. A function that is registered after tables with its code is asked
/// for the cells that they lack; a function with code 0 is not.
#[repr(C)]
pub struct mbm_custom {
    /// Private.
    pub service: mbm_service,
    /// Carries out a request and writes the data of the response, without the function
    /// code, to `response`. `capacity` is the space in bytes that the frame buffer has
    /// after the request; the server sends at most 252 bytes. Returns the number of bytes
    /// written, or MBM_REPLY_EXCEPTION | code, or MBM_REPLY_NONE, MBM_REPLY_PENDING or
    /// MBM_REPLY_DECLINED.
    pub serve: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            request: *const mbm_request,
            response: *mut u8,
            capacity: u16,
        ) -> u16,
    >,
    /// Passed to `serve`. Any value; may be NULL.
    pub context: *mut c_void,
    /// The function code, 1 to 127. 0 means every function that no earlier record of the
    /// unit serves. The standard reserves 65 to 72 and 100 to 110 for users (V1.1b3, 5).
    pub code: u8,
    /// The length of the request PDUs, which a server of RTU over TCP needs. If it is
    /// zeroed, a request is complete when its CRC is right.
    pub length: mbm_rule,
}

/// The kind of a user's function. No other record has this kind.
pub(super) const CUSTOM: u8 = 0x80;

/// True if this is the head of a user's function.
pub(super) unsafe fn is_custom(service: *const mbm_service) -> bool {
    (*service).kind == CUSTOM
}

/// The counters, the event log and the listen only mode of a unit. Initialise the struct with
/// MBM_INIT and pass it to mbm_unit_serveDiagnostics. The counters wrap at 65536; you may read
/// them at any time. The sub-functions below are those of function 08 (V1.1b3, 6.8), in hex.
#[repr(C)]
pub struct mbm_diagnostics {
    /// Private.
    pub service: mbm_service,
    /// Optional: called when the client restarts the communications (sub-function 01).
    /// `clearLog` is 1 if the client cleared the event log too, else 0.
    pub restart: Option<unsafe extern "C" fn(context: *mut c_void, clearLog: u8)>,
    /// Passed to `restart`. Any value; may be NULL.
    pub context: *mut c_void,
    /// The value that sub-function 02 returns. You set it.
    pub diagnosticRegister: u16,
    /// Sub-function 0B: frames with a right CRC, for any unit.
    pub busMessages: u16,
    /// Sub-function 0C: damaged frames.
    pub busCommunicationErrors: u16,
    /// Sub-function 0D: exceptions, including those that broadcasts caused.
    pub exceptionErrors: u16,
    /// Sub-function 0E: requests for this unit, and broadcasts.
    pub serverMessages: u16,
    /// Sub-function 0F: requests without a response.
    pub noResponses: u16,
    /// Sub-function 10: exceptions with code 07.
    pub naks: u16,
    /// Sub-function 11: exceptions with code 06.
    pub busy: u16,
    /// Sub-function 12: frames that were too long for the buffer.
    pub characterOverruns: u16,
    /// The event count that function 0B returns: requests that were carried out.
    pub events: u16,
    /// 1 in listen only mode, else 0.
    pub listenOnly: u8,
    /// Private.
    pub hidden: [u8; 67],
}

const _: () = {
    use core::mem::offset_of;
    let start = offset_of!(mbm_diagnostics, diagnosticRegister);
    assert!(offset_of!(mbm_diagnostics, events) - start == offset_of!(Diagnostics, events));
    assert!(
        offset_of!(mbm_diagnostics, listenOnly) - start == offset_of!(Diagnostics, listen_only)
    );
    let end = offset_of!(mbm_diagnostics, hidden) + 67;
    assert!(end - start == size_of::<Diagnostics>());
};
