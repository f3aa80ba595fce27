//! The settings of a client for devices that deviate from the standard, and for those that need time.

use super::kind;
use super::object::{mbm_client, queue, transport, Object, SerialTransport, TolerantTransport};
use super::object::{LinkedKind, TransportKind};
use crate::framing::{MBM_FRAMING_RTU, MBM_FRAMING_TCP};
use crate::pointers;
use mbm::client::{ACCEPT_TRANSACTION, ACCEPT_UNIT};
use mbm::error::Status;
use mbm::time::millis;

/// mbm_client_setAccept: a response of another unit than that of its request is accepted.
pub const MBM_ACCEPT_UNIT: u8 = 1;
/// mbm_client_setAccept: a response with another transaction identifier than that of its
/// request is accepted.
pub const MBM_ACCEPT_TRANSACTION: u8 = 2;

const _: () = {
    assert!(MBM_ACCEPT_UNIT == ACCEPT_UNIT);
    assert!(MBM_ACCEPT_TRANSACTION == ACCEPT_TRANSACTION);
};

/// Changes a setting of a client with TCP frames, whose stream is tolerant from then on.
/// `change` returns false if it refuses, with nothing changed.
///
/// # Safety
/// The client has TCP frames.
unsafe fn set_tolerant(
    object: *mut Object,
    change: impl FnOnce(&mut TolerantTransport) -> bool,
) -> Status {
    // A tolerant stream begins as the other one does. What follows is zero, which is no setting.
    if !change(transport::<TolerantTransport>(object)) {
        return Status::INVALID_ARGUMENT;
    }
    let kind: *const TransportKind = &raw const kind::TOLERANT;
    if (*object).linked {
        (*(*object).kind.cast::<LinkedKind>().cast_mut()).transport = kind;
    } else {
        (*object).kind = kind;
    }
    Status::OK
}

/// The status of a setting that is refused if `is_allowed` is false.
pub(super) fn allowed(is_allowed: bool) -> Status {
    match is_allowed {
        true => Status::OK,
        false => Status::INVALID_ARGUMENT,
    }
}

/// Sets which responses in TCP frames the client accepts although their header is not that of
/// the request: some devices answer with unit 0, 1 or 255 whatever unit was asked, some with
/// transaction identifier 0 or a count of their own. All else of the response must be right.
///
/// With MBM_ACCEPT_TRANSACTION nothing tells a late response from the right one. So only one
/// request may be in flight, and after a request without an answer the client sends no other
/// one until the late response has come, or two response timeouts and the quiet time
/// (mbm_client_setQuietTime) after that request. Over a new connection the next one is sent at
/// once: mbm_link_setClose with MBM_LINK_CLOSE_AFTER_FAILURE makes one, after which no late
/// response comes, however late it is.
///
/// @param accept  MBM_ACCEPT_UNIT, MBM_ACCEPT_TRANSACTION, both or 0 (the default)
/// @return a status; MBM_INVALID_ARGUMENT also for a client without TCP frames, and for
///         MBM_ACCEPT_TRANSACTION if mbm_client_setInFlight allows more than one request
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setAccept(client: *mut mbm_client, accept: u8) -> u8 {
    pointers::with(client, |object| match (*(*object).kind).framing {
        MBM_FRAMING_TCP => set_tolerant(object, |stream| stream.set_accept(accept)),
        _ => allowed(accept == 0),
    })
}

/// Sets whether the client accepts responses that deviate from the standard: to a read with
/// more data than requested, of which the first count, and to a write with another address,
/// value or quantity than requested. (Some meters send four bytes for one register.) The frame
/// buffer must hold the response. A response with less data than requested stays
/// MBM_MALFORMED_REPLY.
///
/// On an RTU line such a reply ends the request once the line is silent, so that a right one
/// after it wins.
///
/// @param on  0 (the default) or 1
/// @return a status; MBM_INVALID_ARGUMENT for 1 on a line with ASCII frames
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setLenient(client: *mut mbm_client, on: u8) -> u8 {
    pointers::with(client, |object| match (*(*object).kind).framing {
        MBM_FRAMING_TCP => set_tolerant(object, |stream| {
            stream.set_lenient(on != 0);
            true
        }),
        MBM_FRAMING_RTU => {
            transport::<SerialTransport>(object).set_lenient(on != 0);
            Status::OK
        }
        _ => allowed(on == 0),
    })
}

/// Sets the least time from the end of a request to the next one, for devices that need a
/// pause. On a serial line and in RTU over TCP this is the gap, unless t3.5 is longer: a later
/// call of mbm_client_setBaudRate or mbm_client_setGap replaces it. In TCP frames only one
/// request may be in flight.
///
/// @param waitMs  milliseconds, 0 (the default) to 65535
/// @return a status; MBM_INVALID_ARGUMENT also if mbm_client_setInFlight allows more than one
///         request
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setMessageWait(client: *mut mbm_client, waitMs: u32) -> u8 {
    pointers::with(client, |object| {
        let Ok(wait) = u16::try_from(waitMs) else {
            return Status::INVALID_ARGUMENT;
        };
        let wait = millis(wait);
        let kind = &*(*object).kind;
        if kind.framing == MBM_FRAMING_TCP {
            return set_tolerant(object, |stream| stream.set_message_wait(wait));
        }
        let settings = kind.settings(object);
        let least = match kind.framing == MBM_FRAMING_RTU && queue(object).has_broadcast {
            true => settings.silence.get(),
            false => 0,
        };
        settings.set_gap(wait.max(least));
        Status::OK
    })
}
