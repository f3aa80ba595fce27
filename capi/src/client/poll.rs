//! Polling a client, and cancelling its requests.

use super::object::{
    mbm_client, on_transport, queue, Advance, LinkedKind, Object, SerialTransport, TcpTransport,
};
use super::request::{mbm_clientRequest, RequestPtr};
use super::MBM_CLIENT_DEPTH;
use crate::{pointers, port};
use mbm::client::{late_rest, ClientRequest as _, RequestState, Transport};
use mbm::engine::LateUnits;
use mbm::error::Status;

/// The time on the clock of a client's port.
unsafe fn now(object: *mut Object) -> u32 {
    port::now((*(*object).kind).port(object))
}

/// The time on the clock of a client's port, in microseconds.
///
/// # Safety
/// [`pointers::check`] found a client; no reference into it lives.
pub(crate) unsafe fn clock(client: *mut mbm_client) -> u32 {
    pointers::with_hooks(client, || now(pointers::object(client)))
}

/// Microseconds for which the line of a client leaves a unit alone, because it may still answer a
/// request that was cancelled; 0 if the object is no client.
pub(crate) unsafe fn rest(client: *mut mbm_client, unit: u8) -> u32 {
    // No reference lives while the clock is read.
    if pointers::check(client) != Status::OK {
        return 0;
    }
    let object = pointers::object(client);
    let kind = &*(*object).kind;
    if kind.late_units == 0 {
        return 0;
    }
    let late_units = object.byte_add(kind.late_units.into()).cast::<LateUnits>();
    let now = clock(client);
    let mut state = RequestState::NONE;
    state.unit = unit.into();
    late_rest(&state, &mut *late_units, kind.settings(object), now)
}

/// Sends and receives for all requests, without waiting, and calls `done` of those that have
/// ended, of at most 17 in one call. It also takes care of the client's link, if
/// mbm_link_begin gave it one.
///
/// Call it as often as you like. mbm_client_pollDelay returns when the next call is due.
///
/// @return MBM_PENDING while requests are pending; MBM_OK if none is; MBM_BUSY also from within
///         `done`, and while the client is suspended
#[no_mangle]
pub unsafe extern "C" fn mbm_client_poll(client: *mut mbm_client) -> u8 {
    pointers::with(client, |object| {
        if (*object).polling || (*object).queue.suspended {
            return Status::BUSY;
        }
        advance_all(client, (*(*object).kind).advance)
    })
}

/// Advances the requests, and calls `done` of those that ended. `advance` is
/// that of the kind of transport.
///
/// # Safety
/// `client` is begun, and `advance` is that of its transport; no reference into it lives.
unsafe fn advance_all(client: *mut mbm_client, advance: Advance) -> Status {
    let object = pointers::object(client);
    // No reference lives while `done` is called, because `done` may use the object. If `done`
    // zeroed the object, or began it again, `polling` is false and the loop ends.
    let now = pointers::with_hooks(client, || now(object));
    (*object).polling = true;
    let mut rounds = MBM_CLIENT_DEPTH + 1;
    // `done` may have given the line away.
    while rounds > 0 && !(*object).queue.suspended {
        let fresh = rounds > MBM_CLIENT_DEPTH;
        match pointers::with_hooks(client, || advance(object, now, fresh)) {
            Some(request) => request.call_done(),
            None => break,
        }
        if !(*object).polling {
            return Status::OK;
        }
        rounds -= 1;
    }
    (*object).polling = false;
    if (*object).queue.is_empty() {
        Status::OK
    } else {
        Status::PENDING
    }
}

/// Returns how long mbm_client_poll will have nothing to do unless a byte arrives. A program
/// may sleep, or wait for a byte in select, for that time, but no longer: while a frame leaves on a
/// serial line, the driver would go off late. The client reads bytes only while
/// a request is pending, or if it has a link (mbm_link_begin). With a link the delay also ends
/// when the link is to be opened again, and is at most one second while the client is idle.
///
/// @return microseconds; 0 means poll now, also from within a hook of the port; 0xFFFFFFFF means
///         that no request is pending. While a TCP port accepts no bytes to send it is 1000: to
///         poll sooner, also wait until the port accepts bytes, as mbm_tcp_wait does
#[no_mangle]
pub unsafe extern "C" fn mbm_client_pollDelay(client: *mut mbm_client) -> u32 {
    match pointers::check(client) {
        Status::OK => pointers::with_hooks(client, || {
            let object = pointers::object(client);
            let now = now(object);
            let delay = on_transport!(object, transport => Transport::poll_delay(transport, &(*object).queue, now));
            if !(*object).linked {
                return delay;
            }
            ((*(*object).kind.cast::<LinkedKind>()).delay)(object, now, delay)
        }),
        Status::BUSY => 0,
        _ => u32::MAX,
    }
}

/// Returns how many requests are pending: queued or in flight.
///
/// @return 0 to 16
#[no_mangle]
pub unsafe extern "C" fn mbm_client_pending(client: *const mbm_client) -> u8 {
    pointers::read(client, 0, |object| queue(object).pending() as u8)
}

/// Cancels a request. Its status becomes MBM_CANCELLED, `done` is not called, and you may use
/// the request again at once. The device may have received the request, and may still send
/// a reply. So on a serial line the next request to its unit is sent when that reply has come,
/// at the latest two response timeouts and the quiet time after the cancelled one was sent.
/// Requests to other units are sent meanwhile.
///
/// @param request  a request that was queued on this client
/// @return a status; MBM_NOT_PENDING for a request that has ended already or was never queued here
#[no_mangle]
pub unsafe extern "C" fn mbm_client_cancel(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
) -> u8 {
    pointers::with(client, |object| match RequestPtr::new(request) {
        None => Status::INVALID_ARGUMENT,
        Some(request) => match queue(object).cancel_one(|queued| *queued == request) {
            Some(request) => {
                if request.state().is_sent() {
                    let release = (*(*object).kind).release;
                    pointers::with_hooks(client, || release(object, Some(&request)));
                }
                Status::OK
            }
            None => Status::NOT_PENDING,
        },
    })
}

/// Returns the transaction identifier on the wire: that of the TCP frame in which the client
/// sent the request last. The client chooses a new one for each frame, also for a retry.
///
/// @param request  a request, pending or ended
/// @return the identifier; 0 in other framings, for a request that was never sent, and for NULL.
///         0 may also be the identifier of a frame
#[no_mangle]
pub unsafe extern "C" fn mbm_client_wireTransaction(request: *const mbm_clientRequest) -> u16 {
    RequestPtr::new(request.cast_mut()).map_or(0, |request| request.state().wire())
}
