//! An interpreter of calls of the C API. The input chooses the functions, their arguments, and
//! what the hooks do. Hooks may call the API too.
//!
//! Every object, buffer and record is a block of the heap of exactly its size, so that the
//! address sanitizer detects an access to any byte beside it. All pointers passed are NULL or
//! valid, and stay valid until the input has been run.

#[macro_use]
mod check;

mod asked;
mod client;
mod frame;
mod gateway;
mod identification;
pub mod life;
mod line;
mod link;
mod memory;
mod node;
mod packet;
mod plan;
mod pool;
mod port;
mod ports;
mod prepared;
mod records;
mod registers;
mod ring;
mod server;
mod serving;
mod sniffer;
mod text;
mod trace;
mod traffic;
mod types;
mod world;

use std::sync::atomic::Ordering;
use world::World;

/// Makes one step: calls with an object of one noun, a change of a port, or time.
fn step(w: &World) {
    match w.byte() % 32 {
        0 | 1 => line::step(w),
        2..=4 => node::step(w),
        5..=8 => client::step(w),
        9 | 10 => plan::step(w),
        11 | 12 => link::step(w),
        13..=17 => server::step(w),
        18 | 19 => gateway::step(w),
        20..=22 => sniffer::step(w),
        23 if w.byte() & 1 == 0 => trace::step(w),
        23 if w.byte() & 1 == 0 => ring::step_of_dma(w),
        23 => ring::step(w),
        24 | 25 => packet::step(w),
        26 | 27 => frame::step(w),
        28 if w.byte() & 1 == 0 => registers::step(w),
        28 => types::step(w),
        29 => registers::step_of_bits(w),
        30 => ports::change(w),
        _ => match w.byte() {
            byte @ 0..0xE0 => w.clock.set(w.clock.get().wrapping_add(1 << (byte % 26))),
            0xE0..0xF0 => text::step(w),
            _ => {
                let port = &w.ports[w.below(w.ports.len())];
                let bytes = traffic::request(w, port.framing.get());
                port.inbox.borrow_mut().extend(bytes);
            }
        },
    }
}

/// Sequences of calls of the C API. No call accesses memory that it was not given, every call
/// returns, and a call that is refused changes nothing.
pub fn run(data: &[u8]) {
    let w = World::new(data, step);
    prepared::prepare(&w);
    while !w.is_over() {
        step(&w);
    }
}

/// The number of calls of the C API so far.
pub fn calls() -> u64 {
    world::CALLS.load(Ordering::Relaxed)
}

/// Prints every call from now on.
pub fn trace() {
    memory::TRACE.store(true, Ordering::Relaxed);
}
