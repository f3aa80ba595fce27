//! Lines.

use super::check::{refused_changes_nothing, span};
use super::ports;
use super::world::World;
use mbm_c::*;
use std::ptr::null_mut;

/// A buffer for frames of any size, and its length.
fn frame(w: &World) -> (*mut u8, u16) {
    let bytes = match w.byte() {
        0..0xA0 => 256,
        _ => w.word(),
    };
    (w.buffer(bytes.into()), bytes)
}

/// One of the lines, a new one, a copy of one, or NULL.
fn pick(w: &World) -> *mut mbm_line {
    match w.calling_node() {
        Some(node) => w.line_of(node),
        None => w.lines.pick(w),
    }
}

pub fn begin(w: &World, line: *mut mbm_line) {
    let mut port = ports::port(w, MBM_FRAMING_RTU);
    if w.rarely(4) {
        let callbacks: *mut mbm_nodeCallbacks = w.zeroed();
        refused!(w, mbm_nodeCallbacks_begin(callbacks, port));
        port = call!(w, mbm_nodeCallbacks_port(callbacks));
    }
    let (frame, bytes) = match w.byte() {
        0..0xE0 => frame(w),
        0xE0..0xF8 => (null_mut(), 0),
        _ => (null_mut(), 256),
    };
    refused!(w, mbm_line_beginRtu(line, port, frame, bytes));
}

fn set_frame(w: &World, line: *mut mbm_line) {
    let (frame, bytes) = frame(w);
    refused!(w, mbm_line_setFrame(line, frame, bytes));
}

fn set(w: &World, line: *mut mbm_line) {
    let (byte, word, long) = (w.byte(), w.word(), w.long());
    let choice = w.byte() % 8;
    let counters: *mut mbm_counters = if byte & 1 == 0 {
        null_mut()
    } else {
        w.zeroed()
    };
    // Sometimes too large a number.
    let time = if byte < 0xF0 { word.into() } else { long };
    refused_changes_nothing(w, &[span(line)], "mbm_line_set", || match choice {
        0 => call!(w, mbm_line_setBaudRate(line, long)),
        1 => call!(w, mbm_line_setGap(line, long)),
        2 => call!(w, mbm_line_setTurnaroundDelay(line, time)),
        3 => call!(w, mbm_line_setQuietTime(line, time)),
        4 => call!(w, mbm_line_setRetries(line, byte)),
        5 => call!(w, mbm_line_setEchoDiscard(line, byte & 3)),
        6 => call!(w, mbm_line_setPostFlushHold(line, byte)),
        _ => call!(w, mbm_line_setCounters(line, counters)),
    });
}

/// Reports that the wire was used.
fn used(w: &World, line: *mut mbm_line) {
    let (byte, long) = (w.byte(), w.long());
    refused_changes_nothing(w, &[span(line)], "mbm_line_used", || match byte & 1 {
        0 => call!(w, mbm_line_used(line)),
        _ => call!(w, mbm_line_usedAt(line, long)),
    });
}

/// Makes one call with a line.
pub fn step(w: &World) {
    let line = pick(w);
    match w.byte() % 16 {
        0..=3 => begin(w, line),
        4..=6 => set_frame(w, line),
        7..=10 => set(w, line),
        11 | 12 => used(w, line),
        13 | 14 => {
            refused!(w, mbm_line_cancel(line));
        }
        _ => {
            // The user may zero a line at any time, also in the hook `idle`.
            if !line.is_null() && w.is_free() {
                w.note(|| format!("memset({line:?}, 0, line)"));
                // SAFETY: no function uses the line now.
                unsafe { line.cast::<u8>().write_bytes(0, size_of::<mbm_line>()) };
            }
        }
    }
}
