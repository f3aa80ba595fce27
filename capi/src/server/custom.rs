//! Functions that the user defines, and functions that the user switches off.

use super::hooks::connection;
use super::records::{is_custom, mbm_custom, mbm_request, CUSTOM};
use super::units::{add_as, add_first, is_ignored_broadcast, refusal_of, request, Services};
use super::{mbm_service, mbm_unit};
use crate::functions;
use core::ffi::c_void;
use mbm::error::Status;
use mbm::pdu::custom::Rule;
use mbm::server::custom::{self, HandlerResult};
use mbm::server::{Indication, Reply};

/// A function of yours returns this, or-ed with the exception code (1 to 127), to answer
/// with an exception.
pub const MBM_REPLY_EXCEPTION: u16 = 0x0100;
/// A function of yours returns this to send no response.
pub const MBM_REPLY_NONE: u16 = 0x0200;
/// A function of yours returns this if it has not finished. The next poll calls it again
/// with the same request. The server receives nothing meanwhile.
pub const MBM_REPLY_PENDING: u16 = 0x0300;
/// A function of yours returns this to decline the request: the next record of the unit that
/// serves the function code answers, or exception 01 if there is none.
pub const MBM_REPLY_DECLINED: u16 = 0x0400;

/// The functions that a unit answers with exception 01, even if it could serve them: see
/// mbm_unit_switchFunction.
#[repr(C)]
pub struct mbm_functionMask {
    /// Private.
    pub service: mbm_service,
    /// Private.
    pub off: [u8; 16],
}

unsafe extern "C" fn serve(service: *mut mbm_service, pdu: *mut u8, info: *const c_void) -> usize {
    let code = (*service.cast::<mbm_custom>()).code;
    if code != *pdu && (code != 0 || (*refusal_of(info)).is_of_cells()) {
        return Reply::NOT_HANDLED.code();
    }
    call_handler(service.cast(), pdu, info)
}

/// Calls the handler of the record. A function of its own, so that a request for another
/// function stays cheap.
unsafe fn call_handler(record: *mut mbm_custom, pdu: *mut u8, info: *const c_void) -> usize {
    // No reference to the record is kept while its function runs.
    let to = (*info.cast::<Indication>()).to;
    let connection = connection(info);
    let (pdu, length) = request(pdu, info);
    let function = pdu.first().copied().unwrap_or(0);
    if is_ignored_broadcast(info, function) {
        return Reply::NOT_HANDLED.code();
    }
    let Some(handler) = (*record).serve else {
        return Reply::NOT_HANDLED.code();
    };
    let context = (*record).context;
    custom::serve(pdu, length, |data, space| {
        let request = mbm_request {
            connection,
            data: data.as_ptr(),
            length: data.len() as u16,
            unit: to,
            function,
        };
        let capacity = space.len() as u16;
        let returned = handler(context, &raw const request, space.as_mut_ptr(), capacity);
        match (returned & 0xFF00, returned as u8) {
            (0, bytes) => HandlerResult::Data(bytes.into()),
            (MBM_REPLY_EXCEPTION, code @ 1..=0x7F) => HandlerResult::Exception(code),
            (MBM_REPLY_NONE, 0) => HandlerResult::NoResponse,
            (MBM_REPLY_PENDING, 0) => HandlerResult::Pending,
            (MBM_REPLY_DECLINED, 0) => HandlerResult::Declined,
            _ => HandlerResult::Exception(Reply::SERVER_DEVICE_FAILURE.exception_code()),
        }
    })
    .code()
}

/// The length rule of `function`, if this is the head of the record for that function.
unsafe fn rule_of(service: *const mbm_service, function: u8) -> Option<Rule> {
    // A record of that kind is a `mbm_custom`.
    if !is_custom(service) {
        return None;
    }
    let record = service.cast::<mbm_custom>();
    if (*record).code != function {
        return None;
    }
    functions::rule((*record).length)
}

/// The length rule that the units have for a user's function.
pub(super) unsafe fn rule(units: *const mbm_unit, count: u8, function: u8) -> Option<Rule> {
    for index in 0..count {
        for service in Services::new(units.add(index.into())) {
            if let Some(rule) = rule_of(service, function) {
                return Some(rule);
            }
        }
    }
    None
}

/// Serves a function of yours, in every framing.
///
/// @return a status; see mbm_unit_serveFiles. MBM_INVALID_ARGUMENT for a NULL `serve`, a code above
///         127 or an invalid `length`
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveCustom(unit: *mut mbm_unit, custom: *mut mbm_custom) -> u8 {
    if custom.is_null()
        || (*custom).serve.is_none()
        || (*custom).code > 127
        || functions::rule((*custom).length).is_none()
    {
        return Status::INVALID_ARGUMENT.code();
    }
    add_as(unit, custom.cast(), CUSTOM, serve).code()
}

/// Answers a disabled function with exception 01, and leaves any other to the services
/// after this one.
unsafe extern "C" fn refuse_disabled(
    service: *mut mbm_service,
    pdu: *mut u8,
    _info: *const c_void,
) -> usize {
    let off = custom::DisabledFunctions((*service.cast::<mbm_functionMask>()).off);
    if off.is_disabled(*pdu) {
        Reply::ILLEGAL_FUNCTION.code()
    } else {
        Reply::NOT_HANDLED.code()
    }
}

/// The byte of the mask that has the bit of a function.
///
/// # Safety
/// `mask` is valid; `code` is at most 127.
unsafe fn mask_byte(mask: *mut mbm_functionMask, code: u8) -> *mut u8 {
    // Code 127 is in the last of the 16 bytes.
    (&raw mut (*mask).off).cast::<u8>().add((code / 8).into())
}

/// Switches a function of a unit off or on. The unit answers a function that is off with
/// exception 01, even if a record serves it.
///
/// @param mask  must stay valid for as long as the unit is used; initialised with MBM_INIT. Units
///              that share a mask have the same functions off
/// @param code  the function code, 1 to 127
/// @param on    0 switches the function off, anything else switches it on
/// @return a status; see mbm_unit_serveFiles
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_switchFunction(
    unit: *mut mbm_unit,
    mask: *mut mbm_functionMask,
    code: u8,
    on: u8,
) -> u8 {
    if mask.is_null() || code == 0 || code > 127 {
        return Status::INVALID_ARGUMENT.code();
    }
    let status = add_first(unit, mask.cast(), refuse_disabled);
    if status == Status::OK.code() {
        let (byte, bit) = (mask_byte(mask, code), 1 << (code % 8));
        *byte |= bit;
        if on != 0 {
            *byte ^= bit;
        }
    }
    status
}
