//! The client.

use super::check::{refused_changes_nothing, span, PENDING};
use super::world::{Grant, World};
use super::{asked, identification, ports};
use mbm_c::*;
use std::ffi::c_void;
use std::ptr::{null, null_mut};

pub fn begin(w: &World, client: *mut mbm_client) {
    let framing = w.byte() % 4;
    let port = ports::port(w, framing);
    let size = |w: &World| match w.byte() {
        0..0x80 => 260,
        0x80..0xA0 => 513,
        0xA0..0xC0 => w.byte().into(),
        _ => w.word(),
    };
    let (bytes, more) = (size(w), size(w));
    let (frame, outgoing) = (w.buffer(bytes.into()), w.buffer(more.into()));
    refused_changes_nothing(w, &[span(client)], "mbm_client_begin", || match framing {
        MBM_FRAMING_RTU => call!(w, mbm_client_beginRtu(client, port, frame, bytes)),
        MBM_FRAMING_ASCII => call!(w, mbm_client_beginAscii(client, port, frame, bytes)),
        MBM_FRAMING_TCP => call!(
            w,
            mbm_client_beginTcp(client, port, frame, bytes, outgoing, more)
        ),
        _ => call!(w, mbm_client_beginRtuOverTcp(client, port, frame, bytes)),
    });
}

pub unsafe extern "C" fn random(_: *mut c_void) -> u32 {
    let w = World::current();
    w.hook(Grant::Nothing, 16);
    w.random()
}

fn set(w: &World, client: *mut mbm_client) {
    let (byte, word, more, long) = (w.byte(), w.word(), w.word(), w.long());
    let choice = w.byte() % 20;
    let counters: *mut mbm_counters = if byte & 1 == 0 {
        null_mut()
    } else {
        w.zeroed()
    };
    let chance: Option<unsafe extern "C" fn(*mut c_void) -> u32> = (!w.rarely(8)).then_some(random);
    let context: *mut c_void = null_mut();
    let limit = asked::retry_limit(w);
    let records: Vec<u8> = (0..byte % 8).collect();
    let units: *mut mbm_clientUnit = w
        .block(
            records.len() * size_of::<mbm_clientUnit>(),
            align_of::<mbm_clientUnit>(),
        )
        .cast();
    for (at, unit) in records.iter().enumerate() {
        // SAFETY: the index is below the count.
        let record = unsafe { &mut *units.add(at) };
        (record.unit, record.delayUs) = ((*unit).into(), more.into());
        (record.retryLimit, record.timeoutMs) = (limit, if w.rarely(2) { word.into() } else { 0 });
    }
    let none: *mut mbm_clientUnit = null_mut();
    let units = w.null_or(8, || units);
    refused_changes_nothing(w, &[span(client)], "mbm_client_set", || match choice {
        0 => call!(w, mbm_client_setDelimiter(client, byte)),
        1 => call!(w, mbm_client_setInFlight(client, byte % 20)),
        2 => call!(w, mbm_client_setResponseTimeout(client, u32::from(word))),
        3 => call!(w, mbm_client_setBaudRate(client, long)),
        4 => call!(w, mbm_client_setGap(client, long)),
        5 => call!(w, mbm_client_setTurnaroundDelay(client, u32::from(word))),
        6 => call!(w, mbm_client_setQuietTime(client, u32::from(word))),
        7 => call!(w, mbm_client_setEchoDiscard(client, byte & 3)),
        8 => call!(w, mbm_client_setPostFlushHold(client, byte)),
        9 => call!(w, mbm_client_setRetries(client, byte)),
        10 => call!(
            w,
            mbm_client_setBackoff(client, byte % 6, u32::from(word), u32::from(more))
        ),
        11 => call!(w, mbm_client_setJitter(client, byte % 128, chance, context)),
        12 => call!(w, mbm_client_setCounters(client, counters)),
        13 => call!(w, mbm_client_setUnits(client, units, byte % 8)),
        14 => call!(w, mbm_client_setBusyRetries(client, byte, u32::from(word))),
        15 => call!(w, mbm_client_setAccept(client, byte % 6)),
        16 => call!(w, mbm_client_setLenient(client, byte & 3)),
        17 => call!(w, mbm_client_setMessageWait(client, u32::from(word))),
        _ => call!(w, mbm_client_setUnits(client, none, byte)),
    });
}

