//! `mbm_link_*`: keeps the link of a client open.

mod object;
mod pace;
mod port;

pub use object::{mbm_link, mbm_linkCounters};
pub use pace::*;

use crate::client::object::{self as client, TransportKind};
use crate::client::{mbm_client, mbm_linkHooks, set_backoff};
use crate::pointers::{self, change, with, CObject as _};
use core::ffi::c_void;
use mbm::client::{LinkEvent, LinkState, MOST_REPLACE_AFTER};
use mbm::error::Status;
use mbm::time::timeout;
use object::{report, Object};

/// mbm_link_state: there is no link. The client opens it when the wait is over.
pub const MBM_LINK_IS_DOWN: u8 = 1;
/// mbm_link_state: the connection is being made.
pub const MBM_LINK_IS_CONNECTING: u8 = 2;
/// mbm_link_state: the link is open.
pub const MBM_LINK_IS_UP: u8 = 3;

/// An event of a link: it is open now. The status is MBM_OK.
pub const MBM_LINK_EVENT_CONNECTED: u8 = 0;
/// An event of a link: it was open and is lost. The status is MBM_LINK_LOST, or
/// MBM_RESPONSE_TIMED_OUT if the link has closed it since the device had fallen silent: see
/// mbm_link_setReplaceAfter.
pub const MBM_LINK_EVENT_LOST: u8 = 1;
/// An event of a link: an attempt to open it failed. The status is the result of `connect` or
/// `status` of mbm_linkHooks; MBM_CONNECT_TIMED_OUT if the connection took too long.
pub const MBM_LINK_EVENT_FAILED: u8 = 2;

/// The default of mbm_link_setReplaceAfter on TCP.
const REPLACE_AFTER: u8 = 2;

const _: () = {
    assert!(MBM_LINK_IS_DOWN == LinkState::Down as u8);
    assert!(MBM_LINK_IS_CONNECTING == LinkState::Connecting as u8);
    assert!(MBM_LINK_IS_UP == LinkState::Up as u8);
    assert!(MBM_LINK_EVENT_CONNECTED == LinkEvent::Connected as u8);
    assert!(MBM_LINK_EVENT_LOST == LinkEvent::Lost as u8);
    assert!(MBM_LINK_EVENT_FAILED == LinkEvent::Failed as u8);
};

/// Gives a client a link, which mbm_client_poll keeps open from then on:
/// - It notices the loss of the link also while the client has no request. For that, an idle
///   client reads the port in each poll and drops what it reads: late replies, noise, frames
///   of others. If something else reads the line, call mbm_client_suspend first.
/// - It opens the link again: for a request at once, if the link was good until it was lost; else
///   after a wait that grows with each attempt that fails. A link that was opened for a request,
///   and is lost before anything was sent over it, has failed too.
/// - A link that the peer closes twice in a row while no request is there stays closed until the
///   next request.
/// - It looks whether the link is still open before it sends a request. So a peer that closes idle
///   connections costs no request.
/// - It replaces a connection on which the device answers no more: see mbm_link_setReplaceAfter.
/// - When the link is lost, requests in flight end with MBM_LINK_LOST, because the device may
///   have carried them out. The others end too, or wait: see mbm_link_setRequestsWait.
/// - Requests that are in flight when the link begins go on if `status` finds the link open, and
///   end with MBM_LINK_LOST if not. No byte of an ended request is sent over a new link.
///
/// mbm_client_pollDelay returns when the next poll is due, for an idle client at most one
/// second. A wait for bytes that also ends when the link is lost, as mbm_tcp_wait and
/// mbm_tty_wait, finds the loss at once.
///
/// In the first poll the link calls `status` to find out whether the link is open already, and
/// `connect` if not. After a loss or a failed attempt it calls `disconnect`, once.
///
/// Client and link must stay where they are, and must not be copied. A program does not also
/// call mbm_client_reconnect.
///
/// All settings of the link return to their defaults. The call may be repeated at any time,
/// also with another client. A begin function of the client ends the link.
///
/// @param client  the client, begun; it must not have another link
/// @param hooks   how the link is opened and closed; copied. `connect` must not be NULL. The hooks
///                must not use the client or the link: each function returns MBM_BUSY
/// @return a status; MBM_NOT_INITIALISED if the client was not begun; MBM_BUSY also while the
///         client is suspended, and if it has another link
#[no_mangle]
pub unsafe extern "C" fn mbm_link_begin(
    link: *mut mbm_link,
    client: *mut mbm_client,
    hooks: *const mbm_linkHooks,
) -> u8 {
    let status = match hooks.as_ref() {
        Some(hooks) if hooks.connect.is_some() && !link.is_null() => begin(link, client, hooks),
        _ => Status::INVALID_ARGUMENT,
    };
    status.code()
}

