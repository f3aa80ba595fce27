//! The simulated lines: a port with a device on its line. The device finds each frame that was
//! written, and checks that the request in it had not ended when its first byte was written.

use super::state::{Life, Wire, FIRST_ID};
use crate::api::traffic::framed;
use mbm_c::*;
use std::ffi::c_void;

/// What the device does with a request, from 0 on: it responds at once, late, damaged, with the
/// exception of a busy device, or not at all. Above that it does one of these.
const SILENT: u8 = 4;

impl Wire {
    /// A new connection begins: nothing of the old one arrives, and frames begin anew.
    pub fn reset(&self, life: &Life) {
        self.replies.borrow_mut().clear();
        self.partial.borrow_mut().clear();
        let left = call!(&life.w, mbm_ring_available(self.ring));
        let bytes = life.w.unset_bytes(left.into());
        call!(&life.w, mbm_ring_read(self.ring, bytes, left));
    }

    /// Microseconds until the device sends something.
    pub fn delay(&self, now: u64) -> u64 {
        let replies = self.replies.borrow();
        let next = replies.iter().map(|(due, _)| due.saturating_sub(now)).min();
        next.unwrap_or(u64::MAX)
    }

    /// Lets bytes arrive.
    pub fn arrive(&self, life: &Life, bytes: &[u8]) {
        let (place, length) = (life.w.array(bytes), bytes.len() as u16);
        call!(&life.w, mbm_ring_write(self.ring, place, length));
    }

    fn deliver(&self, life: &Life) {
        let now = life.now.get();
        loop {
            let next = self.replies.borrow_mut().pop_front();
            match next {
                Some((due, bytes)) if due <= now => self.arrive(life, &bytes),
                Some(later) => return self.replies.borrow_mut().push_front(later),
                None => return,
            }
        }
    }

    /// Takes one byte that was written.
    fn take(&self, life: &Life, byte: u8) {
        let mut partial = self.partial.borrow_mut();
        if partial.is_empty() {
            *self.pending.borrow_mut() = life.live.borrow().clone();
        }
        partial.push(byte);
        let framing = self.framing.get();
        let is_right = match framing {
            MBM_FRAMING_TCP => partial.len() != 4 || partial[2..] == [0, 0],
            MBM_FRAMING_ASCII => partial[0] == b':',
            _ => true,
        };
        assert!(is_right, "the connection has lost its frames: {partial:?}");
        let content = match framing {
            MBM_FRAMING_TCP => partial.get(6..).unwrap_or_default().to_vec(),
            MBM_FRAMING_ASCII => partial[1..].chunks_exact(2).map_while(hex).collect(),
            _ => partial.clone(),
        };
        if let [_, _, high, low, ..] = content[..] {
            let id = u16::from_be_bytes([high, low]);
            assert!(
                id < FIRST_ID || self.pending.borrow().contains(&id),
                "request {id:#x} was sent after it had ended: {partial:02x?}"
            );
            // While the client is suspended, the line is the master's.
            if let Some(master) = life.borrower(self) {
                let asked = master.and_then(|master| master.pending.get());
                assert!(
                    asked.is_some_and(|(asked, _)| asked == id),
                    "request {id:#x} was sent by a client that is suspended"
                );
            }
        }
        let is_whole = match framing {
            MBM_FRAMING_TCP => {
                partial.len() >= 6
                    && content.len() >= usize::from(partial[4]) * 256 + usize::from(partial[5])
            }
            MBM_FRAMING_ASCII => byte == b'\n',
            _ => match content[..] {
                [_, 16, _, _, _, _, count, ..] => content.len() >= 9 + usize::from(count),
                [_, 16, ..] => false,
                _ => content.len() >= 8,
            },
        };
        if !is_whole {
            return;
        }
        let transaction = u16::from_be_bytes([partial[0], partial[1]]);
        partial.clear();
        self.transaction.set(transaction);
        self.respond(life, transaction, &content);
    }

