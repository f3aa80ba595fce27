//! The records that a unit knows: the head of every one, a user's function, and that of
//! diagnostics.

use crate::functions::mbm_rule;
use core::ffi::c_void;
use mbm::server::diagnostics::Diagnostics;
#[cfg(doc)]
use mbm::server::Reply;

/// The head of each record that a mbm_unit_serve function takes. Private.
#[repr(C)]
pub struct mbm_service {
    /// Serves a request, if it is one of this family. NULL in a zeroed record,
    /// which serves nothing.
    pub serve: Option<
        unsafe extern "C" fn(service: *mut mbm_service, pdu: *mut u8, info: *const c_void) -> usize,
    >,
    /// What kind of record of its family it is served as, from 1 on; 0 in a zeroed one.
    pub kind: u8,
}

/// The function of a service. `pdu` points to the PDU of a request that `info`
/// tells of, and returns a [`Reply`].
pub(super) type Serve =
    unsafe extern "C" fn(service: *mut mbm_service, pdu: *mut u8, info: *const c_void) -> usize;

/// A request for a function of yours.
#[repr(C)]
pub struct mbm_request {
    /// What stands behind the function code.
    pub data: *const u8,
    /// Bytes of it, 0 to 252.
    pub length: u16,
    /// The unit that it was sent to. On a serial line 0 is broadcast: no response is
    /// sent.
    pub unit: u8,
    /// The function code.
    pub function: u8,
}

/// A function of yours. Zero it, set what you need, and hand it to
/// mbm_unit_serveCustom.
#[repr(C)]
pub struct mbm_custom {
    /// Private.
    pub service: mbm_service,
    /// Carries out a request and writes the data of the response, which stand
    /// behind the function code, to `response`. `capacity` is what the frame
    /// buffer has left behind the request, at most 252 of it are used. Returns
    /// how many bytes it wrote, or MBM_REPLY_EXCEPTION | code, MBM_REPLY_NONE or
    /// MBM_REPLY_PENDING.
    pub serve: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            request: *const mbm_request,
            response: *mut u8,
            capacity: u16,
        ) -> u16,
    >,
    /// Handed to `serve`. Yours, may be NULL.
    pub context: *mut c_void,
    /// The function code, 1 to 127; 0 is every function that nothing before it
    /// serves. 65 to 72 and 100 to 110 are left to users (V1.1b3, 5).
    pub code: u8,
    /// How long its request PDUs are, which RTU over TCP asks. Zeroed, a request is
    /// whole once its CRC is right.
    pub length: mbm_rule,
}

/// The kind of a function of yours, which no other record has.
pub(super) const CUSTOM: u8 = 0x80;

/// True if the record with this head is a function of C.
///
/// # Safety
/// `service` is the head of a record of any kind.
#[inline(always)]
pub(super) unsafe fn is_custom(service: *const mbm_service) -> bool {
    // SAFETY: as the caller promises.
    unsafe { (*service).kind == CUSTOM }
}

/// True if the record with this head is a function of C that has another code than
/// `function`.
///
/// # Safety
/// As for [`is_custom`].
#[inline(always)]
pub(super) unsafe fn is_of_another(service: *const mbm_service, function: u8) -> bool {
    // SAFETY: as the caller promises; a record of that kind is a function of C.
    unsafe {
        is_custom(service) && {
            let code = (*service.cast::<mbm_custom>()).code;
            code != function && code != 0
        }
    }
}

/// What a unit knows of its line. Zero it, and hand it to
/// mbm_unit_serveDiagnostics. Counters wrap at 2^16; read them as you like.
#[repr(C)]
pub struct mbm_diagnostics {
    /// Private.
    pub service: mbm_service,
    /// Optional: called when the client restarts the line with sub-function 01 of
    /// 08; `clearLog` is 1 if it cleared the event log too.
    pub restart: Option<unsafe extern "C" fn(context: *mut c_void, clearLog: u8)>,
    /// Handed to `restart`. Yours, may be NULL.
    pub context: *mut c_void,
    /// What sub-function 02 of 08 returns: yours.
    pub diagnosticRegister: u16,
    /// Sub-function 0B: frames with a right CRC, for whichever unit.
    pub busMessages: u16,
    /// Sub-function 0C: frames that arrived damaged.
    pub busCommunicationErrors: u16,
    /// Sub-function 0D: exceptions, those of broadcasts too.
    pub exceptionErrors: u16,
    /// Sub-function 0E: requests for this unit, and broadcasts.
    pub serverMessages: u16,
    /// Sub-function 0F: requests that were not answered.
    pub noResponses: u16,
    /// Sub-function 10: exceptions 07.
    pub naks: u16,
    /// Sub-function 11: exceptions 06.
    pub busy: u16,
    /// Sub-function 12: frames that the buffer could not hold.
    pub characterOverruns: u16,
    /// What 0B returns: requests that were carried out.
    pub events: u16,
    /// 1 in listen only mode.
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
