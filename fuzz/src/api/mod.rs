//! An interpreter of calls of the C API: an input says which functions are called,
//! with which arguments, and what the hooks do, which call the API in their turn.
//!
//! Every object, buffer and record is a block of the heap of exactly its size, so
//! that the address sanitizer sees each byte beside them. Only memory that is
//! valid is ever handed over, and it stays valid for as long as the input runs.

mod asked;
mod bits;
mod check;
mod client;
mod frame;
mod master;
mod packet;
mod ports;
mod prepared;
mod records;
mod registers;
mod ring;
mod server;
mod serving;
mod sniffer;
mod text;
mod traffic;
mod world;

use std::sync::atomic::Ordering;
use world::World;

/// Does one thing: with an object of one noun, with a port, or with time.
fn step(w: &World) {
    match w.byte() % 32 {
        0..=4 => master::step(w),
        5..=11 => client::step(w),
        12..=19 => server::step(w),
        20..=22 => sniffer::step(w),
        23 => ring::step(w),
        24 | 25 => packet::step(w),
        26 | 27 => frame::step(w),
        28 => registers::step(w),
        29 => bits::step(w),
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

/// Runs one input.
pub fn run(data: &[u8]) {
    let w = World::new(data);
    prepared::prepare(&w);
    while !w.is_over() {
        step(&w);
    }
}

/// How many functions of the C API were called so far.
pub fn calls() -> u64 {
    world::CALLS.load(Ordering::Relaxed)
}

/// Prints every call from now on.
pub fn trace() {
    world::TRACE.store(true, Ordering::Relaxed);
}
