//! The settings of a gateway, its own units and its own functions.

use super::storage::Parts;
use super::{mbm_gateway, Core};
use crate::client::{mbm_client, mbm_clientRequest, mbm_client_custom};
use crate::framing::{mbm_framing, MBM_FRAMING_TCP, MBM_MAX_TCP_FRAME};
use crate::functions::{declared, mbm_function};
use crate::pointers::{self, In};
use crate::server::{have_ids, mbm_unit, mbm_unit_respond};
use core::ffi::c_void;
use core::ptr::null;
use core::slice::from_raw_parts;
use mbm::error::Status;
use mbm::frame::tcp;
use mbm::pdu::is_public;
use mbm::pdu::length::{self, Length};
use mbm::time::timeout;

/// Sets how many requests of one connection may be pending at once
/// (NumberMaxOfServerTransaction of the messaging on TCP/IP guide V1.0b, 4.4.1). The next
/// requests of the connection wait in its socket.
///
/// @param most  1 to 65535; the default is 65535. Fewer if there are not enough places for requests
#[no_mangle]
pub unsafe extern "C" fn mbm_gateway_setMaxPending(gateway: *mut mbm_gateway, most: u16) -> u8 {
    pointers::with(gateway, |core| {
        if most == 0 {
            return Status::INVALID_ARGUMENT;
        }
        (*core).set_max_pending(most);
        Status::OK
    })
}

/// Sets for how long a request may wait until its line is free. After that time the gateway
/// answers it with exception 0A and does not send it. Set it to the time that the clients on
/// TCP wait, less the response timeout of the line: then no device carries out a request that
/// its client has given up.
///
/// @param timeMs  milliseconds, 1 to 1000000 (16 minutes); 0, the default, lets requests wait for
///                any time
#[no_mangle]
pub unsafe extern "C" fn mbm_gateway_setQueueTime(gateway: *mut mbm_gateway, timeMs: u32) -> u8 {
    pointers::with(gateway, |core| {
        let Some(time) = timeout(timeMs) else {
            return Status::INVALID_ARGUMENT;
        };
        (*core).set_queue_time(time);
        Status::OK
    })
}

/// Serves units of the gateway itself: those that a route to MBM_GATEWAY_LOCAL leads to. The
/// unit ids that such a route maps to are those of the units; 0 and 255 address the first
/// unit. A request for an id that no unit has gets no response.
///
/// A function of a unit that returns MBM_REPLY_PENDING is called again at each
/// mbm_gateway_poll. Other requests go on meanwhile, also those for the same unit.
///
/// @param units  one unit, or an array of units; must stay valid for as long as the gateway is
///               used. Servers may serve the same units. NULL only if `count` is 0
/// @param count  how many units
/// @return a status; MBM_INVALID_ARGUMENT for a unit with an id above 255
#[no_mangle]
pub unsafe extern "C" fn mbm_gateway_serveUnits(
    gateway: *mut mbm_gateway,
    units: *mut mbm_unit,
    count: u8,
) -> u8 {
    pointers::with(gateway, |core| {
        if count > 0 && (units.is_null() || !have_ids(units, count)) {
            return Status::INVALID_ARGUMENT;
        }
        let parts = &mut (*core).storage;
        parts.units = units;
        parts.unit_count = count;
        parts.serve = if count > 0 { Some(serve) } else { None };
        Status::OK
    })
}

/// As [`Serve`](super::storage::Serve).
unsafe fn serve(
    parts: &Parts,
    connection: *mut c_void,
    frame: *mut u8,
    length: u16,
) -> Option<u16> {
    let framing = mbm_framing {
        functions: null(),
        functionCount: 0,
        kind: MBM_FRAMING_TCP,
        delimiter: 0,
    };
    let mut response = 0;
    // SAFETY: mbm_gateway_serveUnits requires `unit_count` units.
    let status = unsafe {
        mbm_unit_respond(
            parts.units,
            parts.unit_count,
            connection,
            In::from(&framing),
            frame,
            length,
            MBM_MAX_TCP_FRAME,
            &raw mut response,
        )
    };
    (status != Status::PENDING.code()).then_some(response)
}

/// Declares functions of your own. The gateway passes on every function. If one of your own is
/// declared, the gateway also checks the length of its requests, and knows on RTU when its
/// replies end without waiting for a silence.
///
/// @param functions  the declarations; they must stay valid for as long as the gateway is used.
///                   NULL only if `count` is 0
/// @param count      how many declarations
/// @return a status; MBM_INVALID_ARGUMENT for a declaration that is not valid
#[no_mangle]
pub unsafe extern "C" fn mbm_gateway_setFunctions(
    gateway: *mut mbm_gateway,
    functions: In<mbm_function>,
    count: u8,
) -> u8 {
    pointers::with(gateway, |core: *mut Core| {
        let is_valid = functions
            .slice(count.into())
            .and_then(|functions| declared(functions, None))
            .is_ok();
        if !is_valid {
            return Status::INVALID_ARGUMENT;
        }
        let parts = &mut (*core).storage;
        parts.functions = functions.pointer();
        parts.function_count = count;
        parts.forward_declared = if count > 0 {
            Some(forward_declared)
        } else {
            None
        };
        Status::OK
    })
}

/// As [`ForwardDeclared`](super::storage::ForwardDeclared).
unsafe fn forward_declared(
    parts: &Parts,
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    frame: *mut u8,
    length: u16,
) -> Option<Status> {
    // SAFETY: mbm_gateway_setFunctions requires `function_count` declarations. The frame has
    // `length` bytes after header and function code.
    unsafe {
        let functions = from_raw_parts(parts.functions, parts.function_count.into());
        let pdu = from_raw_parts(frame.add(tcp::PDU), 1 + usize::from(length));
        let code = pdu.first().copied().filter(|code| !is_public(*code))?;
        let own = functions.iter().find(|function| function.code == code)?;
        let function = declared(functions, Some(code)).ok()??;
        let is_right = match length::request(pdu, &[function]) {
            Length::Exactly(right) => right == pdu.len(),
            Length::AtLeast(_) => false,
            Length::Silence | Length::Unknown => true,
        };
        if !is_right {
            return Some(Status::ILLEGAL_DATA_VALUE);
        }
        let response = &raw const own.response;
        let status = mbm_client_custom(client, request, code, length, response);
        Some(Status::from_code(status))
    }
}
