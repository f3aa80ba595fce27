//! The link object, and how a client with a link is polled.

use crate::client::mbm_clientRequest;
use crate::client::mbm_linkHooks;
use crate::client::object::{self as client, LinkedKind};
use crate::client::request::RequestPtr;
use crate::pointers::{self, c_object};
use crate::port::mbm_port;
use core::ffi::c_void;
use mbm::client::{ClientRequest as _, Link, LinkEvent, LinkHooks, LinkState};
use mbm::error::Status;

/// A link that opens itself again when it was lost. It belongs to one client:
/// mbm_client_poll polls both.
///
/// You own the storage. Initialise it with MBM_INIT. It must stay where it is until
/// mbm_link_end or until the client was begun again.
#[repr(C)]
pub struct mbm_link {
    /// Private.
    pointers: [*mut c_void; 34],
    /// Private.
    words: [u32; 24],
}

/// Counters of a link. You may read and zero them at any time, but not from
/// an interrupt; each wraps at 2^32.
#[repr(C)]
pub struct mbm_linkCounters {
    /// Calls of `connect` of mbm_linkHooks.
    pub attempts: u32,
    /// Attempts that failed.
    pub failed: u32,
    /// How often the link was opened, or found open by mbm_link_begin.
    pub connected: u32,
    /// How often an open link was lost.
    pub lost: u32,
}

/// The fields in the storage of an `mbm_link`.
#[repr(C)]
pub struct Object {
    /// The client's `kind` points here.
    pub(super) kind: LinkedKind,
    mark: u8,
    /// A LinkEvent, and its status.
    pub(super) event: u8,
    pub(super) status: u8,
    /// Bytes were read since this was last set to false.
    pub(super) has_read: bool,
    pub(super) port: mbm_port,
    pub(super) hooks: mbm_linkHooks,
    pub(super) random: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    pub(super) random_context: *mut c_void,
    pub(super) callback: Option<unsafe extern "C" fn(context: *mut c_void, event: u8, status: u8)>,
    pub(super) callback_context: *mut c_void,
    pub(super) counters: *mut mbm_linkCounters,
    pub(super) core: Link,
    pub(super) pace: Pace,
    /// A request that is never sent. While the client is idle, it is in the client's queue. Its
    /// `done` calls `callback`, so `callback` may do what `done` of any request may.
    pub(super) request: mbm_clientRequest,
}

/// When the link is closed although it is good, and how long it rests after it was opened.
#[repr(C)]
pub(super) struct Pace {
    /// The delay after connecting, in milliseconds.
    pub(super) delay_ms: u16,
    /// MBM_LINK_CLOSE_..., added up, and whether the delay is over. (One byte holds both: the storage
    /// of a link has no other.)
    pub(super) flags: u8,
}

c_object! { mbm_link, *mut Object }

/// The hooks of a link, as the core calls them.
struct Hooks(*mut Object);

// SAFETY, of all functions here: the hooks are C functions that keep the contract of their
// comments, and the link is begun.
impl LinkHooks for Hooks {
    fn disconnect(&mut self) {
        // SAFETY: see above.
        unsafe {
            let hooks = &raw const (*self.0).hooks;
            if let Some(disconnect) = (*hooks).disconnect {
                disconnect((*hooks).context);
            }
        }
    }

    fn connect(&mut self) -> Status {
        // SAFETY: see above. Closing uses no hook of the link, and not its core.
        unsafe {
            // In the first step nothing was closed yet.
            close(self.0);
            count(self.0, |counters| &mut counters.attempts);
            let hooks = &raw const (*self.0).hooks;
            match (*hooks).connect {
                Some(connect) => Status::from_code(connect((*hooks).context)),
                None => Status::LINK_LOST,
            }
        }
    }

    fn status(&mut self) -> Status {
        // SAFETY: see above.
        unsafe {
            let hooks = &raw const (*self.0).hooks;
            match (*hooks).status {
                Some(status) => Status::from_code(status((*hooks).context)),
                // Only in the first step is the link neither open nor being opened.
                None => Status::LINK_LOST,
            }
        }
    }

