//! The state of a port: what has arrived, and how the port behaves.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;

/// A byte stream and a clock.
#[derive(Default)]
pub struct Port {
    /// The bytes that have arrived.
    pub inbox: RefCell<VecDeque<u8>>,
    /// The behaviour of read, write and flush; 0 is good behaviour.
    pub reads: Cell<u8>,
    pub writes: Cell<u8>,
    pub flushes: Cell<u8>,
    /// Microseconds between two calls of `micros`.
    pub step: Cell<u32>,
    /// What is connected, modulo 4: 0 nothing, 1 the next port, 2 a device, 3 a client that
    /// sends requests.
    pub peer: Cell<u8>,
    /// The framing of the connected device or client.
    pub framing: Cell<u8>,
}

impl Port {
    /// A port with good behaviour. Two ports have a device, one has a client that sends
    /// requests, and the bytes of one go to the first port.
    pub fn new(index: usize) -> Port {
        let port = Port::default();
        port.peer.set([2, 2, 3, 1][index % 4]);
        port.step.set(100);
        port
    }
}