fn poll(w: &World, client: *mut mbm_client) {
    for _ in 0..1 + w.byte() % 12 {
        let status = checked!(w, mbm_client_poll(client));
        if status != PENDING {
            break;
        }
        let count = call!(w, mbm_client_pending(client));
        assert!(count <= MBM_CLIENT_DEPTH, "{count} requests");
        if w.byte() < 0x40 {
            w.clock
                .set(w.clock.get().wrapping_add(1 << (w.byte() % 22)));
        }
    }
}

unsafe extern "C" fn disconnect(_: *mut c_void) {
    World::current().hook(Grant::All, 8);
}

unsafe extern "C" fn connect(_: *mut c_void) -> u8 {
    let w = World::current();
    w.hook(Grant::All, 8);
    [0, PENDING, 230, w.random() as u8][(w.random() % 4) as usize]
}

/// Calls that reconnect a link or suspend the client.
fn line(w: &World, client: *mut mbm_client) {
    match w.byte() % 4 {
        0 => {
            let hooks = w.byte();
            let link = if hooks >= 0xE0 {
                null()
            } else {
                w.put(mbm_linkHooks {
                    context: null_mut(),
                    disconnect: (hooks & 1 != 0).then_some(disconnect),
                    connect: (hooks & 2 != 0).then_some(connect),
                    status: None,
                })
            };
            call!(w, mbm_client_reconnect(client, link));
        }
        1 => {
            let connected = call!(w, mbm_client_isConnected(client));
            assert!(connected <= 1);
        }
        choice => {
            let line = w.lines.pick(w);
            let spans = [span(client), span(line)];
            refused_changes_nothing(w, &spans, "suspend or resume", || match choice {
                2 => {
                    w.lenders.borrow_mut().push(client);
                    call!(w, mbm_client_suspend(client, line))
                }
                _ => call!(w, mbm_client_resume(client, line)),
            });
        }
    }
}

/// Makes one call with a client of the pool.
pub fn step(w: &World) {
    step_with(w, w.clients.pick(w));
}

/// Makes one call with a client.
pub fn step_with(w: &World, client: *mut mbm_client) {
    match w.byte() % 16 {
        0 | 1 => begin(w, client),
        2 | 3 => set(w, client),
        4..=8 => asked::request(w, client),
        9..=11 => poll(w, client),
        12 => {
            call!(w, mbm_client_pollDelay(client));
            call!(w, mbm_client_getResponseTimeout(client, w.byte()));
            match w.byte() % 4 {
                0 => {}
                1 => identification::reply(w),
                _ => identification::identify(w, client),
            }
        }
        13 => {
            let request = w.requests.pick(w);
            call!(w, mbm_client_wireTransaction(request));
            let spans = [span(client), span(request)];
            refused!(w, &spans, mbm_client_cancel(client, request));
        }
        14 => line(w, client),
        _ => {
            // The user may zero a client that has no pending request and is not suspended.
            // SAFETY: the pointer is NULL or an object.
            let pending = unsafe { mbm_client_pending(client) };
            let lender = w.lenders.borrow().contains(&client);
            if !client.is_null() && !lender && !w.is_inside() && (pending == 0 || w.wild) {
                w.note(|| format!("memset({client:?}, 0, client)"));
                // SAFETY: nothing uses the client now.
                unsafe { client.cast::<u8>().write_bytes(0, size_of::<mbm_client>()) };
            }
        }
    }
}
