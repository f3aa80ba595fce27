//! Traces, `mbm_trace_*`: before any port, and used by any object.

use super::check::{bytes, is_status, refused_changes_nothing, span};
use super::world::{Grant, World};
use super::{packet, ports};
use mbm_c::*;
use std::ffi::c_void;
use std::ptr::null_mut;

/// The hook: looks at every byte of the record, and sometimes calls the API.
unsafe extern "C" fn hook(_: *mut c_void, record: *const mbm_traceRecord) {
    let w = World::current();
    // SAFETY: the record that a trace hands out.
    let record = unsafe { *record };
    assert!(record.length > 0 && record.direction <= MBM_TRACE_SENT);
    assert!(record.kind <= MBM_PACKET_RESPONSE);
    is_status("a record", record.status);
    assert_eq!(
        bytes((record.bytes, record.length.into())).len(),
        usize::from(record.length)
    );
    w.hook(Grant::Nothing, 64);
}

fn begin(w: &World, trace: *mut mbm_trace) {
    let kind = w.byte();
    let port = ports::plain(w, kind % 4);
    let size = match w.byte() {
        0..0x80 => 2 * MBM_MAX_ASCII_FRAME,
        byte @ 0x80..0xC0 => u16::from(byte) % 64,
        _ => w.word(),
    };
    let buffer = w.null_or(64, || w.buffer(size.into()));
    let (functions, count) = packet::functions(w);
    let framing = w.put(mbm_framing {
        functions,
        functionCount: count,
        kind: if kind >= 0xF0 { kind } else { kind % 4 },
        delimiter: if w.rarely(8) { w.byte() } else { 0 },
    });
    let take = (!w.rarely(64)).then_some(hook as unsafe extern "C" fn(_, _));
    let sends = w.byte();
    let sends = if sends >= 0xF0 { sends } else { sends & 1 };
    refused_changes_nothing(w, &[span(trace)], "mbm_trace_begin", || {
        let context = null_mut();
        call!(
            w,
            mbm_trace_begin(trace, sends, port, framing, buffer, size, take, context)
        )
    });
}

/// Makes calls with a trace.
pub fn step(w: &World) {
    let trace = w.traces.pick(w);
    match w.byte() % 4 {
        0 | 1 => begin(w, trace),
        2 => {
            let timeout = w.word();
            refused!(w, mbm_trace_setFrameTimeout(trace, u32::from(timeout)));
        }
        _ => {
            refused!(w, mbm_trace_flush(trace));
        }
    }
    let event = w.events.any();
    let record = w.unset::<mbm_traceRecord>();
    let status = call!(w, mbm_trace_ofEvent(event, record));
    if is_status("mbm_trace_ofEvent", status) == MBM_OK {
        // SAFETY: the record of an event, whose memory is valid until the input has been run.
        let record = unsafe { *record };
        assert!(record.kind <= MBM_PACKET_RESPONSE && record.direction == MBM_TRACE_RECEIVED);
        bytes((record.bytes, record.length.into()));
    }
}
