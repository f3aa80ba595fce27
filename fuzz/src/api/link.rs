//! Links of clients. A client that has a link must stay where it is and must not be copied, so
//! each link has a client of its own.

use super::check::{refused_changes_nothing, span};
use super::client;
use super::world::{Grant, World};
use mbm_c::*;
use std::ffi::c_void;
use std::ptr::{null, null_mut};

unsafe extern "C" fn disconnect(_: *mut c_void) {
    World::current().hook(Grant::Nothing, 8);
}

unsafe extern "C" fn connect(_: *mut c_void) -> u8 {
    let w = World::current();
    w.hook(Grant::Nothing, 8);
    [0, 0, 235, w.random() as u8][(w.random() % 4) as usize]
}

unsafe extern "C" fn changed(_: *mut c_void, event: u8, status: u8) {
    assert!(event <= MBM_LINK_EVENT_FAILED);
    assert!((event == MBM_LINK_EVENT_CONNECTED) == (status == 0));
    World::current().hook(Grant::All, 3);
}

/// A client and its link: those of the run, or new ones.
fn pick(w: &World) -> (*mut mbm_client, *mut mbm_link) {
    let choice = usize::from(w.byte());
    let count = w.linked.borrow().len();
    if count == 0 || choice >= 0xF8 && count < 3 {
        let new = (w.zeroed(), w.zeroed());
        w.linked.borrow_mut().push(new);
        client::begin(w, new.0);
        return new;
    }
    let (client, link) = w.linked.borrow()[choice % count];
    // Sometimes the link of another client.
    match choice {
        0xE0..0xE8 => (client, w.linked.borrow()[0].1),
        0xE8..0xEC => (null_mut(), link),
        0xEC..0xF0 => (client, null_mut()),
        _ => (client, link),
    }
}

fn hooks(w: &World) -> *const mbm_linkHooks {
    let which = w.byte();
    if which >= 0xF8 {
        return null();
    }
    w.put(mbm_linkHooks {
        context: null_mut(),
        disconnect: (which & 1 != 0).then_some(disconnect),
        connect: (which < 0xF0).then_some(connect),
        status: (which & 2 != 0).then_some(connect),
    })
}

fn set(w: &World, link: *mut mbm_link) {
    let (byte, word, more) = (w.byte(), w.word(), w.word());
    let choice = w.byte() % 10;
    let counters: *mut mbm_linkCounters = if byte & 1 == 0 {
        null_mut()
    } else {
        w.zeroed()
    };
    let context: *mut c_void = null_mut();
    let chance: Option<unsafe extern "C" fn(*mut c_void) -> u32> =
        (!w.rarely(8)).then_some(client::random);
    let callback: Option<unsafe extern "C" fn(*mut c_void, u8, u8)> =
        (!w.rarely(8)).then_some(changed);
    refused_changes_nothing(w, &[span(link)], "mbm_link_set", || match choice {
        0 => call!(
            w,
            mbm_link_setBackoff(link, byte % 6, u32::from(word % 50), u32::from(more))
        ),
        1 => call!(w, mbm_link_setJitter(link, byte % 128, chance, context)),
        2 => call!(w, mbm_link_setConnectTimeout(link, u32::from(word))),
        3 => call!(w, mbm_link_setRequestsWait(link, byte & 3)),
        4 => call!(w, mbm_link_setCounters(link, counters)),
        5 => call!(w, mbm_link_setReplaceAfter(link, byte % 128)),
        6 => call!(w, mbm_link_setClose(link, byte % 5)),
        7 => call!(w, mbm_link_setDelayAfterConnect(link, u32::from(word))),
        _ => call!(w, mbm_link_setCallback(link, callback, context)),
    });
}

/// Makes one call with a link or with its client.
pub fn step(w: &World) {
    let (client, link) = pick(w);
    // A line that was copied while it had a client's port may still use the port.
    let lenders = w.lenders.borrow().clone();
    let lent = w
        .linked
        .borrow()
        .iter()
        .any(|(client, _)| lenders.contains(client));
    match w.byte() % 16 {
        0 | 1 if !lent => {
            let hooks = hooks(w);
            let spans = [span(client), span(link)];
            refused_changes_nothing(w, &spans, "mbm_link_begin", || {
                call!(w, client, mbm_link_begin(link, client, hooks))
            });
        }
        2 if !lent => {
            let spans = [span(link), span(client)];
            refused!(w, &spans, mbm_link_end(link));
        }
        3 | 4 => set(w, link),
        5 => {
            refused!(w, mbm_link_reconnect(link));
        }
        6 => {
            let state = call!(w, mbm_link_state(link));
            assert!(state <= MBM_LINK_IS_UP, "state {state}");
        }
        7 => {
            let delay = call!(w, mbm_client_pollDelay(client));
            if w.byte() & 1 == 0 && delay < 0x0100_0000 {
                w.clock.set(w.clock.get().wrapping_add(delay));
            }
        }
        _ => client::step_with(w, client),
    }
}