/// As [`mbm_link_begin`].
///
/// # Safety
/// `link` is not NULL.
unsafe fn begin(link: *mut mbm_link, client: *mut mbm_client, hooks: &mbm_linkHooks) -> Status {
    let status = pointers::check(client);
    if status != Status::OK {
        return status;
    }
    let target = pointers::object(client);
    let object = pointers::object(link);
    if (*target).queue.suspended || (*target).linked && !is_of(object, target) {
        return Status::BUSY;
    }
    match pointers::check(link) {
        Status::NOT_INITIALISED => {}
        Status::OK => {
            let status = end(object);
            if status != Status::OK {
                return status;
            }
        }
        refused => return refused,
    }
    // Zero is a valid value of every field but those that are set here.
    pointers::zero(link);
    let transport = (*target).kind;
    (*object).kind.transport = transport;
    (*object).hooks = *hooks;
    (*object).port.copy(&*(*transport).port(target));
    (*object).request.done = Some(report);
    (*object).request.context = link.cast();
    (*object).core.begin();
    if !(*target).queue.has_broadcast {
        (*object).core.replace_after = REPLACE_AFTER;
    }
    let port = port::port(object);
    (*(*transport).port(target)).copy(&port);
    let kind = &raw mut (*object).kind;
    (*kind).kind = TransportKind {
        advance: object::advance,
        release: object::release,
        ..*transport
    };
    (*kind).delay = object::delay;
    (*kind).client = client;
    (*target).kind = (&raw const (*object).kind).cast();
    (*target).linked = true;
    mbm_link::mark(link).write(pointers::BEGUN);
    Status::OK
}

/// True if the link is that of the client. It is not if the client was begun again since.
unsafe fn is_of(link: *const Object, client: *const client::Object) -> bool {
    (*client).linked && (*client).kind.cast::<Object>() == link
}

/// Restores the client as it was before the link began.
unsafe fn end(link: *mut Object) -> Status {
    let client = (*link).kind.client;
    if client.is_null() {
        return Status::OK;
    }
    let object = pointers::object(client);
    if !is_of(link, object) {
        return Status::OK;
    }
    if pointers::check(client) != Status::OK || (*object).queue.suspended {
        return Status::BUSY;
    }
    let transport = (*link).kind.transport;
    (*object).kind = transport;
    (*object).linked = false;
    (*(*transport).port(object)).copy(&(*link).port);
    Status::OK
}

/// Ends a link. The client and its requests stay; the link itself stays open or closed as it
/// is. If its callback has just reported a loss, open it anew before the client sends again: half
/// a frame may have been sent. The storage is free, and begins anew with mbm_link_begin.
///
/// @param link  the object; the client's storage must still be valid
/// @return a status; MBM_BUSY also while the client is suspended
#[no_mangle]
pub unsafe extern "C" fn mbm_link_end(link: *mut mbm_link) -> u8 {
    with(link, |object| {
        let status = end(object);
        if status == Status::OK {
            mbm_link::mark(link).write(0);
        }
        status
    })
}

functions! {
    (link: *mut mbm_link)

    /// Closes the link and opens it again, at the next poll of the client and without a wait. Call
    /// it when you know better than the link: the network is back, the address has changed.
    /// Requests in flight end with MBM_LINK_LOST; queued ones wait for this attempt.
    fn mbm_link_reconnect() = change(|object| (*object).core.restart());

    /// Sets the wait before an attempt to open the link. The first attempt after a loss waits for
    /// `delayMs`; each attempt that fails lets the wait grow. It starts anew when the link was open
    /// for as long as the last wait, or bytes have arrived. A request does not wait for the first
    /// attempt after the loss of such a link: it is made at once.
    ///
    /// @param backoff     MBM_BACKOFF_NONE to MBM_BACKOFF_EXPONENTIAL (the default), as of
    ///                    mbm_client_setBackoff
    /// @param delayMs     the first wait in milliseconds, 0 to 1000000; the default is 500
    /// @param maxDelayMs  the longest wait in milliseconds, 0 to 1000000; the default is 30000
    fn mbm_link_setBackoff(backoff: u8, delayMs: u32, maxDelayMs: u32)
        = with(|object| {
            let waits = &mut (*object).core.waits;
            set_backoff(waits, backoff, delayMs, maxDelayMs)
        });
}

