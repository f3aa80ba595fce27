//! Nodes.

use super::check::{bytes, checked_call, is_status, span, unchanged_if_refused, Span, PENDING};
use super::line;
use super::ports;
use super::world::World;
use mbm_c::*;
use std::ptr::null_mut;

/// One of the nodes, a new one, a copy of one, or NULL.
fn pick(w: &World) -> *mut mbm_node {
    if let Some(node) = w.calling_node() {
        return node;
    }
    let node = w.nodes.pick(w);
    if let Some((from, new)) = w.nodes.take_copy() {
        w.set_line_of(new, w.line_of(from));
    }
    node
}

fn begin(w: &World, node: *mut mbm_node) {
    let (unit, line) = (w.unit_id(), w.lines.pick(w));
    let words = |w: &World| match w.byte() {
        0..0x80 => 125,
        0x80..0xE0 => u16::from(w.byte()),
        0xE0..0xF0 => 0,
        _ => w.word(),
    };
    let (response, transmit) = (words(w), words(w));
    let place = |w: &World, count: u16| -> *mut u16 {
        if count == 0 && w.rarely(2) {
            null_mut()
        } else {
            w.buffer(2 * usize::from(count)).cast()
        }
    };
    let (responses, transmits) = (place(w, response), place(w, transmit));
    let spans = [span(node), span(line)];
    let status = refused!(
        w,
        &spans,
        mbm_node_begin(node, line, unit, responses, response, transmits, transmit)
    );
    if status == MBM_OK {
        w.set_line_of(node, line);
    }
}

/// A callback that makes no calls.
unsafe extern "C" fn quiet() {}

/// Settings. They may be set in hooks of the line, too.
fn set(w: &World, node: *mut mbm_node) {
    let (byte, word, long) = (w.byte(), w.word(), w.long());
    let choice = w.byte() % 8;
    let time = if byte < 0xF0 { word.into() } else { long };
    let callback = (byte & 1 == 0).then_some(quiet as unsafe extern "C" fn());
    unchanged_if_refused(w, &[span(node)], "mbm_node_set", || match choice {
        0 => call!(w, mbm_node_setSlaveID(node, byte)),
        1 => call!(w, mbm_node_setResponseTimeout(node, time)),
        2 => call!(w, mbm_node_setBlocking(node, byte & 1)),
        3 => call!(w, mbm_node_idle(node, callback)),
        4 => call!(w, mbm_node_preTransmission(node, callback)),
        5 => call!(w, mbm_node_postTransmission(node, callback)),
        _ => call!(w, mbm_node_setLenient(node, byte & 1)),
    });
    call!(w, mbm_node_getSlaveID(node));
}

/// The object that a hook must not use if it must not make a request of the node: the line while
/// its hooks run, otherwise the node.
fn lock(w: &World, node: *mut mbm_node) -> Span {
    let line = w.line_of(node);
    if w.is_locked(line.cast()) {
        span(line)
    } else {
        span(node)
    }
}

/// Starts a request, most often of a node that was begun. A blocking one must return.
fn request(w: &World, node: *mut mbm_node) {
    if w.line_of(node).is_null() && !w.rarely(4) {
        begin(w, node);
    }
    let (a, b, c, d) = (w.word(), w.word(), w.word(), w.word());
    let choice = w.byte() % 13;
    let spans = [span(node), span(w.line_of(node))];
    let before = spans.map(bytes);
    let inner = w.inner_calls.get();
    let status = checked_call(w, lock(w, node), "a request", || match choice {
        0 => call!(w, mbm_node_readCoils(node, a, b)),
        1 => call!(w, mbm_node_readDiscreteInputs(node, a, b)),
        2 => call!(w, mbm_node_readHoldingRegisters(node, a, b)),
        3 => call!(w, mbm_node_readInputRegisters(node, a, b)),
        4 => call!(w, mbm_node_writeSingleCoil(node, a, b as u8)),
        5 => call!(w, mbm_node_writeSingleRegister(node, a, b)),
        6 => call!(w, mbm_node_writeMultipleCoils(node, a, b)),
        7 => call!(w, mbm_node_writeQueuedCoils(node)),
        8 => call!(w, mbm_node_writeMultipleRegisters(node, a, b)),
        9 => call!(w, mbm_node_writeQueuedRegisters(node)),
        10 => call!(w, mbm_node_maskWriteRegister(node, a, b, c)),
        11 => call!(w, mbm_node_readWriteMultipleRegisters(node, a, b, c, d)),
        _ => call!(w, mbm_node_readWriteQueuedRegisters(node, a, b)),
    });
    if w.inner_calls.get() - inner != u32::from(w.is_inside()) {
        // A hook may have changed anything.
        return;
    }
    match status {
        MBM_BUSY | MBM_INVALID_ARGUMENT => {
            assert!(
                spans.map(bytes) == before,
                "a request returned {status}, and changed the node or its line"
            );
        }
        // The node keeps that status.
        MBM_NOT_INITIALISED => {
            let [_, line] = spans.map(bytes);
            assert!(
                line == before[1],
                "a request without a port changed the line"
            );
        }
        PENDING => changes_are_refused(w, node),
        _ => {}
    }
    if status == MBM_NOT_INITIALISED && !w.rarely(4) {
        // The next request may find a line with a port and a frame buffer.
        line::begin(w, w.line_of(node));
    }
}

