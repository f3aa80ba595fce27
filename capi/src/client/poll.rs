//! Moving a client's requests on, and giving them up.

use super::object::{
    mbm_client, on_transport, queue, Advance, Object, SerialTransport, TcpTransport,
};
use super::request::{mbm_clientRequest, RequestPtr};
use super::MBM_CLIENT_DEPTH;
use crate::{pointers, port};
use mbm::client::{ClientRequest as _, Transport as _};
use mbm::error::Status;

/// The time on the clock of a client's port.
///
/// # Safety
/// `object` is begun; no reference into it lives, as the clock is a hook.
unsafe fn now(object: *mut Object) -> u32 {
    // SAFETY: as the caller promises.
    unsafe { port::now((*(*object).kind).port(object)) }
}

/// Moves all requests on, without waiting, and calls `done` of those that have
/// ended, of at most 17 in one call.
///
/// Call it as often as you like; mbm_client_pollDelay tells when the next call
/// is due.
///
/// @param client  the object
/// @return MBM_PENDING while requests wait or are under way, MBM_OK if there are
///         none, MBM_BUSY from within `done` and while the line is lent;
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_poll(client: *mut mbm_client) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        pointers::with(client, |object| {
            if (*object).polling || (*object).queue.suspended {
                return Status::BUSY;
            }
            let kind = (*object).kind;
            #[cfg(not(any(target_os = "none", mbm_firmware)))]
            return ((*kind).poll)(client);
            #[cfg(any(target_os = "none", mbm_firmware))]
            turns(client, (*kind).advance)
        })
    }
}

/// Polls, and calls `done` of the requests that ended. One function for all kinds of
/// line, but a part of each kind's own on a host, with `advance` in it.
///
/// # Safety
/// `client` is begun, with a line that `advance` is for; no reference into it lives.
#[cfg_attr(not(any(target_os = "none", mbm_firmware)), inline(always))]
pub(super) unsafe fn turns(client: *mut mbm_client, advance: Advance) -> Status {
    let object = pointers::object(client);
    // SAFETY: as the caller promises. No reference lives while `done` is called, for
    // that may use the object. If it zeroed it, and perhaps began it anew, polling is
    // over.
    unsafe {
        let now = pointers::with_hooks(client, || now(object));
        (*object).polling = true;
        let mut turns = MBM_CLIENT_DEPTH + 1;
        while turns > 0 {
            let fresh = turns > MBM_CLIENT_DEPTH;
            match pointers::with_hooks(client, || advance(object, now, fresh)) {
                Some(request) => request.call(),
                None => break,
            }
            if !(*object).polling {
                return Status::OK;
            }
            turns -= 1;
        }
        (*object).polling = false;
        if (*object).queue.is_empty() {
            Status::OK
        } else {
            Status::PENDING
        }
    }
}

/// How long mbm_client_poll will find nothing to do unless a byte arrives, so
/// that a program may wait for one in select, or sleep, until then. Bytes are taken
/// only while a request is pending: with none, wait for something else.
///
/// @param client  the object
/// @return microseconds; 0 means poll now, and is returned within a hook of the port;
///         0xFFFFFFFF that there is no request; 1000
///         while a TCP port does not take what is to be sent: to poll sooner, wait
///         for that too, as mbm_tcp_wait does
#[no_mangle]
pub unsafe extern "C" fn mbm_client_pollDelay(client: *mut mbm_client) -> u32 {
    // SAFETY: as the header demands.
    unsafe {
        match pointers::check(client) {
            Status::OK => pointers::with_hooks(client, || {
                let object = pointers::object(client);
                let now = now(object);
                on_transport!(object, line => line.poll_delay(&(*object).queue, now))
            }),
            Status::BUSY => 0,
            _ => u32::MAX,
        }
    }
}

/// How many requests wait or are under way.
///
/// @param client  the object
/// @return 0 to 16
#[no_mangle]
pub unsafe extern "C" fn mbm_client_pending(client: *const mbm_client) -> u8 {
    // SAFETY: as the header demands.
    unsafe { pointers::read(client, 0, |object| queue(object).pending() as u8) }
}

/// Gives a request up. It is yours again at once, with the status MBM_CANCELLED;
/// `done` is not called. It may have reached the device, and may still be answered.
///
/// @param client   the object
/// @param request  a request that this client was given
/// @return MBM_OK; MBM_NOT_PENDING, with nothing changed, for a request that has
///         ended already or was never queued here; MBM_INVALID_ARGUMENT or
///         MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_cancel(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
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
}

/// The transaction identifier on the wire: that of the TCP frame in which the request
/// was sent last. The client chooses it, another one for each frame, also for a retry.
///
/// @param request  a request, pending or ended
/// @return the identifier; 0 in other framings, for a request that was never sent, and
///         for NULL. 0 is also an identifier
#[no_mangle]
pub unsafe extern "C" fn mbm_client_wireTransaction(request: *const mbm_clientRequest) -> u16 {
    // SAFETY: as the header demands: NULL, or a request that is zeroed or was used.
    unsafe { RequestPtr::new(request.cast_mut()).map_or(0, |request| request.state().wire()) }
}