/// Shortens each wait before an attempt by a random part, so that many clients that lost their
/// server together do not connect at the same time.
///
/// @param percent  0 (the default) to 100: the largest part of the wait that is taken off
/// @param random   as of mbm_client_setJitter; must not use the client or the link. NULL only if
///                 `percent` is 0
/// @param context  your pointer, passed to `random`; may be NULL
#[no_mangle]
pub unsafe extern "C" fn mbm_link_setJitter(
    link: *mut mbm_link,
    percent: u8,
    random: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    context: *mut c_void,
) -> u8 {
    with(link, |object| {
        if !(*object).core.waits.set_jitter(percent, random.is_some()) {
            return Status::INVALID_ARGUMENT;
        }
        (*object).random = random;
        (*object).random_context = context;
        Status::OK
    })
}

/// Sets how long a connection may take to be made. Then the attempt has failed, with
/// MBM_CONNECT_TIMED_OUT.
///
/// @param timeoutMs  milliseconds, 1 to 1000000 (16 minutes); 0: as long as `status` returns
///                   MBM_PENDING. The default is 10000
#[no_mangle]
pub unsafe extern "C" fn mbm_link_setConnectTimeout(link: *mut mbm_link, timeoutMs: u32) -> u8 {
    with(link, |object| {
        let Some(timeout) = timeout(timeoutMs) else {
            return Status::INVALID_ARGUMENT;
        };
        (*object).core.connect_timeout = timeout;
        Status::OK
    })
}

/// Sets after how many requests in a row without any byte the link is closed and opened anew,
/// because some devices keep a connection open on which they answer no more. Repetitions count. So
/// do requests that you cancel while they are in flight, once nothing was heard for the client's
/// response timeout. While others are in flight, which may still be answered, the link is closed
/// 16 requests later at the most; they end with MBM_LINK_LOST. Requests that wait are sent over
/// the new link.
///
/// Some devices answer nothing in the first seconds of a connection. So each link over which no byte
/// came has twice as many requests as the one before, up to 16 times as many and at most 100.
///
/// @param requests  0 to 100; 0 for never. The default is 2 on TCP, and 0 on a serial line
#[no_mangle]
pub unsafe extern "C" fn mbm_link_setReplaceAfter(link: *mut mbm_link, requests: u8) -> u8 {
    with(link, |object| {
        if requests > MOST_REPLACE_AFTER {
            return Status::INVALID_ARGUMENT;
        }
        (*object).core.replace_after = requests;
        Status::OK
    })
}

functions! {
    (link: *mut mbm_link)

    /// Sets whether requests wait for the link. By default they do not: while the link is down,
    /// every request ends at the next poll: with MBM_CONNECT_TIMED_OUT if the last attempt took
    /// longer than the connect timeout, else with MBM_LINK_LOST. (A program whose `done` queues the
    /// request again at once then polls without a pause: let it wait.) If requests wait, they stay
    /// in the queue until the link is open again or until you cancel them; their response timeout
    /// begins when they are sent. While a connection is being made, requests always wait; those for
    /// which a lost link is opened again end with MBM_CONNECT_TIMED_OUT if that takes as long as
    /// their response timeout.
    ///
    /// @param on  0 (the default) or 1
    fn mbm_link_setRequestsWait(on: u8) = change(|object| (*object).core.keeps_requests = on != 0);

    /// Sets the function that mbm_client_poll calls when the link was opened or lost, or when an
    /// attempt has failed.
    ///
    /// @param callback  gets an MBM_LINK_EVENT_ constant and a status. It may do what `done` of a
    ///                  request may, and call every function on the link; NULL for none
    /// @param context   your pointer, passed to `callback`; may be NULL
    fn mbm_link_setCallback(
        callback: Option<unsafe extern "C" fn(context: *mut c_void, event: u8, status: u8)>,
        context: *mut c_void)
        = change(|object| {
            (*object).callback = callback;
            (*object).callback_context = context;
        });

    /// Sets your storage for counters, in which the link counts from now on.
    ///
    /// @param counters  your counters, initialised with MBM_INIT; NULL stops counting
    fn mbm_link_setCounters(counters: *mut mbm_linkCounters)
        = change(|object| (*object).counters = counters);
}

/// Returns what a link is doing.
///
/// @return MBM_LINK_IS_DOWN, MBM_LINK_IS_CONNECTING or MBM_LINK_IS_UP; 0 before the first poll, and
///         for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_link_state(link: *const mbm_link) -> u8 {
    pointers::read(link, 0, |object| (*object).core.state() as u8)
}