/// While a request of the node is pending, the line takes none of another node, and neither
/// the line nor the node can be begun again.
fn changes_are_refused(w: &World, node: *mut mbm_node) {
    let line = w.line_of(node);
    let is_other = |other: &*mut mbm_node| *other != node && w.line_of(*other) == line;
    if let Some(other) = w.nodes.all().into_iter().find(is_other) {
        let spans = [span(other), span(node), span(line)];
        let status = unchanged_if_refused(w, &spans, "a request", || {
            call!(w, mbm_node_readCoils(other, 0, 1))
        });
        assert_eq!(status, MBM_BUSY, "a second request on a line");
    }
    if !w.rarely(8) {
        return;
    }
    let (new, frame): (*mut mbm_line, _) = (w.zeroed(), w.noise(256));
    let port = ports::good(w, 0, MBM_FRAMING_RTU);
    let spans = [span(node), span(line), span(new)];
    for choice in 0..3 {
        let none = null_mut();
        let status = unchanged_if_refused(w, &spans, "a begin", || match choice {
            0 => call!(w, mbm_node_begin(node, new, 1, none, 0, none, 0)),
            1 => call!(w, mbm_line_beginRtu(line, port, frame, 256)),
            _ => call!(w, mbm_line_setFrame(line, frame, 256)),
        });
        assert_eq!(status, MBM_BUSY, "a change while a request is pending");
    }
}

/// Polls a few times, or until the request has ended.
fn poll(w: &World, node: *mut mbm_node) {
    for _ in 0..1 + w.byte() % 16 {
        let status = checked!(w, mbm_node_poll(node));
        if status != PENDING {
            return;
        }
    }
}

fn words(w: &World, node: *mut mbm_node) {
    let (byte, word) = (w.byte(), w.word());
    match w.byte() % 14 {
        0 => drop(call!(w, mbm_node_beginTransmission(node, word))),
        1 => {
            for _ in 0..byte % 130 {
                call!(w, mbm_node_send(node, word));
            }
        }
        2 => drop(call!(w, mbm_node_send(node, u16::from(byte)))),
        3 => {
            for _ in 0..byte {
                call!(w, mbm_node_sendBit(node, byte & 1));
            }
        }
        4 => {
            let count = call!(w, mbm_node_available(node));
            assert!(count <= 125, "{count} words to receive");
        }
        5 => {
            for _ in 0..byte % 8 {
                call!(w, mbm_node_receive(node));
            }
        }
        6 => drop(call!(w, mbm_node_getResponseBuffer(node, byte))),
        7..=11 => {
            let (choice, long) = (w.byte() % 5, w.long());
            let spans = [span(node)];
            unchanged_if_refused(w, &spans, "a word", || match choice {
                0 => call!(w, mbm_node_clearResponseBuffer(node)),
                1 => call!(w, mbm_node_setTransmitBuffer(node, byte, word)),
                2 => call!(w, mbm_node_clearTransmitBuffer(node)),
                3 => call!(w, mbm_node_send8(node, byte)),
                _ => call!(w, mbm_node_send32(node, long)),
            });
        }
        12 => {
            let count = call!(w, mbm_node_requestFrom(node, word, u16::from(byte)));
            let line = span(w.line_of(node)).0;
            assert!(
                count <= 125 && (count == 0 || !w.is_locked(line)),
                "{count} words to receive of a request"
            );
        }
        _ => drop(call!(w, mbm_node_getExceptionCode(node))),
    }
}

/// Makes one call with a node.
pub fn step(w: &World) {
    let node = pick(w);
    match w.byte() % 16 {
        0 | 1 => begin(w, node),
        2 => set(w, node),
        3..=7 => request(w, node),
        8 | 9 => words(w, node),
        10 => {
            let delay = call!(w, mbm_node_pollDelay(node));
            if w.byte() & 1 == 0 && delay < 0x0100_0000 {
                w.clock.set(w.clock.get().wrapping_add(delay));
            }
        }
        11 => {
            refused!(w, mbm_node_cancel(node));
        }
        12 => {
            let status = call!(w, mbm_node_status(node));
            is_status("mbm_node_status", status);
            assert!(!w.is_locked(node.cast()) || status == MBM_BUSY);
        }
        13 if w.byte() & 1 == 0 => {
            // The user may zero a node at any time, also in the hook `idle`.
            if !node.is_null() && w.is_free() {
                w.note(|| format!("memset({node:?}, 0, node)"));
                // SAFETY: no function uses the node now.
                unsafe { node.cast::<u8>().write_bytes(0, size_of::<mbm_node>()) };
                w.set_line_of(node, null_mut());
            }
        }
        _ => poll(w, node),
    }
}
