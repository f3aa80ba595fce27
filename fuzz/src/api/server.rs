//! Servers, and `mbm_unit_respond`, which needs no server.

use super::check::{is_status, refused_changes_nothing, span, OK};
use super::world::World;
use super::{ports, records, traffic};
use mbm_c::*;
use std::ffi::c_void;
use std::ptr::null_mut;

/// Begins a server with any framing and a buffer of any size.
fn begin(w: &World) {
    let server = w.servers.pick(w);
    let framing = w.byte() % 4;
    let port = ports::port(w, framing);
    let (units, count) = records::array(w);
    let count = if w.rarely(8) { count / 2 } else { count };
    let size = match w.byte() {
        0..0x80 => 260,
        byte @ 0x80..0xC0 => u16::from(byte) % 48,
        0xC0..0xE0 => 513,
        _ => w.word(),
    };
    let frame = w.buffer(size.into());
    let spans = [span(server)];
    refused_changes_nothing(w, &spans, "mbm_server_beginRtu", || match framing {
        MBM_FRAMING_RTU => call!(
            w,
            mbm_server_beginRtu(server, port, units, count, frame, size)
        ),
        MBM_FRAMING_ASCII => call!(
            w,
            mbm_server_beginAscii(server, port, units, count, frame, size)
        ),
        MBM_FRAMING_TCP => call!(
            w,
            mbm_server_beginTcp(server, port, units, count, frame, size)
        ),
        _ => call!(
            w,
            mbm_server_beginRtuOverTcp(server, port, units, count, frame, size)
        ),
    });
}

/// Polls a server a few times while time passes.
fn poll(w: &World) {
    let server = w.servers.pick(w);
    for _ in 0..1 + w.byte() % 4 {
        checked!(w, mbm_server_poll(server));
        w.clock
            .set(w.clock.get().wrapping_add(1 << (w.byte() % 20)));
    }
}

fn set(w: &World) {
    let server = w.servers.pick(w);
    let spans = [span(server)];
    refused_changes_nothing(w, &spans, "mbm_server_set", || match w.byte() % 4 {
        0 => {
            let time = w.long();
            call!(w, mbm_server_setSilence(server, time))
        }
        1 => {
            let baud = w.long();
            call!(w, mbm_server_setBaudRate(server, baud))
        }
        2 => {
            let time = w.long() as u16;
            call!(w, mbm_server_setReceiveLatency(server, time))
        }
        _ => {
            let on = w.byte() & 3;
            call!(w, mbm_server_setEchoDiscard(server, on))
        }
    });
}

/// Answers one frame without a server. The call sets `response` in any case.
fn respond(w: &World) {
    let framing = if w.rarely(16) { w.byte() } else { w.byte() % 4 };
    let (units, count) = records::array(w);
    let request = traffic::request(w, framing);
    let framing = w.put(mbm_framing {
        functions: std::ptr::null(),
        functionCount: 0,
        kind: framing,
        delimiter: if w.rarely(16) { w.byte() } else { 0 },
    });
    let space = w.word();
    let capacity = if w.rarely(4) { space } else { 513 };
    let length = request.len().min(capacity.into());
    let frame = w.noise(capacity.into());
    for (at, byte) in request[..length].iter().enumerate() {
        // SAFETY: the index is below the capacity.
        unsafe { *frame.add(at) = *byte };
    }
    let length = match w.byte() {
        0xF0.. => w.word(),
        _ => length as u16,
    };
    let frame = w.null_or(64, || frame);
    let response = w.null_or(64, || w.unset::<u16>());
    let status = call!(
        w,
        std::ptr::null::<mbm_unit>(),
        mbm_unit_respond(
            units,
            count,
            null_mut::<c_void>(),
            framing,
            frame,
            length,
            capacity,
            response
        )
    );
    is_status("mbm_unit_respond", status);
    if !response.is_null() {
        // SAFETY: the pointer is not NULL.
        let response = unsafe { response.read() };
        assert!(
            response <= capacity,
            "mbm_unit_respond returned the length {response}; the capacity is {capacity}"
        );
        assert!(
            status == OK || response == 0,
            "a refused call has left a response"
        );
    }
}

/// Changes a unit between two calls, as the user may.
fn unit(w: &World) {
    let unit = records::unit(w);
    if unit.is_null() || w.is_inside() {
        return;
    }
    // SAFETY: the pointer is a unit of an array.
    unsafe {
        if w.rarely(16) {
            w.note(|| format!("memset({unit:?}, 0, unit)"));
            unit.write(std::mem::zeroed());
        }
        (*unit).id = w.unit_id().into();
    }
}

/// Makes one call with a server or a unit.
pub fn step(w: &World) {
    match w.byte() % 16 {
        0 | 1 => begin(w),
        2..=6 => poll(w),
        7 => {
            let server = w.servers.pick(w);
            call!(w, mbm_server_pollDelay(server));
        }
        8 => set(w),
        9 | 10 => respond(w),
        11 => unit(w),
        12 => records::set_hooks(w),
        _ => records::serve(w),
    }
}
