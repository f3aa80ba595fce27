//! Ports with every behaviour: bytes delivered, bytes accepted, and false return values.

use super::port::Port;
use super::traffic;
use super::world::{Grant, World};
use mbm_c::{mbm_node, mbm_port};
use std::ffi::c_void;

/// Changes the behaviour of a port, most often to a good one.
pub fn change(w: &World) {
    let port = &w.ports[w.below(w.ports.len())];
    let mode = |w: &World| match w.byte() {
        0..0x80 => 0,
        byte => byte,
    };
    port.reads.set(mode(w));
    port.writes.set(mode(w));
    port.flushes.set(mode(w));
    port.peer.set(w.byte());
    port.step.set(1 << (w.byte() % 24));
}

/// A complete port.
pub fn good(w: &World, index: usize, framing: u8) -> *const mbm_port {
    w.ports[index].framing.set(framing);
    w.put(mbm_port {
        context: index as *mut c_void,
        read: Some(read),
        write: Some(write),
        micros: Some(micros),
        flush: Some(flush),
        preTransmission: Some(transmission),
        postTransmission: Some(transmission),
        idle: Some(idle),
    })
}

/// A port for an object of this framing; sometimes that of a trace.
pub fn port(w: &World, framing: u8) -> *const mbm_port {
    if w.rarely(8) {
        // NULL if the trace was not begun, or while its hook runs.
        let trace = w.traces.pick(w);
        return call!(w, mbm_trace_port(trace));
    }
    plain(w, framing)
}

/// A port for an object of this framing; sometimes one that lacks a hook.
pub fn plain(w: &World, framing: u8) -> *const mbm_port {
    if w.rarely(64) {
        return std::ptr::null();
    }
    let index = w.below(w.ports.len());
    w.ports[index].framing.set(framing);
    let hooks = w.byte();
    let lacks = if hooks >= 0xF8 { hooks % 8 } else { 8 };
    w.put(mbm_port {
        context: index as *mut c_void,
        read: (lacks != 0).then_some(read),
        write: (lacks != 1).then_some(write),
        micros: (lacks != 2).then_some(micros),
        flush: (hooks & 1 != 0).then_some(flush),
        preTransmission: (hooks & 2 != 0).then_some(transmission),
        postTransmission: (hooks & 2 != 0).then_some(transmission),
        idle: (hooks & 4 != 0).then_some(idle),
    })
}

fn enter<'a>(context: *mut c_void, grant: Grant, times: u32) -> (&'a World, &'a Port) {
    let w = World::current();
    w.hook(grant, times);
    (w, &w.ports[context as usize])
}

unsafe extern "C" fn read(context: *mut c_void, bytes: *mut u8, capacity: u16) -> i16 {
    let (w, port) = enter(context, Grant::Nothing, 64);
    assert!(
        !bytes.is_null() && capacity <= i16::MAX as u16,
        "read of {capacity}"
    );
    let place = unsafe { std::slice::from_raw_parts_mut(bytes, capacity.into()) };
    let mode = port.reads.get();
    if mode % 16 == 15 {
        return -1;
    }
    if mode % 16 == 14 {
        // The peer sends without pause.
        place.fill(mode);
        return capacity as i16;
    }
    if port.inbox.borrow().is_empty() && port.peer.get() % 4 == 3 && w.random().is_multiple_of(4) {
        let framing = port.framing.get();
        let frame = w.inside(Grant::Nothing, || traffic::request(w, framing));
        port.inbox.borrow_mut().extend(frame);
    }
    let most = if mode % 16 == 13 { 1 } else { capacity.into() };
    let mut inbox = port.inbox.borrow_mut();
    let count = most.min(inbox.len());
    for (place, byte) in place.iter_mut().zip(inbox.drain(..count)) {
        *place = byte;
    }
    match mode % 16 {
        // Returns more than the capacity.
        12 => capacity.saturating_add(mode.into()).min(i16::MAX as u16) as i16,
        11 => i16::MAX,
        // Returns less than it has written.
        10 => {
            place.fill(0x5A);
            (count / 2) as i16
        }
        _ => count as i16,
    }
}

unsafe extern "C" fn write(context: *mut c_void, bytes: *const u8, length: u16) -> i16 {
    let (w, port) = enter(context, Grant::Nothing, 64);
    assert!(
        !bytes.is_null() && (1..=i16::MAX as u16).contains(&length),
        "write of {length}"
    );
    let mut taken = unsafe { std::slice::from_raw_parts(bytes, length.into()) };
    let mode = port.writes.get();
    match mode % 16 {
        15 => return -1,
        14 => return 0,
        13 => taken = &taken[..taken.len().min(1)],
        _ => {}
    }
    match port.peer.get() % 4 {
        1 => {
            let next = (context as usize + 1) % w.ports.len();
            let mut inbox = w.ports[next].inbox.borrow_mut();
            if inbox.len() < 4096 {
                inbox.extend(taken);
            }
        }
        2 => {
            let framing = port.framing.get();
            let answer = w.inside(Grant::Nothing, || traffic::answer(w, framing, taken));
            port.inbox.borrow_mut().extend(answer);
        }
        _ => {}
    }
    match mode % 16 {
        12 => i16::MAX,
        11 => length.saturating_add(1).min(i16::MAX as u16) as i16,
        _ => taken.len() as i16,
    }
}

unsafe extern "C" fn micros(context: *mut c_void) -> u32 {
    let (w, port) = enter(context, Grant::Nothing, 256);
    // The more hooks a call has called, the faster the clock, so that every call ends.
    let step = u64::from(port.step.get().max(1)) << (w.hooks() / 16).min(23);
    let now = w.clock.get().wrapping_add(step.min(1 << 23) as u32);
    w.clock.set(now);
    now
}

unsafe extern "C" fn flush(context: *mut c_void) -> u8 {
    let (w, port) = enter(context, Grant::Nothing, 64);
    match port.flushes.get() % 8 {
        7 => 0,
        6 => (w.random() & 1) as u8,
        _ => 1,
    }
}

unsafe extern "C" fn transmission(context: *mut c_void) {
    enter(context, Grant::Nothing, 64);
}

unsafe extern "C" fn idle(context: *mut c_void, node: *mut mbm_node) {
    let (w, _) = enter(context, Grant::All, 16);
    assert!(w.nodes.all().contains(&node), "`idle` gets an unknown node");
    w.inside(Grant::All, || {
        call!(w, mbm_node_pollDelay(node));
    });
}
