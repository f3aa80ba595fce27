//! The link of each line, and what happens to the line itself.

use super::state::{new, Life};
use crate::api::check::{OK, PENDING};
use mbm_c::*;
use std::ffi::c_void;
use std::ptr::{null, null_mut};

unsafe extern "C" fn disconnect(context: *mut c_void) {
    let wire = &Life::current().lines[context as usize].wire;
    wire.is_open.set(false);
    wire.is_opening.set(false);
}

unsafe extern "C" fn connect(context: *mut c_void) -> u8 {
    let life = Life::current();
    let wire = &life.lines[context as usize].wire;
    wire.is_opening.set(false);
    wire.is_open.set(false);
    wire.reset(life);
    match life.w.random() % 4 {
        0 | 1 => {
            wire.is_open.set(true);
            OK
        }
        2 => {
            wire.is_opening.set(true);
            PENDING
        }
        _ => MBM_LINK_LOST,
    }
}

unsafe extern "C" fn status(context: *mut c_void) -> u8 {
    let life = Life::current();
    let wire = &life.lines[context as usize].wire;
    if !wire.is_opening.get() {
        return if wire.is_open.get() {
            OK
        } else {
            MBM_LINK_LOST
        };
    }
    match life.w.random() % 8 {
        0 | 1 => {
            wire.is_opening.set(false);
            wire.is_open.set(true);
            OK
        }
        2 => {
            wire.is_opening.set(false);
            MBM_LINK_LOST
        }
        _ => PENDING,
    }
}

unsafe extern "C" fn changed(context: *mut c_void, event: u8, _: u8) {
    assert!(event <= MBM_LINK_EVENT_FAILED);
    let life = Life::current();
    if event != MBM_LINK_EVENT_CONNECTED {
        // The callback may end the link before it is closed. The connection is lost all the same.
        unsafe { disconnect(context) };
    }
    life.callback();
}

pub fn begin_or_end(life: &Life, at: usize) {
    let w = &life.w;
    let line = &life.lines[at];
    let link = line.link.get();
    if line.has_link.get() && w.byte() & 1 == 0 {
        if call!(w, mbm_link_end(link)) == OK {
            line.has_link.set(false);
            if life.inside.get() == 0 {
                // SAFETY: the link has ended, so nothing uses it.
                drop(unsafe { Box::from_raw(link) });
                line.link.set(new());
            }
        }
        return;
    }
    let hooks = w.put(mbm_linkHooks {
        context: at as *mut c_void,
        disconnect: (w.byte() & 3 != 0).then_some(disconnect),
        connect: Some(connect),
        status: Some(status),
    });
    let client = line.client.get();
    if call!(w, client, mbm_link_begin(link, client, hooks)) != OK {
        return;
    }
    line.has_link.set(true);
    line.keeps.set(w.byte() & 1 == 0);
    line.connects_for_ever.set(false);
    call!(
        w,
        mbm_link_setRequestsWait(link, u8::from(line.keeps.get()))
    );
    let callback: Option<unsafe extern "C" fn(*mut c_void, u8, u8)> = Some(changed);
    let context = at as *mut c_void;
    call!(w, mbm_link_setCallback(link, callback, context));
}

pub fn set(life: &Life, at: usize) {
    let w = &life.w;
    let line = &life.lines[at];
    if !line.has_link.get() {
        return;
    }
    let link = line.link.get();
    let (byte, word) = (w.byte(), u16::from(w.byte()));
    match byte % 5 {
        0 => {
            call!(
                w,
                mbm_link_setBackoff(link, byte >> 2 & 3, u32::from(word), 2 * u32::from(word))
            );
        }
        1 => {
            if call!(w, mbm_link_setConnectTimeout(link, u32::from(word))) == OK {
                line.connects_for_ever.set(word == 0);
            }
        }
        2 => {
            if call!(w, mbm_link_setRequestsWait(link, byte >> 2 & 1)) == OK {
                line.keeps.set(byte >> 2 & 1 != 0);
            }
        }
        3 => {
            call!(w, mbm_link_setReplaceAfter(link, byte % 101));
        }
        _ => {
            let chance: Option<unsafe extern "C" fn(*mut c_void) -> u32> = Some(number);
            let context: *mut c_void = null_mut();
            call!(w, mbm_link_setJitter(link, byte % 101, chance, context));
        }
    }
}

unsafe extern "C" fn number(_: *mut c_void) -> u32 {
    Life::current().w.random()
}

pub fn reconnect(life: &Life, at: usize) {
    let w = &life.w;
    let line = &life.lines[at];
    if line.has_link.get() {
        let link = line.link.get();
        call!(w, mbm_link_reconnect(link));
        return;
    }
    // By hand: the program has opened the line again.
    let client = line.client.get();
    let hooks: *const mbm_linkHooks = null();
    if call!(w, mbm_client_reconnect(client, hooks)) == OK {
        line.wire.reset(life);
        line.wire.is_open.set(true);
        line.wire.is_opening.set(false);
    }
}

/// The line is lost or comes back, the port takes few bytes or none, the device changes.
pub fn change_wire(life: &Life, at: usize) {
    let w = &life.w;
    let line = &life.lines[at];
    let wire = &line.wire;
    match w.byte() % 8 {
        0 => {
            wire.is_open.set(false);
            wire.is_opening.set(false);
        }
        // A connection that is still being made takes and gives nothing.
        1 if !line.has_link.get() && wire.is_open.get() => {
            wire.is_open.set(false);
            wire.is_opening.set(true);
        }
        2 if wire.is_opening.get() => {
            wire.is_opening.set(false);
            wire.is_open.set(true);
        }
        3 => wire.takes.set([0, 1, 5, 13][usize::from(w.byte()) % 4]),
        4 => wire.takes.set(u16::MAX),
        5 => wire.flushes.set(w.byte() & 3 != 0),
        _ => wire.device.set(w.byte()),
    }
}