    fn random(&mut self) -> u32 {
        // SAFETY: see above.
        unsafe {
            match (*self.0).random {
                Some(random) => random((*self.0).random_context),
                None => 0,
            }
        }
    }
}

/// Gives up the frames that the client has sent or received in part, because their bytes must
/// not get into the next connection. Its requests in flight end with [`Status::LINK_LOST`].
///
/// # Safety
/// `link` is that of its client; the port's hooks that this calls must not use either.
unsafe fn close(link: *mut Object) {
    let object = (*link).kind.client.cast();
    ((*(*link).kind.transport).release)(object, None);
    client::queue(object).interrupt();
}

/// Counts one event, if there are counters.
unsafe fn count(link: *mut Object, counter: impl FnOnce(&mut mbm_linkCounters) -> &mut u32) {
    // The counters are valid as mbm_link_setCounters demands.
    if let Some(counters) = (*link).counters.as_mut() {
        let counter = counter(counters);
        *counter = counter.wrapping_add(1);
    }
}

/// Advances link and client.
pub(super) unsafe fn advance(
    object: *mut client::Object,
    now: u32,
    fresh: bool,
) -> Option<RequestPtr> {
    // `done` of a request may have ended the link during this poll of the client.
    if !(*object).linked {
        return ((*(*object).kind).advance)(object, now, fresh);
    }
    let link = (*object).kind.cast::<Object>().cast_mut();
    pointers::with_hooks(link.cast::<mbm_link>().cast_const(), || {
        advance_linked(link, object, now, fresh)
    })
}

/// As [`advance`].
///
/// # Safety
/// `link` is the client's.
unsafe fn advance_linked(
    link: *mut Object,
    object: *mut client::Object,
    now: u32,
    fresh: bool,
) -> Option<RequestPtr> {
    // No reference into link or client lives while the port's hooks run; the core is not used by
    // the hooks of the link, whose calls are refused.
    if (*link).core.is_up() {
        close_if_silent(link, object, now);
    }
    if (*link).core.is_up() {
        let ended = advance_transport(link, object, now, fresh);
        if (*link).core.is_up() || ended.is_some() {
            return ended;
        }
    }
    let is_wanted = client::queue(object).has_waiting();
    let happened = (*link).core.step(now, fresh, is_wanted, &mut Hooks(link));
    if (*link).core.state() == LinkState::Down {
        close(link);
    }
    if let Some((event, status)) = happened {
        let queue = client::queue(object);
        queue.connected = event == LinkEvent::Connected;
        queue.unanswered = 0;
        return note(link, event, status);
    }
    if (*link).core.is_up() {
        // `fresh` is over, or the link was up before: there is nothing to do.
        return None;
    }
    let queue = client::queue(object);
    if (*link).core.fails_requests() {
        queue.fail_all();
    } else if let (Some(since), false) = ((*link).core.waits_since(), queue.has_lost()) {
        let transport = &*(*link).kind.transport;
        let timeout = transport.settings(object).response_timeout.get();
        queue.fail_overdue(now, since, timeout, transport.storage(object));
        (*link).core.has_timed_out = queue.has_lost();
    }
    let mut ended = queue.end_lost(now, (*(*link).kind.transport).storage(object))?;
    if (*link).core.has_timed_out {
        ended.state_mut().status = Status::CONNECT_TIMED_OUT;
    }
    Some(ended)
}

/// Advances the client's requests. An idle client reads and drops what arrives.
unsafe fn advance_transport(
    link: *mut Object,
    object: *mut client::Object,
    now: u32,
    fresh: bool,
) -> Option<RequestPtr> {
    // The request of the link is in no queue.
    // The link's own step, which calls no hook while the link is up.
    (*link).core.step(now, false, false, &mut Hooks(link));
    if !fresh || !client::queue(object).is_empty() {
        let mut fresh = fresh;
        if client::queue(object).may_send(now) {
            // Only reading shows whether the peer has closed the link. Bytes that are sent
            // over a closed link are lost.
            client::queue(object).is_held = true;
            let ended = read_all(link, object, now);
            client::queue(object).is_held = false;
            if ended.is_some() || (*link).core.is_lost {
                return ended;
            }
            fresh = false;
        }
        let mut ended = advance_noting(link, object, now, fresh)?;
        if (*link).core.is_lost && ended.state().status.is_failure() {
            ended.state_mut().status = Status::LINK_LOST;
        }
        return Some(ended);
    }
    let placeholder = RequestPtr::new(&raw mut (*link).request)?;
    client::queue(object).begin_idle(placeholder, now);
    advance_noting(link, object, now, true);
    client::queue(object).end_idle();
    None
}

