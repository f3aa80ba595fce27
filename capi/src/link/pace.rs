//! When a link is closed although it is good, and how long it rests after it was opened. A program
//! that calls neither setter contains none of this code.

use super::object::{advance as advance_link, advance_noting, mbm_link, Object};
use crate::client::object as client;
use crate::client::request::RequestPtr;
use crate::pointers;
use mbm::client::{ClientRequest as _, LinkState};
use mbm::error::Status;
use mbm::time::millis;

/// mbm_link_setClose: the link stays open.
pub const MBM_LINK_CLOSE_NEVER: u8 = 0;
/// mbm_link_setClose: the link is closed when mbm_client_poll finds no request.
pub const MBM_LINK_CLOSE_WHEN_IDLE: u8 = 1;
/// mbm_link_setClose: the link is closed after a request without a right response.
pub const MBM_LINK_CLOSE_AFTER_FAILURE: u8 = 2;

/// In the flags of a link: its delay after connecting is over.
const SETTLED: u8 = 0x80;

/// Sets when the link is closed although it is good. A request opens it again, without a wait,
/// and waits for that. Such a close is no loss: the link counts none and reports none.
///
/// MBM_LINK_CLOSE_WHEN_IDLE is for devices with few places for connections. A program that
/// queues the requests of a round before it polls closes the link after each round. A plan does
/// so in its first round; later it spreads the requests, and the link is closed after each that
/// none follows at once.
///
/// MBM_LINK_CLOSE_AFTER_FAILURE is for devices that answer no more, or wrongly, until they are
/// connected to anew: after a request, or its repetition, whose response is missing, damaged or
/// malformed. An exception is a right response. Over the new connection no late response comes.
/// Other requests in flight end with MBM_LINK_LOST, those that wait are sent over it.
///
/// @param when  MBM_LINK_CLOSE_NEVER (the default), MBM_LINK_CLOSE_WHEN_IDLE,
///              MBM_LINK_CLOSE_AFTER_FAILURE, or the last two added
#[no_mangle]
pub unsafe extern "C" fn mbm_link_setClose(link: *mut mbm_link, when: u8) -> u8 {
    pointers::with(link, |object| {
        if when > MBM_LINK_CLOSE_WHEN_IDLE | MBM_LINK_CLOSE_AFTER_FAILURE {
            return Status::INVALID_ARGUMENT;
        }
        let pace = &mut (*object).pace;
        pace.flags = pace.flags & SETTLED | when;
        (*object).kind.kind.advance = advance;
        Status::OK
    })
}

/// Sets how long no request is sent after the link was opened, for devices that answer nothing
/// at first. Requests wait meanwhile; their response timeout begins when they are sent.
///
/// @param delayMs  milliseconds, 0 (the default) to 65535
#[no_mangle]
pub unsafe extern "C" fn mbm_link_setDelayAfterConnect(link: *mut mbm_link, delayMs: u32) -> u8 {
    pointers::with(link, |object| {
        let Ok(delay) = u16::try_from(delayMs) else {
            return Status::INVALID_ARGUMENT;
        };
        (*object).pace.delay_ms = delay;
        (*object).kind.kind.advance = advance;
        Status::OK
    })
}

/// Advances link and client, and closes the link or lets it rest as the settings say.
unsafe fn advance(object: *mut client::Object, now: u32, fresh: bool) -> Option<RequestPtr> {
    if !(*object).linked {
        return advance_link(object, now, fresh);
    }
    // Nothing else uses link and client during these calls.
    let link = (*object).kind.cast::<Object>().cast_mut();
    note_age(link, now);
    let flags = (*link).pace.flags;
    let closes = flags & !SETTLED;
    let is_resting = (*link).core.is_up() && flags & SETTLED == 0;
    if is_resting && !client::queue(object).is_empty() {
        return hold(link, object, now, fresh);
    }
    if closes & MBM_LINK_CLOSE_WHEN_IDLE != 0 && fresh && client::queue(object).is_empty() {
        (*link).core.close(now);
    }
    if closes & MBM_LINK_CLOSE_AFTER_FAILURE == 0 {
        return advance_link(object, now, fresh);
    }
    let retries = client::queue(object).retries();
    let ended = advance_link(object, now, fresh);
    let has_failed = match &ended {
        Some(ended) => ended.state().status.may_be_repeated(),
        None => client::queue(object).retries() > retries,
    };
    if has_failed {
        (*link).core.close(now);
    }
    ended
}

/// Notes whether the delay after connecting is over.
unsafe fn note_age(link: *mut Object, now: u32) {
    let core = &(*link).core;
    if core.state() != LinkState::Up {
        (*link).pace.flags &= !SETTLED;
    } else if core.age(now) >= millis((*link).pace.delay_ms) {
        // It stays over when the clock wraps.
        (*link).pace.flags |= SETTLED;
    }
}

/// Lets the requests wait until the delay is over. What arrives is dropped, and a loss is
/// noticed.
///
/// # Safety
/// `link` is the client's.
unsafe fn hold(
    link: *mut Object,
    object: *mut client::Object,
    now: u32,
    fresh: bool,
) -> Option<RequestPtr> {
    let left = millis((*link).pace.delay_ms) - (*link).core.age(now);
    if client::queue(object).has_lost() {
        let storage = (*(*link).kind.transport).storage(object);
        return client::queue(object).end_lost(now, storage);
    }
    let mut ended = None;
    if fresh {
        client::queue(object).is_held = true;
        ended = pointers::with_hooks(link.cast::<mbm_link>().cast_const(), || {
            advance_noting(link, object, now, true)
        });
        client::queue(object).is_held = false;
    }
    client::queue(object).set_next_due(now, left);
    ended
}