    /// Sends an exception for a request that the device may not have received yet.
    pub fn guess(&self, life: &Life) {
        let random = life.w.random();
        let (ahead, unit) = (random as u16 % 3, 1 + (random >> 8) as u8 % 3);
        let function = [1, 3, 6, 16][(random >> 16) as usize % 4];
        let transaction = self.transaction.get().wrapping_add(ahead);
        let pdu = [function | 0x80, 4];
        self.arrive(life, &framed(self.framing.get(), transaction, unit, &pdu));
    }

    fn respond(&self, life: &Life, transaction: u16, content: &[u8]) {
        let [unit, function, a, b, c, d, ..] = *content else {
            panic!("a frame of {} bytes", content.len());
        };
        let random = life.w.random();
        let mode = match self.device.get() {
            mode @ 0..=SILENT => mode,
            _ => [0, 0, 0, 1, 2, 3, SILENT, 0][random as usize % 8],
        };
        if unit == 0 || mode == SILENT {
            return;
        }
        let bits = usize::from(d).div_ceil(8);
        let first = u16::from_be_bytes([a, b]);
        let pdu = match function {
            3 | 4 if mode != 3 && life.plan.is_lacking(first, d.into()) => vec![function | 0x80, 2],
            _ if mode == 3 => vec![function | 0x80, if random & 8 == 0 { 5 } else { 6 }],
            1 | 2 => [vec![function, bits as u8], vec![0; bits]].concat(),
            3 | 4 => [vec![function, 2 * d], vec![0x5A; 2 * usize::from(d)]].concat(),
            _ => vec![function, a, b, c, d],
        };
        let mut frame = framed(self.framing.get(), transaction, unit, &pdu);
        if mode == 2 {
            let at = random as usize % frame.len();
            frame[at] ^= 0x10;
        }
        let latency = match mode {
            1 => u64::from(random % 900_000),
            _ => u64::from(random % 5_000),
        };
        let due = life.now.get() + latency;
        self.replies.borrow_mut().push_back((due, frame));
    }
}

fn hex(pair: &[u8]) -> Option<u8> {
    u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()
}

/// The port of a line; `context` is the line's index.
pub fn port(index: usize, has_all: bool) -> mbm_port {
    mbm_port {
        context: index as *mut c_void,
        read: Some(read),
        write: Some(write),
        micros: Some(micros),
        flush: has_all.then_some(flush),
        preTransmission: Some(driver_on),
        postTransmission: has_all.then_some(driver_off),
        idle: None,
    }
}

fn wire<'a>(context: *mut c_void) -> (&'a Life, &'a Wire) {
    let life = Life::current();
    (life, &life.lines[context as usize].wire)
}

unsafe extern "C" fn read(context: *mut c_void, bytes: *mut u8, capacity: u16) -> i16 {
    let (life, wire) = wire(context);
    if !wire.is_open.get() {
        return if wire.is_opening.get() { 0 } else { -1 };
    }
    wire.deliver(life);
    call!(&life.w, mbm_ring_read(wire.ring, bytes, capacity)) as i16
}

unsafe extern "C" fn write(context: *mut c_void, bytes: *const u8, length: u16) -> i16 {
    assert!(length > 0, "a write of no bytes");
    let (life, wire) = wire(context);
    if !wire.is_open.get() {
        return if wire.is_opening.get() { 0 } else { -1 };
    }
    let count = length.min(wire.takes.get());
    // SAFETY: the client passes `length` bytes.
    for byte in unsafe { std::slice::from_raw_parts(bytes, count.into()) } {
        wire.take(life, *byte);
    }
    count as i16
}

pub unsafe extern "C" fn micros(_: *mut c_void) -> u32 {
    let life = Life::current();
    (life.now.get() as u32).wrapping_add(life.jumped.get())
}

unsafe extern "C" fn flush(context: *mut c_void) -> u8 {
    wire(context).1.flushes.get().into()
}

unsafe extern "C" fn driver_on(context: *mut c_void) {
    // A frame that was given up may be incomplete. The next one begins here.
    wire(context).1.partial.borrow_mut().clear();
}

unsafe extern "C" fn driver_off(_: *mut c_void) {}