/// Reads all bytes that have arrived, also if they are more than the client's buffer holds.
/// Returns a request that has ended.
unsafe fn read_all(link: *mut Object, object: *mut client::Object, now: u32) -> Option<RequestPtr> {
    const MOST_READS: u8 = 16;
    for _ in 0..MOST_READS {
        let ended = advance_noting(link, object, now, true);
        if ended.is_some() || !(*link).has_read {
            return ended;
        }
    }
    None
}

/// Advances the client's transport, and notes whether bytes have arrived.
pub(super) unsafe fn advance_noting(
    link: *mut Object,
    object: *mut client::Object,
    now: u32,
    fresh: bool,
) -> Option<RequestPtr> {
    (*link).has_read = false;
    let ended = ((*(*link).kind.transport).advance)(object, now, fresh);
    if (*link).has_read {
        client::queue(object).note_received();
    }
    ended
}

/// Closes the link if the device has fallen silent.
unsafe fn close_if_silent(link: *mut Object, object: *mut client::Object, now: u32) {
    let queue = client::queue(object);
    let timeout = (*(*link).kind.transport)
        .settings(object)
        .response_timeout
        .get();
    let (unanswered, in_flight) = (queue.unanswered, queue.in_flight());
    (*link)
        .core
        .close_if_silent(unanswered, in_flight, timeout, now);
}

/// Notes that a request in flight was cancelled, and discards its state.
///
/// # Safety
/// `object` has a link.
pub(super) unsafe fn release(object: *mut client::Object, request: Option<&RequestPtr>) {
    let link = (*object).kind.cast::<Object>().cast_mut();
    if request.is_some() {
        (*link).core.cancelled = (*link).core.cancelled.saturating_add(1);
    }
    ((*(*link).kind.transport).release)(object, request);
}

/// Counts an event. Returns the request whose `done` reports it. A link without a callback returns
/// that request too, because the poll goes on after a request that ended. Without it, an attempt
/// that fails in each poll would keep all requests from ending.
unsafe fn note(link: *mut Object, event: LinkEvent, status: Status) -> Option<RequestPtr> {
    count(link, |counters| match event {
        LinkEvent::Connected => &mut counters.connected,
        LinkEvent::Lost => &mut counters.lost,
        LinkEvent::Failed => &mut counters.failed,
    });
    (*link).event = event as u8;
    (*link).status = status.code();
    RequestPtr::new(&raw mut (*link).request)
}

/// Reports an event to the program: `done` of the link's request.
///
/// # Safety
/// `context` is a link that is begun.
pub(super) unsafe extern "C" fn report(context: *mut c_void, _: *mut mbm_clientRequest) {
    let link = context.cast::<Object>();
    // No reference lives while the hook runs.
    if let Some(callback) = (*link).callback {
        callback((*link).callback_context, (*link).event, (*link).status);
    }
}

/// Microseconds until the next poll of the client is due; `delay` is that of its transport.
pub(super) unsafe fn delay(object: *mut client::Object, now: u32, delay: u32) -> u32 {
    let link = (*object).kind.cast::<Object>();
    let queue = client::queue(object);
    if queue.suspended {
        return u32::MAX;
    }
    let fails = (*link).core.fails_requests() && !queue.is_empty();
    if (*link).core.state() != LinkState::Up && (fails || queue.has_lost()) {
        return 0;
    }
    (*link).core.delay(now, delay, queue.has_waiting())
}
