//! Functions that the caller defines, and functions switched off.

use super::records::{is_custom, mbm_custom, mbm_request, CUSTOM};
use super::units::{add_as, add_first, is_unheard, request, Places};
use super::{mbm_service, mbm_unit};
use crate::functions;
use core::ffi::c_void;
use mbm::error::Status;
use mbm::pdu::custom::Rule;
use mbm::server::custom::{self, Outcome};
use mbm::server::{Reply, RequestInfo};

/// What a function of yours returns for an exception: this, or-ed with the code.
pub const MBM_REPLY_EXCEPTION: u16 = 0x0100;
/// What a function of yours returns for no response at all.
pub const MBM_REPLY_NONE: u16 = 0x0200;
/// What a function of yours returns to be asked again at the next poll, with the
/// same request. The server hears nothing meanwhile.
pub const MBM_REPLY_PENDING: u16 = 0x0300;

/// Functions that a unit answers with exception 01, though it could serve them:
/// see mbm_unit_switchFunction.
#[repr(C)]
pub struct mbm_functionMask {
    /// Private.
    pub service: mbm_service,
    /// Private.
    pub off: [u8; 16],
}

/// # Safety
/// `service` is the head of a function of C; `pdu` has the bytes and room of
/// `info`.
unsafe extern "C" fn serve(service: *mut mbm_service, pdu: *mut u8, info: *const c_void) -> usize {
    // SAFETY: as the caller promises.
    unsafe {
        let code = (*service.cast::<mbm_custom>()).code;
        if code != 0 && code != *pdu {
            return Reply::NOT_HANDLED.code();
        }
        serve_mine(service.cast(), pdu, info)
    }
}

/// [`serve`], of the function that the record serves: apart, for a request of another is
/// to cost little.
///
/// # Safety
/// As for [`serve`].
#[cfg_attr(not(target_os = "none"), inline(never))]
unsafe fn serve_mine(record: *mut mbm_custom, pdu: *mut u8, info: *const c_void) -> usize {
    // SAFETY: as the caller promises; no reference to the record is kept while
    // its function runs.
    unsafe {
        let to = (*info.cast::<RequestInfo>()).to;
        let (pdu, length) = request(pdu, info);
        let function = pdu.first().copied().unwrap_or(0);
        if is_unheard(info, function) {
            return Reply::NOT_HANDLED.code();
        }
        let Some(handler) = (*record).serve else {
            return Reply::NOT_HANDLED.code();
        };
        let context = (*record).context;
        custom::serve(pdu, length, |data, space| {
            let request = mbm_request {
                data: data.as_ptr(),
                length: data.len() as u16,
                unit: to,
                function,
            };
            let capacity = space.len() as u16;
            let said = handler(context, &raw const request, space.as_mut_ptr(), capacity);
            match (said & 0xFF00, said as u8) {
                (0, bytes) => Outcome::Data(bytes.into()),
                (MBM_REPLY_EXCEPTION, code @ 1..=0x7F) => Outcome::Exception(code),
                (MBM_REPLY_NONE, 0) => Outcome::NoResponse,
                (MBM_REPLY_PENDING, 0) => Outcome::Pending,
                _ => Outcome::Exception(Reply::SERVER_DEVICE_FAILURE.exception_code()),
            }
        })
        .code()
    }
}

/// The length rule of a function, if the record with this head is that function.
///
/// # Safety
/// `service` is the head of a record of any kind.
unsafe fn declared(service: *const mbm_service, function: u8) -> Option<Rule> {
    // SAFETY: as the caller promises; what this file serves is a function of C.
    unsafe {
        if !is_custom(service) {
            return None;
        }
        let record = service.cast::<mbm_custom>();
        if (*record).code != function {
            return None;
        }
        functions::rule((*record).length)
    }
}

/// The length rule that a unit has for a user's function.
///
/// # Safety
/// `units` points to `count` units.
pub(super) unsafe fn rule(units: *const mbm_unit, count: u8, function: u8) -> Option<Rule> {
    // SAFETY: as the caller promises.
    unsafe {
        for index in 0..count {
            for service in Places::new(units.add(index.into())) {
                if let Some(rule) = declared(service, function) {
                    return Some(rule);
                }
            }
        }
    }
    None
}

/// Serves a function of yours, on every framing.
///
/// @param unit    the unit
/// @param custom  yours, for as long as the unit is used
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer, no function, a code
///         from 128 on, or a length that is no rule; MBM_BUFFER_TOO_SMALL if the unit
///         has no place
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveCustom(unit: *mut mbm_unit, custom: *mut mbm_custom) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        if custom.is_null()
            || (*custom).serve.is_none()
            || (*custom).code > 127
            || functions::rule((*custom).length).is_none()
        {
            return Status::INVALID_ARGUMENT.code();
        }
        add_as(unit, custom.cast(), CUSTOM, serve).code()
    }
}

/// # Safety
/// `service` is the head of switches; `pdu` points to a function code.
unsafe extern "C" fn gate(
    service: *mut mbm_service,
    pdu: *mut u8,
    _heading: *const c_void,
) -> usize {
    // SAFETY: as the caller promises.
    unsafe {
        let off = custom::DisabledFunctions((*service.cast::<mbm_functionMask>()).off);
        if off.is_disabled(*pdu) {
            Reply::ILLEGAL_FUNCTION.code()
        } else {
            Reply::NOT_HANDLED.code()
        }
    }
}

/// The byte that has the switch of a function.
///
/// # Safety
/// `switches` is a record of them, and `code` 127 at most.
unsafe fn switch(switches: *mut mbm_functionMask, code: u8) -> *mut u8 {
    // SAFETY: as the caller promises; a sixteenth byte has code 127.
    unsafe {
        (&raw mut (*switches).off)
            .cast::<u8>()
            .add((code / 8).into())
    }
}

/// Switches a function of a unit off or on again. One that is off is answered with
/// exception 01, whatever serves it.
///
/// @param unit  the unit
/// @param mask  yours, for as long as the unit is used; zeroed before the first call.
///              Units that share one share what is switched off
/// @param code  the function code, 1 to 127
/// @param on    0 switches the function off, anything else on
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer or another code;
///         MBM_BUFFER_TOO_SMALL if the unit has no place
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_switchFunction(
    unit: *mut mbm_unit,
    mask: *mut mbm_functionMask,
    code: u8,
    on: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        if mask.is_null() || code == 0 || code > 127 {
            return Status::INVALID_ARGUMENT.code();
        }
        let status = add_first(unit, mask.cast(), gate);
        if status == Status::OK.code() {
            let (byte, bit) = (switch(mask, code), 1 << (code % 8));
            *byte |= bit;
            if on != 0 {
                *byte ^= bit;
            }
        }
        status
    }
}
